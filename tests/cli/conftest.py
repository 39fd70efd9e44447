"""One simulated recording for all tests of the command line, and a way to run it in this process."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

import northdown as nd
from northdown.cli.main import main

DURATION, RATE = 12.0, 50.0


@dataclass(frozen=True)
class Outcome:
    """What a command gave back."""

    code: int
    out: str
    err: str

    @property
    def error(self) -> str:
        """The only line on standard error, which must be an error with nothing on standard output."""
        assert self.code == 2
        assert self.out == ""
        assert self.err.count("\n") == 1
        assert self.err.startswith("error: ")
        return self.err.strip()


Run = Callable[..., Outcome]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run the command line in this process, 80 columns wide."""
    monkeypatch.setenv("COLUMNS", "80")

    def call(*arguments: object) -> Outcome:
        capsys.readouterr()
        code = main([str(a) for a in arguments])
        return Outcome(code, *capsys.readouterr())

    return call


@pytest.fixture(scope="session")
def recording() -> nd.Recording:
    return dataclasses.replace(nd.simulate(DURATION, rate=RATE, seed=3), name="walk")


@pytest.fixture(scope="session")
def csv(recording: nd.Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recording with its truth."""
    path = tmp_path_factory.mktemp("cli") / "walk.csv"
    nd.write_recording(recording, path)
    return path
