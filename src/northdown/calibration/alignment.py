"""Alignment of a magnetometer to the body: the rotation that its own calibration cannot see.

Two observations tell how the magnetometer's axes lie. With a gyroscope: in body axes a constant field turns against
the body, ṁ = −ω × m, so that between two times m₁ = ΔRᵀ m₀, with ΔR from the integrated gyroscope. Without one: the
angle between the field and the vertical, the dip, is the same in all positions.

Of the gyroscope's equation a linear form serves as the start, so that axes may be named in any way; the
dip's equation starts from axes that agree roughly. Neither tells a magnetometer from one with all axes reversed.

Sources: S. Bonnet, C. Bassompierre, C. Godin, S. Lesecq, A. Barraud, Sensors and Actuators A 156, 2009 (constant
dip); M. Kok, T. B. Schön, IEEE Sensors J. 16(14), 2016 (alignment to inertial sensors).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from northdown._validation import FloatArray, check_choice, check_number
from northdown.calibration._ellipsoid import weakest
from northdown.calibration._field_pairs import Pairs, gather_pairs
from northdown.calibration._inputs import axis_words, gather
from northdown.calibration._known_noise import ignored
from northdown.calibration._solve import Model, Solution, robust
from northdown.calibration.field import steady_pairs
from northdown.calibration.model import Calibration
from northdown.calibration.part import Evidence, SensorCalibration
from northdown.errors import InputError, expected
from northdown.recording import Recording

# Fewest observations, and angle (rad) beyond which the result is no agreement.
_FEWEST: Final = 30
_WORST: Final = math.radians(15.0)
_FLOOR: Final = 1e-9
# The dip is one number for each moment: from few positions many rotations keep it nearly constant, the more so when
# some moments may be left out. Beyond these the σ would not be honest.
_WORST_CONDITION: Final = 50.0
_LEAST_USED: Final = 0.8
# Offsets that calibrations usually leave (1-σ of each axis, relative to field and gravity): the dip cannot tell them
# from a rotation where positions are few.
_LEFT_MAG: Final = 0.01
_LEFT_ACC: Final = 0.003

Residuals = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""From a rotation matrix and further unknowns to residuals and their derivatives."""

_HOW: Final = "turn the sensor slowly about all three axes, away from iron"


def align_magnetometer(
    recording: Recording | Sequence[Recording],
    *,
    method: str = "gyr",
    tolerance: float = 0.02,
    gravity: float = 9.80665,
) -> Calibration:
    """Rotation of a calibrated magnetometer to the axes of the other sensors.

    Parameters
    ----------
    recording : Recording or sequence of these
        With `mag`, its hard and soft iron corrected, and `gyr` or `acc`.
    method : {"gyr", "dip"}
        ``"gyr"``: the field turns as the gyroscope says; aligns to the gyroscope's axes. ``"dip"``: the angle to the
        vertical is constant; aligns to the accelerometer's axes.
    tolerance : float
        Largest predicted 1-σ of the rotation that is accepted, rad.
    gravity : float
        Local gravity, m/s², for ``"dip"``.

    Returns
    -------
    Calibration
        Its part `mag` has the rotation as its matrix, no offset, and as `matrix_sigma` the rotation's 1-σ (rad)
        carried to the elements. Join it to the magnetometer's calibration: ``iron.then(alignment)``.

    Raises
    ------
    InputError
        When the motion does not fix the rotation.
    """
    check_choice("method", method, ("gyr", "dip"))
    tolerance = check_number("tolerance", tolerance, above=0.0, high=0.5, unit="rad")
    recordings = gather(recording, ("mag", "gyr" if method == "gyr" else "acc"))
    solution, matrix, before, after = _by_gyr(recordings) if method == "gyr" else _by_dip(recordings, gravity)
    direction, sigma = weakest(solution)
    if method == "dip" and (solution.condition > _WORST_CONDITION or solution.used < _LEAST_USED):
        sigma = math.inf
    if not sigma <= tolerance:
        got = "motion that does not fix the rotation"
        if sigma < 0.5:
            got = f"motion that leaves the rotation about {axis_words(direction)} uncertain to "
            got += f"{math.degrees(sigma):.1f}° (1-σ)"
        do = f"{_HOW}, or accept it with a larger tolerance" if sigma < 0.5 else _HOW
        raise InputError(expected("turns about all axes", got, do=do))
    if not after < _WORST:
        other = "gyroscope" if method == "gyr" else "accelerometer"
        got = f"one that differs by {math.degrees(after):.0f}° from the {other}"
        raise InputError(
            expected(
                "a calibrated magnetometer", got, do="calibrate it first, and check axes and units of all sensors"
            )
        )
    notes = _lag_notes(solution) if method == "gyr" else ()
    turn = float(np.arccos(np.clip((np.trace(matrix) - 1.0) / 2.0, -1.0, 1.0)))
    # a small rotation δ moves element (i, j) by (δ × column j)_i
    spread = np.sqrt(
        np.array([[((_cross(matrix[:, j])[i] * solution.sigma[:3]) ** 2).sum() for j in range(3)] for i in range(3)])
    )
    evidence = Evidence(
        f"alignment by {'gyroscope' if method == 'gyr' else 'dip'}",
        "angle of the field to where it should be",
        "rad",
        before,
        after,
        len(solution.weights) // (3 if method == "gyr" else 1),
        solution.used,
        condition=solution.condition,
        notes=(f"turned by {math.degrees(turn):.2f}°, known to {math.degrees(sigma):.2f}° (1-σ)", *notes),
    )
    unit = recordings[0].mag_unit
    return Calibration(mag=SensorCalibration("mag", matrix=matrix, matrix_sigma=spread, unit=unit, evidence=evidence))


def magnetometer_lag(recording: Recording | Sequence[Recording]) -> tuple[float, float]:
    """Time (s) by which a magnetometer's samples are late against the gyroscope's, and its 1-σ.

    Parameters
    ----------
    recording : Recording or sequence of these
        With `gyr` and a calibrated `mag`, turned fast about several axes.

    Notes
    -----
    A lag of 10 ms turns the field by 2° at 200 °/s. It is found together with the magnetometer's alignment, from
    the part of its disagreement with the gyroscope that grows with the rate. ``recording.shift("mag", -lag)``
    undoes it.
    """
    solution, _, _, _ = _by_gyr(gather(recording, ("mag", "gyr")))
    return float(solution.x[-1]), float(solution.sigma[-1])


def _lag_notes(solution: Solution) -> tuple[str, ...]:
    """Remark on samples that are late, when that is sure and matters."""
    lag, sigma = 1e3 * float(solution.x[-1]), 1e3 * float(solution.sigma[-1])
    if abs(lag) < max(4.0 * sigma, 2.0):
        return ()
    late = "late" if lag > 0.0 else "early"
    return (f"the magnetometer's samples are {abs(lag):.1f} ± {sigma:.1f} ms {late} against the gyroscope's",)


def _cross(v: FloatArray) -> FloatArray:
    """Matrix of v ×."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _crosses(v: FloatArray) -> FloatArray:
    """Matrices (N, 3, 3) of v ×, for vectors (N, 3)."""
    out = np.zeros((len(v), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    out[:, 1, 0], out[:, 2, 0], out[:, 2, 1] = v[:, 2], -v[:, 1], v[:, 0]
    return out


def _rotation(vector: FloatArray) -> FloatArray:
    """Rotation matrix of a rotation vector."""
    from scipy.spatial.transform import Rotation

    mat: FloatArray = Rotation.from_rotvec(vector).as_matrix()
    return mat


def _refine(
    residuals: Residuals,
    start: FloatArray,
    extra: FloatArray,
    *,
    components: int = 1,
    shared: int = 0,
    all_persistent: bool = False,
) -> tuple[Solution, FloatArray]:
    """Robust fit of a rotation and further unknowns, about a start that is moved until nothing is left to turn."""
    matrix, others = start, extra
    solution: Solution | None = None
    for _ in range(6):
        here, base = matrix, others

        def prepare(_: FloatArray, __: float, here: FloatArray = here) -> Model:
            def model(x: FloatArray) -> tuple[FloatArray, FloatArray]:
                return residuals(_rotation(x[:3]) @ here, x[3:])

            return model

        solution = robust(
            prepare,
            np.concatenate([np.zeros(3), base]),
            floor=_FLOOR,
            components=components,
            shared=shared,
            all_persistent=all_persistent,
        )
        matrix, others = _rotation(solution.x[:3]) @ here, solution.x[3:]
        if np.linalg.norm(solution.x[:3]) < 1e-9:
            break
    if solution is None:
        raise InputError(expected("a rotation", "none"))
    return solution, matrix


class _DipResiduals:
    """up · (M m) − c, for unit vectors."""

    def __init__(self, up: FloatArray, field: FloatArray) -> None:
        self.up, self.field = up, field

    def __call__(self, mat: FloatArray, others: FloatArray) -> tuple[FloatArray, FloatArray]:
        turned = self.field @ mat.T
        residual = (self.up * turned).sum(axis=1) - others[0]
        # up · (δ × v) = δ · (v × up)
        return residual, np.column_stack([np.cross(turned, self.up), -np.ones(len(turned))])


class _GyrResiduals:
    """M m₁ − ΔRᵀ M m₀ (unit vectors), with ΔR turned further by a bias of the gyroscope, and both fields late.

    A field that is seen τ late is that of now turned back: m(t) = m̃(t) − τ ω × m̃(t).
    """

    def __init__(self, pairs: Pairs) -> None:
        self.pairs = pairs

    def __call__(self, mat: FloatArray, others: FloatArray) -> tuple[FloatArray, FloatArray]:
        p = self.pairs
        bias, lag = others[:3], others[3]
        first, second = p.before @ mat.T, p.after @ mat.T
        moved_first, moved_second = np.cross(p.rate_before, first), np.cross(p.rate_after, second)
        carried = np.einsum("nji,nj->ni", p.turn, first - lag * moved_first)
        # a bias b turns the end by −b Δt, and the field seen there by (b Δt) ×
        lever = -_crosses(carried) * p.length[:, None, None]
        residual = second - lag * moved_second - carried - lever @ bias
        # With the second field as predicted, not as measured: where turns say nothing of an axis, its derivative is
        # then zero, and not the noise.
        by_turn = np.einsum("nji,njk,nkl->nil", p.turn, _crosses(first), np.eye(3) - p.turn)
        by_lag = np.einsum("nji,nj->ni", p.turn, moved_first) - moved_second
        return residual.ravel(), np.concatenate([by_turn, -lever, by_lag[:, :, None]], axis=2).reshape(-1, 7)


def _by_dip(recordings: Sequence[Recording], gravity: float) -> tuple[Solution, FloatArray, float, float]:
    up, field = steady_pairs(recordings, gravity)
    if len(up) < _FEWEST:
        got = f"{len(up)}"
        raise InputError(
            expected(f"at least {_FEWEST} moments of 0.2 s in which the sensor hardly moves", got, do=_HOW)
        )
    unit = field / np.linalg.norm(field, axis=1)[:, None]
    residuals = _DipResiduals(up, unit)
    height = (up * unit).sum(axis=1)
    start = np.array([float(np.median(height))])
    solution, matrix = _refine(residuals, np.eye(3), start, all_persistent=True)
    if np.isfinite(solution.covariance).all():
        own = residuals(matrix, solution.x[3:])[1]
        turned = unit @ matrix.T
        by_acc = turned - up * (up * turned).sum(axis=1)[:, None]
        left = np.column_stack([_LEFT_MAG * up @ matrix, _LEFT_ACC * by_acc])
        extra = ignored(own, left, solution.weights, 1.0)
        solution = replace(solution, covariance=solution.covariance + extra)
    kept = solution.weights > 0.0
    before = float(np.arcsin(np.clip(height[kept], -1.0, 1.0)).std())
    after = float(np.arcsin(np.clip((up * (unit @ matrix.T)).sum(axis=1)[kept], -1.0, 1.0)).std())
    return solution, matrix, before, after


def _by_gyr(recordings: Sequence[Recording]) -> tuple[Solution, FloatArray, float, float]:
    pairs = gather_pairs(recordings)
    if len(pairs) < _FEWEST:
        got = f"{len(pairs)}"
        raise InputError(expected(f"at least {_FEWEST} turns of 3° or more within 0.25 s", got, do=_HOW))
    residuals = _GyrResiduals(pairs)
    nothing = np.zeros(4)
    # Rows of the linear equations M m₁ − ΔRᵀ M m₀ = 0 for the nine elements of M.
    rows = np.einsum("ij,nk->nijk", np.eye(3), pairs.after) - np.einsum("nji,nk->nijk", pairs.turn, pairs.before)
    _, _, right = np.linalg.svd(rows.reshape(-1, 9), full_matrices=False)
    u, _, v = np.linalg.svd(right[-1].reshape(3, 3))
    start: FloatArray = u @ v
    start = start if np.linalg.det(start) > 0.0 else -start
    plain = np.sqrt((residuals(np.eye(3), nothing)[0].reshape(-1, 3) ** 2).sum(axis=1))
    linear = np.sqrt((residuals(start, nothing)[0].reshape(-1, 3) ** 2).sum(axis=1))
    # from turns about one axis the linear start means nothing: the axes as they are then fit as well
    start = start if np.median(linear) < 0.7 * np.median(plain) else np.eye(3)
    solution, matrix = _refine(residuals, start, nothing, components=3, shared=1)
    kept = solution.weights.reshape(-1, 3).min(axis=1) > 0.0
    left = residuals(matrix, solution.x[3:])[0].reshape(-1, 3)
    was = float(np.sqrt(np.mean(plain[kept] ** 2))) if kept.any() else math.nan
    now = float(np.sqrt((left[kept] ** 2).sum(axis=1).mean())) if kept.any() else math.nan
    return solution, matrix, was, now
