r"""Attitude error: total, heading and inclination.

With the error quaternion in the navigation frame

.. math::

    q_e = q_\mathrm{est} \otimes q_\mathrm{ref}^{-1} = (w, x, y, z)

the total error is 2 acos\|w\|; it splits into a turn about the vertical, heading = 2 atan\|z / w\|, and the least
tilt that is left, inclination = 2 acos √(w² + z²). All three are computed here with
atan2, which keeps full precision near zero, where acos loses half the digits, and is defined where w = 0.

Source: D. Laidig, M. Caruso, A. Cereatti, T. Seel, Data 6(7):72, 2021, doi:10.3390/data6070072, section 4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from northdown._validation import FloatArray, check_number
from northdown.evaluation.alignment import Alignment, AlignmentKind, choose_kind, fit
from northdown.evaluation.clock import Clock, ClockOffset, choose_clock
from northdown.evaluation.matching import Truth, match
from northdown.frames import Frame
from northdown.orientation import Orientation

if TYPE_CHECKING:
    import pandas as pd
    from scipy.spatial.transform import Rotation


@dataclass(frozen=True)
class ErrorSummary:
    """One figure each for the total, heading and inclination error.

    Parameters
    ----------
    total, heading, inclination : float
        Errors, rad.
    """

    total: float
    heading: float
    inclination: float

    @property
    def total_deg(self) -> float:
        """Total error, degrees."""
        return float(np.rad2deg(self.total))

    @property
    def heading_deg(self) -> float:
        """Heading error, degrees."""
        return float(np.rad2deg(self.heading))

    @property
    def inclination_deg(self) -> float:
        """Inclination error, degrees."""
        return float(np.rad2deg(self.inclination))

    def __str__(self) -> str:
        return (
            f"total {self.total_deg:.3f}°, heading {self.heading_deg:.3f}°, inclination {self.inclination_deg:.3f}°"
        )


@dataclass(frozen=True, eq=False)
class AttitudeError:
    """Error of an estimated orientation at the samples that count.

    Parameters
    ----------
    time : (M,) array
        Time, s.
    total, heading, inclination : (M,) arrays
        Errors in rad, from 0 to π. Heading and inclination are about the vertical of `frame`.
    heading_signed : (M,) array
        Heading error with its sign, rad, in (−π, π]: positive where the estimate is turned too far about +z.
    rotvec : (M, 3) array
        Error as a rotation vector e, rad, in axes of `frame`: estimate = exp(e) · truth.
    index : (M,) array of int
        Samples of the estimate that these are.
    frame : {"NED", "ENU", "NWU"}
        Frame of the estimate.
    name : str
        Name of the estimate.
    alignment : Alignment, optional
        Constant rotations that were found and taken out first; None when there were none. As they are fitted to this
        very estimate, the errors are then lower bounds.
    clock : ClockOffset, optional
        Offset between the clocks that was taken out; None when both are taken as recorded.
    """

    time: FloatArray
    total: FloatArray
    heading: FloatArray
    inclination: FloatArray
    heading_signed: FloatArray
    rotvec: FloatArray
    index: npt.NDArray[np.intp]
    frame: Frame
    name: str = ""
    alignment: Alignment | None = None
    clock: ClockOffset | None = None

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        clocks = "" if self.clock is None else f", clocks aligned: {self.clock}"
        return f"<AttitudeError {self.name or 'unnamed'}: {len(self)} samples, RMSE {self.rmse()}{clocks}>"

    def _reduce(self, function: Callable[[FloatArray], np.floating]) -> ErrorSummary:
        return ErrorSummary(
            float(function(self.total)), float(function(self.heading)), float(function(self.inclination))
        )

    def rmse(self) -> ErrorSummary:
        """Root mean square of each error."""
        return self._reduce(lambda x: np.sqrt(np.mean(x * x)))

    def mean(self) -> ErrorSummary:
        """Mean of each error (of its size: signs do not cancel)."""
        return self._reduce(np.mean)

    def max(self) -> ErrorSummary:
        """Largest value of each error."""
        return self._reduce(np.max)

    def percentile(self, percent: float) -> ErrorSummary:
        """Value that `percent` of the samples do not exceed, of each error."""
        p = check_number("percent", percent, low=0.0, high=100.0, unit="%")
        return self._reduce(lambda x: np.percentile(x, p))

    def to_pandas(self) -> pd.DataFrame:
        """Table with one row per sample: time (s) and errors (rad)."""
        import pandas as pd

        columns = {"time": self.time, "total": self.total, "heading": self.heading, "inclination": self.inclination}
        columns["heading_signed"] = self.heading_signed
        columns |= {f"rotvec_{c}": self.rotvec[:, i] for i, c in enumerate("xyz")}
        table = pd.DataFrame(columns)
        table.attrs = {"frame": self.frame, "name": self.name}
        return table


def attitude_error(
    estimate: Orientation,
    truth: Truth,
    *,
    mask: npt.ArrayLike | None = None,
    alignment: AlignmentKind | Alignment | None = None,
    max_gap: float | None = None,
    clock: Clock | ClockOffset = "as recorded",
) -> AttitudeError:
    """Error of an estimate, sample by sample.

    Parameters
    ----------
    estimate : Orientation
        Estimated orientation, N samples.
    truth : Orientation or Recording
        True orientation in any navigation frame, or a recording that carries it. Of a recording, samples where
        `movement` is false do not count.
    mask : (N,) array of bool, optional
        Samples of the estimate that count. All of them when not given, also those flagged as still unknown.
    alignment : {"none", "heading", "rotations"} or Alignment, optional
        Constant rotations to find and take out first (see `align`), or those found before. When not given:
        what the recording's `reference_offset` says, and ``"none"`` for an Orientation.
    max_gap : float, optional
        Longest gap (s) of the truth to interpolate across; see `match`.
    clock : {"as recorded", "aligned"} or ClockOffset
        ``"aligned"`` finds the offset between the recording's gyroscope and its reference (see `clock_offset`) and
        takes it out: the estimate stamped t is compared with the truth at t − offset. It comes from the angular
        rates only, not from the estimate, and is the same for every estimator. Or an offset found before.

    Returns
    -------
    AttitudeError
        In the frame of the estimate.

    Raises
    ------
    InputError
        When there is no reference, no overlap in time or no sample left, or when the motion does not determine the
        alignment or the offset of the clocks.

    Notes
    -----
    Source: D. Laidig et al., Data 6(7):72, 2021, section 4. When heading and body axes are aligned first, the
    alignment uses the estimate itself, so the errors are lower bounds.
    """
    kind = choose_kind(truth, alignment)
    offset = choose_clock(truth, clock)
    late = 0.0 if offset is None else offset.offset
    matched = match(estimate, truth, mask=mask, max_gap=max_gap, late=late)
    measured, true = estimate.rotation[matched.index], matched.truth.rotation
    found: Alignment | None = None
    if isinstance(kind, Alignment):
        found = kind
    elif kind != "none":
        found = fit(measured, true, kind, estimate.frame)
    if found is not None:
        # The truth is turned, not the estimate: the vertical of the estimate is the real one, that of an
        # arbitrary reference frame is not.
        true = found.apply_inverse(matched.truth).rotation
    error = measured * true.inv()
    total, signed, inclination = split(error)
    return AttitudeError(
        time=estimate.time[matched.index],
        total=total,
        heading=np.abs(signed),
        inclination=inclination,
        heading_signed=signed,
        rotvec=error.as_rotvec(),
        index=matched.index,
        frame=estimate.frame,
        name=estimate.name,
        alignment=found,
        clock=offset,
    )


def split(error: Rotation) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Total, signed heading and inclination error (N,), rad, of error rotations in the navigation frame."""
    x, y, z, w = error.as_quat().T
    z = np.where(w < 0.0, -z, z)
    w = np.abs(w)
    total = 2.0 * np.arctan2(np.sqrt(x * x + y * y + z * z), w)
    inclination = 2.0 * np.arctan2(np.hypot(x, y), np.hypot(w, z))
    heading = 2.0 * np.arctan2(z, w)
    return total, np.where(heading <= -np.pi, np.pi, heading), inclination
