"""Figures as files: complete or absent; matplotlib only where it is needed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pytest

from northdown import plots
from northdown.errors import InputError, MissingDependencyError
from northdown.orientation import Orientation

pytest.importorskip("matplotlib")

from matplotlib.figure import Figure


def small() -> Figure:
    quat = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1))
    return plots.quaternion(Orientation(np.arange(3.0), quat))


@pytest.mark.parametrize(("suffix", "start"), [(".png", b"\x89PNG"), (".pdf", b"%PDF"), (".SVG", b"<?xml")])
def test_save_writes_each_format(tmp_path: Path, suffix: str, start: bytes) -> None:
    path = tmp_path / f"figure{suffix}"
    assert plots.save(small(), path) == path
    assert path.read_bytes().startswith(start)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_save_refuses_what_it_cannot_do(tmp_path: Path) -> None:
    figure = small()
    with pytest.raises(InputError, match=r"ending in .png, .pdf or .svg, got 'figure.jpg'"):
        plots.save(figure, tmp_path / "figure.jpg")
    with pytest.raises(InputError, match="a folder that exists"):
        plots.save(figure, tmp_path / "nowhere" / "figure.png")
    (tmp_path / "taken.png").mkdir()
    with pytest.raises(InputError, match="the name of a file to write, got the folder"):
        plots.save(figure, tmp_path / "taken.png")


def test_a_failed_save_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "figure.png"
    path.write_bytes(b"old")
    figure = small()

    def broken(file: BinaryIO, **_: object) -> None:
        file.write(b"half")
        raise RuntimeError("renderer")

    monkeypatch.setattr(figure, "savefig", broken)
    with pytest.raises(RuntimeError):
        plots.save(figure, path)
    assert path.read_bytes() == b"old"
    assert len(list(tmp_path.iterdir())) == 1


def test_matplotlib_is_loaded_late_and_pyplot_never() -> None:
    code = (
        "import sys, numpy as np, northdown.plots as p; from northdown.recording import Recording; "
        "assert 'matplotlib' not in sys.modules; "
        "p.sensors(Recording(np.arange(5.0), np.zeros((5, 3)))).canvas.draw(); "
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_without_matplotlib_the_message_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'northdown\[plots\]'"):
        small()
