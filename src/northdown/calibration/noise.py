"""Noise of a sensor at rest: white noise, bias instability, random walk and their like, with intervals.

The Allan deviation of a still part of a recording is fitted with the terms of IEEE Std 952-1997, annex C; see
`northdown.calibration._noise_fit` for the equations. What the record is too short or too noisy to tell is left open,
with an upper limit and the reason, instead of being given a number.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from northdown._validation import FloatArray, check_choice, check_increasing, check_number
from northdown.calibration._noise_fit import FLICKER, QUANTISATION, RAMP, WALK, WHITE, AxisFit, fit_axis
from northdown.calibration._noise_units import NAMES, SYMBOLS, si_unit
from northdown.calibration._runs import find_runs
from northdown.calibration.allan import LEAST_SAMPLES, AllanCurve, curve_of_runs, sample_rows
from northdown.calibration.noise_model import AllanResult, Coefficient, NoiseModel, Sensor
from northdown.calibration.rest import find_rests
from northdown.checks.base import duration
from northdown.errors import InputError, expected
from northdown.recording import SENSORS, Recording

# Smaller deviations are no noise, and larger values no signal, in any unit; squares of all between are numbers.
_LEAST_DEVIATION, _MOST = 1e-150, 1e100
# A mean rate beyond this (rad/s) is a turn, no bias.
_TURN = 0.2
# Share of a part that must look still for no word about it, and what a rest is cut short by at its ends (s).
_MOSTLY, _ENDS = 0.98, 0.5
# Shorter records seldom show anything but white noise.
_SHORT = 600.0


def identify_noise(
    recording: Recording,
    sensor: Sensor = "gyr",
    *,
    start: float | None = None,
    stop: float | None = None,
    ramp: bool = False,
    confidence: float = 0.95,
) -> AllanResult:
    """Find the noise coefficients of a sensor from a recording in which it lay still.

    Parameters
    ----------
    recording : Recording
        With a long still part: ten minutes for the white noise, hours for bias instability and random walk.
    sensor : {"gyr", "acc", "mag"}
        Which sensor.
    start, stop : float, optional
        The still part, start ≤ time < stop, as in `recording.time` (s). When neither is given, the longest part in
        which the sensors hardly vary is found.
    ramp : bool
        Whether to fit a steady ramp R too; it is hard to tell from a random walk.
    confidence : float
        Confidence of the intervals, between 0.5 and 0.999.

    Returns
    -------
    AllanResult
        Curve, coefficients with intervals and reasons, and notes.

    Raises
    ------
    InputError
        Without the sensor, when time runs backwards, when there are fewer than 256 still samples, or when an axis
        never changes.

    Notes
    -----
    Samples that are missing and gaps in time split the still part into runs; no cluster reaches across, and squared
    differences of all runs are averaged. Sampling is taken as even within a run, at the mean rate.

    Examples
    --------
    >>> import numpy as np
    >>> import northdown as nd
    >>> noise = np.random.default_rng(0).normal(0.0, 0.002, (60_000, 3))
    >>> recording = nd.Recording(np.arange(60_000) / 100.0, gyr=noise)
    >>> model = identify_noise(recording, "gyr").axes[0]
    >>> round(model.white_noise.value, 6)  # 0.002 rad/s over √(100 Hz)
    0.0002
    >>> model.random_walk.value, model.random_walk.reason
    (None, 'does not show in 600 s')
    """
    check_choice("sensor", sensor, SENSORS)
    confidence = check_number("confidence", confidence, low=0.5, high=0.999)
    if not isinstance(recording, Recording):
        raise InputError(expected("a Recording", type(recording).__name__))
    check_increasing(recording.time)
    _check_size(recording)
    notes: list[str] = []
    part = _still_part(recording, sensor, start, stop, notes)
    values: FloatArray = getattr(part, sensor)
    there = sample_rows(values)
    time, values = part.time[there], values[there]
    starts, stops, rate = find_runs(time, notes)
    curve = curve_of_runs(values, rate, starts, stops)
    _check_alive(curve, sensor)
    lasted = float(time[-1] - time[0])
    if lasted < _SHORT:
        notes.append(
            f"still for {duration(lasted)} only: white noise shows in it, slower noise needs an hour or more"
        )
    _note_resolution(values, curve, notes)
    arbitrary = sensor == "mag" and recording.mag_unit == "arbitrary"
    return _fit_axes(recording.name, sensor, curve, time, ramp, confidence, arbitrary, notes)


def _fit_axes(
    name: str,
    sensor: Sensor,
    curve: AllanCurve,
    time: FloatArray,
    ramp: bool,
    confidence: float,
    arbitrary: bool,
    notes: list[str],
) -> AllanResult:
    from scipy.stats import chi2

    terms = [t for t in range(5) if ramp or t != RAMP]
    variance = curve.deviation**2
    fits = [
        fit_axis(
            variance[:, k],
            curve.size,
            curve.lengths,
            terms=terms,
            confidence=confidence,
            longest_skip=min(curve.rate, float(curve.size[-1]) / 16.0),
        )
        for k in range(3)
    ]
    models = tuple(_model(a, f, curve, sensor, arbitrary) for a, f in zip("xyz", fits, strict=True))
    _note_fit(models, curve, notes)
    freedom = np.column_stack([f.freedom for f in fits])
    tail = 0.5 * (1.0 - confidence)
    return AllanResult(
        sensor=sensor,
        curve=curve,
        low=curve.deviation * np.sqrt(freedom / chi2.ppf(1.0 - tail, freedom)),
        high=curve.deviation * np.sqrt(freedom / chi2.ppf(tail, freedom)),
        freedom=freedom,
        axes=(models[0], models[1], models[2]),
        start=float(time[0]),
        stop=float(time[-1]),
        confidence=confidence,
        arbitrary=arbitrary,
        notes=tuple(notes),
        name=name,
    )


def _still_part(
    recording: Recording, sensor: str, start: float | None, stop: float | None, notes: list[str]
) -> Recording:
    """The samples to work with: as given, or the longest rest."""
    values: FloatArray | None = getattr(recording, sensor)
    if values is None:
        raise InputError(expected(f"{sensor} in the recording", "none"))
    there = int(sample_rows(values).sum())
    if there < LEAST_SAMPLES:
        raise InputError(expected(f"{LEAST_SAMPLES} samples of {sensor} or more", f"{there}"))
    if not recording.duration > 0.0:
        raise InputError(expected("samples over some time", "all at the same time"))
    given = start is not None or stop is not None
    if given:
        first = -math.inf if start is None else check_number("start", start, unit="s")
        last = math.inf if stop is None else check_number("stop", stop, unit="s")
        part = recording.between(first, last)
    else:
        part = _longest_rest(recording, notes)
    there = int(sample_rows(getattr(part, sensor)).sum())
    if there < LEAST_SAMPLES or not part.duration > 0.0:
        what = "in the part given" if given else "in the longest still part"
        hint = "choose a longer part" if given else "let the sensor lie still for an hour, or give start and stop"
        raise InputError(expected(f"{LEAST_SAMPLES} samples of {sensor} or more {what}", f"{there}", do=hint))
    if given and _can_tell_rest(part):
        rest = sum(r.duration for r in find_rests(part))
        if rest < _MOSTLY * part.duration - _ENDS:
            notes.append(f"the part given looks still in {rest:.4g} s of its {part.duration:.4g} s only")
    return part


def _can_tell_rest(recording: Recording) -> bool:
    return recording.gyr is not None or recording.acc is not None


def _longest_rest(recording: Recording, notes: list[str]) -> Recording:
    if not _can_tell_rest(recording):
        notes.append("without gyroscope and accelerometer rest cannot be told: the whole recording is taken")
        return recording
    # what turns steadily is as quiet as what rests
    rests = [r for r in find_rests(recording) if r.gyr is None or float(np.linalg.norm(r.gyr)) < _TURN]
    if not rests:
        return recording[:0]
    longest = max(rests, key=lambda rest: rest.duration)
    return recording[longest.start : longest.stop]


def _check_size(recording: Recording) -> None:
    for name in SENSORS:
        values: FloatArray | None = getattr(recording, name)
        if values is not None and (large := np.abs(values) > _MOST).any():
            row = int(np.argmax(large.any(axis=1)))
            raise InputError(
                expected(f"{name} of a size that a sensor can measure", f"{np.nanmax(np.abs(values[row])):g}", at=row)
            )


def _check_alive(curve: AllanCurve, sensor: str) -> None:
    for axis, deviation in zip("xyz", curve.deviation.T, strict=True):
        # squares must be numbers of full precision too
        if deviation.min() < _LEAST_DEVIATION:
            got = "one value" if deviation.max() < _LEAST_DEVIATION else "a signal that repeats exactly"
            raise InputError(
                expected(
                    f"noise in {sensor} {axis}",
                    f"{got} in the whole still part",
                    do="check the sensor and the resolution with which it was recorded",
                )
            )


def _note_resolution(values: FloatArray, curve: AllanCurve, notes: list[str]) -> None:
    coarse = []
    for axis, column, deviation in zip("xyz", values[:20_000].T, curve.deviation[0], strict=True):
        steps = np.diff(np.unique(column))
        if steps.size and deviation < 0.5 * steps.min():
            coarse.append(axis)
    if coarse:
        notes.append(
            f"{', '.join(coarse)}: the noise is less than half the resolution of the recording, so that rounding "
            "distorts it"
        )


def _note_fit(models: Sequence[NoiseModel], curve: AllanCurve, notes: list[str]) -> None:
    for shortest in sorted({m.shortest for m in models if m.shortest > curve.tau[0]}):
        axes = ", ".join(m.axis for m in models if m.shortest == shortest)
        notes.append(
            f"{axes}: cluster times below {duration(shortest)} are left out, as the fastest noise is not white (a "
            "low-pass filter, interpolation or vibration)"
        )
    for model in models:
        if model.widening > 1.0:
            notes.append(
                f"{model.axis}: the model misses the curve by {model.widening:.1f} times its noise (vibration, "
                "temperature, motion?); intervals are widened by that"
            )


def _model(axis: str, fit: AxisFit, curve: AllanCurve, sensor: str, arbitrary: bool) -> NoiseModel:
    """Coefficients of one axis in SI units."""
    # from squares in units of samples
    scale = curve.rate ** np.array([-1.0, -0.5, 0.0, 0.5, 1.0])

    def coefficient(k: int) -> Coefficient:
        unit = si_unit(sensor, SYMBOLS[k], arbitrary=arbitrary)
        value, low, high = (float(np.sqrt(v[k]) * scale[k]) for v in (fit.values, fit.low, fit.high))
        reason = "" if fit.determined[k] else _reason(k, fit, curve)
        return Coefficient(SYMBOLS[k], None if reason else value, low, high, unit, reason)

    return NoiseModel(
        axis=axis,
        quantisation=coefficient(QUANTISATION),
        white_noise=coefficient(WHITE),
        bias_instability=coefficient(FLICKER),
        random_walk=coefficient(WALK),
        ramp=coefficient(RAMP),
        fitted=tuple((np.sqrt(fit.values) * scale).tolist()),
        shortest=float(curve.tau[int(np.argmax(fit.used))]),
        widening=fit.widening,
        lag=float(np.sqrt(fit.lag)) / curve.rate,
    )


def _reason(term: int, fit: AxisFit, curve: AllanCurve) -> str:
    """Why a coefficient is not determined."""
    if not math.isfinite(fit.high[term]):
        return "not looked for" if term == RAMP else "the shortest cluster times are left out"
    lasts = duration(float(curve.lengths.max()) / curve.rate)
    others = [k for k in range(5) if k != term and not fit.determined[k] and fit.values[k] > 0.0]
    if fit.needed and others and fit.values[term] > 0.0:
        return f"cannot be told from {' and '.join(NAMES[SYMBOLS[k]] for k in others)} in {lasts}"
    if term == QUANTISATION:
        return "hidden by the white noise at this sampling rate"
    return f"does not show in {lasts}"
