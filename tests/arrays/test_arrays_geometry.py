"""J and P of an array against exact rigid-body kinematics, the named geometries, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from northdown.arrays import (
    GEOMETRIES,
    AccelerometerArray,
    coplanar6,
    coplanar7,
    geometry,
    ring,
    tetrahedron12,
    triads,
)
from northdown.errors import InputError

NAMES = (*GEOMETRIES, "ring6", "ring12")


def felt(position, direction, angular, force, rate):
    """Reading of one accelerometer by vectors alone, in the order of the textbooks."""
    return direction @ (force + np.cross(angular, position) + np.cross(rate, np.cross(rate, position)))


@pytest.mark.parametrize("name", NAMES)
def test_matrix_and_products_are_rigid_body_kinematics(name):
    rng = np.random.default_rng(1)
    array = geometry(name, 0.3)
    for _ in range(5):
        angular, force, rate = rng.normal(0.0, 10.0, (3, 3))
        x, y, z = rate
        said = array.matrix @ [*angular, *force] + array.products @ [x * x, y * y, z * z, x * y, x * z, y * z]
        truth = [felt(p, d, angular, force, rate) for p, d in zip(array.position, array.direction, strict=True)]
        np.testing.assert_allclose(said, truth, rtol=0, atol=1e-12)  # m/s²; rounding of values of some 100


def test_k06_table_as_printed():
    # the seven rows of table 2.1, degrees; positions then sensing directions in the plane
    places = [80, 200, -100, 20, 40, 160, 280]
    lines = [170, -70, -180, 90]
    array = coplanar7(2.0, printed=True)
    angle = np.deg2rad(places)
    np.testing.assert_allclose(array.position, 2.0 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]))
    angle = np.deg2rad(lines)
    expected = np.vstack(
        [np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]), np.tile([0.0, 0.0, 1.0], (3, 1))]
    )
    np.testing.assert_allclose(array.direction, expected, atol=1e-15)
    corrected = coplanar7(2.0)
    assert corrected.direction[:2].tolist() == [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    assert np.array_equal(corrected.position, array.position)
    assert np.array_equal(corrected.direction[2:], array.direction[2:])


def test_coplanar_six_leaves_one_out():
    assert coplanar6().names == ("A1", "A2", "A3x", "A4", "A5", "A6")
    assert coplanar6(without="A3x").names == ("A1", "A2", "A3y", "A4", "A5", "A6")
    with pytest.raises(InputError, match="without to be one of A3y, A3x"):
        coplanar6(without="A4")


@pytest.mark.parametrize("name", NAMES)
def test_named_geometries_have_their_size(name):
    one, two = geometry(name, 1.0), geometry(name, 0.25)
    np.testing.assert_allclose(two.position, 0.25 * one.position, atol=1e-15)
    assert np.array_equal(two.direction, one.direction)
    assert len(set(one.names)) == len(one) == int("".join(c for c in name.split("-")[0] if c.isdigit()))
    np.testing.assert_allclose(one.scaled(0.25).position, two.position, atol=1e-15)


def test_triads_share_places():
    array = triads([[0.1, 0.0, 0.0], [0.0, 0.2, 0.0]], names=["left", "right"])
    assert array.names == ("leftx", "lefty", "leftz", "rightx", "righty", "rightz")
    assert np.array_equal(array.direction, np.vstack([np.eye(3), np.eye(3)]))
    # all at the same distance from the middle, and from each other
    corners = tetrahedron12(0.1).position[::3]
    apart = [np.linalg.norm(a - b) for i, a in enumerate(corners) for b in corners[:i]]
    np.testing.assert_allclose(np.linalg.norm(corners, axis=1), 0.1)
    np.testing.assert_allclose(apart, 0.1 * np.sqrt(8.0 / 3.0))


def test_without_keeps_the_others():
    array = ring(8).without(2)
    assert array.names == ("z1", "t1", "t2", "z3", "t3", "z4", "t4")
    with pytest.raises(InputError, match="a number from 0 to 6"):
        array.without(7)


ONE = [[0.1, 0.0, 0.0]]


@pytest.mark.parametrize(
    ("values", "part"),
    [
        ({"position": ONE, "direction": [[0.0, 0.0, 0.0]]}, "a direction of finite numbers, not all zero"),
        ({"position": ONE, "direction": [[0.0, np.nan, 1.0]]}, "[0.0, nan, 1.0] of accelerometer 1"),
        ({"position": [[np.nan, 0, 0]], "direction": ONE}, "a position within 10000 m"),
        ({"position": [[1e9, 0, 0]], "direction": ONE}, "a position within 10000 m"),
        ({"position": [[np.inf, 0, 0]], "direction": ONE}, "finite numbers in position"),
        ({"position": ONE, "direction": ONE * 2}, "direction with 1 rows"),
        ({"position": np.zeros((0, 3)), "direction": np.zeros((0, 3))}, "1 to 256 accelerometers, got 0"),
        ({"position": np.zeros((257, 3)), "direction": np.ones((257, 3))}, "1 to 256 accelerometers, got 257"),
        ({"position": ONE * 2, "direction": ONE * 2, "names": ["a", "a"]}, "2 different names"),
        ({"position": ONE, "direction": ONE, "names": ["a,b"]}, "names of letters"),
        ({"position": ONE, "direction": ONE, "names": [""]}, "names of letters"),
        ({"position": ONE, "direction": ONE, "names": [7]}, "names of letters"),
    ],
)
def test_what_makes_no_array(values, part):
    with pytest.raises(InputError) as caught:
        AccelerometerArray(**values)
    message = str(caught.value)
    assert part in message
    assert "\n" not in message


@pytest.mark.parametrize("name", ["ring7", "ring4", "ring", "RING8", "nothing", None, "ring99999"])
def test_unknown_geometry(name):
    with pytest.raises(InputError):
        geometry(name)
    with pytest.raises(InputError):
        geometry("ring8", 0.0)
