"""Recordings of public data sets by name, from a local folder or downloaded with their checksums.

==================== ============================================================== ======= ==================
function             what                                                           frame   reference
==================== ============================================================== ======= ==================
`broad`              BROAD, 39 trials, 286 Hz                                       ENU     optical
`repoimu`            RepoIMU, T-stick trials, 100 Hz                                ENU     optical, two offsets
`ximu`               x-IMU on the foot, walking, 256 Hz                             NWU     none
`fusion`             example log of the Fusion library, 100 Hz                      NWU     none
==================== ============================================================== ======= ==================
"""

from __future__ import annotations

import operator
import os

from northdown._validation import check_choice
from northdown.datasets.registry import BROAD, DATA_SETS, FUSION, REPOIMU, XIMU
from northdown.datasets.store import local_files, locate
from northdown.errors import InputError, expected
from northdown.io import read
from northdown.recording import Recording

__all__ = ["broad", "fusion", "names", "repoimu", "ximu"]

Root = str | os.PathLike[str] | None


def broad(trial: int | str, root: Root = None, *, download: bool = False, base_url: str | None = None) -> Recording:
    """One trial of BROAD: nine axes at 286 Hz, optical reference in ENU, and the samples over which errors count.

    Parameters
    ----------
    trial : int or str
        Number 1 to 39, or the whole name such as ``"01_undisturbed_slow_rotation_A"``.
    root : str or os.PathLike, optional
        Folder that has ``broad/`` in it, or the files themselves. When not given, the environment variable
        ``NORTHDOWN_DATA``, or else ``northdown`` in the user's cache folder.
    download : bool
        Fetch the file from the data set's public repository if it is not there, and keep it in `root`.
    base_url : str, optional
        Fetch from a copy of the repository at this address.

    Raises
    ------
    InputError
        When there is no such trial, the file is not there, or cannot be fetched whole.

    References
    ----------
    D. Laidig, M. Caruso, A. Cereatti, T. Seel, Data 6(7):72, 2021, doi:10.3390/data6070072; CC BY 4.0.
    """
    stem = _name(trial) if isinstance(trial, str) else rf"{_whole(trial, 'trial', 1, 39):02d}_\w+"
    what = f"BROAD's trial {trial}"
    return read(locate(BROAD, rf"{stem}\.(mat|hdf5)", what, root, download=download, base_url=base_url))


def repoimu(
    test: int, trial: int = 1, root: Root = None, *, download: bool = False, base_url: str | None = None
) -> Recording:
    """One T-stick trial of RepoIMU: nine axes at 100 Hz and a Vicon reference.

    The reference differs from the sensor by constant rotations of both the world and the body axes
    (``reference_offset="rotations"``). The field has unit size (``mag_unit="arbitrary"``).

    Parameters
    ----------
    test : int
        Number 1 to 11. Tests 5 and 10 drive the gyroscope beyond its range.
    trial : int
        Number of the trial, from 1. Test 1, at rest, has only one.
    root, download, base_url
        As for `broad`.

    Raises
    ------
    InputError
        As for `broad`.

    References
    ----------
    A. Szczęsna et al., ICCVG 2016, doi:10.1007/978-3-319-46418-3_45.
    """
    test, trial = _whole(test, "test", 1, 11), _whole(trial, "trial", 1, 9)
    ending = "Static" if test == 1 else f"Trial{trial}"
    what = f"RepoIMU's test {test}, trial {trial}"
    pattern = rf"TStick_Test{test:02d}_{ending}\.csv"
    return read(locate(REPOIMU, pattern, what, root, download=download, base_url=base_url))


def ximu(root: Root = None, *, download: bool = False, base_url: str | None = None) -> Recording:
    """Read a walk along a straight line with an x-IMU on the foot: nine axes at 256 Hz, no reference.

    Parameters
    ----------
    root, download, base_url
        As for `broad`.

    Raises
    ------
    InputError
        As for `broad`.

    References
    ----------
    x-io Technologies, Gait-Tracking-With-x-IMU, 2013.
    """
    pattern = r"straightLine_CalInertialAndMag\.csv"
    path = locate(XIMU, pattern, "x-IMU's straight walk", root, download=download, base_url=base_url)
    return read(path, rate=256.0, frame="NWU")


def fusion(root: Root = None, *, download: bool = False, base_url: str | None = None) -> Recording:
    """Read the example log of x-io's Fusion library: nine axes at 100 Hz, no reference.

    Parameters
    ----------
    root, download, base_url
        As for `broad`.

    Raises
    ------
    InputError
        As for `broad`.

    References
    ----------
    x-io Technologies, Fusion; MIT.
    """
    path = locate(FUSION, r"sensor_data\.csv", "Fusion's example log", root, download=download, base_url=base_url)
    return read(path, frame="NWU")


def names(dataset: str, root: Root = None) -> tuple[str, ...]:
    """Names, without suffix, of a data set's recordings that are in a folder.

    Parameters
    ----------
    dataset : {"broad", "repoimu", "ximu", "fusion"}
        The data set.
    root : str or os.PathLike, optional
        As for `broad`.

    Returns
    -------
    tuple of str
        Sorted; empty when the folder has none.
    """
    patterns = {
        "broad": r"\d\d_\w+\.(mat|hdf5)",
        "repoimu": r"TStick_\w+\.csv",
        "ximu": r"\w+_CalInertialAndMag\.csv",
        "fusion": r"sensor_data\.csv",
    }
    data = DATA_SETS[check_choice("dataset", dataset, tuple(DATA_SETS))]
    return tuple(sorted({path.stem for path in local_files(data, root, patterns[dataset])}))


def _whole(value: int, name: str, low: int, high: int) -> int:
    try:
        number = operator.index(value)
    except TypeError:
        number = low - 1
    if not low <= number <= high:
        raise InputError(expected(f"a whole number from {low} to {high} for {name}", repr(value)[:40]))
    return number


def _name(trial: str) -> str:
    """Name of a trial without suffix; it goes into a path, so nothing but letters, digits and underscores."""
    stem = trial.removesuffix(".mat").removesuffix(".hdf5")
    if not (stem and stem.replace("_", "a").isascii() and stem.replace("_", "a").isalnum()):
        raise InputError(expected("the name of a trial, such as '01_undisturbed_slow_rotation_A'", repr(trial)[:60]))
    return stem
