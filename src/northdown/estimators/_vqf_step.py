"""The step of VQF; its problem, equations and source stand in vqf.py.

All is in NED: the almost-inertial frame of the strapdown integration, the frame after the correction of its
inclination, whose heading drifts, and the final one.

The state's attitude is q = turn ⊗ level ⊗ free: `free` is the strapdown integration, `level` corrects its
inclination, and `turn` = (cos, sin) of half the correction of its heading. A sensor's `count` and `age` are the
number of its samples and the time (s) from the first to the last of them, `since` the time since the last.
"""

from __future__ import annotations

import math
from typing import Any, Final

from northdown.estimators import _vqf_layout as at
from northdown.estimators._vqf_bias import grow, rows_ned, update
from northdown.kernels.butterworth import channel, gains, vector
from northdown.kernels.jit import inline
from northdown.kernels.quaternion import dot, multiply, normalize, rotate, unit
from northdown.kernels.so3 import exp
from northdown.kernels.wahba import arc_to_up
from northdown.orientation import Flag

_MAG_REJECTED: Final = int(Flag.MAG_REJECTED)

# Squared sine of the angle between field and vertical below which the field gives no heading, as for the start.
PARALLEL: Final = 1e-6


@inline
def filter_rate(p: Any, s: Any, dt: float, gyr: Any) -> Any:
    """The gyroscope's part of the state after a sample, and whether the rate allows for rest."""
    half_omega, tau, clip, still = p[at.REST_OMEGA], p[at.REST_FULL], p[at.BIAS_CLIP], p[at.REST_RATE]
    count, age = s[0], s[1]
    if dt == 0.0 and count > 0.0:
        return s, True
    gain, ratio = gains((s[2], s[3], s[4]), dt, half_omega)
    age += dt
    count += 1.0
    how = (True, 1.0, 1.0 / count, 0.0)
    if age >= tau:
        how = (False, ratio, gain[1], gain[2])
    f = vector(how, s[5:14], gyr)
    off = (gyr[0] - f[0], gyr[1] - f[3], gyr[2] - f[6])
    largest = max(math.fabs(f[0]), math.fabs(f[3]), math.fabs(f[6]))
    return (count, age) + gain + f, dot(off, off) < still and largest <= clip


@inline
def turned(turn: Any, q: Any) -> Any:
    """The attitude q turned about down by turn = (cos, sin) of half the angle, of unit norm."""
    c, s = turn
    return normalize((c * q[0] - s * q[3], c * q[1] - s * q[2], c * q[2] + s * q[1], c * q[3] + s * q[0]))


@inline
def filter_rotation(how: Any, f: Any, rows: Any) -> Any:
    """Low-pass of a rotation matrix, nine channels."""
    return vector(how, f[0:9], rows[0]) + vector(how, f[9:18], rows[1]) + vector(how, f[18:27], rows[2])


@inline
def correct_inclination(p: Any, s: Any, free: Any, level: Any, bias: Any, cov: Any, rate: Any, acc: Any) -> Any:
    """Level, bias, covariance and the accelerometer's part of the state after a sample of specific force.

    `rate` is the low-passed rate, by which the bias is known at rest.
    """
    count, age, since = s[0], s[1], s[2]
    gain, rest_gain = (s[3], s[4], s[5]), (s[6], s[7], s[8])
    resting, rest = s[60], s[61]
    dt = since if count > 0.0 else 0.0
    gain, ratio = gains(gain, dt, p[at.ACC_OMEGA])
    rest_gain, rest_ratio = gains(rest_gain, dt, p[at.REST_OMEGA])
    dt = gain[0]
    count += 1.0
    age += dt
    mean = (True, 1.0, 1.0 / count, 0.0)
    how = mean if age < p[at.ACC_FULL] else (False, ratio, gain[1], gain[2])
    rest_how = mean if age < p[at.REST_FULL] else (False, rest_ratio, rest_gain[1], rest_gain[2])

    rest_f = vector(rest_how, s[51:60], acc)
    off = (acc[0] - rest_f[0], acc[1] - rest_f[3], acc[2] - rest_f[6])
    if dot(off, off) >= p[at.REST_FORCE]:
        resting = 0.0
        rest = 0.0
    elif resting >= p[at.REST_TIME]:
        rest = 1.0

    f = vector(how, s[9:18], rotate(free, acc))
    u = unit(rotate(level, (f[0], f[3], f[6])))
    level = normalize(multiply(arc_to_up(u), level))

    rows = rows_ned(multiply(level, free))
    known = (dot(rows[0], bias), dot(rows[1], bias))
    rot = filter_rotation(how, s[18:45], rows)
    north = channel(how, s[45:48], known[0])
    east = channel(how, s[48:51], known[1])
    motion_bias, rest_bias = p[at.MOTION_BIAS], p[at.REST_BIAS]
    if dt > 0.0 and (motion_bias > 0.0 or rest_bias > 0.0):
        walk = p[at.BIAS_WALK] * dt
        cov = grow(cov, p[at.BIAS_START], walk)
        if rest > 0.0 and rest_bias > 0.0:
            w = p[at.BIAS_REST] * (p[at.BIAS_REST] / walk + 1.0)
            axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
            e = (rate[0] - bias[0], rate[1] - bias[1], rate[2] - bias[2])
            bias, cov = update(bias, cov, axes, e, (w, w, w), p[at.BIAS_CLIP])
        elif motion_bias > 0.0:
            w = p[at.BIAS_MOTION] * (p[at.BIAS_MOTION] / walk + 1.0)
            rows = ((rot[0], rot[3], rot[6]), (rot[9], rot[12], rot[15]), (rot[18], rot[21], rot[24]))
            e = (
                u[1] / dt + north[0] - dot(rows[0], bias),
                -u[0] / dt + east[0] - dot(rows[1], bias),
                -dot(rows[2], bias),
            )
            bias, cov = update(bias, cov, rows, e, (w, w, p[at.BIAS_VERTICAL] * w), p[at.BIAS_CLIP])
    clocks = (count, age, 0.0) + gain + rest_gain
    return level, bias, cov, clocks + f + rot + north + east + rest_f + (resting, rest)


@inline
def close(field: Any, to: Any, p: Any) -> bool:
    """Whether norm and dip of a field are those of another one, within the thresholds."""
    same: bool = math.fabs(field[0] - to[0]) < p[at.NORM] * to[0] and math.fabs(field[1] - to[1]) < p[at.DIP]
    return same


@inline
def toward(field: Any, to: Any, k: float) -> Any:
    """Norm and dip of a field, moved by the fraction k towards another one."""
    return (field[0] + k * (to[0] - field[0]), field[1] + k * (to[1] - field[1]))


@inline
def detect_disturbance(p: Any, m: Any, field: Any, k: float, dt: float, rate_square: float) -> Any:
    """Reference, candidate and disturbance after the field's norm and dip, low-passed.

    m = (reference, 2; candidate, 2; its age; time undisturbed; whether disturbed), k = the gain of the references.
    """
    reference, candidate = (m[0], m[1]), (m[2], m[3])
    age, undisturbed, disturbed = m[4], m[5], m[6]
    if close(field, reference, p):
        undisturbed += dt
        if undisturbed >= p[at.UNDISTURBED]:
            disturbed = 0.0
            reference = toward(reference, field, k)
    else:
        undisturbed = 0.0
        disturbed = 1.0
    # A new place is believed once its field has stayed the same for long enough, counted only while the body turns.
    if close(field, candidate, p):
        if rate_square >= p[at.NEW_RATE]:
            age += dt
        candidate = toward(candidate, field, k)
        if disturbed > 0.0 and (age >= p[at.NEW_TIME] or (reference[0] == 0.0 and age >= p[at.FIRST_TIME])):
            reference = candidate
            disturbed = 0.0
            undisturbed = p[at.UNDISTURBED]
    else:
        age = 0.0
        candidate = field
    return reference + candidate + (age, undisturbed, disturbed)


@inline
def heading_gain(p: Any, k: float, least: float, rejected: float, disturbed: float, dt: float) -> Any:
    """Gain of the heading's correction, the least gain of the next, and the time (s) charged to rejection.

    The least gain is 1/N for the Nth sample at the start, so that heading is then the mean of what was measured.
    """
    if p[at.REJECTION] > 0.0:
        if disturbed > 0.0:
            if rejected <= p[at.LONGEST]:
                rejected += dt
                k = 0.0
            else:
                k /= p[at.SLOWER]
        else:
            rejected = max(rejected - p[at.SLOWER] * dt, 0.0)
    if least > 0.0:
        k = max(k, least)
        least /= least + 1.0
        if least * p[at.TAU_MAG] < dt:
            least = 0.0
    return k, least, rejected


@inline
def correct_heading(p: Any, s: Any, turn: Any, h: Any, rate_square: float) -> Any:
    """Turn and the magnetometer's part of the state after a sample h of the field, in NED by the present attitude."""
    count, age, since = s[0], s[1], s[2]
    gain, k, reference_k, least = (s[3], s[4], s[5]), s[6], s[7], s[8]
    f, m, rejected = s[9:15], s[15:20] + (s[20], s[22]), s[21]
    dt = since if count > 0.0 else 0.0
    fresh, ratio = gains(gain, dt, p[at.MAG_OMEGA])
    if fresh[0] != gain[0]:
        k = 1.0 - math.exp(-dt / p[at.TAU_MAG])
        reference_k = 1.0 - math.exp(-dt / p[at.TAU_REFERENCE])
    dt = fresh[0]
    count += 1.0
    age += dt
    how = (True, 1.0, 1.0 / count, 0.0) if age < p[at.MAG_FULL] else (False, ratio, fresh[1], fresh[2])
    if p[at.REJECTION] > 0.0:
        norm = math.sqrt(dot(h, h))
        f = channel(how, f[0:3], norm) + channel(how, f[3:6], math.asin(h[2] / norm))
        m = detect_disturbance(p, m, (f[0], f[3]), reference_k, dt, rate_square)
    gain_now, least, rejected = heading_gain(p, k, least, rejected, m[6], dt)
    half_angle = -0.5 * gain_now * math.atan2(h[1], h[0])
    c, d = math.cos(half_angle), math.sin(half_angle)
    turn = (c * turn[0] - d * turn[1], c * turn[1] + d * turn[0])
    clocks = (count, age, 0.0) + fresh + (k, reference_k, least)
    return turn, clocks + f + m[0:6] + (rejected, m[6])


@inline
def step(p: Any, s: Any, dt: float, gyr: Any, acc: Any, mag: Any) -> Any:
    """One sample."""
    bias, cov = (s[4], s[5], s[6]), s[7:13]
    free, level, turn = s[13:17], s[17:21], (s[21], s[22])
    g, still = filter_rate(p, s[23:37], dt, gyr)
    a, m = s[37:99], s[99:122]
    rate = (g[5], g[8], g[11])
    a = a[:2] + (a[2] + dt,) + a[3:]
    m = m[:2] + (m[2] + dt,) + m[3:]
    # A rate that departs ends the rest before its sample. The first sample's step, not known then, is taken for the
    # second's.
    even = g[2] if dt > 0.0 else 0.0
    resting = (a[60] + (even if g[0] != 2.0 else 2.0 * even), a[61]) if still else (even, 0.0)
    a = a[:60] + resting
    if dt > 0.0:
        turning = exp((dt * (gyr[0] - bias[0]), dt * (gyr[1] - bias[1]), dt * (gyr[2] - bias[2])))
        free = normalize(multiply(free, turning))
    # also False where a component is NaN
    if dot(acc, acc) > 0.0 and (a[0] == 0.0 or a[2] > 0.0):
        level, bias, cov, a = correct_inclination(p, a, free, level, bias, cov, rate, acc)
    q = multiply(level, free)
    out = turned(turn, q)
    if m[0] == 0.0 or m[2] > 0.0:
        h = rotate(out, mag)
        across = h[0] * h[0] + h[1] * h[1]
        if across > PARALLEL * dot(h, h):
            turn, m = correct_heading(p, m, turn, h, dot(rate, rate))
            out = turned(turn, q)
    return out + bias + cov + free + level + turn + g + a + m


@inline
def aligned(p: Any, s: Any, q: Any, heading_known: bool) -> Any:
    """State for an attitude found from the sensors: their filters begin anew.

    When tilt has been known for longer, heading needs nothing but the first sample's own correction.
    """
    a, m = s[37:99], s[99:122]
    if math.isinf(a[1]):
        s = q + s[4:13] + q + (1.0, 0.0, 0.0, 0.0, 1.0, 0.0) + s[23:37] + (0.0, 0.0, 0.0) + a[3:] + m
    if heading_known:
        s = s[:99] + (0.0, 0.0, 0.0) + m[3:8] + (1.0,) + m[9:]
    return s


@inline
def output(p: Any, s: Any) -> Any:
    """Attitude, bias, its sigma, rest, upper bound of the sigma in all directions, rest of the covariance."""
    xx, xy, xz, yy, yz, zz = s[7:13]
    x, y, z = math.fabs(xy), math.fabs(xz), math.fabs(yz)
    bound = math.sqrt(min(max(xx + x + y, yy + x + z, zz + y + z), p[at.BIAS_START]))
    return s[:7] + (math.sqrt(xx), math.sqrt(yy), math.sqrt(zz), s[98], bound, xy, xz, yz)


@inline
def flagged(p: Any, s: Any) -> int:
    """Whether this sample of the magnetometer was found disturbed."""
    return _MAG_REJECTED if p[at.REJECTION] > 0.0 and s[121] > 0.0 and s[101] == 0.0 and s[99] > 0.0 else 0
