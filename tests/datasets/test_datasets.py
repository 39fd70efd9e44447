"""Data sets: found in a folder, or fetched from a local server with checksum."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import http.server
import logging
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from northdown import datasets
from northdown.datasets import registry, store
from northdown.errors import InputError, MissingDependencyError

TRIAL = "01_undisturbed_slow_rotation_A"


def make_trial(path: Path, n: int = 8) -> None:
    arrays = {f"imu_{s}": np.full((n, 3), float(k)) for k, s in enumerate(("gyr", "acc", "mag"))}
    quat = np.tile([1.0, 0, 0, 0], (n, 1))
    path.parent.mkdir(parents=True, exist_ok=True)
    more = {"opt_quat": quat, "opt_pos": np.zeros((n, 3)), "movement": np.ones((n, 1), bool), "sampling_rate": 100.0}
    scipy.io.savemat(path, arrays | more)


class Quiet(http.server.SimpleHTTPRequestHandler):
    """Serves files without a word."""

    def log_message(self, *args: object) -> None:
        pass


@pytest.fixture
def server(tmp_path) -> Iterator[tuple[str, Path]]:
    """A copy of the repository on this machine: its address and its folder."""
    folder = tmp_path / "remote"
    make_trial(folder / "data_mat" / f"{TRIAL}.mat")
    handler = functools.partial(Quiet, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as httpd:
        thread = threading.Thread(target=httpd.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield f"http://127.0.0.1:{httpd.server_port}", folder
        httpd.shutdown()
        thread.join()


@pytest.fixture
def known(server, monkeypatch) -> None:
    """Registry that knows the server's file."""
    data = (server[1] / "data_mat" / f"{TRIAL}.mat").read_bytes()
    sums = {f"{TRIAL}.mat": hashlib.sha256(data).hexdigest()}
    monkeypatch.setattr(datasets, "BROAD", dataclasses.replace(registry.BROAD, sha256=sums))


@pytest.fixture(autouse=True)
def no_environment(monkeypatch, tmp_path) -> None:
    monkeypatch.delenv("NORTHDOWN_DATA", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for name in ("http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"):
        monkeypatch.delenv(name, raising=False)
    logging.getLogger("pooch").setLevel(logging.WARNING)


def refused(call, *parts: str) -> None:
    with pytest.raises(InputError) as caught:
        call()
    message = str(caught.value)
    assert message.startswith("expected ")
    assert "\n" not in message
    for part in parts:
        assert part in message


@pytest.mark.parametrize("inside", ["broad", "."])
def test_local_folder(inside: str, tmp_path, monkeypatch) -> None:
    make_trial(tmp_path / inside / f"{TRIAL}.mat")
    for recording in (
        datasets.broad(1, tmp_path),
        datasets.broad(TRIAL, tmp_path),
        datasets.broad(np.int64(1), str(tmp_path)),
    ):
        assert (recording.name, recording.frame, len(recording)) == (TRIAL, "ENU", 8)
    monkeypatch.setenv("NORTHDOWN_DATA", str(tmp_path))
    assert datasets.broad(1).name == TRIAL
    assert datasets.names("broad") == (TRIAL,)


def test_nothing_there(tmp_path) -> None:
    assert datasets.names("broad", tmp_path) == ()
    refused(lambda: datasets.broad(1, tmp_path), "BROAD's trial 1", "NORTHDOWN_DATA", "download=True")
    refused(lambda: datasets.broad(2, tmp_path), "NORTHDOWN_DATA")
    refused(lambda: datasets.repoimu(2, root=tmp_path / "none"), "RepoIMU's test 2, trial 1")
    refused(lambda: datasets.ximu(tmp_path), "x-IMU")
    refused(lambda: datasets.fusion(tmp_path), "Fusion")


@pytest.mark.parametrize("trial", [0, 40, -1, 1.5, None, "", "../secret", "01_a/b", "x\n", "01_undisturbed.*"])
def test_impossible_trials(trial, tmp_path) -> None:
    refused(lambda: datasets.broad(trial, tmp_path))


@pytest.mark.parametrize(("test", "trial"), [(0, 1), (12, 1), (2, 0), ("2", 1)])
def test_impossible_tests(test, trial, tmp_path) -> None:
    refused(lambda: datasets.repoimu(test, trial, tmp_path), "a whole number")


def test_unknown_data_set(tmp_path) -> None:
    refused(lambda: datasets.names("narrow", tmp_path), "broad, repoimu, ximu, fusion")


@pytest.mark.usefixtures("known")
def test_download(server, tmp_path) -> None:
    root = tmp_path / "here"
    recording = datasets.broad(1, root, download=True, base_url=server[0])
    assert recording.name == TRIAL
    assert [p.name for p in (root / "broad").iterdir()] == [f"{TRIAL}.mat"]
    assert datasets.broad(1, root).name == TRIAL  # from now on without the network


@pytest.mark.usefixtures("known")
def test_download_into_the_cache(server, tmp_path) -> None:
    datasets.broad(TRIAL, download=True, base_url=server[0] + "/")
    assert (tmp_path / "cache" / "northdown" / "broad" / f"{TRIAL}.mat").is_file()


@pytest.mark.usefixtures("known")
def test_wrong_checksum(server, tmp_path) -> None:
    file = server[1] / "data_mat" / f"{TRIAL}.mat"
    file.write_bytes(file.read_bytes() + b"x")
    root = tmp_path / "here"
    refused(lambda: datasets.broad(1, root, download=True, base_url=server[0]), "SHA-256", "nothing was kept")
    assert not list((root / "broad").iterdir())


@pytest.mark.usefixtures("known")
def test_not_on_the_server(server, tmp_path) -> None:
    (server[1] / "data_mat" / f"{TRIAL}.mat").unlink()
    root = tmp_path / "here"
    refused(lambda: datasets.broad(1, root, download=True, base_url=server[0]), "to download", "HTTPError")
    assert not list((root / "broad").iterdir())


@pytest.mark.usefixtures("known")
def test_no_network(tmp_path) -> None:
    # port 9 (discard) of this machine: nobody listens
    call = functools.partial(datasets.broad, 1, tmp_path / "here", download=True, base_url="http://127.0.0.1:9")
    refused(call, "check the network")


def test_bad_address(tmp_path) -> None:
    refused(lambda: datasets.broad(1, tmp_path, download=True, base_url="nowhere"), "an address")


def test_unknown_checksum(tmp_path) -> None:
    refused(lambda: datasets.broad(39, tmp_path, download=True), "a known checksum", "raw.githubusercontent.com")


def test_pooch_missing(tmp_path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pooch", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'northdown\[download\]'"):
        datasets.broad(1, tmp_path, download=True)


def test_registry_is_sound() -> None:
    for data in registry.DATA_SETS.values():
        assert data.base_url.startswith("https://")
        for name, checksum in data.sha256.items():
            assert len(checksum) == 64
            assert int(checksum, 16)
            assert data.path(name).isascii()
            assert " " not in data.path(name)


def test_registry_matches_the_real_files(data_root) -> None:
    for data in registry.DATA_SETS.values():
        folder = store.folders(data, data_root)[0]
        for name, checksum in data.sha256.items():
            assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == checksum


def test_real(data_root) -> None:
    assert datasets.broad(5, data_root).name == "05_undisturbed_slow_rotation_with_breaks_B"
    repoimu = datasets.repoimu(3, 1, data_root)
    assert (repoimu.reference_offset, repoimu.mag_unit) == ("rotations", "arbitrary")
    ximu, fusion = datasets.ximu(data_root), datasets.fusion(data_root)
    assert (ximu.frame, fusion.frame) == ("NWU", "NWU")
    assert ximu.rate == pytest.approx(256.0, rel=1e-9)
    # their logs start at rest, level, in the northern hemisphere: force up, field down, so z points up as in NWU
    for recording in (ximu, fusion):
        assert recording.acc[:50, 2].mean() > 9.0  # m/s²
        assert recording.mag[:50, 2].mean() < -20.0  # µT
    assert len(datasets.names("repoimu", data_root)) == 7
    assert datasets.names("fusion", data_root) == ("sensor_data",)
