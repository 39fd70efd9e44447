"""The program ``northdown``: finds the command, and turns every failure into one line and an exit code."""

from __future__ import annotations

import contextlib
import functools
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from typing import Annotated, Any

import typer

from northdown import __version__
from northdown.cli import console
from northdown.cli.allan import allan
from northdown.cli.arrays import arrays
from northdown.cli.calibrate import calibrate
from northdown.cli.compare import compare
from northdown.cli.consistency import consistency
from northdown.cli.demo import demo
from northdown.cli.estimate import estimate
from northdown.cli.estimators import estimators
from northdown.cli.info import info
from northdown.cli.navigate import navigate
from northdown.cli.observability import observability
from northdown.cli.reproduce import reproduce
from northdown.cli.simulate import simulate
from northdown.errors import NorthdownError

DEFECT, MISTAKE, INTERRUPTED, BROKEN_PIPE = 1, 2, 130, 141

# typer names this class in public only through its subclass.
_UsageError: type[Exception] = typer.BadParameter.__bases__[0]

app = typer.Typer(
    name="northdown",
    # Plain text reads the same on a screen, in a pipe and without colour.
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"northdown {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def program(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
    debug: Annotated[
        bool, typer.Option("--debug", help="Show where an error was raised; anywhere on the line.")
    ] = False,
) -> None:
    """Attitude and heading from inertial and magnetic sensors.

    New here? Run 'northdown demo', then 'northdown info' on a recording of your own.
    """
    if context.invoked_subcommand is None:
        print(context.get_help())


def _stoppable(command: Callable[..., None]) -> Callable[..., None]:
    """Make Ctrl-C and a closed pipe end a command with their own exit codes, whatever typer makes of them."""

    @functools.wraps(command)
    def run(**values: Any) -> None:
        try:
            command(**values)
            sys.stdout.flush()
        except KeyboardInterrupt:
            raise typer.Exit(INTERRUPTED) from None
        except BrokenPipeError:
            raise typer.Exit(BROKEN_PIPE) from None

    return run


_COMMANDS = (
    info,
    estimate,
    navigate,
    compare,
    consistency,
    observability,
    estimators,
    calibrate,
    allan,
    simulate,
    arrays,
    reproduce,
    demo,
)
for _command in _COMMANDS:
    app.command(_command.__name__)(_stoppable(_command))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        Without the program's name; those of the process when not given.

    Returns
    -------
    int
        Exit code: 0 success, 1 a defect, 2 a mistake in data or command, 130 interrupted.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in given
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, OSError, ValueError):
            stream.reconfigure(errors="replace")  # type: ignore[union-attr]
    try:
        code = _run([a for a in given if a != "--debug"])
        sys.stdout.flush()
    except (Exception, KeyboardInterrupt) as problem:
        if debug:
            traceback.print_exception(problem)
        code, line = _explain(problem)
        if line:
            _last_words(line)
    else:
        if code == INTERRUPTED:
            _last_words("interrupted")
    if code == BROKEN_PIPE:
        _forget_output()
    return code


def _run(arguments: list[str]) -> int:
    code = typer.main.get_command(app).main(args=arguments, prog_name="northdown", standalone_mode=False)
    return code if isinstance(code, int) else 0


def _explain(problem: BaseException) -> tuple[int, str]:
    """Exit code and last line for whatever was raised."""
    if isinstance(problem, NorthdownError):
        return MISTAKE, f"error: {problem}"
    if isinstance(problem, _UsageError):
        return MISTAKE, f"error: {_usage(problem)}"
    if isinstance(problem, BrokenPipeError):
        return BROKEN_PIPE, ""
    if isinstance(problem, (KeyboardInterrupt, typer.Abort)):
        return INTERRUPTED, "interrupted"
    if isinstance(problem, MemoryError):
        return MISTAKE, "error: expected enough memory, got too little; cut the recording with --start and --stop"
    if isinstance(problem, OSError):
        _forget_output()
        where = f" ({problem.filename})" if problem.filename else ""
        return MISTAKE, f"error: {problem.strerror or type(problem).__name__}{where}"
    what = f"{type(problem).__name__}: {problem}"
    return DEFECT, f"error: a defect of northdown, please report it ({what}); --debug shows where"


def _usage(problem: Any) -> str:
    """What is wrong with the command line, and where to look it up."""
    message = str(problem.format_message()).strip().rstrip(".")
    message = message[:1].lower() + message[1:]
    context = problem.ctx
    command = context.command_path if context is not None else "northdown"
    return f"{message}; see '{command} --help'"


def _last_words(line: str) -> None:
    with contextlib.suppress(OSError):
        console.warn(line)


def _forget_output() -> None:
    """Point standard output to nowhere, so that Python does not complain of it when it ends."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


if __name__ == "__main__":
    raise SystemExit(main())
