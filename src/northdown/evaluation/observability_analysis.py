r"""Which states can be told from the measurements: rank and singular values of the observability matrix.

At each time of a motion the measurements z and their derivatives are stacked and differentiated by the state x,

.. math::  W = \nabla_x \, [z, \dot z, \ddot z, \dots]   \quad\text{(K06 (3.17))}

A direction of the state that W takes to zero changes none of them: no estimator can find it from data close to that
time. The derivatives follow exactly, by Taylor series of the motion's own law.

This is local. Over a longer stretch more may become observable: a bias about the vertical shows when the body is held
in another attitude later, though it shows in neither. So the matrices of all times are also taken together, each
carried back to the first time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray, as_float_array, check_increasing, check_number, check_time
from northdown.errors import InputError, expected
from northdown.evaluation.observability_changes import Changes, transitions
from northdown.evaluation.observability_equations import gradients, undefined
from northdown.evaluation.observability_models import Method, Model, State, Unknown, Variant, parse_sensors
from northdown.evaluation.observability_rate import rate_series
from northdown.evaluation.observability_result import Observability, zero_limit
from northdown.evaluation.observability_words import Namer
from northdown.orientation import Orientation
from northdown.recording import Recording
from northdown.simulation.motion import Motion

Trajectory: TypeAlias = Motion | Orientation | Recording

HIGHEST_ORDER: Final = 8
MOST_TIMES: Final = 100_000
TOLERANCE: Final = 1e-10
_USUAL_TIMES: Final = 1001
# Bounds the memory for the matrices.
_AT_ONCE: Final = 2048


def observability(
    trajectory: Trajectory,
    sensors: str | Sequence[str] = "acc xyz, mag xyz",
    *,
    state: State = "quaternion",
    unknown: Unknown | Sequence[Unknown] = (),
    method: Method = "direct",
    variant: Variant = "scale-free",
    order: int = 3,
    times: npt.ArrayLike | None = None,
    dip: float = math.radians(60.0),
    tolerance: float = TOLERANCE,
    bandwidth: float = 10.0,
) -> Observability:
    """Rank, singular values and unobservable directions along a motion.

    Parameters
    ----------
    trajectory : Motion, Orientation or Recording
        What the body does. An `Orientation`, and the reference that a recording must have, is followed by a smooth
        spline.
    sensors : str or sequence of str
        Axes, such as ``"acc yz, mag xy"``; all three where none is named. The accelerometer tells the direction of
        gravity, as all attitude filters take it. ``"gyr"`` may be named when the rate is unknown.
    state : {"quaternion", "quaternion+norm", "euler", "tangent"}
        How the attitude is written; with ``+norm`` the quaternion's length is one more measurement.
    unknown : {"gyr_bias", "field", "dip", "rate"}, or several
        What is to be found besides the attitude; see `Model`. The rate is known, up to the bias, unless named here;
        then the angular acceleration is.
    method : {"direct", "indirect"}
        Measured are the axes themselves, or K06's −tan ψ, −sin θ, tan φ.
    variant : {"scale-free", "printed-pitch", "printed-rate", "printed"}
        Equations of the quaternion: made independent of its length, or with K06's z₂, with K06's 1/‖q‖, or both.
    order : int
        Highest derivative of the measurements, 0 to 8. Raising it may show more, by changes
        that are harder to measure.
    times : (N,) array, optional
        When to look, s, not decreasing; about 1000 times over the whole motion when not given.
    dip : float
        Of the magnetic field below the horizon, rad; its size is one.
    tolerance : float
        Singular values count as zero up to this part of the largest one, or of 1 where that is larger (measured are
        unit vectors). Raising it counts as unobservable what is poorly observable.
    bandwidth : float
        For orientations: above this frequency (Hz) they are smoothed. Raising it follows faster turns, and noise.

    Returns
    -------
    Observability
        ``print`` it.

    Raises
    ------
    InputError
        For unknown names, combinations without sense, times outside the motion, or an orientation that no smooth
        spline follows.

    Notes
    -----
    From the second order on, derivatives of the rate enter. Those of a measured orientation are mostly noise, which
    makes weak directions look strong, such as a bias about the vertical at rest. With ``order=0`` they do not enter,
    and the measurements of all times taken together tell what a filter gets over the whole motion.
    """
    if not isinstance(unknown, (str, list, tuple)):
        raise InputError(expected("unknown as a name or several", type(unknown).__name__))
    chosen = tuple(dict.fromkeys([unknown] if isinstance(unknown, str) else unknown))
    angle = check_number("dip", dip, low=-math.pi / 2, high=math.pi / 2, unit="rad")
    model = Model(
        parse_sensors(sensors),
        state,
        chosen,
        method,
        variant,
        (math.cos(angle), math.sin(angle)),
    )
    highest = _whole("order", order, HIGHEST_ORDER)
    share = check_number("tolerance", tolerance, above=0.0, high=0.1)
    motion = follow(trajectory, bandwidth=bandwidth)
    return _analyse(model, motion, _times(motion, times), highest, share)


def follow(trajectory: Trajectory, *, bandwidth: float = 10.0) -> Motion:
    """The motion itself, or one along a spline through a measured orientation.

    Parameters
    ----------
    trajectory, bandwidth
        As for `observability`.
    """
    if isinstance(trajectory, Motion):
        return trajectory
    if isinstance(trajectory, Recording):
        if trajectory.reference is None:
            do = "estimate it first and give the estimate"
            raise InputError(expected("a recording with a reference", "one without", do=do))
        trajectory = trajectory.reference
    if not isinstance(trajectory, Orientation):
        raise InputError(expected("a Motion, an Orientation or a Recording", type(trajectory).__name__))
    from northdown.simulation.motion_through import replay

    try:
        motion = replay(trajectory, bandwidth=bandwidth)
    except InputError as problem:
        raise InputError(f"{problem}, or raise the bandwidth above {bandwidth:g} Hz") from None
    # a spline's derivatives are least certain at its ends
    edge = min(1.0 / bandwidth, 0.1 * motion.duration)
    return replace(motion, start=motion.start + edge, stop=motion.stop - edge)


def _times(motion: Motion, times: npt.ArrayLike | None) -> FloatArray:
    if times is None:
        return np.linspace(motion.start, motion.stop, _USUAL_TIMES)
    found = np.atleast_1d(as_float_array("times", times))
    if found.ndim != 1 or not 1 <= len(found) <= MOST_TIMES:
        raise InputError(expected(f"1 to {MOST_TIMES} times", f"an array of shape {found.shape}"))
    check_increasing(check_time(found))
    return found


def _whole(name: str, value: int, high: int) -> int:
    number = check_number(name, value, low=0, high=high)
    if number != int(number):
        raise InputError(expected(f"a whole number for {name}", f"{value}"))
    return int(number)


def _analyse(model: Model, motion: Motion, time: FloatArray, order: int, tolerance: float) -> Observability:
    n, count = len(model.state_names), len(time)
    quat = np.ascontiguousarray(motion.at(time).quat.T)
    defined = ~undefined(model, quat)
    changes = Changes(model, quat)
    carried = transitions(model, changes, motion, time)
    values, axes = np.full((count, n), np.nan), np.full((count, n, n), np.nan)
    rates, together = np.empty((3, count)), np.zeros((0, n))
    for part in (slice(k, min(k + _AT_ONCE, count)) for k in range(0, count, _AT_ONCE)):
        rate = rate_series(motion.turning, time[part], max(order, 1))
        rates[:, part] = rate.coefficients[0]
        use = defined[part]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            matrices = gradients(model, quat[:, part], rate, order)[use]
        values[part][use], axes[part][use] = _decompose(matrices)
        # in terms of changes at the first time, of which all matrices tell
        first = matrices @ np.linalg.solve(changes.maps[part][use], carried[part][use])
        together = np.linalg.qr(np.concatenate([together, first.reshape(-1, n)]))[1]
    rank = np.zeros(count, np.intp)
    rank[defined] = _rank(values[defined], tolerance)
    namer = Namer(changes, rates, model.field)
    hidden = tuple(namer.describe_states(k, axes[k, rank[k] :].T) if defined[k] else () for k in range(count))
    overall, all_axes = (x[0] for x in _decompose(together[None] / math.sqrt(max(int(defined.sum()), 1))))
    known = int(_rank(overall[None], tolerance)[0])
    return Observability(
        time=time,
        singular_values=values,
        rank=rank,
        directions=axes,
        unobservable=hidden,
        weakest=_weakest(namer, values, axes, rank),
        defined=defined,
        overall=overall,
        overall_rank=known,
        overall_unobservable=namer.describe(0, all_axes[known:].T),
        model=model,
        order=order,
        tolerance=tolerance,
        name=motion.name,
    )


def _rank(values: FloatArray, tolerance: float) -> npt.NDArray[np.intp]:
    return np.asarray((values > zero_limit(values, tolerance)[:, None]).sum(axis=1), np.intp)


def _weakest(namer: Namer, values: FloatArray, axes: FloatArray, rank: npt.NDArray[np.intp]) -> str:
    """Of the directions that are observable, the one that is worst so, where it is worst; several that are equal."""
    if not (rank > 0).any():
        return ""
    last = np.where(rank > 0, values[np.arange(len(values)), np.maximum(rank - 1, 0)], np.inf)
    at = int(np.argmin(last))
    known = values[at, : rank[at]]
    equal = known <= (1.0 + 1e-9) * known[-1]
    return " or ".join(namer.describe_states(at, axes[at, : rank[at]][equal].T))


def _decompose(matrices: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Singular values (N, n), falling, and right singular vectors (N, n, n) as rows."""
    count, rows, n = matrices.shape
    if rows < n:  # fewer measurements than states: the missing rows measure nothing
        matrices = np.concatenate([matrices, np.zeros((count, n - rows, n))], axis=1)
    _, values, axes = np.linalg.svd(matrices, full_matrices=False)
    return values, axes
