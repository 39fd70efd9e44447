"""Compiled kernels on disk: found again by another process, never stale, never an obstacle."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import northdown
from northdown.kernels import jit

# A kernel with its helper in another file: numba's own cache would not see an edit of the helper.
HELPER = """
from northdown.kernels.jit import inline

@inline
def twice(x):
    return 2.0 * x
"""
KERNEL = """
from northdown.kernels.jit import compiled
from northdown.kernels.probe_helper import twice

def make():
    def kernel(x):
        return twice(x) + 1.0
    return kernel
"""
CALL = """
from northdown.kernels.jit import compiled
from northdown.kernels.probe import make
print("result", compiled(make(), "probe", "(f8,)")(10.0))
"""
TRIPLE = HELPER.replace("2.0 * x", "3.0 * x")


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of what compiles kernels, with the probe kernel in it, for other processes to run."""
    source = Path(northdown.__file__).parent
    target = tmp_path / "lib" / "northdown"
    (target / "kernels").mkdir(parents=True)
    (target / "__init__.py").touch()
    shutil.copy(source / "kernels" / "jit.py", target / "kernels")
    (target / "kernels" / "__init__.py").touch()
    (target / "kernels" / "probe_helper.py").write_text(HELPER)
    (target / "kernels" / "probe.py").write_text(KERNEL)
    return target


def start(package: Path, code: str = CALL) -> subprocess.Popen[str]:
    clean = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    return subprocess.Popen(
        [sys.executable, "-W", "error", "-c", code],
        env=clean | {"PYTHONPATH": str(package.parent), "NUMBA_DEBUG_CACHE": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=package.parent,
    )


def finish(process: subprocess.Popen[str]) -> str:
    output, _ = process.communicate(timeout=120)
    assert process.returncode == 0, output
    return output


def files(folder: Path) -> set[str]:
    return {p.name for p in folder.rglob("probe.*.nb*")}


def test_processes_share_the_cache_until_a_helper_is_edited(package):
    racing = [start(package), start(package)]
    assert all("result 21.0" in finish(p) for p in racing)
    saved = files(package)
    assert len(saved) == 2

    later = finish(start(package))
    assert "result 21.0" in later
    assert "data loaded" in later
    assert "data saved" not in later

    (package / "kernels" / "probe_helper.py").write_text(TRIPLE)
    # more lines above the kernel: numba itself would begin new files, as it names them by line number
    (package / "kernels" / "probe.py").write_text("# a comment\n\n" + KERNEL)
    edited = finish(start(package))
    assert "result 31.0" in edited
    assert "data loaded" not in edited
    assert files(package) == saved


def test_edit_after_import_is_not_saved_as_if_it_had_been_compiled(package):
    helper = package / "kernels" / "probe_helper.py"
    *imports, call = CALL.strip().splitlines()
    edit = f"import pathlib; pathlib.Path({str(helper)!r}).write_text({TRIPLE!r})"
    output = finish(start(package, "\n".join([*imports, edit, call])))
    assert "result 21.0" in output  # this process had loaded the helper as it was
    assert not files(package)


class Place:
    """A folder with a file that defines a kernel, and the folder that the user's caches go to."""

    def __init__(self, root: Path) -> None:
        self.code, self.home = root / "code", root / "home"
        self.code.mkdir()
        self.home.mkdir()
        (self.code / "probe.py").write_text("def kernel(x):\n    return 2.0 * x + 1.0\n")

    def run(self) -> int:
        """Load and compile the kernel as a new process would; how often the cache was hit."""
        spec = importlib.util.spec_from_file_location("probe", self.code / "probe.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        kernel = jit.compiled(module.kernel, "probe", "(f8,)")
        assert kernel(10.0) == 21.0
        return sum(kernel.stats.cache_hits.values())


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Place:
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    # an edit of the package while this runs is not the matter here
    monkeypatch.setattr(jit, "source_hash", lambda: jit._SOURCES)
    place = Place(tmp_path)
    for name in ("HOME", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.setenv(name, str(place.home))
    return place


def test_kernel_is_compiled_once(place):
    assert [place.run(), place.run()] == [0, 1]
    assert len(files(place.code)) == 2


@pytest.mark.parametrize("damage", ["empty", "no pickle", "half"])
@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_damaged_file_is_compiled_anew_and_mended(place, suffix, damage):
    place.run()
    (file,) = place.code.rglob(f"probe.*.{suffix}")
    whole = file.read_bytes()
    file.write_bytes({"empty": b"", "no pickle": b"no pickle", "half": whole[: len(whole) // 2]}[damage])
    assert [place.run(), place.run()] == [0, 1]


def test_folder_that_takes_no_files_uses_the_users_cache(place):
    # A plain file where the folder would be: this holds for a superuser too, whom permissions do not stop.
    (place.code / "__pycache__").write_text("not a folder")
    assert [place.run(), place.run()] == [0, 1]
    assert len(files(place.home)) == 2


def test_without_any_place_for_files_it_warns_and_still_works(place):
    (place.code / "__pycache__").write_text("not a folder")
    place.home.rmdir()
    place.home.write_text("not a folder either")
    with pytest.warns(RuntimeWarning, match="not kept between runs"):
        place.run()


def test_full_disk_warns_and_still_works(place, monkeypatch):
    def full(*args: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile.save", full)
    with pytest.warns(RuntimeWarning, match="No space left"):
        place.run()
    assert not files(place.code)
