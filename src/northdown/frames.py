"""Navigation frames, mounting of the sensor, Euler conventions, body rates and Euler rates.

Frames
------
============ ======= ======= ======= =========================================
name         x       y       z       used by
============ ======= ======= ======= =========================================
``"NED"``    north   east    down    aerospace; the default; all filters inside
``"ENU"``    east    north   up      robotics (ROS REP 103), BROAD, VQF
``"NWU"``    north   west    up      x-io Fusion, Madgwick
============ ======= ======= ======= =========================================

North is *magnetic* north unless a declination has been applied.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Final, Literal, get_args

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray, as_float_array, check_choice, check_number
from northdown.errors import InputError, expected

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Frame = Literal["NED", "ENU", "NWU"]
FRAMES: Final[tuple[str, ...]] = get_args(Frame)

EulerConvention = Literal["zyx", "rfu"]
EULER_COLUMNS: Final[dict[str, tuple[str, str, str]]] = {
    "zyx": ("roll", "pitch", "yaw"),
    "rfu": ("pitch", "roll", "heading"),
}

_HALF = math.sqrt(0.5)
# Quaternions (w, x, y, z) from NED to each frame: half turns about (1, 1, 0)/√2 and about x.
_FROM_NED: Final[dict[str, tuple[float, float, float, float]]] = {
    "NED": (1.0, 0.0, 0.0, 0.0),
    "ENU": (0.0, _HALF, _HALF, 0.0),
    "NWU": (0.0, 1.0, 0.0, 0.0),
}


def check_frame(frame: str) -> Frame:
    """Check the name of a navigation frame (upper or lower case)."""
    return check_choice("frame", frame.upper() if isinstance(frame, str) else frame, FRAMES)  # type: ignore[return-value]


def quat_from_ned(frame: str) -> FloatArray:
    """Quaternion (w, x, y, z), shape (4,), that takes NED components to components in `frame`."""
    return np.array(_FROM_NED[check_frame(frame)])


def rotation_between(source: str, target: str) -> Rotation:
    """Rotation that takes components in frame `source` to components in frame `target`."""
    from scipy.spatial.transform import Rotation

    to_source = Rotation.from_quat(np.roll(quat_from_ned(source), -1))
    to_target = Rotation.from_quat(np.roll(quat_from_ned(target), -1))
    return to_target * to_source.inv()


def up_axis(frame: str) -> FloatArray:
    """Unit vector, shape (3,), that points up, in components of `frame`."""
    return np.array([0.0, 0.0, -1.0 if check_frame(frame) == "NED" else 1.0])


def mat_ecef_ned(latitude: float, longitude: float) -> FloatArray:
    """Matrix (3, 3) from NED to Earth-centred Earth-fixed components.

    Parameters
    ----------
    latitude, longitude : float
        Geodetic latitude and longitude, rad.

    Notes
    -----
    Columns are the directions north, east and down in ECEF (K06 section 2-1).
    """
    lat = check_number("latitude", latitude, low=-math.pi / 2, high=math.pi / 2, unit="rad")
    lon = check_number("longitude", longitude, low=-2 * math.pi, high=2 * math.pi, unit="rad")
    sl, cl, so, co = math.sin(lat), math.cos(lat), math.sin(lon), math.cos(lon)
    return np.array([[-sl * co, -so, -cl * co], [-sl * so, co, -cl * so], [cl, 0.0, -sl]])


def mounting_matrix(spec: str) -> FloatArray:
    """Matrix (3, 3) of a mounting such as ``"y,-x,z"``: row i says which sensor axis is the new axis i.

    Raises
    ------
    InputError
        When the text does not name each axis once, or when the axes would be left-handed.
    """
    parts = [p.strip().lower() for p in spec.split(",")] if isinstance(spec, str) else []
    parts = [p.replace("−", "-") for p in parts]  # a typeset minus, as in messages and documents
    matches = [m for p in parts if (m := re.fullmatch(r"([+-]?)([xyz])", p))]
    if len(parts) != 3 or len(matches) != 3:
        raise InputError(expected("a mounting such as 'y,-x,z'", repr(spec), do="name three signed axes"))
    mat = np.zeros((3, 3))
    for row, match in enumerate(matches):
        mat[row, "xyz".index(match[2])] = -1.0 if match[1] == "-" else 1.0
    determinant = round(float(np.linalg.det(mat)))
    if determinant == 0:
        raise InputError(expected("each of x, y, z once in the mounting", repr(spec)))
    if determinant < 0:
        raise InputError(
            expected("a right-handed mounting", f"{spec!r}, which mirrors space", do="change the sign of one axis")
        )
    return mat


def as_euler(rotation: Rotation, convention: str = "zyx") -> FloatArray:
    """Euler angles (N, 3) or (3,) in radians of a rotation body → navigation frame.

    Parameters
    ----------
    rotation : scipy.spatial.transform.Rotation
        For ``"zyx"`` body to any frame; for ``"rfu"`` body to ENU.
    convention : {"zyx", "rfu"}
        ``"zyx"``: aerospace roll, pitch, yaw; R = Rz(yaw) Ry(pitch) Rx(roll) (K06 (2.4), W section 1). In NED with
        a forward-right-down body, yaw is the heading, clockwise from north.
        ``"rfu"``: body right-forward-up in ENU; pitch about x, roll about y, heading clockwise from
        north; R = Rz(−heading) Rx(pitch) Ry(roll) (J14 section 2.2).

    Notes
    -----
    At pitch ±90° only the sum or difference of the other two is defined; roll is then set to 0. That is done where
    cos(pitch) is below 1e-9.
    """
    check_choice("convention", convention, tuple(EULER_COLUMNS))
    mat = rotation.as_matrix()
    if convention == "rfu":
        sin_pitch, a, b = mat[..., 2, 1], -mat[..., 2, 0], mat[..., 2, 2]
        c, d = mat[..., 0, 1], mat[..., 1, 1]
        e, f = -mat[..., 1, 0], mat[..., 0, 0]
    else:
        sin_pitch, a, b = -mat[..., 2, 0], mat[..., 2, 1], mat[..., 2, 2]
        c, d = mat[..., 1, 0], mat[..., 0, 0]
        e, f = -mat[..., 0, 1], mat[..., 1, 1]
    # atan2 of the two legs keeps full precision near ±90°, where asin loses half the digits
    cos_pitch = np.hypot(c, d)
    pitch = np.arctan2(sin_pitch, cos_pitch)
    locked = cos_pitch < 1e-9
    roll = np.where(locked, 0.0, np.arctan2(a, b))
    yaw = np.where(locked, np.arctan2(e, f), np.arctan2(c, d))
    return np.stack([pitch, roll, yaw] if convention == "rfu" else [roll, pitch, yaw], axis=-1)


def from_euler(angles: npt.ArrayLike, convention: str = "zyx") -> Rotation:
    """Rotation body → navigation frame from Euler angles (N, 3) or (3,) in radians; inverse of `as_euler`.

    Raises
    ------
    InputError
        On another shape, or an angle that is not finite.
    """
    from scipy.spatial.transform import Rotation

    check_choice("convention", convention, tuple(EULER_COLUMNS))
    a = as_float_array("angles", angles)
    if a.ndim not in (1, 2) or a.shape[-1] != 3:
        raise InputError(expected("angles of shape (3,) or (N, 3)", f"shape {a.shape}"))
    bad = ~np.isfinite(np.atleast_2d(a)).all(axis=1)
    if bad.any():
        raise InputError(expected("finite angles", "NaN or infinity", at=int(np.argmax(bad))))
    if convention == "rfu":
        return Rotation.from_euler("ZXY", np.stack([-a[..., 2], a[..., 0], a[..., 1]], axis=-1))
    return Rotation.from_euler("ZYX", a[..., ::-1])


def rate_from_euler_rate(roll: float, pitch: float) -> FloatArray:
    """Matrix (3, 3) from (roll, pitch, yaw) rates to body rates, zyx convention (K06 (2.8), corrected).

    Parameters
    ----------
    roll, pitch : float
        Euler angles, rad.
    """
    roll, pitch = check_number("roll", roll, unit="rad"), check_number("pitch", pitch, unit="rad")
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    return np.array([[1.0, 0.0, -sp], [0.0, cr, cp * sr], [0.0, -sr, cp * cr]])


def euler_rate_from_rate(roll: float, pitch: float) -> FloatArray:
    """Matrix (3, 3) from body rates to (roll, pitch, yaw) rates, zyx convention (K06 (2.9)).

    Parameters
    ----------
    roll, pitch : float
        Euler angles, rad.

    Raises
    ------
    InputError
        Within 1e-9 of pitch ±90°, where yaw and roll rates are unbounded.
    """
    roll, pitch = check_number("roll", roll, unit="rad"), check_number("pitch", pitch, unit="rad")
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    if abs(cp) < 1e-9:
        raise InputError(
            expected(
                "pitch away from ±90°",
                f"{math.degrees(pitch):.9f}°",
                do="use quaternions or rotation vectors here",
            )
        )
    return np.array([[1.0, sr * sp / cp, cr * sp / cp], [0.0, cr, -sr], [0.0, sr / cp, cr / cp]])
