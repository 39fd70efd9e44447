"""Hard and soft iron: truth recovered, σ honest, refusals, invariance, disturbed and unevenly spread data."""

from __future__ import annotations

import numpy as np
import pytest
from cal_truth import (
    FIELD,
    HARD_IRON,
    SOFT_IRON,
    chi2_bounds,
    directions,
    field_recording,
    room_recording,
    true_matrix,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import approx_fprime, minimize
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from northdown.calibration import calibrate_magnetometer, coverage
from northdown.calibration._ellipsoid import curvature, ellipsoid_model, symmetric
from northdown.calibration._prior import Prior
from northdown.calibration._uneven import with_direction
from northdown.errors import InputError
from northdown.recording import Recording

RNG = np.random.default_rng


@pytest.mark.parametrize("hard", [HARD_IRON, np.zeros(3), np.array([300.0, 0.0, -150.0])])
def test_hard_and_soft_iron_are_recovered(hard: np.ndarray) -> None:
    part = calibrate_magnetometer(field_recording(directions(RNG(1), 1500), hard=hard)).mag
    assert part.evidence.model == "ellipsoid"
    assert np.abs(part.offset - hard).max() < 0.5  # µT, asked for under 0.5 µT of noise
    assert np.abs(part.matrix - true_matrix()).max() < 0.01  # 1 %
    assert part.evidence.after == pytest.approx(0.5, rel=0.1)  # the noise, µT
    assert part.evidence.coverage == 1.0
    assert not part.evidence.notes


def test_without_noise_the_truth_is_exact() -> None:
    part = calibrate_magnetometer(field_recording(directions(RNG(2), 300), noise=0.0)).mag
    assert np.abs(part.offset - HARD_IRON).max() < 1e-6  # µT; rounding of 50 µT squared
    assert np.abs(part.matrix - true_matrix()).max() < 1e-8


def test_sigma_is_honest() -> None:
    seeds = 60
    offsets, matrices = [], []
    for seed in range(seeds):
        part = calibrate_magnetometer(field_recording(directions(RNG(seed), 300), seed=seed)).mag
        offsets.append((part.offset - HARD_IRON) / part.offset_sigma)
        matrices.append(((part.matrix - true_matrix()) / part.matrix_sigma)[np.triu_indices(3)])
    low, high = chi2_bounds(3 * seeds)
    assert low < np.mean(np.square(offsets)) < high
    # the determinant is 1: six elements have five degrees of freedom
    low, high = chi2_bounds(5 * seeds)
    assert low < np.mean(np.square(matrices)) < high


def test_sigma_of_half_a_sphere_is_honest_too() -> None:
    """Along the axis that half a sphere tells least of, where the fit's curvature bias would show."""
    errors = []
    for seed in range(50):
        unit = directions(RNG(seed), 500)
        unit[:, 2] = np.abs(unit[:, 2])
        part = calibrate_magnetometer(field_recording(unit, seed=seed), tolerance=0.1).mag
        assert part.evidence.model == "ellipsoid"
        errors.append((part.offset - HARD_IRON) / part.offset_sigma)
    low, high = chi2_bounds(150)
    assert low < np.mean(np.square(errors)) < high
    assert np.abs(np.mean(errors, axis=0)).max() < 3.5 / np.sqrt(50)  # no bias: mean of unit normals


def test_a_given_field_is_the_size_of_calibrated_samples() -> None:
    recording = field_recording(directions(RNG(3), 1000))
    kept = calibrate_magnetometer(recording)
    given_field = calibrate_magnetometer(recording, field=48.0)
    assert given_field.mag.norm == 48.0
    assert np.linalg.norm(given_field.apply(recording).mag, axis=1).mean() == pytest.approx(48.0, abs=0.05)
    assert np.linalg.norm(kept.apply(recording).mag, axis=1).mean() == pytest.approx(kept.mag.norm, abs=0.05)
    assert np.linalg.det(kept.mag.matrix) == pytest.approx(1.0, abs=1e-12)
    assert given_field.mag.matrix == pytest.approx(kept.mag.matrix * 48.0 / kept.mag.norm, rel=1e-9)


def circle(normal: np.ndarray, height: float, n: int = 600) -> np.ndarray:
    """Directions on the cone at that height along the normal."""
    angle = np.linspace(0.0, 6.0 * np.pi, n)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.full(n, height / np.sqrt(1.0 - height**2))])
    ring /= np.linalg.norm(ring, axis=1)[:, None]
    turn, _ = Rotation.align_vectors([normal], [[0.0, 0.0, 1.0]])
    return turn.apply(ring)


@pytest.mark.parametrize("height", [0.0, 0.5])
@pytest.mark.parametrize("normal", [[1.0, 0.0, 0.0], [0.6, -0.48, 0.64]])
@pytest.mark.parametrize("noise", [0.0, 0.5, 2.0])
def test_planar_data_are_refused(normal: list[float], height: float, noise: float) -> None:
    with pytest.raises(InputError, match=r"turn the sensor slowly about all three axes"):
        calibrate_magnetometer(field_recording(circle(np.array(normal), height), noise=noise))


@pytest.mark.parametrize(
    ("height", "soft", "seeds"), [(0.08, SOFT_IRON, 32), (0.08, np.eye(3), 8), (0.05, SOFT_IRON, 8)]
)
def test_refusal_names_the_axis_that_is_not_known(height: float, soft: np.ndarray, seeds: int) -> None:
    # a ring, 10° or 6° high, about y: y is told by the ring's bend alone
    for seed in range(seeds):
        unit = directions(RNG(seed), 20_000)
        unit = unit[np.abs(unit[:, 1]) < height]
        with pytest.raises(InputError, match=r"offset along y\b"):
            calibrate_magnetometer(field_recording(unit, noise=1.0, soft=soft, seed=seed))


def test_points_that_fix_the_ring_alone_are_accepted_when_asked_for() -> None:
    """What is uncertain is the scale along the ring's axis: more than the default accepts, and said to be."""
    unit = directions(RNG(4), 20_000)
    recording = field_recording(unit[np.abs(unit[:, 1]) < 0.08], noise=1.0)
    with pytest.raises(InputError, match="scale and offset along y uncertain"):
        calibrate_magnetometer(recording, tolerance=0.1)
    part = calibrate_magnetometer(recording, tolerance=0.2).mag
    assert np.abs((part.offset - HARD_IRON) / part.offset_sigma).max() < 3.5
    assert part.matrix_sigma[1, 1] > 0.1
    assert any("scale and offset along y may be wrong" in note for note in part.evidence.notes)


@pytest.mark.parametrize(
    "mag",
    [
        np.full((500, 3), 20.0),
        np.zeros((500, 3)),
        np.linspace([10.0, 0.0, 0.0], [60.0, 0.0, 0.0], 500),
        np.array([20.0, 5.0, 40.0]) + 0.5 * np.random.default_rng(5).normal(size=(2000, 3)),
        np.repeat(FIELD * np.vstack([np.eye(3), -np.eye(3)]), 100, axis=0),
        np.random.default_rng(6).uniform(-60.0, 60.0, (500, 3)),
    ],
    ids=["stuck", "zero", "line", "lying still", "six directions", "no sphere at all"],
)
def test_what_is_no_calibration_is_refused(mag: np.ndarray) -> None:
    with pytest.raises(InputError, match="expected"):
        calibrate_magnetometer(Recording(np.arange(len(mag)) * 0.01, mag=mag))


def test_points_with_their_mean_at_zero_are_no_problem() -> None:
    once = directions(RNG(25), 200)
    part = calibrate_magnetometer(Recording(np.arange(400) * 0.01, mag=FIELD * np.vstack([once, -once]))).mag
    assert np.abs(part.offset).max() < 1e-6  # µT


def test_too_few_samples_are_refused_and_few_give_hard_iron_only() -> None:
    unit = directions(RNG(7), 45)
    with pytest.raises(InputError, match="at least 20"):
        calibrate_magnetometer(field_recording(unit[:15]))
    soft = np.eye(3)
    part = calibrate_magnetometer(field_recording(unit, soft=soft)).mag
    assert part.evidence.model == "sphere"
    assert np.array_equal(part.matrix, np.eye(3))
    assert "45 directions are too few for soft iron" in part.evidence.notes[0]
    assert np.abs((part.offset - HARD_IRON) / part.offset_sigma).max() < 4.0


def spiral(n: int) -> np.ndarray:
    """Directions from pole to pole in 20 turns."""
    angle = np.linspace(0.0, 40.0 * np.pi, n)
    height = np.cos(np.linspace(0.05, np.pi - 0.05, n))
    radius = np.sqrt(1.0 - height**2)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])


def band(seed: int, height: float, n: int) -> np.ndarray:
    """Directions within a band about the equator."""
    unit = directions(RNG(seed), round(n / height))
    return unit[np.abs(unit[:, 1]) < height]


def test_soft_iron_that_is_hardly_seen_stays_small() -> None:
    """On a band ±9° high, with errors that persist, the nine unknowns of an ellipsoid alone would run away."""
    errors, sigmas = [], []
    for seed in range(12):
        unit = band(seed, 0.15, 300)
        order = np.argsort(np.arctan2(unit[:, 2], unit[:, 0]))
        recording = field_recording(unit[order], soft=np.eye(3), seed=seed)
        uneven = 1.0 + 0.005 * np.sin(3.0 * np.arctan2(unit[order, 2], unit[order, 0]) + seed)
        mag = (recording.mag - HARD_IRON) * uneven[:, None] + HARD_IRON
        # the points say so little that by default they are refused
        with pytest.raises(InputError, match=r"offset along y\b"):
            calibrate_magnetometer(Recording(recording.time, mag=mag))
        part = calibrate_magnetometer(Recording(recording.time, mag=mag), tolerance=0.2).mag
        # 3 % (1-σ) is what soft iron is taken to be, and these data say less
        assert np.abs(part.matrix - np.eye(3)).max() < 0.03
        assert part.evidence.after < 0.2 * part.evidence.before
        assert any("soft iron is hardly known" in note for note in part.evidence.notes)
        errors.append((part.offset - HARD_IRON) / part.offset_sigma)
        sigmas.append(part.offset_sigma[1])
    assert np.mean(np.square(errors)) < 1.5  # σ are no understatement
    assert 0.1 < np.mean(sigmas) < 2.5  # µT; along the band's axis


def test_spread_over_parts_left_out() -> None:
    part = calibrate_magnetometer(field_recording(directions(RNG(17), 1500))).mag
    assert part.evidence.held_out_after == pytest.approx(0.5, rel=0.1)  # the noise, µT
    size = np.linalg.norm(field_recording(directions(RNG(17), 1500)).mag, axis=1)
    spread = 1.4826 * np.median(np.abs(size - np.median(size))) / np.median(size) * part.norm
    assert part.evidence.held_out_before == pytest.approx(spread, rel=1e-3)


def test_nothing_to_gain_is_said_and_not_refused() -> None:
    """A sensor that needs no calibration: the fit is good, but makes nothing better."""
    gained = []
    for seed in range(8):
        recording = field_recording(directions(RNG(seed), 800), hard=np.zeros(3), soft=np.eye(3), seed=seed)
        evidence = calibrate_magnetometer(recording).mag.evidence
        assert evidence.held_out_after == pytest.approx(evidence.held_out_before, rel=0.15)
        gained.append(not any("nothing was gained" in note for note in evidence.notes))
        assert gained[-1] == (evidence.held_out_after < evidence.held_out_before)
    assert sum(gained) < len(gained)


@pytest.mark.parametrize("size", [4.0, 8.0, 16.0, 24.0])
def test_a_magnet_that_comes_later_is_refused(size: float) -> None:
    """It is there for the second half: what suits one half spoils the other."""
    once = spiral(1500)
    recording = field_recording(np.vstack([once, once]), hard=np.zeros(3), soft=np.eye(3))
    mag = np.array(recording.mag)
    mag[1500:] += size * np.array([0.6, -0.64, 0.48])
    with pytest.raises(InputError, match="a field that a correction makes more even"):
        calibrate_magnetometer(Recording(recording.time, mag=mag), tolerance=0.2)


def test_the_prior_is_that_of_students_t() -> None:
    """Alternating unknowns and variance ends where the density itself is largest."""
    freedom, scale, noise = 3.0, 0.03, 0.02
    prior = Prior(np.zeros(5), np.eye(5), scale, freedom)
    for size in (0.01, 0.1, 0.5):
        seen = size * RNG(19).normal(size=5)

        def cost(x: np.ndarray, seen: np.ndarray = seen) -> float:
            tail = 0.5 * (freedom + 5.0) * np.log1p(x @ x / (freedom * scale**2))
            return float(0.5 * ((x - seen) ** 2).sum() / noise**2 + tail)

        best = minimize(cost, seen, method="BFGS", options={"gtol": 1e-9}).x
        x = seen
        for _ in range(300):
            x = np.linalg.solve(np.eye(5) + noise**2 * prior.precision(x), seen)
        assert x == pytest.approx(best, abs=1e-5)
    assert np.linalg.norm(x) > 0.98 * np.linalg.norm(seen)  # of 0.5, clearly seen, next to nothing is lost


def test_rotating_the_sensor_turns_the_result() -> None:
    recording = field_recording(directions(RNG(8), 600))
    turn = Rotation.from_rotvec([0.4, -1.0, 0.7]).as_matrix()
    plain, turned = calibrate_magnetometer(recording).mag, calibrate_magnetometer(recording.rotate_body(turn)).mag
    assert turned.offset == pytest.approx(turn @ plain.offset, abs=1e-6)  # µT; where the iteration ends
    assert turned.matrix == pytest.approx(turn @ plain.matrix @ turn.T, abs=1e-8)
    assert turned.norm == pytest.approx(plain.norm, rel=1e-8)


def test_order_and_unit_of_the_samples_do_not_matter() -> None:
    recording = field_recording(directions(RNG(9), 400))
    plain = calibrate_magnetometer(recording).mag
    mixed = Recording(recording.time, mag=recording.mag[RNG(1).permutation(400)])
    assert calibrate_magnetometer(mixed).mag.offset == pytest.approx(plain.offset, abs=1e-6)  # µT
    gauss = Recording(recording.time, mag=recording.mag / 100.0, mag_unit="arbitrary")
    part = calibrate_magnetometer(gauss).mag
    assert part.unit == "arbitrary"
    assert part.offset == pytest.approx(plain.offset / 100.0, abs=1e-8)
    assert part.matrix == pytest.approx(plain.matrix, abs=1e-8)


@pytest.mark.parametrize("share", [0.1, 0.3])
def test_a_disturbed_stretch_does_not_matter(share: float) -> None:
    recording = field_recording(directions(RNG(10), 1000))
    mag = np.array(recording.mag)
    mag[100 : 100 + int(1000 * share)] += [40.0, 10.0, -30.0]  # past a magnet, µT
    part = calibrate_magnetometer(Recording(recording.time, mag=mag)).mag
    assert np.abs(part.offset - HARD_IRON).max() < 0.5  # µT
    assert np.abs(part.matrix - true_matrix()).max() < 0.01
    assert part.evidence.used == pytest.approx(1.0 - share, abs=0.05)
    assert any("left out as disturbed" in note for note in part.evidence.notes)


def test_more_disturbed_than_not_is_refused() -> None:
    recording = field_recording(directions(RNG(11), 1000))
    mag = np.array(recording.mag)
    mag[:700] += RNG(2).normal(0.0, 40.0, (700, 3))
    with pytest.raises(InputError, match="expected"):
        calibrate_magnetometer(Recording(recording.time, mag=mag))


def test_lying_still_does_not_outvote_turning() -> None:
    recording = field_recording(directions(RNG(12), 500))
    lying = np.array([80.0, 0.0, 0.0]) + 0.3 * RNG(3).normal(size=(20_000, 3))  # on a steel table, µT
    both = Recording(np.arange(20_500) * 0.01, mag=np.vstack([lying, recording.mag]))
    part = calibrate_magnetometer(both).mag
    assert np.abs(part.offset - HARD_IRON).max() < 0.5  # µT
    assert part.evidence.samples < 2000


def test_several_recordings_and_missing_samples() -> None:
    recording = field_recording(directions(RNG(13), 800))
    mag = np.array(recording.mag)
    mag[::3] = np.nan
    holes = Recording(recording.time, mag=mag)
    there = Recording(recording.time[~np.isnan(mag[:, 0])], mag=mag[~np.isnan(mag[:, 0])])
    one = calibrate_magnetometer(holes).mag
    assert np.array_equal(one.offset, calibrate_magnetometer(there).mag.offset)
    parts = [holes[:300], holes[300:]]
    assert calibrate_magnetometer(parts).mag.offset == pytest.approx(one.offset, abs=1e-6)


def test_an_uneven_field_enlarges_the_sigma() -> None:
    """Errors that stay from one direction to the next do not average out, however many samples there are."""
    unit = spiral(6000)
    # the first part shows in the residuals; the second is as large, but looks like hard iron
    uneven = 1.0 + 0.09 * unit[:, 0] * unit[:, 1] * unit[:, 2] + 0.015 * unit[:, 2]
    mag = FIELD * unit * uneven[:, None] + 0.1 * RNG(4).normal(size=unit.shape)
    even = calibrate_magnetometer(field_recording(unit, noise=0.1, hard=np.zeros(3), soft=np.eye(3))).mag
    part = calibrate_magnetometer(Recording(np.arange(6000) * 0.01, mag=mag)).mag
    assert part.offset_sigma.min() > 10.0 * even.offset_sigma.max()
    # the field itself moves the offset by 0.75 µT: this must be within what the σ allows
    assert abs(part.offset[2]) > 0.5
    assert abs(part.offset[2]) < 5.0 * part.offset_sigma[2]


def test_sigma_in_uneven_rooms_is_honest() -> None:
    """Rooms whose field varies by 3 %, and a sensor at a lever arm: the gradient along the field passes for iron.

    Stretches of time agree on the wrong offset, so that scatter between them alone would be 2 to 6 times too small.
    """
    squares = []
    for lever, wander, length in ((0.2, 0.1, 0.5), (0.4, 0.1, 0.5), (0.2, 0.05, 1.0)):
        for seed in range(9):
            recording = room_recording(seed, lever=lever, wander=wander, length=length)
            part = calibrate_magnetometer(recording).mag
            squares.append((((part.offset - HARD_IRON) / part.offset_sigma) ** 2).sum())
    # one component of the gradient does harm, and two others tell of it: 3 F(1, 2), whose median for 27 rooms is
    # 2.0 ± 1.0, to χ²(3), whose is 2.4 ± 0.5. With scatter between stretches alone it is 17
    assert 0.7 < np.median(squares) < 5.0
    # 5 % of χ²(3) and 25 % of 3 F(1, 2) are above 7.8, the latter ± 8 %
    assert np.mean(np.array(squares) > 7.81) < 0.45


def test_a_field_that_changes_with_time_enlarges_the_sigma() -> None:
    """Of a part of the sphere, seen over and over while the field drifts: 2000 points are 40 independent values."""
    errors = []
    for seed in range(12):
        rng = RNG(60_000 + seed)
        time = np.arange(2000) * 0.1
        height = 1.0 - (1.0 - np.cos(np.deg2rad(50.0))) * np.sin(np.pi * time / 6.1 + rng.uniform(0.0, 3.0)) ** 2
        angle, radius = 2.0 * np.pi * time / 3.77, np.sqrt(1.0 - height**2)
        unit = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])
        keep = np.exp(-1.0 / 50.0)
        drift = lfilter([0.01 * np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.normal(size=3000))[1000:]
        mag = FIELD * unit * (1.0 + drift)[:, None] + HARD_IRON + 0.1 * rng.normal(size=unit.shape)
        part = calibrate_magnetometer(Recording(time, mag=mag), tolerance=0.2).mag
        errors.append((part.offset - HARD_IRON) / part.offset_sigma)
    # no understatement; with scores summed over no stretches it is 2.3
    assert np.mean(np.square(errors)[:, :2]) < 1.0


def test_what_comes_back_with_the_direction() -> None:
    """A variance in closed form: of a harmonic of degree 3, at all times; nothing of what changes with time only."""
    unit = directions(RNG(23), 20_000)
    pattern = 0.09 * unit[:, 0] * unit[:, 1] * unit[:, 2]
    slow = 0.01 * np.sin(2.0 * np.pi * np.arange(20_000) / 400.0)
    noise = 0.01 * RNG(24).normal(size=20_000)
    one = np.ones(20_000)
    # bins 11° wide smooth it by 4 % or so
    assert with_direction(unit, pattern + slow + noise, one, 0.01) == pytest.approx(0.09**2 / 105.0, rel=0.15)
    assert with_direction(unit, slow + noise, one, 0.01) < 0.02 * 0.01**2
    # of what is seen once only, all that persists may come back
    once = np.repeat(coverage(unit).centres[::4], 20, axis=0)
    assert with_direction(once, noise[:500], one[:500], 0.004) == pytest.approx(0.004**2)


@pytest.mark.parametrize("shift", [[30.0, -12.0, 45.0], [-500.0, 300.0, 200.0]])
def test_what_is_added_to_all_samples_is_added_to_the_offset(shift: list[float]) -> None:
    """Nothing draws the offset to where it is expected: of points that are hardly known neither."""
    unit = band(3, 0.5, 600)
    plain = field_recording(unit, noise=1.0)
    moved = Recording(plain.time, mag=plain.mag + np.array(shift))
    first, second = (calibrate_magnetometer(r, tolerance=0.2).mag for r in (plain, moved))
    assert second.offset - first.offset == pytest.approx(np.array(shift), abs=1e-6)  # µT, where the iteration ends
    assert second.matrix == pytest.approx(first.matrix, abs=1e-7)
    assert second.offset_sigma == pytest.approx(first.offset_sigma, rel=1e-4)


def test_soft_iron_added_to_all_samples_is_found() -> None:
    """The prior takes next to nothing from what 800 directions all around say."""
    plain = field_recording(directions(RNG(21), 800), hard=np.zeros(3), soft=np.eye(3))
    iron = Recording(plain.time, mag=plain.mag @ SOFT_IRON.T)
    first, second = calibrate_magnetometer(plain).mag, calibrate_magnetometer(iron).mag
    # the same noise, stretched by soft iron: its effect on both fits differs by a tenth of what it is
    assert np.abs(second.matrix - true_matrix()).max() < 1.5 * np.abs(first.matrix - np.eye(3)).max()
    assert np.abs(np.linalg.solve(SOFT_IRON, second.offset) - first.offset).max() < 0.3 * first.offset_sigma.max()


def test_iron_within_its_uncertainty_is_said_to_be() -> None:
    words = "no larger than their uncertainty"
    said = []
    for seed in range(20):
        bare = field_recording(directions(RNG(seed), 400), hard=np.zeros(3), soft=np.eye(3), seed=seed)
        said.append(any(words in note for note in calibrate_magnetometer(bare).mag.evidence.notes))
    # both are so in 0.95² of all cases: 14 of 20 or fewer once in 70 times
    assert sum(said) >= 15
    for hard, soft in ((HARD_IRON / 25.0, np.eye(3)), (np.zeros(3), SOFT_IRON)):
        iron = field_recording(directions(RNG(1), 1500), hard=hard, soft=soft)
        assert not any(words in note for note in calibrate_magnetometer(iron).mag.evidence.notes)


def test_nothing_gained_over_all_directions_is_said() -> None:
    """A tenth of the directions is next to a magnet: they make the spread, and no correction mends them."""
    recording = field_recording(directions(RNG(22), 1000), hard=np.array([1.0, 0.0, 0.0]), soft=np.eye(3))
    mag = np.array(recording.mag)
    near = slice(300, 400)
    mag[near] += np.linspace(0.5, 1.5, 100)[:, None] * np.array([-60.0, 10.0, 20.0])
    part = calibrate_magnetometer(Recording(recording.time, mag=mag)).mag
    assert part.evidence.after < part.evidence.before
    before, after = np.linalg.norm(mag, axis=1), np.linalg.norm(part.correct(mag), axis=1)
    assert after.std() / after.mean() > before.std() / before.mean()
    assert any(
        "over all directions, disturbed ones too, the field's size is no more even" in n for n in part.evidence.notes
    )


def test_derivatives_of_the_distance() -> None:
    rng = RNG(14)
    points = 1.3 * directions(rng, 6) + 0.1
    x = np.concatenate([rng.normal(0.0, 0.1, 3), [1.1, 0.9, 1.0, 0.05, -0.04, 0.08]])
    model = ellipsoid_model(points)
    numeric = approx_fprime(x, lambda v: model(v)[0], 1e-7)
    assert model(x)[1] == pytest.approx(numeric, abs=1e-5)  # forward differences


def test_mean_curvature_of_known_surfaces() -> None:
    sphere = curvature(4.0 * directions(RNG(15), 5), np.zeros(3), np.eye(3) / 4.0)
    assert sphere == pytest.approx(np.full(5, 0.25), rel=1e-12)
    # at the tip of an ellipsoid with semi-axes a, b, c both curvatures are c/a² and c/b²
    a, b, c = 2.0, 3.0, 5.0
    tip = curvature(np.array([[0.0, 0.0, c]]), np.zeros(3), symmetric(np.array([1 / a, 1 / b, 1 / c, 0, 0, 0])))
    assert tip[0] == pytest.approx(0.5 * (c / a**2 + c / b**2), rel=1e-12)


def test_wrong_arguments() -> None:
    recording = field_recording(directions(RNG(16), 100))
    with pytest.raises(InputError, match="field above 0"):
        calibrate_magnetometer(recording, field=0.0)
    with pytest.raises(InputError, match="tolerance"):
        calibrate_magnetometer(recording, tolerance=float("nan"))
    with pytest.raises(InputError, match="samples of the magnetometer"):
        calibrate_magnetometer(Recording(recording.time, gyr=recording.mag))
    with pytest.raises(InputError, match="at least one recording"):
        calibrate_magnetometer([])
    with pytest.raises(InputError, match="one unit"):
        calibrate_magnetometer([recording, Recording(recording.time, mag=recording.mag, mag_unit="arbitrary")])


@settings(max_examples=40, deadline=None)
@given(
    arrays(
        np.float64,
        st.tuples(st.integers(0, 80), st.just(3)),
        elements=st.floats(-1e12, 1e12) | st.just(np.nan) | st.sampled_from([0.0, 1.0, 1e-300]),
    )
)
def test_hostile_arrays_are_refused_or_calibrated(mag: np.ndarray) -> None:
    try:
        part = calibrate_magnetometer(Recording(np.arange(len(mag)) * 0.01, mag=mag)).mag
    except InputError:
        return
    assert np.isfinite(part.offset).all()
    assert np.isfinite(part.matrix).all()


def test_large_noise_does_not_bias_the_field() -> None:
    """On the outside of a sphere is more room than on the inside: σ²/R = 0.18 µT here."""
    seeds = 16
    errors = []
    for seed in range(seeds):
        recording = field_recording(directions(RNG(seed), 400), noise=3.0, soft=np.eye(3), seed=seed)
        errors.append(calibrate_magnetometer(recording, tolerance=0.1).mag.norm - FIELD)
    # a mean of 400 samples and 16 seeds: 3/√6400 = 0.04 µT
    assert abs(np.mean(errors)) < 0.1
