"""What K06 prints: the filters' standard deviations (tables 4.2 to 4.13) and the comparison (4.14, 4.15).

Source: C.-F. Kao, M.S. thesis, National Chiao Tung University, 2006 (K06).
"""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

MotionName = Literal["sine", "rest"]
Method = Literal["indirect", "direct"]
FilterName = Literal["EKF", "IKF"]


class Row(NamedTuple):
    """One row of three tables: what filter, on what motion."""

    motion: MotionName
    method: Method
    filter: FilterName


ENTRIES: Final = ("ωx", "ωy", "ωz", "q1", "q2", "q3", "q4", "roll", "pitch", "yaw")
"""Columns of the three tables together. K06's quaternion has its scalar last, as q4."""
UNITS: Final = ("rad/s",) * 3 + ("",) * 4 + ("°",) * 3

TABLES: Final[dict[tuple[MotionName, Method], tuple[str, str, str]]] = {
    ("sine", "indirect"): ("4.2", "4.3", "4.4"),
    ("sine", "direct"): ("4.5", "4.6", "4.7"),
    ("rest", "indirect"): ("4.8", "4.9", "4.10"),
    ("rest", "direct"): ("4.11", "4.12", "4.13"),
}
"""Numbers of the tables of angular rate, quaternion and Euler angles."""

# fmt: off
SIGMA: Final[dict[Row, tuple[float, ...]]] = {
    Row("sine", "indirect", "EKF"): (
        0.0534215, 0.0603691, 0.0825561,
        0.00179418, 0.00118782, 0.00319378, 0.000548506,
        0.193084, 0.135928, 0.358407,
    ),
    Row("sine", "indirect", "IKF"): (
        0.0530846, 0.0679526, 0.0816686,
        0.00177664, 0.00117169, 0.00317014, 0.000540283,
        0.192943, 0.133034, 0.355625,
    ),
    Row("sine", "direct", "EKF"): (
        0.0543299, 0.069509, 0.0785577,
        0.00182298, 0.00154747, 0.00296722, 0.000509682,
        0.194311, 0.180333, 0.335605,
    ),
    Row("sine", "direct", "IKF"): (
        0.0549644, 0.0730245, 0.0790014,
        0.00183037, 0.00156135, 0.00297157, 0.000510061,
        0.194922, 0.18275, 0.336073,
    ),
    Row("rest", "indirect", "EKF"): (
        0.0489364, 0.0526945, 0.0699814,
        0.00167559, 0.0009566, 0.00297959, 0.00030126,
        0.175456, 0.112958, 0.32696,
    ),
    Row("rest", "indirect", "IKF"): (
        0.0493237, 0.0602448, 0.0696266,
        0.00167858, 0.000961408, 0.00297664, 0.000298442,
        0.175755, 0.113943, 0.326444,
    ),
    Row("rest", "direct", "EKF"): (
        0.0504285, 0.0636494, 0.0722155,
        0.00172898, 0.00146212, 0.00298883, 0.000298423,
        0.173629, 0.180776, 0.327432,
    ),
    Row("rest", "direct", "IKF"): (
        0.0511206, 0.0672784, 0.0726071,
        0.00173872, 0.00147368, 0.00299294, 0.000297954,
        0.174406, 0.182882, 0.327851,
    ),
}
# fmt: on
"""The filters' own standard deviations at t = 2 s, in the order of `ENTRIES`, by row of the tables."""

MEASUREMENT: Final = (0.59409, 0.569463, 1.50727)
"""Table 4.14: roll, pitch and yaw from accelerometer and magnetometer alone, degrees."""
GYRO_BASED: Final[dict[float, tuple[float, float, float]]] = {
    0.03: (0.02492, 0.029246, 0.027),
    0.1: (0.06606, 0.078879, 0.08434),
    0.2: (0.11333, 0.128593, 0.15245),
    1.0: (0.28082, 0.279052, 0.47802),
    10.0: (0.56266, 0.485279, 1.20272),
}
"""Table 4.14: the filter with a gyroscope, by the gyroscope's standard deviation (rad/s), degrees."""
GYRO_FREE: Final = (0.12035, 0.090792, 0.1716)
"""Table 4.14: the filter without one, degrees."""
GYRO_FREE_RATE: Final = (0.0249928, 0.0346422, 0.0333314)
"""Table 4.15: standard deviations of its angular rate in the steady state, rad/s."""
