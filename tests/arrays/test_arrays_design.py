"""Leaving one out, and the search for the best places, against arrays whose worth is known."""

from __future__ import annotations

import numpy as np
import pytest

from northdown.arrays import AccelerometerArray, analyse, best_in_plane, coplanar7, leave_one_out, ring
from northdown.arrays.design import _Search
from northdown.errors import InputError


def determinant(array, half):
    rows = np.hstack([np.cross(array.position / half, array.direction), array.direction])
    return np.linalg.det(rows.T @ rows)


def corners(half, gap):
    """Eight: at each corner one along z and, `gap` beside it, one in the plane across the diagonal."""
    position, direction = [], []
    for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        position += [[x * half, y * half, 0], [x * (half - gap), y * half, 0]]
        direction += [[0, 0, 1], [-y, x, 0]]
    return AccelerometerArray(np.array(position, float), np.array(direction, float))


@pytest.fixture(scope="module")
def eight():
    return best_in_plane(8, 0.1, seed=3, starts=8)


def test_best_eight_is_no_worse_than_the_corners(eight):
    # the determinant's sixth root, 0.2 % for a search that stops early
    known = determinant(corners(0.05, 0.005), 0.05)
    assert determinant(eight.array, 0.05) > known * 0.998**6
    assert determinant(eight.array, 0.05) > 5.0 * determinant(ring(8, 0.05), 0.05)


def test_bounds_and_spacing_are_kept(eight):
    position = eight.array.position
    assert np.abs(position[:, :2]).max() <= 0.05
    assert not position[:, 2].any()
    apart = [np.linalg.norm(a - b) for i, a in enumerate(position) for b in position[:i]]
    assert min(apart) > 0.995 * 0.005
    np.testing.assert_allclose(np.linalg.norm(eight.array.direction, axis=1), 1.0)
    assert 0.0 <= eight.spread < 0.05


def test_same_seed_same_array_and_any_unit(eight):
    again = best_in_plane(8, 0.1, seed=3, starts=8)
    assert np.array_equal(again.array.position, eight.array.position)
    assert np.array_equal(again.array.direction, eight.array.direction)
    larger = best_in_plane(8, 1.0, seed=3, starts=8)
    np.testing.assert_allclose(larger.array.position, 10.0 * eight.array.position, atol=1e-12)


def test_a_optimal_is_better_in_its_own_measure():
    d, a = (best_in_plane(7, 0.2, criterion=c, seed=1, starts=8) for c in "DA")

    def squares(found):
        return (found.analysis.angular_dilution * 0.1) ** 2 + found.analysis.force_dilution**2

    assert squares(a) <= squares(d) * 1.001
    assert determinant(d.array, 0.1) >= determinant(a.array, 0.1) * 0.999


@pytest.mark.parametrize("criterion", ["D", "A"])
def test_gradient_of_the_search(criterion):
    search = _Search(7, 0.4, criterion)
    x = search.start(np.random.default_rng(0))
    cost, slope = search._cost(x, 3.0)
    steps = 1e-6 * np.eye(len(x))
    differences = [(search._cost(x + s, 3.0)[0] - search._cost(x - s, 3.0)[0]) / 2e-6 for s in steps]
    # central differences: relative rounding of 1e-16/1e-6
    np.testing.assert_allclose(slope, differences, rtol=1e-5, atol=1e-7 * abs(cost))


def test_leave_one_out_of_k06():
    whole = analyse(coplanar7(0.0175))
    found = {r.name: r for r in leave_one_out(whole)}
    assert [found[n].condition for n in ("A4", "A5", "A6")] == [np.inf] * 3
    rest = analyse(coplanar7(0.0175).without(3))
    assert found["A3y"].angular == pytest.approx(rest.angular_dilution / whole.angular_dilution)
    assert found["A3y"].force == pytest.approx(rest.force_dilution / whole.force_dilution)
    factors = [r.angular for r in leave_one_out(whole)]
    assert np.round(factors, 9).tolist() == sorted(np.round(factors, 9))
    assert min(factors) >= 1.0


@pytest.mark.parametrize(
    "arguments",
    [(5, 0.1), (65, 0.1), (8.5, 0.1), (True, 0.1), (8, 0.0), (8, np.nan)],
)
def test_wrong_numbers(arguments):
    with pytest.raises(InputError):
        best_in_plane(*arguments)
    for wrong in ({"criterion": "E"}, {"spacing": -1.0}, {"seed": -1}, {"starts": 0}, {"starts": 10**9}):
        with pytest.raises(InputError):
            best_in_plane(8, 0.1, **wrong)


def test_no_room():
    with pytest.raises(InputError, match="room for accelerometers 80 mm apart"):
        best_in_plane(8, 0.1, spacing=0.08, starts=3)
