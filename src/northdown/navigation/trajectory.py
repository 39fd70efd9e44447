"""`Trajectory`: where a body went, with its velocity, orientation and uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from northdown._validation import BoolArray, FloatArray, as_float_array, check_index, check_mask, check_vectors
from northdown.errors import InputError, expected
from northdown.frames import Frame, check_frame, rotation_between
from northdown.orientation import Orientation

if TYPE_CHECKING:
    import pandas as pd

AXES: Final = {
    "NED": ("north", "east", "down"),
    "ENU": ("east", "north", "up"),
    "NWU": ("north", "west", "up"),
}
"""Names of the axes of each frame."""

_VECTORS = ("position", "velocity")
_COVARIANCES = ("position_covariance", "velocity_covariance")


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Position, velocity and orientation of a body over time.

    Parameters
    ----------
    orientation : Orientation
        Attitude, body → navigation frame; its times and its frame are those of the trajectory.
    position : (N, 3) array
        Of the sensor, m, in axes of `frame`; from an origin that the maker of the trajectory chose.
    velocity : (N, 3) array
        m/s, in axes of `frame`.
    position_covariance, velocity_covariance : (N, 3, 3) array, optional
        m² and m²/s², in axes of `frame`. None where the method has none.
    acc_bias : (N, 3) array, optional
        Estimated accelerometer bias, m/s², in body axes. That of the gyroscope is in `orientation`.
    still : (N,) array of bool, optional
        Samples at which the body was taken to stand still.
    name : str
        For tables and figures.

    Raises
    ------
    InputError
        On wrong shapes or infinite values.
    """

    orientation: Orientation
    position: FloatArray
    velocity: FloatArray
    position_covariance: FloatArray | None = None
    velocity_covariance: FloatArray | None = None
    acc_bias: FloatArray | None = None
    still: BoolArray | None = None
    name: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.orientation, Orientation):
            raise InputError(expected("orientation as an Orientation", type(self.orientation).__name__))
        set_field = object.__setattr__
        n = len(self.orientation)
        for key in (*_VECTORS, "acc_bias"):
            value = getattr(self, key)
            if value is not None or key in _VECTORS:
                set_field(self, key, check_vectors(key, value, n))
        for key in _COVARIANCES:
            value = getattr(self, key)
            if value is not None:
                array = as_float_array(key, value)
                if array.shape != (n, 3, 3):
                    raise InputError(expected(f"{key} of shape ({n}, 3, 3)", f"shape {array.shape}"))
                set_field(self, key, array)
        if self.still is not None:
            set_field(self, "still", check_mask("still", self.still, n))

    @property
    def time(self) -> FloatArray:
        """Time in seconds, (N,)."""
        return self.orientation.time

    @property
    def frame(self) -> Frame:
        """Navigation frame."""
        return self.orientation.frame

    @property
    def height(self) -> FloatArray:
        """Height above the origin, (N,), m: up in every frame."""
        up: FloatArray = -self.position[:, 2] if self.frame == "NED" else self.position[:, 2]
        return up

    @property
    def position_sigma(self) -> FloatArray | None:
        """Standard deviation of the position along each axis, (N, 3), m."""
        return _sigma(self.position_covariance)

    @property
    def velocity_sigma(self) -> FloatArray | None:
        """Standard deviation of the velocity along each axis, (N, 3), m/s."""
        return _sigma(self.velocity_covariance)

    def __len__(self) -> int:
        return len(self.orientation)

    def __repr__(self) -> str:
        span = f"{self.time[0]:g} to {self.time[-1]:g} s, {self.distance():.2f} m" if len(self) else "no samples"
        tail = ", with covariance" if self.position_covariance is not None else ""
        return f"<Trajectory {self.name or 'unnamed'}: {len(self)} samples, {span}, {self.frame}{tail}>"

    def __getitem__(self, index: slice | npt.NDArray[Any]) -> Trajectory:
        """Part of the trajectory, by slice, mask or increasing indices."""
        chosen = check_index(index, len(self))
        keys = (*_VECTORS, *_COVARIANCES, "acc_bias", "still")
        picked: dict[str, Any] = {k: v[chosen] for k in keys if (v := getattr(self, k)) is not None}
        return replace(self, orientation=self.orientation[chosen], **picked)

    def distance(self, *, horizontal: bool = False) -> float:
        """Length of the path, m.

        Parameters
        ----------
        horizontal : bool
            Of its projection on the ground, without the ups and downs of, say, a foot.
        """
        steps = np.diff(self.position[:, : 2 if horizontal else 3], axis=0)
        return float(np.sqrt((steps**2).sum(axis=1)).sum())

    def closure(self, *, horizontal: bool = False) -> float:
        """Distance from the first to the last position, m: the error, where a walk ends at its start."""
        if not len(self):
            return 0.0
        return float(np.linalg.norm((self.position[-1] - self.position[0])[: 2 if horizontal else 3]))

    def to_frame(self, frame: str) -> Trajectory:
        """The same trajectory expressed in another navigation frame."""
        target = check_frame(frame)
        if target == self.frame:
            return self
        mat = rotation_between(self.frame, target).as_matrix()
        turned: dict[str, Any] = {k: getattr(self, k) @ mat.T for k in _VECTORS}
        turned |= {k: mat @ v @ mat.T for k in _COVARIANCES if (v := getattr(self, k)) is not None}
        return replace(self, orientation=self.orientation.to_frame(target), **turned)

    def to_pandas(self, convention: str = "zyx") -> pd.DataFrame:
        """Table with one row per sample.

        Position (m) under the names of the frame's axes, such as ``north``; velocity (m/s) as ``v_north``; standard
        deviations as ``sigma_north`` and ``sigma_v_north``; accelerometer bias (m/s²) as ``acc_bias_x``; ``still``;
        then the columns of `Orientation.to_pandas`.
        """
        names = AXES[self.frame]
        columns: dict[str, npt.NDArray[Any]] = {}
        for prefix, value in (
            ("", self.position),
            ("v_", self.velocity),
            ("sigma_", self.position_sigma),
            ("sigma_v_", self.velocity_sigma),
        ):
            if value is not None:
                columns |= {f"{prefix}{axis}": value[:, i] for i, axis in enumerate(names)}
        if self.acc_bias is not None:
            columns |= {f"acc_bias_{axis}": self.acc_bias[:, i] for i, axis in enumerate("xyz")}
        if self.still is not None:
            columns["still"] = self.still
        table = self.orientation.to_pandas(convention)
        for place, (name, value) in enumerate(columns.items(), start=1):
            table.insert(place, name, value)
        table.attrs = {"frame": self.frame, "name": self.name}
        return table


def _sigma(covariance: FloatArray | None) -> FloatArray | None:
    if covariance is None:
        return None
    sigma: FloatArray = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0))
    return sigma
