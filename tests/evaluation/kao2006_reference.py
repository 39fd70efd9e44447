"""K06's filter a second time: its matrices as printed (quaternion with the scalar last), one run, plain loops.

Jacobians are differences, and the update is the information form P = (P⁻¹ + Hᵀ R⁻¹ H)⁻¹ with (3.7), misprints
corrected. Gravity is K06's, the negative of specific force.
"""

from __future__ import annotations

import numpy as np

STEP = 1.0 / 400.0


def omega(w):
    """Matrix of (2.16)."""
    x, y, z = w
    return np.array([[0, z, -y, x], [-z, 0, x, y], [y, -x, 0, z], [-x, -y, -z, 0]])


def c_bn(q):
    """(2.14), NED to body."""
    a, b, c, d = q
    return np.array(
        [
            [a * a - b * b - c * c + d * d, 2 * (a * b + c * d), 2 * (a * c - b * d)],
            [2 * (a * b - c * d), -a * a + b * b - c * c + d * d, 2 * (a * d + b * c)],
            [2 * (a * c + b * d), 2 * (-a * d + b * c), -a * a - b * b + c * c + d * d],
        ]
    )


def change(x, measured, position, direction):
    """(3.25) with the centripetal terms subtracted; without the 1/‖q‖, as q has norm one."""
    w, q = x[:3], x[3:]
    rows = np.array([np.concatenate([np.cross(r, e), e]) for r, e in zip(position, direction, strict=True)])
    centripetal = np.array([e @ np.cross(w, np.cross(w, r)) for r, e in zip(position, direction, strict=True)])
    alpha = (np.linalg.inv(rows) @ (measured - centripetal))[:3]
    return np.concatenate([w + STEP * alpha, q + 0.5 * STEP * omega(w) @ q]), np.linalg.inv(rows)[:3]


def direct(q, field, gravity):
    """(3.23)."""
    m = c_bn(q)
    return np.concatenate([(m @ field)[:2], gravity * m[1:, 2]])


def indirect(g, mag, gravity):
    """(3.10) to (3.16) of gravity and field in the body, by rotation matrices."""
    theta, phi = -np.arcsin(g[0] / gravity), np.arctan2(g[1], g[2])
    ry = np.array([[np.cos(theta), 0, -np.sin(theta)], [0, 1, 0], [np.sin(theta), 0, np.cos(theta)]])
    rx = np.array([[1, 0, 0], [0, np.cos(phi), np.sin(phi)], [0, -np.sin(phi), np.cos(phi)]])
    v = ry.T @ rx.T @ mag
    return np.array([v[1] / v[0], g[0] / gravity, g[1] / g[2]])


def indirect_of(q):
    """(3.16)."""
    a, b, c, d = q
    return np.array(
        [
            -2 * (a * b + c * d) / (a * a - b * b - c * c + d * d),
            -2 * (b * d - a * c),
            2 * (a * d + b * c) / (d * d - a * a - b * b + c * c),
        ]
    )


def slope(function, at, width=1e-6):
    """Central differences."""
    columns = []
    for k in range(len(at)):
        step = np.zeros(len(at))
        step[k] = width
        columns.append((function(at + step) - function(at - step)) / (2 * width))
    return np.array(columns).T


def run(signals, method, iterations, count):
    """States (scalar last) and covariances after `count` samples of the first run."""
    constants, array = signals.constants, signals.array
    used = [array.names.index(n) for n in ("A1", "A2", "A3y", "A4", "A5", "A6")]
    position, direction = array.position[used], array.direction[used]
    a = signals.array_acc[0]
    # (2.26); the z accelerometers sit at 120° to each other
    g = -np.column_stack([0.5 * a[:, 0] - 0.5 * a[:, 2], 0.5 * a[:, 1] + 0.5 * a[:, 3], a[:, 4:].mean(axis=1)])
    field, size = constants.field_n, constants.gravity
    x = np.concatenate([np.zeros(3), np.roll(signals.quat[0], -1)])
    p = constants.start_variance * np.eye(7)
    for k in range(count):
        if k:
            before = a[k - 1][used]
            f = slope(lambda s, m=before: change(s, m, position, direction)[0], x)
            x, inverse = change(x, before, position, direction)
            p = f @ p @ f.T
            p[:3, :3] += STEP**2 * constants.acc_noise**2 * inverse @ inverse.T
        z, h, r = measurement(method, x, g[k], signals.mag[0, k], field, size, constants)
        guess = x
        for _ in range(iterations):
            slopes = np.hstack([np.zeros((len(z), 3)), slope(h, guess[3:])])
            information = np.linalg.inv(p) + slopes.T @ np.linalg.inv(r) @ slopes
            after = np.linalg.inv(information)
            step = after @ slopes.T @ np.linalg.inv(r) @ (z - h(guess[3:]))
            guess = guess + step - after @ np.linalg.inv(p) @ (guess - x)
        x, p = guess, after
        q = x[3:] / np.linalg.norm(x[3:])
        x = np.concatenate([x[:3], q])
        keep = np.eye(7)
        keep[3:, 3:] -= np.outer(q, q)
        # a trace of q's norm is left, so that P can be inverted; 1e-9 of what the attitude has
        p = keep @ p @ keep + 1e-12 * np.outer(np.r_[0, 0, 0, q], np.r_[0, 0, 0, q])
    return x, p


def measurement(method, x, g, mag, field, size, constants):
    """z, h and R."""
    if method == "direct":
        sigma = np.array([constants.mag_noise] * 2 + list(constants.gravity_noise[1:]))
        return np.concatenate([mag[:2], g[1:]]), lambda q: direct(q, field, size), np.diag(sigma**2)
    m = c_bn(x[3:])
    s = slope(lambda v: indirect(v[:3], v[3:], size), np.concatenate([size * m[:, 2], m @ field]))
    noise = np.array([*constants.gravity_noise, *[constants.mag_noise] * 3])
    return (
        indirect(g, mag, size),
        indirect_of,
        s @ np.diag(noise**2) @ s.T,
    )
