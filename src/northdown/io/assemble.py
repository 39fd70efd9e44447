"""From columns of numbers to a `Recording`: time in seconds, SI units, reference, metadata."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray, check_number
from northdown.arrays import AccelerometerArray
from northdown.errors import FormatError, InputError, expected
from northdown.io.array_columns import check_channels_live
from northdown.io.columns import Columns, Plan, Units
from northdown.io.layout import Meta, orientation_extras
from northdown.io.source import MAX_BYTES, quoted
from northdown.io.units import factor, is_arbitrary
from northdown.orientation import Orientation
from northdown.recording import SENSORS, Recording

_EPOCH: Final = 1e8
"""Times above this many seconds (three years) are taken for a date: 1970 plus so much."""


@dataclass(frozen=True)
class Options:
    """What the caller of `read` asks for; see there."""

    rate: float | None = None
    units: Units | None = None
    columns: Columns | None = None
    frame: str | None = None
    name: str = ""
    stem: str = ""
    max_bytes: int = MAX_BYTES
    array: AccelerometerArray | None = None

    def named(self, stem: str) -> Options:
        """The same options, with the name that the file's own gives when nothing else does."""
        return replace(self, stem=stem)


def build_recording(
    plan: Plan,
    values: Mapping[int, npt.NDArray[Any]],
    options: Options,
    meta: Meta | None = None,
    extras: Mapping[str, FloatArray] | None = None,
    rate: float | None = None,
) -> Recording:
    """Make a recording of columns.

    Parameters
    ----------
    plan : Plan
        Places and units of the columns.
    values : mapping
        Array (N,) of numbers for each place.
    options : Options
        The caller's wishes; these come before `meta`.
    meta : dict, optional
        Metadata that northdown wrote into the file.
    extras : mapping, optional
        Columns of the reference beyond its quaternion, by the names of `layout`.
    rate : float, optional
        Sampling rate that the file states, Hz; used when there is no time.
    """
    meta = meta or {}
    rows = len(next(iter(values.values())))
    if not rows:
        raise FormatError(expected("rows of numbers", "none"))
    time = _time(plan, values, rows, options.rate, rate, keep=bool(meta))
    fields: dict[str, Any] = {}
    for sensor in SENSORS:
        if sensor in plan.places:
            array = np.column_stack([values[i].astype(np.float64) for i in plan.places[sensor]])
            fields[sensor] = array * factor(sensor, plan.units.get(sensor))
    if plan.array is not None:
        channels = np.column_stack([values[i].astype(np.float64) for i in plan.places["array"]])
        check_channels_live(plan.array, channels)
        fields |= {"array": plan.array, "array_acc": channels * factor("array", plan.units.get("array"))}
    frame = options.frame or meta.get("frame") or "NED"
    if "mag" in fields and (plan.units.get("mag") is not None or not meta):
        fields["mag_unit"] = "arbitrary" if is_arbitrary(plan.units.get("mag")) else "uT"
    elif "mag_unit" in meta:
        fields["mag_unit"] = meta["mag_unit"]
    if "movement" in plan.places:
        fields["movement"] = values[plan.places["movement"][0]]
    if "reference" in plan.places:
        quat = np.column_stack([values[i].astype(np.float64) for i in plan.places["reference"]])
        stated = meta.get("reference_frame")
        reference = reference_of(time, quat, stated or frame, meta.get("reference_name", ""), extras)
        fields["reference"] = reference if reference is None or not options.frame else reference.to_frame(frame)
    if "reference_offset" in meta:
        fields["reference_offset"] = meta["reference_offset"]
    name = options.name or meta.get("name") or options.stem
    return Recording(time=time, frame=frame, name=name, **fields)  # type: ignore[arg-type]


def reference_of(
    time: FloatArray, quat: FloatArray, frame: str, name: str, extras: Mapping[str, FloatArray] | None = None
) -> Orientation | None:
    """Orientation of the rows that are there: neither NaN nor all zero, which both mean 'not seen'.

    It has times of its own, put in order if the rows are not.
    """
    seen = np.flatnonzero(~np.isnan(quat).any(axis=1) & (quat != 0.0).any(axis=1))
    if not seen.size:
        return None
    order = seen[np.argsort(time[seen], kind="stable")]
    more = {} if extras is None else orientation_extras({k: v[order] for k, v in extras.items()})
    return Orientation(time[order], quat[order], frame, name=name, **more)  # type: ignore[arg-type]


def regular_time(rows: int, rate: float) -> FloatArray:
    """Times 0, 1/rate, 2/rate … of samples at a constant rate in Hz."""
    time: FloatArray = np.arange(rows) / check_number("rate", rate, above=0.0, unit="Hz")
    return time


def _time(
    plan: Plan,
    values: Mapping[int, npt.NDArray[Any]],
    rows: int,
    asked: float | None,
    stated: float | None,
    keep: bool,
) -> FloatArray:
    if asked is not None:
        return regular_time(rows, asked)
    if "time" in plan.places:
        unit = plan.units.get("time", "s" if keep else None)
        return seconds(values[plan.places["time"][0]], unit, keep=keep)
    if stated is not None:
        return regular_time(rows, stated)
    got = "no time" if not plan.counter else f"{quoted(plan.counter)} only"
    hint = "give rate=…, in Hz (--rate on the command line)"
    if "packet" in plan.counter.lower():
        hint = "give rate=256 (an x-IMU's usual rate, Hz), or --rate on the command line"
    raise InputError(expected("a column of time, or a sampling rate", got, do=hint))


def seconds(raw: npt.NDArray[Any], unit: str | float | None = None, *, keep: bool = False) -> FloatArray:
    """Times in seconds.

    Parameters
    ----------
    raw : (N,) array
        Times; integers are subtracted as integers, so nanoseconds since 1970 lose nothing.
    unit : str or float, optional
        Unit of time. When not given, seconds, unless the size shows a date in s, ms, µs or ns since 1970.
    keep : bool
        Keep dates as they are. Otherwise, times more than 1e8 s from zero are counted from the first one.

    Raises
    ------
    InputError
        When whole numbers without unit advance by one or more, which are hardly seconds.
    """
    if raw.dtype.kind == "u":
        raw = raw.astype(np.int64 if not raw.size or raw.max() < 2**63 else np.float64)
    elif raw.dtype.kind == "b":
        raw = raw.astype(np.float64)
    finite = raw[np.isfinite(raw)]
    first = finite[0] if finite.size else 0
    if unit is None:
        size = abs(float(first))
        unit = next((u for limit, u in ((1e17, "ns"), (1e14, "us"), (1e11, "ms")) if size > limit), None)
        if unit is None and len(finite) > 1 and raw.dtype.kind == "i" and size <= _EPOCH:
            step = float(np.median(np.diff(finite.astype(np.float64))))
            if step >= 1.0:
                got = f"whole numbers without unit, {step:g} apart"
                do = "give units={'time': 'ms'}, 'us' or 's', or rate=… in Hz"
                raise InputError(expected("time in seconds", got, do=do))
    scale = factor("time", unit)
    if not keep and abs(float(first)) * scale > _EPOCH:
        wide = raw.dtype.kind == "i" and int(raw.max()) - int(raw.min()) >= 2**63
        raw = raw.astype(np.float64) - float(first) if wide else raw - first
    # division by 1000, not multiplication by 0.001, which has no exact binary form
    parts = round(1.0 / scale) if scale <= 1.0 else 0
    result: FloatArray = raw / float(parts) if parts and abs(parts * scale - 1.0) < 1e-12 else raw * scale
    return np.asarray(result, dtype=np.float64)
