"""`Bench`: a motion, its surroundings and its sensors; gives samples block by block."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray
from northdown.arrays import AccelerometerArray
from northdown.simulation import _quaternions as quaternions
from northdown.simulation.array_errors import ArrayErrors
from northdown.simulation.array_unit import ArrayUnit
from northdown.simulation.dipole import Dipole
from northdown.simulation.imu_clock import BLOCK, Clock, Timing
from northdown.simulation.imu_errors import SensorErrors, TriadErrors
from northdown.simulation.imu_errors_channel import Channel
from northdown.simulation.motion import Motion

# Slower than this (rad/s, m/s and m/s²) counts as rest.
_REST: Final = 1e-6
_GYR, _ACC, _MAG = range(3)

Block = dict[str, npt.NDArray[Any]]


class Bench:
    """Sensors on a moving body; see `measure` for the parameters, which are checked there.

    Before the motion's span the body is taken to rest in its first attitude.
    """

    def __init__(
        self,
        motion: Motion,
        errors: SensorErrors,
        seed: int,
        *,
        rate: float,
        time: npt.ArrayLike | None,
        field: FloatArray,
        gravity: float,
        position: FloatArray,
        disturbances: tuple[Dipole, ...],
        array: tuple[AccelerometerArray, ArrayErrors] | None = None,
    ) -> None:
        self._motion, self._errors = motion, errors
        self._field, self._position, self._disturbances = field[:, None], position, disturbances
        self._gravity = np.array([[0.0], [0.0], [gravity]])
        self._clock = Clock.of(motion, rate, time)
        self._timing = Timing(self._clock, errors, seed)
        self._last: FloatArray = np.zeros(0)
        self._last_quat: FloatArray = np.zeros((4, 0))
        self._other: tuple[FloatArray, FloatArray] = self._last, self._last_quat
        signals = ((errors.gyr, self._mean_rate), (errors.acc, self._delayed_force), (errors.mag, self._magnetic))
        self._channels: list[Channel | None] = []
        for sensor, (own, signal) in enumerate(signals):
            channel = None
            if own is not None:
                period = self._clock.period if own.rate is None else 1.0 / own.rate
                channel = Channel(
                    own,
                    signal,
                    integrates=sensor == _GYR,
                    period=period,
                    start=self._clock.start,
                    seed=seed,
                    sensor=sensor,
                )
            self._channels.append(channel)
        self._array: ArrayUnit | None = None
        if array is not None:
            self._array = ArrayUnit(
                *array, self._state, period=self._clock.period, start=self._clock.start, seed=seed
            )

    def blocks(self) -> Iterator[Block]:
        """Arrays time, quat and movement of each block; gyr, gyr_bias, acc, mag, array_acc where there is such."""
        before: float | None = None
        for first in range(0, self._clock.count, BLOCK):
            instants, stamps, lost = self._timing.block(first, min(first + BLOCK, self._clock.count))
            edges = np.concatenate([[instants[0] - self._clock.period if before is None else before], instants])
            block: Block = {"time": stamps}
            self._remember(edges)
            for sensor, key in ((_GYR, "gyr"), (_ACC, "acc"), (_MAG, "mag")):
                channel = self._channels[sensor]
                if channel is None:
                    continue
                if sensor == _GYR:
                    block[key], bias = channel.read(edges, self._force)
                    block["gyr_bias"] = bias
                else:
                    own: TriadErrors = getattr(self._errors, key)
                    block[key] = self._read(channel, own, edges, first == 0)
            if self._array is not None:
                block["array_acc"] = self._array.read(edges[1:])
            block["movement"] = self._moves(edges)
            block["quat"] = self._quat(stamps).T
            before = float(instants[-1])
            yield {k: v[~lost] for k, v in block.items()} if lost.any() else block

    def _read(self, channel: Channel, errors: TriadErrors, edges: FloatArray, starts: bool) -> FloatArray:
        """Samples of a sensor at the rows' instants, or the newest of its own clock; NaN where there is none."""
        if errors.rate is None:
            return channel.read(edges[1:], self._force)[0]
        begin = self._clock.start + errors.phase
        # a clock that ticks within rounding of a row's instant belongs to that row
        tick = np.floor((edges - begin) * errors.rate + 1e-6)
        if starts:
            tick[0] = -1.0
        fresh = (np.diff(tick) > 0.0) & (tick[1:] >= 0.0)
        values = np.full((len(fresh), 3), np.nan)
        if fresh.any():
            values[fresh] = channel.read(begin + tick[1:][fresh] / errors.rate, self._force)[0]
        return values

    def _inside(self, time: FloatArray) -> FloatArray:
        return np.clip(time, *self._motion.span)

    def _remember(self, time: FloatArray) -> None:
        self._last, self._last_quat = time, self._motion.turning.quat(self._inside(time))

    def _quat(self, time: FloatArray) -> FloatArray:
        """Attitude (4, N); that of the block's instants is made once for all sensors, that of filters' ticks too."""
        for known, quat in ((self._last, self._last_quat), self._other):
            skip = len(known) - len(time)
            if skip in (0, 1) and np.array_equal(known[skip:], time):
                return quat[:, skip:]
        self._other = time, self._motion.turning.quat(self._inside(time))
        return self._other[1]

    def _mean_rate(self, edges: FloatArray) -> FloatArray:
        delay = self._errors.gyr.delay if self._errors.gyr is not None else 0.0
        edges = edges - delay if delay else edges
        quat = self._quat(edges)
        inside = self._inside(edges)
        turn = quaternions.log(quaternions.multiply(quaternions.conjugate(quat[:, :-1]), quat[:, 1:]))
        step = np.diff(inside)
        still = step <= 0.0
        rate: FloatArray = turn / np.where(still, 1.0, step)
        if still.any():
            # before the motion's span, which is where a recording's first mean would begin
            rate[:, still] = self._motion.turning.evaluate(inside[1:][still])[1]
        return np.ascontiguousarray(rate.T)

    def _delayed_force(self, time: FloatArray) -> FloatArray:
        delay = self._errors.acc.delay if self._errors.acc is not None else 0.0
        return self._force(time - delay if delay else time)

    def _force(self, time: FloatArray) -> FloatArray:
        if not self._position.any():
            free = self._motion.path.acceleration(self._inside(time)) - self._gravity
            return np.ascontiguousarray(quaternions.rotate_inverse(self._quat(time), free).T)
        rate, acceleration, force = self._state(time)
        arm = self._position[:, None] + np.zeros_like(rate)
        turning = quaternions.cross(acceleration, arm) + quaternions.cross(rate, quaternions.cross(rate, arm))
        return np.ascontiguousarray((force + turning).T)

    def _state(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Body rate, its derivative, and specific force at the body's origin, (3, N) in body axes."""
        inside = self._inside(time)
        free = self._motion.path.acceleration(inside) - self._gravity
        quat, rate, acceleration = self._motion.turning.evaluate(inside)
        return rate, acceleration, quaternions.rotate_inverse(quat, free)

    def _magnetic(self, time: FloatArray) -> FloatArray:
        delay = self._errors.mag.delay if self._errors.mag is not None else 0.0
        time = time - delay if delay else time
        quat = self._quat(time)
        field = self._field + np.zeros((3, len(time)))
        if self._disturbances:
            place = self._motion.path.evaluate(self._inside(time))[0]
            place = place + quaternions.rotate(quat, self._position[:, None] + np.zeros_like(place))
            for dipole in self._disturbances:
                field = field + dipole.field(time, place)
        return np.ascontiguousarray(quaternions.rotate_inverse(quat, field).T)

    def _moves(self, edges: FloatArray) -> npt.NDArray[np.bool_]:
        step = quaternions.multiply(quaternions.conjugate(self._last_quat[:, :-1]), self._last_quat[:, 1:])
        turns = np.abs(quaternions.log(step)).max(axis=0) > _REST * np.diff(edges)
        _, velocity, acceleration = self._motion.path.evaluate(self._inside(edges[1:]))
        shifts = np.abs(velocity).max(axis=0) > _REST
        moves: npt.NDArray[np.bool_] = turns | shifts | (np.abs(acceleration).max(axis=0) > _REST)
        return moves
