r"""Do the sensors agree about the motion? What the gyroscope integrates must hold the other vectors still.

Gravity and the field are constant in navigation axes, so a vector v_b measured in the body obeys

.. math:: \dot v_b = -\omega_b \times v_b .

Over windows of a few seconds the gyroscope is integrated to R, from the body to the body at the window's start, and
R v_b is averaged over four parts of the window. Averages over two seconds keep gravity and lose nearly all
acceleration, because velocity is bounded. With a right gyroscope the four averages agree; their spread relative
to their size is the *disagreement*, 0 for perfect data and near 1 when nothing fits.

A gyroscope in another unit, or axes that are permuted or reversed, show as a small disagreement of another
hypothesis. The equation is linear in v_b, so all maps of its axes share one integration. Reversing v_b as a whole
changes nothing: whether an accelerometer reports specific force or its opposite cannot be told from the motion.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from northdown._validation import BoolArray, FloatArray
from northdown.checks.base import Signals

_BIN = 0.02
"""Samples are averaged over bins of about this length (s) first."""
_WINDOW = 8.0
"""Length of a window (s), at most: short enough for a poor gyroscope not to drift far."""
_PARTS = 4
_MOST_WINDOWS = 120
_THERE = 0.7
"""Share of gyroscope samples that a window must have; the others are held."""

SCALES: Final[tuple[float, ...]] = (1.0, math.pi / 180.0, 180.0 / math.pi)
"""Factors that the gyroscope may need: none, from deg/s, from a second conversion out of deg/s."""


def _signed_permutations() -> FloatArray:
    """The 24 signed permutation matrices, one of each pair {M, −M}; the identity comes first."""
    found = []
    for axes in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            mat = np.zeros((3, 3))
            mat[range(3), axes] = signs
            found.append(mat)
    # fewer reversed axes first, so that the plainer of the pair is kept
    found.sort(key=lambda m: int((m < 0.0).sum()))
    kept: list[FloatArray] = []
    for mat in found:
        if not any((mat == -other).all() for other in kept):
            kept.append(mat)
    kept.sort(key=lambda m: float(np.trace(m)), reverse=True)
    return np.array(kept)


AXES: Final[FloatArray] = _signed_permutations()


def axes_name(mat: FloatArray) -> str:
    """A signed permutation as text such as 'y, -x, z': what each new axis was."""
    return ", ".join(("-" if row.sum() < 0.0 else "") + "xyz"[int(np.argmax(np.abs(row)))] for row in mat)


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of a recording: rotation vectors (W, L, 3) over each bin, and each sensor's mean in it.

    Parameters
    ----------
    angle : (W, L, 3) array
        Integrated gyroscope over each bin, rad; L is a multiple of 4.
    vectors : dict of (W, L, 3) arrays
        Mean of the sensor over each bin, zero where it has no sample.
    weights : dict of (W, L) arrays
        Weight of each bin in the average of its part; zero where there is no sample.
    bin_step : float
        Length of a bin, s.
    per_bin : int
        Samples in a bin.
    """

    angle: FloatArray
    vectors: dict[str, FloatArray]
    weights: dict[str, FloatArray]
    bin_step: float
    per_bin: int


def make_windows(s: Signals) -> Windows | None:
    """Cut a recording into windows, or None when it is too short, too slow or without a gyroscope."""
    if "gyr" not in s.sensors or not s.step > 0.0:
        return None
    per_bin = max(1, round(_BIN / s.step))
    span = min(_WINDOW, 0.49 * len(s.dt) * s.step)
    bins = int(span / (per_bin * s.step)) // _PARTS * _PARTS
    if bins < 4 * _PARTS or span < 1.0:
        return None
    width = bins * per_bin
    n = len(s.dt) // width
    # a sample stands for the time since the sample before it
    dt = s.dt[: n * width].reshape(n, width)
    gyr = _held(s.sensors["gyr"], s.present["gyr"])[1 : 1 + n * width].reshape(n, width, 3)
    there = s.present["gyr"][1 : 1 + n * width].reshape(n, width)
    longest = max(s.gap, 0.1)
    good = np.flatnonzero(((dt >= 0.0) & (dt <= longest)).all(axis=1) & (there.mean(axis=1) > _THERE))
    if not good.size:
        return None
    if len(good) > _MOST_WINDOWS:
        good = good[np.linspace(0, len(good) - 1, _MOST_WINDOWS).astype(int)]
    shape = (len(good), bins, per_bin)
    angle = np.einsum("nlkj,nlk->nlj", gyr[good].reshape(*shape, 3), dt[good].reshape(shape))
    vectors: dict[str, FloatArray] = {}
    weights: dict[str, FloatArray] = {}
    taper = np.tile(np.hanning(bins // _PARTS + 2)[1:-1], _PARTS)
    for name in ("acc", "mag"):
        if name in s.sensors:
            v = s.sensors[name][1 : 1 + n * width].reshape(n, width, 3)[good].reshape(*shape, 3)
            there = ~np.isnan(v.sum(axis=3))
            number = there.sum(axis=2)
            total = v.sum(axis=2) if there.all() else np.where(there[..., None], v, 0.0).sum(axis=2)
            vectors[name] = total / np.maximum(number, 1)[..., None]
            weights[name] = taper * (number > 0)
    return Windows(angle, vectors, weights, per_bin * s.step, per_bin)


def _held(value: FloatArray, present: BoolArray) -> FloatArray:
    """Rows of (N, 3), the missing ones replaced by the last before them, or by zeros."""
    if present.all():
        return value
    last = np.maximum.accumulate(np.where(present, np.arange(len(value)), 0))
    held: FloatArray = np.where(present[last][:, None], value[last], 0.0)
    return held


@dataclass(frozen=True, eq=False)
class Averages:
    """Tensors of R ⊗ v averaged over the parts of each window, by sensor: (W, 4, 3, 3, 3) with axes j, k, m.

    R_jk is the rotation and v_m the vector; contracting k with m gives the average of R v, contracting with a map of
    the axes the average of R M v.
    """

    tensors: dict[str, FloatArray]

    def vectors(self, sensor: str, axes: FloatArray = AXES[:1]) -> FloatArray:
        """Averages of R M v for each of the maps M (P, 3, 3): (P, W, 4, 3)."""
        t = self.tensors[sensor]
        flat = t.reshape(-1, 9) @ axes.reshape(-1, 9).T
        moved: FloatArray = np.moveaxis(flat.reshape(*t.shape[:3], len(axes)), -1, 0)
        return moved

    def disagreement(self, sensor: str, axes: FloatArray = AXES[:1]) -> FloatArray:
        """Spread of the four averages relative to their size, squared, for each map and window: (P, W)."""
        v = self.vectors(sensor, axes)
        size = np.einsum("pwij,pwij->pw", v, v)
        off = v - v.mean(axis=2, keepdims=True)
        spread = np.einsum("pwij,pwij->pw", off, off)
        share: FloatArray = np.divide(spread, size, out=np.ones_like(size), where=~(size <= 0.0))
        return share


def average(windows: Windows, factor: float) -> Averages:
    """Average over the parts of each window with the gyroscope multiplied by `factor`; 0 for no turning at all."""
    n, bins = windows.angle.shape[:2]
    size = bins // _PARTS
    if factor == 0.0:
        r = np.broadcast_to(np.eye(3).ravel(), (n, _PARTS, size, 9))
    else:
        angle = windows.angle * factor
        attitude = _prefix_product(_exp(angle))
        # back from the bin's end to the mean time of its samples, each of which stands at the end of its step
        back = 0.5 * (1.0 - 1.0 / windows.per_bin)
        r = _matrix(_multiply(attitude, _exp(-back * angle))).reshape(n, _PARTS, size, 9)
    tensors = {}
    for name, vector in windows.vectors.items():
        weight = windows.weights[name].reshape(n, _PARTS, size)
        total = weight.sum(axis=2)
        weighted = vector.reshape(n, _PARTS, size, 3) * weight[..., None]
        t = np.swapaxes(r, 2, 3) @ weighted
        t /= np.where(total > 0.0, total, np.nan)[..., None, None]
        tensors[name] = t.reshape(n, _PARTS, 3, 3, 3)
    return Averages(tensors)


def _multiply(p: FloatArray, q: FloatArray) -> FloatArray:
    """Quaternion product of arrays (..., 4), (w, x, y, z)."""
    a, b, c, d = (p[..., i] for i in range(4))
    w, x, y, z = (q[..., i] for i in range(4))
    out = np.empty(np.broadcast_shapes(p.shape, q.shape))
    out[..., 0] = a * w - b * x - c * y - d * z
    out[..., 1] = a * x + b * w + c * z - d * y
    out[..., 2] = a * y - b * z + c * w + d * x
    out[..., 3] = a * z + b * y - c * x + d * w
    return out


def _exp(v: FloatArray) -> FloatArray:
    """Unit quaternions (..., 4) of rotation vectors (..., 3)."""
    half = 0.5 * np.sqrt(np.einsum("...i,...i->...", v, v))
    out = np.empty((*v.shape[:-1], 4))
    out[..., 0] = np.cos(half)
    out[..., 1:] = 0.5 * np.sinc(half / np.pi)[..., None] * v
    return out


def _prefix_product(q: FloatArray) -> FloatArray:
    """Products q₁ q₂ … q_i along the second axis of (W, L, 4), by doubling."""
    out = q.copy()
    step = 1
    while step < out.shape[1]:
        out[:, step:] = _multiply(out[:, :-step], out[:, step:])
        step *= 2
    return out


def _matrix(q: FloatArray) -> FloatArray:
    """Rotation matrices (..., 9), row by row, of unit quaternions (..., 4)."""
    w, x, y, z = (q[..., i] for i in range(4))
    out: npt.NDArray[np.float64] = np.empty((*q.shape[:-1], 9))
    out[..., 0], out[..., 4], out[..., 8] = 1 - 2 * (y * y + z * z), 1 - 2 * (x * x + z * z), 1 - 2 * (x * x + y * y)
    out[..., 1], out[..., 3] = 2 * (x * y - w * z), 2 * (x * y + w * z)
    out[..., 2], out[..., 6] = 2 * (x * z + w * y), 2 * (x * z - w * y)
    out[..., 5], out[..., 7] = 2 * (y * z - w * x), 2 * (y * z + w * x)
    return out
