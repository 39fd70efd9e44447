"""Public data sets: where their files are, and the checksums of those that are known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final
from urllib.parse import quote


@dataclass(frozen=True)
class DataSet:
    """A public data set.

    Attributes
    ----------
    name : str
        Name of its folder.
    base_url : str
        Address of its repository at one fixed commit, so that the files cannot change.
    folders : dict
        Folder in the repository for each suffix of file names.
    sha256 : dict
        Checksum of each file that can be downloaded.
    remote_names : dict
        Names in the repository, where they differ from ours.
    """

    name: str
    base_url: str
    folders: Mapping[str, str]
    sha256: Mapping[str, str]
    remote_names: Mapping[str, str] = field(default_factory=dict)

    def path(self, file: str) -> str:
        """Address of a file, relative to `base_url`, quoted."""
        folder = self.folders["." + file.rpartition(".")[2]]
        return quote(f"{folder}/{self.remote_names.get(file, file)}")


def _sums(text: str) -> dict[str, str]:
    """Checksums by file name, from the output of ``sha256sum``."""
    rows = (line.split() for line in text.strip().split("\n"))
    return {name: checksum for checksum, name in rows}


_RAW: Final = "https://raw.githubusercontent.com"

BROAD: Final = DataSet(
    "broad",
    f"{_RAW}/dlaidig/broad/afbaa4d75c4cd7c8ca76b8145b1812312d87fb7f/",
    {".mat": "data_mat", ".hdf5": "data_hdf5"},
    _sums("""
ad2cec0390a279953084e1de12dfd8d542af55e4ea187e68e8ebb7c316ecb96b 01_undisturbed_slow_rotation_A.mat
8edaa587044d5d6d06a73785f482c66d44ad1eb7b0d50aa2949f238999a14c79 03_undisturbed_slow_rotation_C.mat
70957bc3e0755c1952115f2b28855b638ff9ee714c75618dd3a89603e4f3a2f2 05_undisturbed_slow_rotation_with_breaks_B.mat
bc1ed36ec3f8d279a3b81078d229549fd4c55ed8338e42c3bd83ab89146096b5 07_undisturbed_fast_rotation_B.mat
355a8bca7c89ba3012a2bad96656bf904d04337dfc2d8e3d50be980eb4e6df28 09_undisturbed_fast_rotation_with_breaks_B.mat
4a78ec3dd01988c065c53eb3157e34425237f0a4598fba95ab2cc19e2342fe72 11_undisturbed_slow_translation_B.mat
4290740d09dc3e055dd3cc939d083fa55321a9c90c0cb0aa3a6ffc26c4350951 15_undisturbed_fast_translation_A.mat
cb7be66ffc50d7d2b23abaf72a85a76925ea2db36a3fd575998811fcf68c219a 21_undisturbed_fast_combined.mat
38326275bd24d350ce188e8621b42e0598e2cc6b5f7eb8c652052afb8f4ae887 25_disturbed_tapping_B.mat
981473c114256006d74c7513c6482a85ba2df7b4ede8d838a8cc755e17e3009c 27_disturbed_phone_vibration_B.mat
0ce63a5f7255e517de271b9cb4349be84ec2ad3c1151c34b16b29637e3a05762 29_disturbed_stationary_magnet_B.mat
8c4bc975757f059728de721468e0d375d124b6b550d0d5a81833d0e68c95c9b2 31_disturbed_stationary_magnet_D.mat
b81855b453629e023635d966f77c87cd17b195c919888d725b57b1cca037962d 33_disturbed_attached_magnet_2cm.hdf5
23681a20515ca56573e81a56f5d8841cb4f55fafc98cac7624d0cac28b76e441 33_disturbed_attached_magnet_2cm.mat
8832fbbd234a63d45cbbbd8fdd897401a0828028655569a50bbfbdad16f48320 35_disturbed_attached_magnet_4cm.mat
"""),
)
"""Berlin Robust Orientation Estimation Assessment Dataset; CC BY 4.0."""

REPOIMU: Final = DataSet(
    "repoimu",
    f"{_RAW}/agnieszkaszczesna/RepoIMU/e8101898804b5191ac707db2080f347cbc8bbc6e/",
    {".csv": "TStick"},
    _sums("""
60a3899f734dd197966af77da1aba66e4792e96d8dcbc375943c4a167e029d1a TStick_Test02_Trial1.csv
fe21902c838007d1d40507b525552237944d401b686d61f3e8db7250536677ab TStick_Test03_Trial1.csv
157a2f03581a9b2ba88a1d173fa4fe07fd2efb6d0212ef142bd4723aea7eb125 TStick_Test04_Trial1.csv
29f48cfbe2e4c2e50bf913bdf34e880f76b0c6d5e7a6be3a0ef86ada0b987f0b TStick_Test05_Trial1.csv
5af3ad5dab89d23ce00fc68e56c9aadb3ac98a4feaa38b6675282ebceeccafb0 TStick_Test06_Trial1.csv
bb56cf2812b55599a8823d17d90b8a55b7a103c58da85999b665aa0aec0f0509 TStick_Test07_Trial1.csv
1cb1865b624d50f795b03e81052280844adeee48238b3c5a8869892069756d84 TStick_Test08_Trial1.csv
"""),
)
"""RepoIMU's T-stick trials."""

XIMU: Final = DataSet(
    "ximu",
    f"{_RAW}/xioTechnologies/Gait-Tracking-With-x-IMU/933d62124fba9467287efb17b9242146f5eb0a23/",
    {".csv": "Gait Tracking With x-IMU/Datasets"},
    _sums("""
1c974d8223b018ff583d0293d6ac178aaff7c8d98d64d86d723560a01ce63511 straightLine_CalInertialAndMag.csv
"""),
)
"""Walks with an x-IMU on the foot."""

FUSION: Final = DataSet(
    "fusion",
    f"{_RAW}/xioTechnologies/Fusion/13ac76882d7a650a041e5f0dc4cf5279d57b7e1b/",
    {".csv": "Examples"},
    _sums("""
a2833a207b4c0c51d52ee62e42069d1a11cf94b1aca1cd46a54d5e8fce577dcd sensor_data.csv
"""),
    {"sensor_data.csv": "Sensor Data.csv"},
)
"""Example log of x-io's Fusion library; MIT."""

DATA_SETS: Final = {data.name: data for data in (BROAD, REPOIMU, XIMU, FUSION)}
