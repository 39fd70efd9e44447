"""What an array can measure: closed forms, laws, published weights, and what is said of a singular one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from northdown.arrays import (
    GEOMETRIES,
    AccelerometerArray,
    analyse,
    coplanar6,
    coplanar7,
    cube6,
    cube9,
    geometry,
    missing_directions,
    ring,
    scaled_matrix,
    solution,
    tetrahedron12,
    triads,
)
from northdown.errors import InputError

NAMES = (*GEOMETRIES, "ring6", "ring8", "ring10")
angles = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


@pytest.mark.parametrize("count", [6, 8, 10, 24])
def test_ring_in_closed_form(count):
    r, m = 0.08, count / 2
    found = analyse(ring(count, r))
    np.testing.assert_allclose(found.angular_noise, [np.sqrt(2 / m) / r, np.sqrt(2 / m) / r, np.sqrt(1 / m) / r])
    np.testing.assert_allclose(found.force_noise, [np.sqrt(2 / m), np.sqrt(2 / m), np.sqrt(1 / m)])
    assert found.length == pytest.approx(r)
    # singular values of the six independent unknowns: √m and √(m/2)
    assert found.condition == pytest.approx(np.sqrt(2.0))


def test_cube_of_six_in_closed_form():
    # each pair: d = (y ± z)/√2 at ± a/2 x, so that JᵀJ is 2·I for f and 2 (a/2)² · I for ω̇
    a = 0.06
    found = analyse(cube6(a))
    np.testing.assert_allclose(found.force_noise, 1 / np.sqrt(2))
    np.testing.assert_allclose(found.angular_noise, 1 / (np.sqrt(2) * a / 2))
    assert found.condition == pytest.approx(1.0)
    assert np.abs(found.leakage[:3]).max() < 1e-15  # no product of rates enters the angular acceleration


def test_tetrahedron_in_closed_form():
    # four triads: f is their mean; JᵀJ of ω̇ is Σ (r² I − r rᵀ) = 4 (2/3) r² I
    r = 0.05
    found = analyse(tetrahedron12(r))
    np.testing.assert_allclose(found.force_noise, 0.5)
    np.testing.assert_allclose(found.angular_noise, np.sqrt(3 / 8) / r)
    assert len(found.measured_products) == 6
    assert np.abs(found.leakage).max() < 1e-15


def test_cube_of_nine_holds_padgaonkar_s_scheme():
    # his ω̇x = (A_zy − A_z0)/2ρy − (A_yz − A_y0)/2ρz has no products: it is in the rows of J⁺ plus the null space
    side = 0.2
    array = cube9(side)
    at = {name: k for k, name in enumerate(array.names)}
    weights = np.zeros(9)
    for name, sign in (("yz", 1), ("oz", -1), ("zy", -1), ("oy", 1)):
        weights[at[name]] = sign / (2 * side)
    np.testing.assert_allclose(weights @ array.matrix, [1, 0, 0, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(weights @ array.products, 0.0, atol=1e-12)
    # least squares is less noisy, by what the null space allows
    assert analyse(array).angular_noise[0] < np.linalg.norm(weights)
    rest = weights - analyse(array).inverse[0]
    assert np.abs(rest @ array.matrix).max() < 1e-12
    assert len(analyse(array).measured_products) == 3


def test_k06_weights_of_gravity():
    # (2.25): halves of A1 and A3x, of A2 and A3y, and the mean of A4 to A6 which are 120° apart; nothing of ω²
    found = analyse(coplanar7(0.0175))
    x, y, z = found.inverse[3:]
    np.testing.assert_allclose(x, [0.5, 0, -0.5, 0, 0, 0, 0], atol=1e-14)
    np.testing.assert_allclose(y, [0, 0.5, 0, 0.5, 0, 0, 0], atol=1e-14)
    np.testing.assert_allclose(z, [0, 0, 0, 0, 1 / 3, 1 / 3, 1 / 3], atol=1e-14)
    assert np.abs(found.leakage[3:]).max() < 1e-15
    assert found.leaks()[:2] == ["ω̇x: ωyωz", "ω̇y: −ωxωz"]
    # the table as printed leaves some in
    assert np.abs(analyse(coplanar7(0.0175, printed=True)).leakage[3:5]).max() > 1e-3
    # (2.24): of six without A3y, f_y holds ωx² + ωz², ωy² + ωz² and ωxωy
    leak = analyse(coplanar6(0.0175)).leakage[4]
    assert (np.abs(leak[[0, 1, 2, 3]]) > 1e-4).all()
    assert leak[2] == pytest.approx(leak[0] + leak[1])
    assert np.abs(leak[4:]).max() < 1e-15


@pytest.mark.parametrize("name", NAMES)
def test_exact_solution_of_exact_measurements(name):
    rng = np.random.default_rng(3)
    found = analyse(geometry(name), rng.uniform(0.5, 2.0, len(geometry(name))))
    x, rate = rng.normal(0.0, 5.0, 6), rng.normal(0.0, 3.0, 3)
    i, k = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
    w = rate[i] * rate[k]
    y = found.array.matrix @ x + found.array.products @ w
    # relative to angular accelerations of some 10 rad/s², their gain being up to 1/r = 60
    np.testing.assert_allclose(found.inverse @ (y - found.array.products @ w), x, atol=1e-11)
    np.testing.assert_allclose(found.inverse @ y, x + found.leakage @ w, atol=1e-11)
    shown = found.null_space @ (y / found.noise)
    np.testing.assert_allclose(
        shown, found.null_space @ (found.array.products / found.noise[:, None]) @ w, atol=1e-11
    )


@given(angles, st.floats(0.01, 100.0), angles)
@settings(max_examples=25, deadline=None)
def test_dilution_does_not_depend_on_axes_and_scales_with_size(turn, factor, shift):
    array = coplanar7(0.02)
    before = analyse(array)
    mat = Rotation.from_rotvec(turn).as_matrix()
    after = analyse(array.turned(mat).scaled(factor))
    assert after.angular_dilution * factor == pytest.approx(before.angular_dilution, rel=1e-9)
    assert after.force_dilution == pytest.approx(before.force_dilution, rel=1e-9)
    assert after.condition == pytest.approx(before.condition, rel=1e-9)
    to_new = np.kron(np.eye(2), mat)
    to_new[:3, :3] /= factor
    expected = to_new @ before.covariance @ to_new.T
    np.testing.assert_allclose(after.covariance, expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())
    # the origin changes neither what is measured nor how well ω̇ is
    moved = analyse(AccelerometerArray(array.position + 0.1 * np.array(shift), array.direction))
    assert moved.condition == pytest.approx(before.condition, rel=1e-6)
    np.testing.assert_allclose(moved.angular_noise, before.angular_noise, rtol=1e-6)


def test_weights_are_those_of_least_squares():
    rng = np.random.default_rng(5)
    noise = rng.uniform(0.5, 3.0, 8)
    array = ring(8, 0.05)
    w = np.diag(noise**-2.0)
    j = array.matrix
    normal = np.linalg.inv(j.T @ w @ j)
    found = analyse(array, noise)
    np.testing.assert_allclose(found.inverse, normal @ j.T @ w, atol=1e-10)
    np.testing.assert_allclose(found.covariance, normal, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(solution(array, noise), found.inverse)
    for wrong in ([1.0] * 7, [0.0] * 8, [np.nan] * 8, "a"):
        with pytest.raises(InputError, match="noise"):
            analyse(array, wrong)


def test_noise_of_samples_is_as_said():
    rng = np.random.default_rng(7)
    found = analyse(coplanar7(0.0175))
    got = (rng.standard_normal((20_000, 7)) @ found.inverse.T).std(axis=0)
    # standard deviation of 20 000 samples: 0.5 % (1 σ)
    np.testing.assert_allclose(got, [*found.angular_noise, *found.force_noise], rtol=0.025)


# ---- redundancy ----


@pytest.mark.parametrize("name", NAMES)
def test_measured_products_are_the_range_of_the_null_space(name):
    found = analyse(geometry(name))
    shown = found.null_space @ found.array.products
    rank = np.linalg.matrix_rank(shown, tol=1e-10) if shown.size else 0
    assert len(found.measured_products) == rank
    if rank:
        both = np.vstack([shown / np.abs(shown).max(), found.measured_products])
        assert np.linalg.matrix_rank(both, tol=1e-9) == rank
    assert np.abs(found.null_space @ found.array.matrix).max(initial=0.0) < 1e-12


def test_redundancy_in_words():
    assert "six accelerometers for six unknowns" in analyse(cube6()).redundancy()
    assert analyse(ring(8)).redundancy() == "2 more than needed, which measure ωx² − ωy² directly"
    assert "ωx² − ωy² and ωxωy directly" in analyse(ring(10)).redundancy()
    assert "all six products" in analyse(tetrahedron12()).redundancy()
    # a seventh along z at the middle of three others along z feels nothing new
    six = coplanar6(0.02)
    seven = AccelerometerArray(np.vstack([six.position, [0, 0, 0]]), np.vstack([six.direction, [0, 0, 1.0]]))
    assert "only average noise" in analyse(seven).redundancy()


def test_summary_holds_the_figures():
    text = analyse(coplanar7(0.0175)).summary()
    for part in (
        "coplanar seven",
        "7 accelerometers",
        "17.5 mm",
        "Condition",
        "46.7",
        "0.577",
        "ωyωz",
        "more than needed",
    ):
        assert part in text


# ---- singular geometries ----


def refused(array) -> str:
    with pytest.raises(InputError) as caught:
        analyse(array)
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 500
    return message


def test_two_triads_feel_no_turn_about_the_line_between_them():
    assert "no accelerometer measures angular acceleration about x;" in refused(triads([[0, 0, 0], [0.1, 0, 0]]))
    diagonal = triads([[0.3, 0.3, 0.3], [0.4, 0.4, 0.3]])
    assert missing_directions(diagonal) != []
    message = refused(triads([[0, 0, 0], [0.1, 0.1, 0]]))
    assert "no accelerometer measures angular acceleration about (0.71, 0.71, 0);" in message


def test_accelerometers_in_one_place_feel_no_turn_at_all():
    line = np.vstack([np.eye(3), [[1, 1, 0], [0, 1, 1], [1, 0, 1]]])
    array = AccelerometerArray(np.tile([0.2, 0.0, 0.0], (6, 1)), line)
    assert scaled_matrix(array).rank == 3
    message = refused(array)
    assert "no accelerometer measures angular acceleration about x;" in message
    # turning about y and z moves them, but all alike
    for turn, force in ("yz", "zy"):
        assert f"angular acceleration about {turn} cannot be told from specific force along {force}" in message
    at_origin = AccelerometerArray(np.zeros((6, 3)), line)
    assert "no accelerometer measures angular acceleration about any axis" in refused(at_origin)


def test_all_along_z_miss_what_is_in_the_plane():
    array = AccelerometerArray(ring(12, 0.1).position, np.tile([0.0, 0.0, 1.0], (12, 1)))
    message = refused(array)
    assert "no accelerometer measures angular acceleration about z" in message
    assert "no accelerometer measures specific force along x and y" in message


def test_a_turn_that_looks_like_a_force():
    # in plane: two along x at the same height, one along y through the middle: turning about z is like force along x
    array = AccelerometerArray(
        [[0.1, 0.1, 0], [-0.1, 0.1, 0], [0, 0.05, 0], [0.1, 0, 0], [-0.1, 0.1, 0], [0, -0.1, 0]],
        [[1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1], [0, 0, 1]],
    )
    message = refused(array)
    assert "angular acceleration about z cannot be told from specific force along x" in message
    # and it is so: this motion is felt by none
    assert np.abs(array.matrix @ [0, 0, 1.0, 0.1, 0, 0]).max() < 1e-15


def test_the_force_is_that_at_the_body_s_origin():
    # unfelt is a turn about z together with the force that holds the place of the accelerometers still
    array = AccelerometerArray(
        [[0.1, 0.1, 0], [-0.1, 0.1, 0], [0, 0.05, 0], [0.1, 0, 0], [-0.1, 0.1, 0], [0, -0.1, 0]],
        [[1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1], [0, 0, 1]],
    )
    for shift, sign in ((0.1, "−"), (-0.1, "")):
        moved = AccelerometerArray(array.position + np.array([shift, 0, 0]), array.direction)
        assert np.abs(moved.matrix @ [0, 0, 1.0, 0.1, -shift, 0]).max() < 1e-15
        assert f"about z cannot be told from specific force along (0.71, {sign}0.71, 0)" in refused(moved)


def test_nearly_singular_says_how_nearly():
    bad = triads([[0, 0, 0], [0.1, 0, 0]])
    near = AccelerometerArray(
        np.vstack([bad.position, [0.05, 1e-6, 0.0]]), np.vstack([bad.direction, [0.0, 0.0, 1.0]])
    )
    message = refused(near)
    assert "angular acceleration about x" in message
    assert "well enough (condition" in message
    assert scaled_matrix(near).rank == 6
    fine = AccelerometerArray(np.vstack([bad.position, [0.05, 0.02, 0.0]]), np.vstack([bad.direction, [0, 0, 1.0]]))
    assert 1.0 < analyse(fine).condition < 100.0


def test_too_few_and_twice_the_same():
    assert "six accelerometers or more, got 5" in refused(cube6().without(0))
    array = AccelerometerArray(
        np.vstack([cube6().position, cube6().position[2]]), np.vstack([cube6().direction, -cube6().direction[2]])
    )
    assert "a3 and a7 in one place and line" in refused(array)
    for wrong in (None, "coplanar7"):
        with pytest.raises(InputError, match="an AccelerometerArray"):
            analyse(wrong)


@given(st.integers(0, 2**32 - 1), st.integers(1, 9))
@settings(max_examples=30, deadline=None)
def test_any_array_is_analysed_or_refused_in_one_line(seed, count):
    rng = np.random.default_rng(seed)
    position = rng.choice([-0.1, 0.0, 0.1], (count, 3))
    direction = rng.choice([-1.0, 0.0, 1.0], (count, 3))
    direction[(direction == 0).all(axis=1)] = [0, 0, 1]
    array = AccelerometerArray(position, direction)
    rank = np.linalg.matrix_rank(array.matrix, tol=1e-10)
    assert scaled_matrix(array).rank == rank
    assert bool(missing_directions(array)) == (rank < 6)
    if rank == 6 and not doubled(array):
        np.testing.assert_allclose(analyse(array).inverse @ array.matrix, np.eye(6), atol=1e-9)
    else:
        refused(array)


def doubled(array) -> bool:
    """Whether two are in one place and line, by their rows of J and P."""
    rows = np.hstack([array.matrix, array.products, array.position])
    lines = [tuple(np.round(np.abs(r), 9)) for r in rows]
    same = [(i, k) for i in range(len(rows)) for k in range(i) if lines[i] == lines[k]]
    return any(abs(array.direction[i] @ array.direction[k]) > 1 - 1e-9 and
               np.array_equal(array.position[i], array.position[k]) for i, k in same)  # fmt: skip
