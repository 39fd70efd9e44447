"""Every command and every line of Python in the README works, in its order."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

README = Path(__file__).parent.parent / "README.md"


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README.read_text(), re.M | re.S)


def run(argv: list[str], folder: Path) -> str:
    done = subprocess.run(argv, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, f"{argv}:\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.mark.slow
def test_command_lines(tmp_path):
    lines = [line for block in blocks("bash") for line in block.splitlines() if line.strip()]
    assert len(lines) >= 5
    for line in lines:
        name, *arguments = line.split()
        assert name == "northdown"
        assert run([sys.executable, "-m", "northdown", *arguments], tmp_path).strip()
    for made in ("orientation.parquet", "angles.png", "demo-output/recording.csv"):
        assert (tmp_path / made).stat().st_size > 1000


def test_python(tmp_path):
    program = "\n".join(blocks("python"))
    assert "inclination" in run([sys.executable, "-W", "error", "-c", program], tmp_path)


def test_make_targets_exist_and_console_lines_are_those_of_ci():
    makefile = (README.parent / "Makefile").read_text()
    targets = set(re.findall(r"`?make (\w+)`?", README.read_text()))
    assert {"demo", "test", "lint", "bench"} <= targets
    for target in targets:
        assert re.search(rf"^{target}:", makefile, re.M), f"no make {target}"


def test_every_estimator_is_listed():
    from northdown.estimators import registry

    listed = re.findall(r"^\| `([\w-]+)` \|", README.read_text(), re.M)
    assert sorted(listed) == sorted(registry())
