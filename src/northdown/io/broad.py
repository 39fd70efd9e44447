"""BROAD: the Berlin Robust Orientation Estimation Assessment Dataset, in its .mat and .hdf5 files.

Arrays ``imu_gyr`` (rad/s), ``imu_acc`` (m/s²), ``imu_mag`` (µT), ``opt_quat`` (w, x, y, z; body to ENU; NaN where the
markers were not seen), ``opt_pos`` (m, not used here), ``movement`` (samples over which errors count), and
``sampling_rate`` (Hz), which is a variable in .mat and an attribute in .hdf5.

Source: D. Laidig, M. Caruso, A. Cereatti, T. Seel, Data 6(7):72, 2021, doi:10.3390/data6070072.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from typing import Any, Final

import numpy.typing as npt

from northdown.errors import FormatError, expected
from northdown.frames import check_frame
from northdown.io.assemble import Options, reference_of, regular_time
from northdown.recording import Recording

UNUSED: Final = ("opt_pos",)
_NAMES: Final = ("imu_gyr", "imu_acc", "imu_mag", "opt_quat", "movement", "sampling_rate")


def matches(names: Container[str]) -> bool:
    """Whether a file with these names is one of BROAD."""
    return all(name in names for name in _NAMES)


def recording_of(arrays: Mapping[str, npt.NDArray[Any]], options: Options) -> Recording:
    """Recording of the data set's arrays, in ENU unless another frame is asked for."""
    rate = arrays["sampling_rate"].ravel()
    quat, gyr = arrays["opt_quat"], arrays["imu_gyr"]
    if len(rate) != 1 or quat.ndim != 2 or quat.shape[1] != 4 or len(quat) != len(gyr):
        raise FormatError(expected("opt_quat of shape (N, 4) and one sampling_rate", f"{quat.shape}, {rate.shape}"))
    time = regular_time(len(gyr), options.rate or float(rate[0]))
    reference = reference_of(time, quat, "ENU", "OptiTrack")
    frame = check_frame(options.frame or "ENU")
    return Recording(
        time,
        gyr,
        arrays["imu_acc"],
        arrays["imu_mag"],
        None if reference is None else reference.to_frame(frame),
        arrays["movement"].ravel(),
        frame,
        options.name or options.stem,
    )
