"""The parts of the error-state filter on an accelerometer array: prediction and the three measurements.

Parameter tuple p: channels' noise density squared, bias walk squared, start bias squared, g, the field's relative
noise density squared 0–4; norm gate, dip gate, field window 5–7; motion time, motion window 8–9; variance density of
a redundant combination 10; cosine and sine of the dip (NaN: learned) 11–12; L_α 13–30, L_f 31–48; C_αα (triangle)
49–54, C_αf V 55–63, V 64–72, Λ 73–75, C_ff (triangle) 76–81; B 82–117; variances of tilt, heading and rate at the
start 118–120. 13–81 are the tuple of `_array_coupling`. The state tuple s is described at `gyro_free_mekf.step`.
"""

from __future__ import annotations

from typing import Any

from northdown.estimators._array_coupling import coupling, force_axis, force_products, force_variance, turning_slope
from northdown.kernels.block_kalman import (
    blocks,
    change_rate,
    full,
    gain,
    joined,
    product,
    raised,
    seen_attitude,
    seen_force_bias,
    seen_rate,
    times,
    total,
    transposed,
    turn_attitude,
)
from northdown.kernels.jit import inline
from northdown.kernels.kalman import symmetric3
from northdown.kernels.quaternion import add, dot, multiply, normalize, scale
from northdown.kernels.rate_kalman import matrix_nb, product_slope, products_slope, times3
from northdown.kernels.so3 import exp


@inline
def predict(p: Any, s: Any, dt: float) -> Any:
    """Attitude, rate and covariance at the next sample; s as in `step`."""
    q, w, cov = (s[0], s[1], s[2], s[3]), (s[4], s[5], s[6]), blocks(s[13:91])
    acceleration, rate, fresh, before = (s[91], s[92], s[93]), (s[94], s[95], s[96]), s[97], s[98]
    h = 0.5 * (before + dt)
    u = h * fresh
    g, noise = coupling(p[13:82], s[99])
    m = matrix_nb(q)
    slope = turning_slope(p[13:82], rate, g)
    x, y = scale(-u * p[3], times3(g, m[1])), scale(u * p[3], times3(g, m[0]))
    by_rate = (
        1.0 - u * slope[0],
        -u * slope[1],
        -u * slope[2],
        -u * slope[3],
        1.0 - u * slope[4],
        -u * slope[5],
        -u * slope[6],
        -u * slope[7],
        1.0 - u * slope[8],
    )
    cov = change_rate(
        cov, (x[0], y[0], 0.0, x[1], y[1], 0.0, x[2], y[2], 0.0), by_rate, u, times(u, g), noise, h * p[0]
    )
    cov = turn_attitude(cov, times(dt, m[0] + m[1] + m[2]))
    # biases of K accelerometers walk, J⁺ shows six combinations
    walk = dt * p[1]
    cross = times(walk, product(p[55:64], transposed(p[64:73])))
    cov = (
        cov[0],
        cov[1],
        cov[2],
        cov[3],
        cov[4],
        cov[5],
        cov[6],
        raised(cov[7], walk, p[49:55]),
        total(cov[8], cross),
        raised(cov[9], walk, p[76:82]),
    )
    w = add(w, scale(h, acceleration))
    return normalize(multiply(q, exp(scale(dt, w)))), w, cov


@inline
def correct_extra(p: Any, cov: Any, d: Any, rate: Any, extra: Any, r: float) -> Any:
    """Scalar updates with the combinations that see products of rates only; returns how many, too."""
    dof = 0.0
    for i in range(6):
        b = p[82:118]
        row = (b[6 * i], b[6 * i + 1], b[6 * i + 2], b[6 * i + 3], b[6 * i + 4], b[6 * i + 5])
        if row[0] != 0.0 or row[1] != 0.0 or row[2] != 0.0 or row[3] != 0.0 or row[4] != 0.0 or row[5] != 0.0:
            x, y, z = rate[0] + d[1][0], rate[1] + d[1][1], rate[2] + d[1][2]
            m = symmetric3(row[0], 0.5 * row[3], 0.5 * row[4], row[1], 0.5 * row[5], row[2])
            t = product(m, full(cov[4]))
            mean = t[0] + t[4] + t[8]
            square = t[0] * t[0] + t[4] * t[4] + t[8] * t[8] + 2.0 * (t[1] * t[3] + t[2] * t[6] + t[5] * t[7])
            h = product_slope(row, (x, y, z))
            ph = seen_rate(cov, h)
            # the form itself is half its slope times the rate
            residual = extra[i] - 0.5 * (h[0] * x + h[1] * y + h[2] * z) - mean
            cov, d = gain(cov, d, ph, dot(h, ph[1]) + 2.0 * square + r, residual)
            dof += 1.0
    return cov, d, dof


@inline
def correct_field(cov: Any, d: Any, y: Any, north: float, down: float, r: float) -> Any:
    """Two scalar updates with the unit vector u = (north, 0, down); y is measured less true, u × δ."""
    h = (0.0, 1.0, 0.0)
    ph = seen_attitude(cov, h)
    cov, d = gain(cov, d, ph, ph[0][1] + r, north * y[2] - down * y[0] - d[0][1])
    h = (down, 0.0, -north)
    ph = seen_attitude(cov, h)
    return gain(cov, d, ph, dot(h, ph[0]) + r, y[1] - dot(h, d[0]))


@inline
def correct_force(p: Any, cov: Any, d: Any, q: Any, rate: Any, y: Any, loose: float, per: float) -> Any:
    """Three scalar updates in the axes in which noise is diagonal; y is the residual at d = 0."""
    m = matrix_nb(q)
    leak = products_slope(force_products(p[13:82]), rate)
    for i in range(3):
        a = force_axis(p[13:82], i)
        ht = (-p[3] * dot(a, m[1]), p[3] * dot(a, m[0]), 0.0)
        hw = add(scale(a[0], leak[0]), add(scale(a[1], leak[1]), scale(a[2], leak[2])))
        ph = joined(joined(seen_attitude(cov, ht), seen_rate(cov, hw)), seen_force_bias(cov, a))
        s = dot(ht, ph[0]) + dot(hw, ph[1]) + dot(a, ph[3]) + per * (force_variance(p[13:82], i) + loose)
        cov, d = gain(cov, d, ph, s, dot(a, y) - dot(ht, d[0]) - dot(hw, d[1]) - dot(a, d[3]))
    return cov, d
