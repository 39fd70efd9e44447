"""The equations of a `Model` on Taylor series, and the gradients of what they measure by the states."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from northdown._validation import BoolArray, FloatArray
from northdown.evaluation.observability_models import ATTITUDE_NAMES, UNKNOWN_NAMES, Model, axes_of
from northdown.evaluation.observability_series import TINY, Array, Series
from northdown.simulation import _quaternions as quaternions

# Closer than this to where an angle, its tangent or its rate is undefined (0.6°), derivatives of third order exceed
# the others by so much that no rank can be told.
_SINGULAR: Final = 0.01


def undefined(model: Model, quat: FloatArray) -> BoolArray:
    """Where, (N,), angles or quotients of this model have no value at attitudes (4, N)."""
    north, _, down = directions(quat)
    bad = np.zeros(quat.shape[1], np.bool_)
    if model.state == "euler" or model.method == "indirect":
        bad |= np.hypot(down[1], down[2]) < _SINGULAR
    if model.method == "indirect":
        bad |= np.abs(down[2]) < _SINGULAR
        if axes_of(model.sensors, "mag"):
            bad |= np.abs(north[0]) < _SINGULAR
    return bad


def gradients(model: Model, quat: FloatArray, rate: Series, order: int) -> FloatArray:
    """Observability matrices ∇ₓ [z, ż, z̈, …].

    Parameters
    ----------
    model : Model
        States, measurements and equations.
    quat : (4, N) array
        Attitudes at which to take it, w, x, y, z, body to NED.
    rate : Series of shape (3, N)
        Body rate, rad/s; of order max(`order`, 1) or more.
    order : int
        Highest derivative of the measurements.

    Returns
    -------
    (N, (order + 1) m, n) array
        Rows in the order of the derivatives; unit of the measurement/sᵏ per unit of the state.
    """
    equations = _Equations(model)
    state = Series([equations.start(quat, rate)])
    for k in range(order):
        state = Series([*state.coefficients, equations.slope(state, rate).coefficients[k] / (k + 1)])
    measured = equations.measure(state)
    rows = [math.factorial(k) / TINY * c.imag for k, c in enumerate(measured.coefficients)]
    return np.ascontiguousarray(np.concatenate(rows).transpose(2, 0, 1))


class _Equations:
    """A model's equations, on series of the numbers it carries along: quaternion or angles, and the unknowns."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.angles = model.state == "euler"
        self.place: dict[str, slice] = {}
        first = 3 if self.angles else 4
        for name in model.unknown:
            size = len(UNKNOWN_NAMES[name])
            self.place[name] = slice(first, first + size)
            first += size
        self.size = first

    def start(self, quat: FloatArray, rate: Series) -> Array:
        """Complex (size, n, N): the numbers at τ = 0, and in the imaginary part their derivatives by the states."""
        n, count = len(self.model.state_names), quat.shape[1]
        value = np.zeros((self.size, count))
        slope = np.zeros((self.size, n, count))
        carried, attitude = (3 if self.angles else 4), len(ATTITUDE_NAMES[self.model.state])
        value[:carried] = euler_angles(quat) if self.angles else quat
        if self.model.state == "tangent":
            for j in range(3):
                turn = np.zeros((4, 1))
                turn[1 + j] = 0.5
                slope[:4, j] = quaternions.multiply(turn, quat)
        else:
            slope[:carried, :attitude] = np.eye(carried)[:, :, None]
        slope[carried:, attitude:] = np.eye(n - attitude)[:, :, None]
        for name, place in self.place.items():
            if name == "rate":
                value[place] = rate.coefficients[0]
            elif name != "gyr_bias":
                north, down = self.model.field
                value[place] = math.atan2(down, north) if name == "dip" else np.array([[north], [down]])
        return value[:, None] + 1j * TINY * slope

    def slope(self, state: Series, rate: Series) -> Any:
        """Derivative of the numbers by time."""
        turning: Any = self._rate(state, rate)
        parts: list[Any] = [_euler_slope(state, turning) if self.angles else self._quaternion_slope(state, turning)]
        for name, place in self.place.items():
            still: Any = 0.0 * state[place]
            parts.append(still + rate.derivative()[:, None] if name == "rate" else still)
        return np.concatenate(parts)

    def _rate(self, state: Series, rate: Series) -> Any:
        if "rate" in self.place:
            return state[self.place["rate"]]
        known: Any = rate[:, None]
        return known - state[self.place["gyr_bias"]] if "gyr_bias" in self.place else known

    def _quaternion_slope(self, state: Any, turning: Any) -> Any:
        q = state[:4]
        still = 0.0 * turning[:1]
        change = 0.5 * quaternions.multiply(q, np.concatenate([still, turning]))
        if self.model.variant in ("printed-rate", "printed"):
            change = change / np.sqrt(_square(q))
        return change

    def measure(self, state: Any) -> Any:
        """The measurements."""
        model = self.model
        rows = self._indirect(state) if model.method == "indirect" else self._direct(state)
        gyr = axes_of(model.sensors, "gyr")
        for axis in gyr:
            k = "xyz".index(axis)
            reading = state[self.place["rate"]][k]
            rows.append(reading + state[self.place["gyr_bias"]][k] if "gyr_bias" in self.place else reading)
        if model.state == "quaternion+norm":
            rows.append(_square(state[:4]))
        return np.stack(rows)

    def _direct(self, state: Any) -> list[Any]:
        north, down = _euler_directions(state) if self.angles else directions(state[:4])[::2]
        rows = [down["xyz".index(axis)] for axis in axes_of(self.model.sensors, "acc")]
        h, v = self._field(state)
        return rows + [h * north[k] + v * down[k] for k in map("xyz".index, axes_of(self.model.sensors, "mag"))]

    def _field(self, state: Any) -> tuple[Any, Any]:
        if "field" in self.place:
            place = state[self.place["field"]]
            return place[0], place[1]
        if "dip" in self.place:
            dip = state[self.place["dip"]][0]
            size = math.hypot(*self.model.field)
            return size * np.cos(dip), size * np.sin(dip)
        return self.model.field

    def _indirect(self, state: Any) -> list[Any]:
        with_field = bool(axes_of(self.model.sensors, "mag"))
        if self.angles:
            roll, pitch, yaw = state[0], state[1], state[2]
            rows = [-np.tan(yaw), -np.sin(pitch), np.tan(roll)]
            return rows if with_field else rows[1:]
        q = state[:4]
        (north, east, down) = directions(q)
        sine = down[0]  # proportional to |q|², as K06 (3.16) has it
        if self.model.variant in ("scale-free", "printed-rate"):
            sine = sine / _square(q)
        rows = [sine, down[1] / down[2]]
        return [-east[0] / north[0], *rows] if with_field else rows


def _square(q: Any) -> Any:
    return q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]


def directions(q: Any) -> tuple[Any, Any, Any]:
    """North, east and down in body axes, times the square of q's length, as K06 (3.19)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    north = [ww + xx - yy - zz, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)]
    east = [2.0 * (x * y + w * z), ww - xx + yy - zz, 2.0 * (y * z - w * x)]
    down = [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), ww - xx - yy + zz]
    return north, east, down


def _euler_directions(angles: Any) -> tuple[list[Any], list[Any]]:
    """North and down in body axes from roll, pitch, yaw (K06 (3.10), (3.13))."""
    sr, cr = np.sin(angles[0]), np.cos(angles[0])
    sp, cp = np.sin(angles[1]), np.cos(angles[1])
    sy, cy = np.sin(angles[2]), np.cos(angles[2])
    return [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy], [-sp, sr * cp, cr * cp]


def _euler_slope(angles: Any, turning: Any) -> Any:
    """Rates of roll, pitch and yaw (K06 (2.9))."""
    sr, cr = np.sin(angles[0]), np.cos(angles[0])
    sp, cp = np.sin(angles[1]), np.cos(angles[1])
    x, y, z = turning[0], turning[1], turning[2]
    yaw = (sr * y + cr * z) / cp
    return np.stack([x + sp * yaw, cr * y - sr * z, yaw])


def euler_angles(quat: FloatArray) -> FloatArray:
    """Roll, pitch and yaw, (3, N), of quaternions (4, N)."""
    north, east, down = directions(quat)
    pitch = np.arctan2(-down[0], np.hypot(down[1], down[2]))
    return np.stack([np.arctan2(down[1], down[2]), pitch, np.arctan2(east[0], north[0])])
