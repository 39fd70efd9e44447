"""Turnings given by their body rate: the attitude is integrated to high order and kept.

A step from time t over h uses the rate at three Gauss nodes, ω₁, ω₂, ω₃, in the Magnus expansion of sixth order,

    α₁ = h ω₂,  α₂ = (√15/3) h (ω₃ − ω₁),  α₃ = (10/3) h (ω₃ − 2 ω₂ + ω₁),

with commutators that are vector products (S. Blanes, F. Casas, J. Ros, "Improved high order integrators based on the
Magnus expansion", BIT 40, 2000). That paper multiplies from the left; here R ← R exp(·), so that rates enter, and the
result leaves, with the opposite sign.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray, check_number
from northdown.errors import InputError, expected
from northdown.simulation import _quaternions as quaternions
from northdown.simulation.motion import Turning, vector

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

RateLaw: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""From times (N,) to body rate (3, N), rad/s, and its derivative (3, N), rad/s²."""

_NODE = math.sqrt(0.15)
# Steps that are integrated at once and kept; always the same, so that results do not depend on what is asked first.
_PAGE = 4096


class FromRate(Turning):
    """Attitude with a given body rate.

    Parameters
    ----------
    start : Rotation
        Attitude at `origin`, body to NED.
    rate : callable
        Body rate and its derivative at given times; six times differentiable.
    step : float
        Step of integration, s. Its error per step is about (w · step)⁷/10⁵ rad, w (rad/s) being the larger of the
        rate and of the angular frequencies in it; for w · step = 0.1 that is 1e-12.
    origin : float
        First time at which it is defined, s.

    Notes
    -----
    The attitudes at the steps are kept: 32 bytes for each, up to the latest time that was asked for.
    """

    def __init__(self, start: Rotation, rate: RateLaw, *, step: float, origin: float = 0.0) -> None:
        self._rate = rate
        self._step = check_number("step", step, above=0.0, unit="s")
        self._origin = check_number("origin", origin, unit="s")
        self._pages: list[FloatArray] = []
        self._next = quaternions.from_rotation(start)
        self.span = (self._origin, math.inf)

    @property
    def law(self) -> RateLaw:
        """The rate and its derivative as a function of time."""
        return self._rate

    def quat(self, time: FloatArray) -> FloatArray:
        """See `Turning`."""
        index: npt.NDArray[np.int64] = np.floor((time - self._origin) / self._step).astype(np.int64)
        if len(index):
            self._extend(int(index.max()))
        page, row = np.divmod(index, _PAGE)
        before = np.empty((4, len(time)))
        for p in np.unique(page):
            here = page == p
            before[:, here] = self._pages[p][:, row[here]]
        left = self._origin + index.astype(np.float64) * self._step
        return quaternions.multiply(before, quaternions.exp(self._turn(left, time - left)))

    def evaluate(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `Turning`."""
        return self.quat(time), *self._rate(time)

    def _extend(self, index: int) -> None:
        while len(self._pages) * _PAGE <= index:
            first = len(self._pages) * _PAGE
            left = self._origin + np.arange(first, first + _PAGE, dtype=np.float64) * self._step
            steps = quaternions.exp(self._turn(left, np.full(_PAGE, self._step)))
            after = quaternions.multiply(self._next, quaternions.cumulative(steps))
            self._pages.append(np.concatenate([self._next, after[:, :-1]], axis=1))
            self._next = quaternions.normalize(after[:, -1:])

    def _turn(self, left: FloatArray, h: FloatArray) -> FloatArray:
        """Rotation vectors (3, N) of the body from times `left` to `left + h`."""
        middle = left + 0.5 * h
        w1, w2, w3 = (-self._rate(t)[0] for t in (middle - _NODE * h, middle, middle + _NODE * h))
        a1, a2, a3 = h * w2, math.sqrt(15.0) / 3.0 * h * (w3 - w1), 10.0 / 3.0 * h * (w3 - 2.0 * w2 + w1)
        c1 = quaternions.cross(a1, a2)
        c2 = quaternions.cross(a1, 2.0 * a3 + c1) / -60.0
        omega = a1 + a3 / 12.0 + quaternions.cross(-20.0 * a1 - a3 + c1, a2 + c2) / 240.0
        return -omega


def sines(amplitude: npt.ArrayLike, frequency: npt.ArrayLike, phase: npt.ArrayLike = (0.0, 0.0, 0.0)) -> RateLaw:
    """Rate whose axes are sines, ωᵢ = Aᵢ sin(2π fᵢ t + φᵢ).

    Parameters
    ----------
    amplitude, frequency, phase : (3,) arrays
        rad/s, Hz and rad.
    """
    a = vector("amplitude", amplitude)[:, None]
    w = 2.0 * np.pi * vector("frequency", frequency)[:, None]
    p = vector("phase", phase)[:, None]

    def law(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        return a * np.sin(w * time + p), a * w * np.cos(w * time + p)

    return law


def free_body(inertia: npt.ArrayLike, rate_x: float, rate_z: float) -> RateLaw:
    """Rate of a body in free flight, the exact solution of Euler's equations in Jacobi's elliptic functions.

    Parameters
    ----------
    inertia : (3,) array
        Principal moments of inertia, increasing; only their ratios matter.
    rate_x, rate_z : float
        Rate about the axes of least and greatest inertia at t = 0, when that about y is zero, rad/s.

    Raises
    ------
    InputError
        When the body would not go round its z axis: I_z (I_z − I_y) ω_z² must exceed I_x (I_y − I_x) ω_x².

    Notes
    -----
    Close to that limit the body turns over again and again, as a book thrown up spinning about its middle axis (L. D.
    Landau, E. M. Lifshitz, Mechanics, section 37).
    """
    i1, i2, i3 = (float(x) for x in vector("inertia", inertia))
    a, c = check_number("rate_x", rate_x, unit="rad/s"), check_number("rate_z", rate_z, above=0.0, unit="rad/s")
    if not 0.0 < i1 < i2 < i3:
        raise InputError(expected("three increasing moments of inertia", f"{i1:g}, {i2:g}, {i3:g}"))
    modulus = i1 * (i2 - i1) * a * a / (i3 * (i3 - i2) * c * c)
    if modulus >= 1.0:
        raise InputError(expected("a body that goes round its z axis", f"rate_x {a:g} rad/s", do="raise rate_z"))
    b = a * math.sqrt(i1 * (i3 - i1) / (i2 * (i3 - i2)))
    speed = c * math.sqrt((i3 - i2) * (i3 - i1) / (i1 * i2))

    def law(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        from scipy.special import ellipj

        sn, cn, dn, _ = ellipj(speed * time, modulus)
        x, y, z = a * cn, b * sn, c * dn
        change = [(i2 - i3) / i1 * y * z, (i3 - i1) / i2 * z * x, (i1 - i2) / i3 * x * y]
        return np.stack([x, y, z]), np.stack(change)

    return law
