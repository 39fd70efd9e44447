"""Simulated disturbances with a known truth: magnets around the body or on it, and manoeuvres that accelerate.

The sensors are those of an MPU-9250 after calibration, at 100 Hz, in a field of 50 µT with 65° dip. Calibration
leaves a fiftieth of the constant errors, and nothing of the gyroscope's answer to gravity except in the scenario that
is about it. Everything that is random follows from the seed.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.interpolate import BPoly
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown.simulation import MPU_9250, Dipole, Motion, Path, SplinePath, measure, random_motion, walk, waypoints

RATE = 100.0
STEP = 0.05  # s between the waypoints of a drive
GRAVITY = 9.80665
WEAKEST = 3.0  # µT of foreign field that count as a disturbance, 6 % of the Earth's
GENTLEST = 1.0  # m/s² of linear acceleration that count as one


@dataclasses.dataclass(frozen=True)
class Case:
    """A recording, and the samples in which it is disturbed."""

    recording: nd.Recording
    disturbed: np.ndarray


def sensors(
    motion: Motion, seed: int, magnets: Sequence[Dipole] = (), name: str = "", *, per_g: float = 0.0
) -> nd.Recording:
    """What the sensors say; `per_g` is the change of the gyroscope's bias, °/s per g."""
    errors = MPU_9250.calibrated()
    gyr = dataclasses.replace(errors.gyr, g_sensitivity=math.radians(per_g) / GRAVITY)
    return measure(motion, dataclasses.replace(errors, gyr=gyr), seed, rate=RATE, disturbances=magnets, name=name)


# ---- magnets ----


def magnet(field: np.ndarray, place: Path | np.ndarray, seen_from: np.ndarray) -> Dipole:
    """Dipole whose field (µT) at the origin is `field` when it stands at −`seen_from` (m)."""
    r = float(np.linalg.norm(seen_from))
    u = seen_from / r
    return Dipole(r**3 / 0.1 * (1.5 * u * (u @ field) - field), place)


def visit(place: np.ndarray, come: float, go: float | None, far: float = 200.0) -> Path:
    """Path that comes from far off within two seconds, stays at a place, and leaves again."""
    times, ways = [come - 2.0, come], [far, 1.0]
    if go is not None:
        times, ways = [*times, go, go + 2.0], [*ways, 1.0, far]
    rests = [[way * place, np.zeros(3), np.zeros(3)] for way in ways]
    return SplinePath(BPoly.from_derivatives(times, rests), times)


class Carried(Path):
    """The shifts of a path while its origin is carried around a circle, starting north."""

    def __init__(self, shift: Path, radius: float, speed: float) -> None:
        self._shift, self._radius, self._rate = shift, radius, speed / radius

    def evaluate(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        w, r = self._rate, self._radius
        sine, cosine, nothing = np.sin(w * time), np.cos(w * time), np.zeros_like(time)
        way = r * np.stack([sine, 1.0 - cosine, nothing])
        velocity = r * w * np.stack([cosine, sine, nothing])
        acceleration = r * w * w * np.stack([-sine, cosine, nothing])
        shift = self._shift.evaluate(time)
        return way + shift[0], velocity + shift[1], acceleration + shift[2]


def near_magnets(motion: Motion, magnets: Sequence[Dipole], seed: int, name: str) -> Case:
    recording = sensors(motion, seed, magnets, name)
    place = motion.at(recording.time).position.T
    field = sum((m.field(recording.time, place) for m in magnets), np.zeros_like(place))
    return Case(recording, np.linalg.norm(field, axis=0) > WEAKEST)


def calm(seed: int) -> Case:
    return near_magnets(random_motion(300.0, seed), (), seed, "no disturbance")


def feeling(seed: int, per_g: float = 0.1) -> Case:
    """A gyroscope whose bias changes with gravity, by default as much as the data sheet allows."""
    recording = sensors(random_motion(300.0, seed), seed, name="gyroscope feels gravity", per_g=per_g)
    return Case(recording, np.zeros(len(recording), bool))


def passing(seed: int) -> Case:
    """Carried at walking speed around a large circle, past eight pieces of steel, again and again."""
    hand = random_motion(300.0, seed)
    radius, rng = 20.0, np.random.default_rng(seed)  # 0.05 m/s², which is 0.3° of tilt
    at = np.deg2rad(45.0 * np.arange(8) + 22.5)
    places = np.column_stack([(radius + 1.2) * np.sin(at), radius - (radius + 1.2) * np.cos(at), np.zeros(8)])
    moments = rng.standard_normal((8, 3))
    moments *= 200.0 / np.linalg.norm(moments, axis=1, keepdims=True)
    motion = dataclasses.replace(hand, path=Carried(hand.path, radius, 1.0))
    return near_magnets(motion, [Dipole(*m) for m in zip(moments, places, strict=True)], seed, "passing steel")


def minute(seed: int) -> Case:
    """A magnet half a metre away, from 120 to 180 s."""
    place = np.array([0.3, 0.4, 0.0])
    found = magnet(np.array([-4.0, 14.0, 6.0]), visit(place, 120.0, 180.0), -place)
    return near_magnets(random_motion(300.0, seed), [found], seed, "magnet for a minute")


def new_place(field: tuple[float, float, float], seed: int, name: str) -> Case:
    """From 150 s on another field is added, for good, the same all over the place."""
    place = np.array([0.0, 0.0, 30.0])
    found = magnet(np.array(field), visit(place, 150.0, None), -place)
    return near_magnets(random_motion(360.0, seed), [found], seed, name)


def attached(seed: int) -> Case:
    """A magnet of 12 µT fixed to the body from 120 s on."""
    clean = sensors(random_motion(360.0, seed), seed, name="magnet attached")
    direction = np.random.default_rng(seed).standard_normal(3)
    late = clean.time >= 120.0
    mag = clean.mag + np.outer(late, 12.0 * direction / np.linalg.norm(direction))
    return Case(dataclasses.replace(clean, mag=mag), late)


# ---- accelerations ----


def accelerated(motion: Motion, seed: int, name: str) -> Case:
    recording = sensors(motion, seed, name=name)
    size = np.linalg.norm(motion.at(recording.time).acceleration, axis=1)
    return Case(recording, size > GENTLEST)


def ramp(time: np.ndarray, start: float, stop: float) -> np.ndarray:
    """From 0 to 1 without a jolt."""
    x = np.clip((time - start) / (stop - start), 0.0, 1.0)
    shape: np.ndarray = x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
    return shape


def drive(
    time: np.ndarray, speed: np.ndarray, rate: np.ndarray, *, banked: bool, heading: float, name: str
) -> Motion:
    """Ride at a speed (m/s) and rate of turn (rad/s); banked so that nothing slides sideways, or level."""
    yaw = heading + np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time))])
    ahead = np.column_stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)]) * speed[:, None]
    place = np.zeros_like(ahead)
    place[1:] = np.cumsum(0.5 * (ahead[1:] + ahead[:-1]) * np.diff(time)[:, None], axis=0)
    bank = np.arctan2(speed * rate, GRAVITY) if banked else np.zeros_like(yaw)
    attitude = Rotation.from_euler("ZX", np.column_stack([yaw, bank]))
    return dataclasses.replace(waypoints(time, attitude, place), name=name)


def long_turn(seed: int, *, banked: bool, name: str) -> Case:
    """Two minutes of circle at 12 m/s and 4 m/s², after 20 s of rest; rest again at the end."""
    time = np.arange(0.0, 240.0 + 0.5 * STEP, STEP)
    speed = 12.0 * (ramp(time, 20.0, 32.0) - ramp(time, 168.0, 180.0))
    rate = 4.0 / 12.0 * (ramp(time, 36.0, 40.0) - ramp(time, 160.0, 164.0))
    return accelerated(drive(time, speed, rate, banked=banked, heading=0.7 * seed, name=name), seed, name)


def town(seed: int) -> Case:
    """Nine times: accelerate to 12 m/s at 3 to 5 m/s², a corner to one side, brake to a stop, wait."""
    rng, name = np.random.default_rng(seed), "car in town"
    time = np.arange(0.0, 240.0 + 0.5 * STEP, STEP)
    speed, rate = np.zeros_like(time), np.zeros_like(time)
    for begin in 20.0 + 22.0 * np.arange(9):
        speed += 12.0 * (ramp(time, begin, begin + 6.0) - ramp(time, begin + 14.0, begin + 19.0))
        corner = rng.choice([-1.0, 1.0]) * math.radians(90.0) / 4.0
        rate += corner * (ramp(time, begin + 7.0, begin + 8.0) - ramp(time, begin + 11.0, begin + 12.0))
    return accelerated(drive(time, speed, rate, banked=False, heading=0.7 * seed, name=name), seed, name)


def shaken(seed: int) -> Case:
    motion = random_motion(240.0, seed, turn=1.5, reach=0.25, bandwidth=0.6)
    return accelerated(motion, seed, "fast hand")


def foot(seed: int) -> Case:
    return accelerated(walk(240.0), seed, "walking foot")


SCENARIOS: dict[str, Callable[[int], Case]] = {
    "no disturbance": calm,
    "gyroscope feels gravity": feeling,
    "passing steel": passing,
    "magnet for a minute": minute,
    "new field, same north": lambda seed: new_place((8.0, 0.0, -15.0), seed, "new field, same north"),
    "new field, north turned": lambda seed: new_place((-3.0, 12.0, -10.0), seed, "new field, north turned"),
    "magnet attached": attached,
    "fast hand": shaken,
    "walking foot": foot,
    "car in town": town,
    "long level turn": lambda seed: long_turn(seed, banked=False, name="long level turn"),
    "long banked turn": lambda seed: long_turn(seed, banked=True, name="long banked turn"),
}
