"""Recordings with known truth for tests of calibration, made with SciPy's rotations and nothing of the package."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from northdown.recording import Recording

GRAVITY = 9.80665
HARD_IRON = np.array([12.0, -25.0, 8.0])  # µT
SOFT_IRON = np.array([[1.1, 0.05, -0.03], [0.05, 0.95, 0.04], [-0.03, 0.04, 1.0]])
FIELD = 50.0  # µT
ACC_MATRIX = np.array([[1.01, 0.004, -0.003], [0.004, 0.99, 0.002], [-0.003, 0.002, 1.005]])
ACC_OFFSET = np.array([0.2, -0.1, 0.15])  # m/s²
GYR_MATRIX = np.array([[1.02, 0.010, -0.008], [-0.006, 0.98, 0.012], [0.005, -0.009, 1.01]])
GYR_BIAS = np.array([0.01, -0.02, 0.005])  # rad/s


def directions(rng: np.random.Generator, n: int) -> np.ndarray:
    """Unit vectors (n, 3), uniform on the sphere."""
    v = rng.normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1)[:, None]


def true_matrix(soft: np.ndarray = SOFT_IRON) -> np.ndarray:
    """Correction of determinant 1 for a symmetric soft iron."""
    inverse = np.linalg.inv(soft)
    return inverse / np.cbrt(np.linalg.det(inverse))


def field_recording(
    unit: np.ndarray,
    *,
    noise: float = 0.5,
    seed: int = 0,
    hard: np.ndarray = HARD_IRON,
    soft: np.ndarray = SOFT_IRON,
    mag_unit: str = "uT",
) -> Recording:
    """Magnetometer that sees the field in these directions (N, 3), 100 Hz."""
    rng = np.random.default_rng(10_000 + seed)
    mag = FIELD * unit @ soft.T + hard + noise * rng.normal(size=unit.shape)
    return Recording(np.arange(len(unit)) * 0.01, mag=mag, mag_unit=mag_unit)


def room_recording(
    seed: int, *, lever: float, wander: float, length: float, uneven: float = 0.03, samples: int = 3000
) -> Recording:
    """Magnetometer that is turned all about at a `lever` arm (m), and moved by `wander` (m), in an uneven field.

    The field is a random one of plane waves whose correlation falls to 1/√e over `length` (m); each of its
    components varies by the share `uneven`. Hard iron as in `HARD_IRON`, noise 0.5 µT, 50 Hz.
    """
    rng = np.random.default_rng(50_000 + seed)
    time = np.arange(samples) * 0.02

    def smooth(terms: int) -> np.ndarray:
        frequency, phase = rng.uniform(0.02, 0.2, (terms, 3)), rng.uniform(0.0, 2.0 * np.pi, (terms, 3))
        return np.sin(2.0 * np.pi * time[:, None, None] * frequency + phase).sum(axis=1)

    steps = Rotation.from_rotvec(0.02 * 0.9 * smooth(5)[1:])
    rotation = Rotation.random(random_state=seed) * running_product(steps)
    place = rotation.apply(lever * directions(rng, 1)[0]) + 0.5 * wander * smooth(4)
    waves = 60
    wave, phase = rng.normal(size=(waves, 3)) / length, rng.uniform(0.0, 2.0 * np.pi, waves)
    dip = np.deg2rad(65.0)
    field = FIELD * np.array([0.0, np.cos(dip), -np.sin(dip)])
    size = FIELD * uneven * np.sqrt(2.0 / waves)
    field = field + size * np.cos(place @ wave.T + phase) @ rng.normal(size=(waves, 3))
    return Recording(time, mag=rotation.inv().apply(field) + HARD_IRON + 0.5 * rng.normal(size=field.shape))


def positions_recording(
    up: np.ndarray, *, seed: int = 0, noise: float = 0.03, rest: float = 3.0, rate: float = 100.0
) -> Recording:
    """Accelerometer that rests with up in these directions (N, 3), shaken in between; with a gyroscope."""
    rng = np.random.default_rng(20_000 + seed)
    still, shaken = round(rest * rate), round(rate)
    raw = GRAVITY * up @ np.linalg.inv(ACC_MATRIX).T + ACC_OFFSET
    acc, gyr = [], []
    for a in raw:
        acc += [np.tile(a, (still, 1)), rng.normal(0.0, 5.0, (shaken, 3))]
        gyr += [np.zeros((still, 3)), rng.normal(0.0, 1.0, (shaken, 3))]
    samples = np.vstack(acc)
    samples = samples + noise * rng.normal(size=samples.shape)
    rates = np.vstack(gyr) + GYR_BIAS + 2e-3 * rng.normal(size=samples.shape)
    return Recording(np.arange(len(samples)) / rate, gyr=rates, acc=samples)


def turns_recording(
    axes: np.ndarray,
    *,
    seed: int = 0,
    rest: float = 3.0,
    turn: float = 1.5,
    rate: float = 100.0,
    noise: float = 1.75e-3,
    acc_noise: float = 0.03,
) -> Recording:
    """Gyroscope and accelerometer: rest, turn about an axis of the body by 70° to 140°, rest, and so on."""
    rng = np.random.default_rng(30_000 + seed)
    attitude = Rotation.random(random_state=seed)
    quat, rates = [], []
    still, moving = round(rest * rate), round(turn * rate)
    profile = 1.0 - np.cos(2.0 * np.pi * (np.arange(moving) + 0.5) / moving)
    profile /= profile.sum()
    for k in range(len(axes) + 1):
        quat.append(np.tile(attitude.as_quat(), (still, 1)))
        rates.append(np.zeros((still, 3)))
        if k < len(axes):
            angle = rng.uniform(1.2, 2.5) * rng.choice([-1.0, 1.0])
            step = angle * profile[:, None] * axes[k] / np.linalg.norm(axes[k])
            path = attitude * Rotation.from_rotvec(np.cumsum(step, axis=0))
            quat.append(path.as_quat())
            rates.append(step * rate)
            attitude = path[-1]
    rotation, w = Rotation.from_quat(np.vstack(quat)), np.vstack(rates)
    acc = rotation.inv().apply([0.0, 0.0, GRAVITY])
    shaken = (np.abs(w).max(axis=1) > 0.0)[:, None]
    acc = acc + acc_noise * rng.normal(size=w.shape) + shaken * rng.normal(0.0, 3.0, w.shape)
    gyr = w @ np.linalg.inv(GYR_MATRIX).T + GYR_BIAS + noise * rng.normal(size=w.shape)
    return Recording(np.arange(len(w)) / rate, gyr=gyr, acc=acc)


def turning_recording(
    *,
    seed: int = 0,
    duration: float = 40.0,
    rate: float = 100.0,
    mag_noise: float = 0.3,
    misaligned: Rotation | None = None,
    lag: float = 0.0,
    axes: np.ndarray | None = None,
) -> Recording:
    """Body that turns smoothly about all its axes without accelerating; all three sensors, dip 65°.

    `misaligned` turns the magnetometer's samples into its own axes; `lag` makes them late, s.
    """
    rng = np.random.default_rng(40_000 + seed)
    scale = np.ones(3) if axes is None else axes
    frequency, phase = rng.uniform(0.05, 0.35, (4, 3)), rng.uniform(0.0, 2.0 * np.pi, (4, 3))

    def rate_at(t: np.ndarray) -> np.ndarray:
        return scale * 0.6 * np.sin(2.0 * np.pi * t[:, None, None] * frequency + phase).sum(axis=1)

    time = np.arange(round(duration * rate) + 1) / rate
    middle = np.concatenate([time[:1], 0.5 * (time[1:] + time[:-1])])
    gyr = rate_at(middle)
    steps = Rotation.from_rotvec(gyr / rate)
    rotation = Rotation.random(random_state=seed) * running_product(steps[1:])
    acc = rotation.inv().apply([0.0, 0.0, GRAVITY])
    dip = np.deg2rad(65.0)
    field = rotation.inv().apply(FIELD * np.array([0.0, np.cos(dip), -np.sin(dip)]))
    if lag:
        field = np.column_stack([np.interp(time - lag, time, field[:, i]) for i in range(3)])
    if misaligned is not None:
        field = misaligned.inv().apply(field)
    return Recording(
        time,
        gyr + 1.75e-3 * rng.normal(size=gyr.shape),
        acc + 0.03 * rng.normal(size=gyr.shape),
        field + mag_noise * rng.normal(size=gyr.shape),
        frame="ENU",
    )


def running_product(steps: Rotation) -> Rotation:
    """1, q₁, q₁q₂, …, by doubling."""
    product = Rotation.from_quat(np.vstack([[0.0, 0.0, 0.0, 1.0], steps.as_quat()]))
    apart = 1
    while apart < len(product):
        quat = product.as_quat()
        quat[apart:] = (product[:-apart] * product[apart:]).as_quat()
        product = Rotation.from_quat(quat)
        apart *= 2
    return product


def chi2_bounds(freedom: int) -> tuple[float, float]:
    """Interval of χ² over its degrees of freedom that holds 99.9 % of it."""
    from scipy.stats import chi2

    low, high = chi2.ppf([0.0005, 0.9995], freedom) / freedom
    return float(low), float(high)
