"""Which column holds what: names as they occur in loggers' headers, or as the caller gives them.

A name is cut into words (``accX``, ``acc_x`` and ``Accelerometer X (g)`` alike). It means a sensor's axis when it
has a word for the sensor, an axis at its end, and otherwise only words that carry no meaning of their own ('imu',
'sensor', 'calibrated' …). A word that isn't known, such as 'bias', 'free' or 'covariance', makes it another quantity,
which is left alone. Of several that fit, the one with fewest extra words is meant; equals are an error, not a guess.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from northdown.arrays import AccelerometerArray
from northdown.errors import InputError, expected
from northdown.io.array_columns import check_no_geometry, find_channels, unit_of_channels
from northdown.io.source import quoted
from northdown.io.units import QUANTITIES, factor, is_unit, split_bracket

Columns = Mapping[str, str | int | Sequence[str | int] | None]
Units = Mapping[str, str | float]

SIZES: Final = {"time": 1, "gyr": 3, "acc": 3, "mag": 3, "reference": 4, "movement": 1}

_SENSOR_WORDS: Final = {
    "gyr": {"gyr", "gyro", "gyros", "gyroscope", "omega", "angvel", "angular", "rotation", "w"},
    "acc": {"acc", "accel", "accelerometer", "acceleration", "a"},
    "mag": {"mag", "magn", "magneto", "magnetometer", "magnetic", "m"},
}
_COMPANIONS: Final = {"gyr": {"velocity", "rate"}, "acc": {"linear"}, "mag": {"field"}}
_TIME_WORDS: Final = frozenset({"time", "timestamp", "timestamps", "times", "stamp", "ts", "t"})
_QUAT_WORDS: Final = frozenset(
    {"ref", "reference", "quat", "quaternion", "q", "qw", "qx", "qy", "qz", "truth", "gt", "vicon", "omc", "opt"}
)
_NEUTRAL: Final = frozenset(
    {"imu", "sensor", "sensors", "body", "s", "rs", "cal", "calibrated", "calib", "data", "measured", "measurement",
     "value", "raw", "motion", "field", "header", "elapsed", "sample", "axis", "vector"}
)  # fmt: skip
_COUNTER_WORDS: Final = frozenset({"packet", "counter", "count", "index", "seq", "number", "sample", "frame"})
_COMPACT: Final = (
    (re.compile(r"(?:g|w|gyr|gyro)([xyz])|([xyz])gyro?"), "gyr"),
    (re.compile(r"(?:a|acc|accel)([xyz])|([xyz])acc"), "acc"),
    (re.compile(r"(?:m|mag)([xyz])|([xyz])mag"), "mag"),
)


@dataclass(frozen=True)
class Plan:
    """Places of the columns to be read, and their units.

    Attributes
    ----------
    places : dict
        For each of ``"time"``, ``"gyr"``, ``"acc"``, ``"mag"``, ``"reference"``, ``"movement"`` that is there:
        indices of its columns, in the order x, y, z or w, x, y, z.
    units : dict
        Unit of each, where one is given.
    counter : str
        Name of a column that counts rows, when there is one; empty otherwise.
    array : AccelerometerArray or None
        Geometry of the array whose channels are the places ``"array"``.
    """

    places: dict[str, tuple[int, ...]]
    units: dict[str, str | float] = field(default_factory=dict)
    counter: str = ""
    array: AccelerometerArray | None = None

    @property
    def needed(self) -> list[int]:
        """Indices of all columns to be read, each once, increasing."""
        return sorted({i for places in self.places.values() for i in places})


def plan_columns(
    labels: Sequence[str],
    *,
    columns: Columns | None = None,
    units: Units | None = None,
    groups: Mapping[str, Sequence[int]] | None = None,
    sensors: bool = True,
    array: AccelerometerArray | None = None,
) -> Plan:
    """Find the columns of a recording among labels.

    Parameters
    ----------
    labels : sequence of str
        Header of each column, with or without unit; empty when there is no header.
    columns : mapping, optional
        Names (or numbers, from 0) of the columns for any of `SIZES`; what is not named is found by its label. None
        or an empty list leaves a quantity out.
    units : mapping, optional
        Units of ``"time"``, ``"gyr"``, ``"acc"``, ``"mag"``; these override those of the labels.
    groups : mapping, optional
        Names of arrays whose columns belong together, with their indices.
    sensors : bool
        Whether at least one sensor must be found.
    array : AccelerometerArray, optional
        Geometry of the array whose channels are to be found, by its names or by ``columns["array"]``.

    Raises
    ------
    InputError
        When names are unknown or doubtful, an axis is missing, units differ between axes, or no sensor is found.
    """
    columns = dict(columns or {})
    channels = _channels(labels, array, columns.pop("array", None), sensors=sensors)
    found: dict[str, dict[str, list[tuple[int, int, str | None]]]] = {}
    counter = ""
    for index, label in enumerate(labels):
        if index in channels:
            continue
        match = _recognise(label)
        if match is not None:
            role, axis, extra, unit = match
            found.setdefault(role, {}).setdefault(axis, []).append((extra, index, unit))
        elif not counter and _COUNTER_WORDS & set(_words(split_bracket(label)[0])):
            counter = label.strip()
    named = _named(labels, columns, groups or {})
    places: dict[str, tuple[int, ...]] = {}
    label_units: dict[str, str | float] = {}
    for role in SIZES:
        if role in named:
            chosen = [(i, _unit_of(labels[i], role)) for i in named[role]]
        else:
            chosen = _pick(role, found.get(role, {}), labels)
        if not chosen:
            continue
        places[role] = tuple(index for index, _ in chosen)
        kinds = {unit for _, unit in chosen}
        if role in QUANTITIES and len(kinds) > 1:
            got = " and ".join(sorted(str(u) for u in kinds))
            raise InputError(expected(f"one unit for the axes of {role}", got, do=f"give units={{{role!r}: …}}"))
        unit = kinds.pop()
        if unit is not None:
            label_units[role] = unit
    if channels:
        places["array"] = channels
        if (channel_unit := unit_of_channels([labels[i] for i in channels])) is not None:
            label_units["array"] = channel_unit
    plan = Plan(places, _override(label_units, units), counter, array)
    if sensors and not {"gyr", "acc", "mag", "array"} & set(places):
        shown = ", ".join(quoted(s, 30) for s in list(groups or labels)[:8] if s) or "no header"
        do = "name them, as in columns={'gyr': ['wx', 'wy', 'wz']}"
        raise InputError(expected("columns of a gyroscope, an accelerometer or a magnetometer", shown, do=do))
    return plan


def _words(name: str) -> list[str]:
    spaced = re.sub(r"([a-z0-9])([A-Z])", r"\1 \2", name)
    return [w for w in re.split(r"[^0-9a-z]+", spaced.lower()) if w]


def _role(words: list[str]) -> tuple[str, str, int] | None:
    """Role, axis and number of extra words of a name without unit."""
    if not words:
        return None
    if words == ["movement"]:
        return "movement", "", 0
    rest, last = words[:-1], words[-1]
    everything = set(words)
    if everything <= _TIME_WORDS | _NEUTRAL and everything & _TIME_WORDS:
        return "time", "", len(everything & _NEUTRAL)
    if set(rest) <= _NEUTRAL:
        for pattern, role in _COMPACT:
            compact = pattern.fullmatch(last)
            if compact:
                return role, compact[1] or compact[2], len(rest)
    if last in ("w", "x", "y", "z", "qw", "qx", "qy", "qz"):
        before = set(rest) - {"orientation"}
        known = set(words if len(last) == 2 else rest) & _QUAT_WORDS
        if known and before <= _QUAT_WORDS | _NEUTRAL:
            return "reference", last[-1], len(before & _NEUTRAL)
    if last in ("x", "y", "z"):
        for role, main in _SENSOR_WORDS.items():
            if set(rest) & main and set(rest) <= main | _COMPANIONS[role] | _NEUTRAL:
                return role, last, len(set(rest) & _NEUTRAL)
    return None


def _recognise(label: str) -> tuple[str, str, int, str | None] | None:
    """Role, axis, number of extra words and unit of a label."""
    name, unit = split_bracket(label)
    role = _role(_words(name))
    if role is not None:
        return (*role, unit)
    if unit is None:
        for separator in re.finditer(r"[_ /.]+", name):
            unit = name[separator.end() :]
            role = _role(_words(name[: separator.start()]))
            if role is not None and role[0] in QUANTITIES and is_unit(role[0], unit):
                return (*role, unit)
    return None


def _unit_of(label: str, role: str) -> str | None:
    """Unit in the label of a column that the caller has named."""
    if role not in QUANTITIES:
        return None
    match = _recognise(label)
    unit = split_bracket(label)[1] if match is None else match[3]
    return unit if unit is not None and is_unit(role, unit) else None


def _channels(
    labels: Sequence[str],
    array: AccelerometerArray | None,
    given: str | int | Sequence[str | int] | None,
    *,
    sensors: bool,
) -> tuple[int, ...]:
    """Indices of an array's channels, by its names or as given; none without an array."""
    if array is None:
        if sensors and given is None:
            check_no_geometry(labels)
        return ()
    listed = [given] if isinstance(given, (str, int)) else given
    return find_channels(labels, array, None if listed is None else [_index(c, labels) for c in listed])


def _pick(
    role: str, axes: dict[str, list[tuple[int, int, str | None]]], labels: Sequence[str]
) -> list[tuple[int, str | None]]:
    """Choose the columns of a role among those recognised."""
    wanted = "wxyz" if SIZES[role] == 4 else "xyz" if SIZES[role] == 3 else ""
    if not axes:
        return []
    chosen: list[tuple[int, str | None]] = []
    for axis in wanted or [""]:
        candidates = sorted(axes.get(axis, []), key=lambda c: c[:2])
        if not candidates:
            have = ", ".join(quoted(labels[c[0][1]], 30) for c in axes.values())
            do = f"give columns={{{role!r}: […]}}, or an empty list to leave it out"
            raise InputError(expected(f"columns {', '.join(wanted)} of {role}", f"only {have}", do=do))
        if len(candidates) > 1 and candidates[0][0] == candidates[1][0]:
            have = " and ".join(quoted(labels[c[1]], 30) for c in candidates[:2])
            raise InputError(
                expected(f"one column for {role} {axis}".rstrip(), have, do=f"choose with columns={{{role!r}: …}}")
            )
        chosen.append((candidates[0][1], candidates[0][2]))
    return chosen


def _named(labels: Sequence[str], columns: Columns, groups: Mapping[str, Sequence[int]]) -> dict[str, list[int]]:
    """Indices of the columns that the caller has named."""
    result: dict[str, list[int]] = {}
    for role, value in columns.items():
        if role not in SIZES:
            raise InputError(expected(f"columns of {', '.join([*SIZES, 'array'])}", quoted(role)))
        names = [value] if isinstance(value, (str, int)) else list(value or ())
        if len(names) == 1 and isinstance(names[0], str) and names[0] in groups:
            result[role] = list(groups[names[0]])
        else:
            result[role] = [_index(name, labels) for name in names]
        if len(result[role]) not in (0, SIZES[role]):
            raise InputError(expected(f"{SIZES[role]} columns for {role}", f"{len(result[role])}"))
    return result


def _index(name: str | int, labels: Sequence[str]) -> int:
    if isinstance(name, int):
        if not 0 <= name < len(labels):
            raise InputError(expected(f"a column number from 0 to {len(labels) - 1}", f"{name}"))
        return name
    if not isinstance(name, str):
        raise InputError(expected("the name or number of a column", quoted(name)))
    exact = [i for i, label in enumerate(labels) if label == name]
    bare = exact or [i for i, label in enumerate(labels) if split_bracket(label)[0] == name]
    if len(bare) == 1:
        return bare[0]
    if len(bare) > 1:
        raise InputError(
            expected("a name that one column has", f"{quoted(name)}, which {len(bare)} have", do="give its number")
        )
    close = difflib.get_close_matches(name, [s for s in labels if s], n=1, cutoff=0.5)
    hint = f"did you mean {quoted(close[0])}?" if close else "check the header"
    raise InputError(expected("the name of a column", quoted(name), do=hint))


def _override(units: dict[str, str | float], given: Units | None) -> dict[str, str | float]:
    """Units of the labels, replaced by those given; each is looked up, so that an unknown one is an error."""
    for quantity in given or {}:
        if quantity not in QUANTITIES:
            raise InputError(expected(f"units of {', '.join(QUANTITIES)}", quoted(quantity)))
    merged = units | dict(given or {})
    for quantity, unit in merged.items():
        factor(quantity, unit)
    return merged
