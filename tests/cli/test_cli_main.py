"""Dispatch, exit codes and streams of the command line."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import northdown
from northdown.cli import main as program

COMMANDS = [command.name for command in program.app.registered_commands]


def python(*arguments: str, **options: object) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run([sys.executable, *arguments], capture_output=True, timeout=120, **options)  # type: ignore[call-overload]


def test_help_names_every_command_in_80_columns(run):
    result = run("--help")
    assert result.code == 0
    assert result.err == ""
    assert all(f"  {command} " in result.out for command in COMMANDS)
    commands = result.out.split("Commands:")[1]
    assert "..." not in commands  # no command's line is cut off
    assert max(map(len, result.out.splitlines())) <= 80
    assert run("-h") == result
    assert run().out == result.out


@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_has_help_both_ways(run, command):
    result = run(command, "--help")
    assert result.code == 0
    assert result.err == ""
    assert max(map(len, result.out.splitlines())) <= 80
    assert run(command, "-h") == result


def test_version(run):
    assert run("--version").out == f"northdown {northdown.__version__}\n"


def test_help_is_quick_because_it_loads_nothing_heavy():
    script = (
        "import sys; from northdown.cli.main import main; code = main(['--help']); "
        "heavy = {'numba', 'pandas', 'matplotlib', 'scipy', 'pyarrow', 'h5py', 'rich.table'} & set(sys.modules); "
        "print(sorted(heavy), file=sys.stderr); sys.exit(code)"
    )
    result = python("-c", script)
    assert result.returncode == 0
    assert result.stderr == b"[]\n"


def test_module_runs_like_the_program():
    result = python("-m", "northdown", "--version")
    assert result.returncode == 0
    assert result.stdout.decode() == f"northdown {northdown.__version__}\n"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["estimat"], "estimate"),
        (["--colour"], "--colour"),
        (["info"], "REC"),
        (["info", "a.csv", "b.csv"], "b.csv"),
        (["estimate", "a.csv", "--fram", "ENU"], "--frame"),
        (["estimate", "a.csv", "-e"], "-e"),
        (["estimators", "mahny"], "did you mean 'mahony'?"),
        (["estimate", "a.csv", "-e", "madgwik"], "did you mean 'madgwick'?"),
        (["compare", "a.csv", "-e", "mahony,madgwik"], "did you mean 'madgwick'?"),
        (["estimate", "a.csv", "--max-gap", "soon"], "--max-gap"),
        (["demo", "--duration", "nan"], "--duration"),
        (["demo", "--seed", "1.5"], "--seed"),
    ],
)
def test_usage_error_is_one_line_and_code_2(run, arguments, says):
    assert says in run(*arguments).error


def test_defect_is_one_line_and_code_1(run, monkeypatch):
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr("northdown.simulation.simulate", broken)
    monkeypatch.setattr("northdown.cli.demo.make_folder", Path)
    result = run("demo")
    assert (result.code, result.out) == (1, "")
    assert result.err.count("\n") == 1
    assert "--debug" in result.err
    assert "ZeroDivisionError" in result.err
    shown = run("demo", "--debug")
    assert shown.code == 1
    assert "Traceback" in shown.err
    assert shown.err.endswith(result.err)


def test_debug_shows_where_a_mistake_was_found(run):
    result = run("info", "nothing-there.csv", "--debug")
    assert result.code == 2
    assert "Traceback" in result.err
    assert run("info", "nothing-there.csv").error == result.err.splitlines()[-1]


def test_interrupt_is_code_130(run, monkeypatch):
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("northdown.simulation.simulate", interrupted)
    monkeypatch.setattr("northdown.cli.demo.make_folder", Path)
    result = run("demo")
    assert (result.code, result.out, result.err) == (130, "", "interrupted\n")


def test_closed_pipe_is_quiet(csv):
    command = f"'{sys.executable}' -m northdown info '{csv}' 2>&1 >&3 | cat >&2"
    # standard output is a pipe whose reader is gone
    script = f"exec 3> >(exec true); sleep 0.2; {command}; exit ${{PIPESTATUS[0]}}"
    result = subprocess.run(["bash", "-c", script], capture_output=True, timeout=120)
    assert result.returncode == 141
    assert b"Traceback" not in result.stderr
    assert b"Broken" not in result.stderr


def test_full_disk_is_one_line(csv):
    with open("/dev/full", "wb") as full:
        result = subprocess.run(
            [sys.executable, "-m", "northdown", "info", str(csv)], stdout=full, stderr=subprocess.PIPE, timeout=120
        )
    assert result.returncode == 2
    assert result.stderr.count(b"\n") == 1
    assert b"No space left" in result.stderr


def test_pipe_gets_no_escape_codes_and_only_what_it_can_encode():
    environment = os.environ | {"TERM": "xterm-256color", "PYTHONIOENCODING": "ascii"}
    result = python("-m", "northdown", "estimators", "mahony", env=environment)
    assert result.returncode == 0
    assert b"-p kp=0.74 rad/s    (? 0)" in result.stdout
    assert b"\x1b" not in result.stdout + result.stderr


def test_every_failure_has_its_code():
    explain = program._explain
    assert explain(MemoryError())[0] == 2
    assert explain(PermissionError(13, "Permission denied", "x.csv")) == (2, "error: Permission denied (x.csv)")
    assert explain(BrokenPipeError()) == (141, "")
    assert explain(KeyboardInterrupt()) == (130, "interrupted")
    assert explain(RuntimeError("a"))[0] == 1
