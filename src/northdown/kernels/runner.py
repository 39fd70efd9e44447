"""The one loop that serves every filter: over a whole recording, over a part of it, or for one live sample.

A filter is a function ``step(p, s, dt, gyr, acc, mag) -> s`` on tuples: parameters p, state s whose first four
entries are the attitude quaternion (body to NED), time since the last sample, and the three sensor vectors.
NaN in acc or mag means that there is no sample. A filter that takes more numbers a sample has ``n_extra`` of them in
one more tuple at the end. :class:`Kernel` compiles the loop around it.

What all filters share is done here, once: the start from the first usable accelerometer and magnetometer
samples, the same again after a long time without any, holding the last rate through short gaps of the gyroscope, and
turning the result to the frame asked for.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from northdown.kernels.holes import LONGEST_HOLE
from northdown.kernels.jit import compiled, inline
from northdown.kernels.numpy_abi import IN_PLACE, THROUGH_NUMBA, Reading, layout_holds
from northdown.kernels.quaternion import congruent, dot, down_b, multiply, whole_axes
from northdown.kernels.tuples import put_tuple, to_fixed_tuple
from northdown.kernels.wahba import has_heading, heading_error, tilt_correction, turn_about_down

# The runner's own entries at the head of the state array.
PENDING: Final = 0  # bits TILT_UNKNOWN, HEADING_UNKNOWN still to be found from the sensors
HELD: Final = 1  # last rate of the gyroscope, three entries
GAP: Final = 4  # time (s) since the last gyroscope sample
LAST: Final = 5  # time (s) of the last sample; NaN before the first
MAX_GAP: Final = 6  # longest time (s) for which a rate is held
PERIOD: Final = 7  # time (s) from one live sample to the next where none is given; NaN when not known
COUNT: Final = 8  # samples done
N_RUNNER: Final = 9

# Stands for the time of a live sample that has none of its own: a number that no clock gives.
NEXT: Final = -1.7e308

# Bits of the flags written for every sample; `northdown.orientation.Flag` gives them their public names.
TILT_UNKNOWN: Final = 1
HEADING_UNKNOWN: Final = 2
GYRO_HELD: Final = 4
LONG_STEP: Final = 8
# The one flag of a filter that says nothing while heading is unknown.
_MAG_REJECTED: Final = 16

# Return codes; a run returns the number of samples done and one of these.
OK: Final = 0
TIME_BACKWARDS: Final = 1
GYRO_GAP: Final = 2
NOT_FINITE: Final = 3
NO_VECTOR: Final = 4
NO_TIME: Final = 5

_NAN: Final = math.nan
# A step that works in place cannot be taken back, so larger samples, which might overflow in it, are refused before.
_LARGEST: Final = 1e12

Array = npt.NDArray[np.float64]
Step = Callable[..., tuple[float, ...]]


@inline
def replace_attitude(p: tuple[float, ...], s: Any, q: Any, heading_known: bool) -> Any:
    """Put the attitude found at the start into the state (the default of `Kernel.aligned`)."""
    return q + s[4:]


@inline
def same_state(p: tuple[float, ...], s: Any) -> Any:
    """What is recorded of the state: all of it (the default of `Kernel.output`)."""
    return s


@inline
def no_flags(p: tuple[float, ...], s: Any) -> int:
    """Flags of a filter that has none (the default of `Kernel.flagged`)."""
    return 0


@inline
def is_attitude(w: float, x: float, y: float, z: float) -> bool:
    """Whether a quaternion is one of an attitude: numbers, and not all zero, as an overflow can leave them."""
    square: float = w * w + x * x + y * y + z * z
    return 0.25 < square < math.inf


@inline
def start_tilt(q: Any, acc: Any) -> Any:
    """Level the attitude q by one accelerometer sample.

    From more than 90 degrees away the body is first turned over about its own x axis, so that the result does
    not hang on noise where the shortest arc has no definite axis, and the x axis keeps its heading.
    """
    if dot(down_b(q), acc) > 0.0:
        q = multiply(q, (0.0, 1.0, 0.0, 0.0))
    return multiply(tilt_correction(q, acc), q)


def _access(kernel: Kernel) -> tuple[Callable[..., Any], Callable[..., None]]:
    """How the loops get at the filter's state: a tuple read and written back, or the array itself."""
    n_state = kernel.n_state
    if kernel.in_place:

        @inline
        def load(state: Any) -> Any:
            return state[N_RUNNER:]

        @inline
        def save(state: Any, s: Any) -> None:
            pass

    else:

        @inline
        def load(state: Any) -> Any:
            return to_fixed_tuple(state[N_RUNNER:], n_state)

        @inline
        def save(state: Any, s: Any) -> None:
            put_tuple(state[N_RUNNER:], s)

    return load, save


def _ignoring_extra(step: Step) -> Step:
    @inline
    def same(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any, extra: Any) -> Any:
        return step(p, s, dt, gyr, acc, mag)

    return same


def _make_extra(n_extra: int) -> Callable[..., Any]:
    """Build what reads the further numbers of a sample; nothing at all where there are none."""

    @inline
    def numbers(array: Any, first: int) -> Any:
        return to_fixed_tuple(array[first:], n_extra)

    @inline
    def none(array: Any, first: int) -> Any:
        return ()

    return numbers if n_extra else none


def make_tick(kernel: Kernel) -> Callable[..., Any]:
    """Build the work of one sample: hold the gyroscope, align while needed, take the filter's step."""
    aligned, flagged, memoryless = kernel.aligned, kernel.flagged, kernel.memoryless
    step = kernel.step if kernel.n_extra else _ignoring_extra(kernel.step)

    @inline
    def tick(p: Any, s: Any, r: Any, dt: float, gyr: Any, acc: Any, mag: Any, extra: Any) -> Any:
        pending, hx, hy, hz, gap, max_gap = r
        flags = 0
        begins_anew = dt > LONGEST_HOLE and dt > max_gap and not memoryless
        if gyr[0] == gyr[0] and gyr[1] == gyr[1] and gyr[2] == gyr[2]:
            gap = 0.0
            if dt > max_gap:
                flags = LONG_STEP
        else:
            gap += dt
            flags = GYRO_HELD
            gyr = (hx, hy, hz)
            if gap > max_gap:
                return GYRO_GAP, flags, s, (pending, hx, hy, hz, gap, max_gap)
        if begins_anew:
            pending, dt = float(TILT_UNKNOWN | HEADING_UNKNOWN), 0.0
        if pending == 0.0:
            s = step(p, s, dt, gyr, acc, mag, extra)
            flags |= flagged(p, s)
        else:
            nothing = (_NAN, _NAN, _NAN)
            tilt_pending = pending != float(HEADING_UNKNOWN)
            tilt_now = tilt_pending and dot(acc, acc) > 0.0
            s = step(p, s, dt, gyr, nothing if tilt_pending else acc, nothing, extra)
            q = (s[0], s[1], s[2], s[3])
            if tilt_now:
                q = start_tilt(q, acc)
                pending -= float(TILT_UNKNOWN)
            heading_now = (
                pending == float(HEADING_UNKNOWN) and (tilt_now or not tilt_pending) and has_heading(down_b(q), mag)
            )
            if heading_now:
                q = turn_about_down(heading_error(q, mag), q)
                pending -= float(HEADING_UNKNOWN)
            if tilt_now or heading_now:
                s = aligned(p, s, q, pending == 0.0)
                if memoryless:
                    s = step(p, s, 0.0, gyr, acc, mag, extra)
            said = flagged(p, s)
            flags |= int(pending) | (said & ~_MAG_REJECTED) if pending > 0.0 else said
        return OK, flags, s, (pending, gyr[0], gyr[1], gyr[2], gap, max_gap)

    return tick


def _make_run(kernel: Kernel) -> Callable[..., Any]:
    tick, output = make_tick(kernel), kernel.output
    load, save = _access(kernel)
    n_params, n_out = kernel.n_params, kernel.n_out
    first, extra = kernel.covariance, _make_extra(kernel.n_extra)

    def run(
        params: Array,
        state: Array,
        turn: Array,
        time: Array,
        gyr: Array,
        acc: Array,
        mag: Array,
        more: Array,
        out: Array,
        flags: npt.NDArray[np.uint8],
    ) -> tuple[int, int]:
        p = to_fixed_tuple(params, n_params)
        s = load(state)
        r = (state[0], state[1], state[2], state[3], state[4], state[MAX_GAP])
        last = state[LAST]
        f = (turn[0], turn[1], turn[2], turn[3])
        is_turned = f[0] != 1.0
        axes = whole_axes(f)
        code = OK
        done = len(time)
        for i in range(len(time)):
            dt = time[i] - last if last == last else 0.0
            if dt < 0.0:
                code = TIME_BACKWARDS
                done = i
                break
            code, flag, s, r = tick(
                p,
                s,
                r,
                dt,
                (gyr[i, 0], gyr[i, 1], gyr[i, 2]),
                (acc[i, 0], acc[i, 1], acc[i, 2]),
                (mag[i, 0], mag[i, 1], mag[i, 2]),
                extra(more[i], 0),
            )
            last = time[i]
            if flag != 0:
                flags[i] = flag
                if code != OK:
                    done = i
                    break
            o = output(p, s)
            if is_turned:
                q = multiply(f, (o[0], o[1], o[2], o[3]))
                out[i, 0] = q[0]
                out[i, 1] = q[1]
                out[i, 2] = q[2]
                out[i, 3] = q[3]
            else:
                for j in range(4):
                    out[i, j] = o[j]
            for j in range(4, n_out):
                out[i, j] = o[j]
            if is_turned and first > 0:
                c = congruent(axes, to_fixed_tuple(out[i, first:], 9))
                for j in range(9):
                    out[i, first + j] = c[j]
        if code == OK and len(time) > 0 and not is_attitude(s[0], s[1], s[2], s[3]):
            code = NOT_FINITE
            for i in range(len(time)):
                if not is_attitude(out[i, 0], out[i, 1], out[i, 2], out[i, 3]):
                    done = i
                    break
        save(state, s)
        for j in range(5):
            state[j] = r[j]
        state[LAST] = last
        state[COUNT] += done
        return code, done

    return run


def _make_update(kernel: Kernel, reading: Reading) -> Callable[..., Any]:
    tick = make_tick(kernel)
    output = kernel.output
    load, save = _access(kernel)
    n_params, n_state, n_out = kernel.n_params, kernel.n_state, kernel.n_out
    largest = _LARGEST if kernel.in_place else sys.float_info.max
    is_vector, vector, doubles = reading.is_vector, reading.vector, reading.doubles
    first_state = _N_TURN + n_params
    first_out = first_state + N_RUNNER + n_state
    first_extra = first_out + n_out
    extra = _make_extra(kernel.n_extra)
    n_work = first_extra + kernel.n_extra

    def update(whole: Any, time: float, gyr: Any, acc: Any, mag: Any) -> Any:
        if not (is_vector(whole, gyr) and is_vector(whole, acc) and is_vector(whole, mag)):
            return -1 - NO_VECTOR
        rate, force, field = vector(gyr), vector(acc), vector(mag)
        for component in rate + force + field:
            if math.fabs(component) > largest:
                return -1 - NOT_FINITE
        work = doubles(whole, n_work)
        turn = work[:_N_TURN]
        state = work[first_state:]
        out = work[first_out:]
        last = state[LAST]
        if time == NEXT:
            if state[PERIOD] != state[PERIOD]:
                return -1 - NO_TIME
            dt = state[PERIOD] if last == last else 0.0
            time = last + dt if last == last else 0.0
        else:
            dt = time - last if last == last else 0.0
            if not dt >= 0.0 or time - time != 0.0:
                return -1 - TIME_BACKWARDS
        p = to_fixed_tuple(work[_N_TURN:], n_params)
        s = load(state)
        r = (state[0], state[1], state[2], state[3], state[4], state[MAX_GAP])
        code, flag, s, r = tick(p, s, r, dt, rate, force, field, extra(work, first_extra))
        if code != OK:
            return -1 - code
        o = output(p, s)
        q = (o[0], o[1], o[2], o[3])
        if not is_attitude(q[0], q[1], q[2], q[3]):
            return -1 - NOT_FINITE
        if turn[0] != 1.0:
            q = multiply((turn[0], turn[1], turn[2], turn[3]), q)
        for j in range(4):
            out[j] = q[j]
        for j in range(4, n_out):
            out[j] = o[j]
        save(state, s)
        for j in range(5):
            state[j] = r[j]
        state[LAST] = time
        state[COUNT] += 1.0
        return int(flag)

    return update


_N_TURN: Final = 4
_VECTOR: Any = numba.float64[::1]
# A recording's arrays may be read-only.
_TIMES: Any = numba.types.Array(numba.float64, 1, "C", readonly=True)
_ROWS: Any = numba.types.Array(numba.float64, 2, "C", readonly=True)
_RUN_SIGNATURE: Final = (
    *(_VECTOR, _VECTOR, _VECTOR),
    *(_TIMES, _ROWS, _ROWS, _ROWS, _ROWS),
    *(numba.float64[:, ::1], numba.uint8[::1]),
)


class Workspace(NamedTuple):
    """What a running estimate keeps, in one array, as a call with one array is quicker than with four."""

    whole: Array
    turn: Array
    """Quaternion from NED to the frame of the result."""
    params: Array
    state: Array
    """The runner's entries, then the filter's."""
    out: Array
    """What was recorded of the last live sample; the first four entries are its attitude."""
    extra: Array
    """Further numbers of the next live sample, to be written before `update`."""


@dataclass(frozen=True)
class Kernel:
    """A filter's step together with the compiled loops around it.

    Parameters
    ----------
    name : str
        Unique name, used for the compilation cache.
    step : inlined function
        ``step(p, s, dt, gyr, acc, mag) -> s`` as described in the module's docstring.
    n_params, n_state : int
        Lengths of the tuples p and s.
    n_out : int
        How many entries of what `output` returns are recorded for every sample; the first four are the attitude.
    output : inlined function
        ``output(p, s) -> tuple``, what is recorded.
    aligned : inlined function
        ``aligned(p, s, q, heading_known) -> s``, the state after its attitude has been set from the sensors: called
        when tilt is found, and again when heading is, or once for both.
    flagged : inlined function
        ``flagged(p, s) -> int``, further flags of the sample just taken.
    covariance : int
        Where the nine entries of the attitude's covariance in NED stand in what is recorded, 0 for none. A whole
        recording's are turned to the frame of the result; a live sample's are not.
    in_place : bool
        Whether the state is an array that the functions above write into and return, rather than a tuple: for filters
        of so many states that tuples are slow to compile.
    memoryless : bool
        Whether the step also takes the samples from which the start was found. A filter must not: it would count
        them twice.
    n_extra : int
        How many numbers a sample has beside the three vectors.

    Notes
    -----
    ``run(params, state, turn, time, gyr, acc, mag, extra, out, flags)`` works through arrays (extra: (N, n_extra))
    and returns a code and the number of samples done. ``update(whole, time, gyr, acc, mag)`` takes one sample,
    returns its flags or −1 − code, and on failure leaves the state as it was. The arrays are those of `workspace`.
    `update` takes anything for a sample: what is not an array of three float64 gives −1 − NO_VECTOR (or TypeError).
    """

    name: str
    step: Step
    n_params: int
    n_state: int
    n_out: int
    output: Callable[..., Any] = same_state
    aligned: Callable[..., Any] = replace_attitude
    flagged: Callable[..., int] = no_flags
    memoryless: bool = False
    covariance: int = 0
    n_extra: int = 0
    in_place: bool = False

    def workspace(self) -> Workspace:
        """New arrays for one running estimate, all zero."""
        ends = np.cumsum((_N_TURN, self.n_params, N_RUNNER + self.n_state, self.n_out, self.n_extra))
        whole = np.zeros(ends[-1])
        return Workspace(whole, *np.split(whole, ends[:-1]))

    @cached_property
    def run(self) -> Callable[..., tuple[int, int]]:
        """The compiled loop over arrays."""
        return compiled(_make_run(self), f"{self.name}-run", _RUN_SIGNATURE)

    @cached_property
    def _update(self) -> Any:
        reading = IN_PLACE if layout_holds() else THROUGH_NUMBA
        signature = (reading.kind, numba.float64, reading.kind, reading.kind, reading.kind)
        return compiled(_make_update(self, reading), f"{self.name}-update", signature)

    @cached_property
    def update(self) -> Callable[..., int]:
        """The compiled work for one live sample."""
        if not layout_holds():
            return self._update  # type: ignore[no-any-return]
        (code,) = self._update.overloads.values()
        return code.entry_point  # type: ignore[no-any-return]
