"""``northdown reproduce``: a publication's tables and figures made again, beside what it prints."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from northdown.cli import console
from northdown.cli.numbers import read_count
from northdown.cli.output import make_folder
from northdown.errors import InputError, MissingDependencyError, expected
from northdown.io.atomic import atomic_write

if TYPE_CHECKING:
    from northdown.evaluation.kao2006 import Results
    from northdown.evaluation.printed_table import PrintedTable

_STUDIES: Final = {
    "kao2006": "C.-F. Kao, M.S. thesis, National Chiao Tung University, 2006: orientation without gyroscopes",
    "jia2014": "R.-C. Jia, Optics and Precision Engineering 22(12), 2014: Euler-angle UKF and quaternion EKF",
}


def reproduce(
    study: Annotated[str, typer.Argument(metavar="STUDY", help=f"One of {', '.join(_STUDIES)}.")],
    out: Annotated[
        str | None,
        typer.Option("--out", "-o", metavar="DIR", help="Folder to write to; STUDY-output when not given."),
    ] = None,
    seed: Annotated[str, typer.Option("--seed", metavar="N", help="Of all noise.")] = "0",
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw the figures too.")] = True,
) -> None:
    """Make a publication's tables and figures again.

    kao2006: gyro-free orientation from coplanar accelerometers. jia2014: Euler-angle UKF against quaternion EKF.
    """
    if study not in _STUDIES:
        raise InputError(expected(f"a study out of {', '.join(_STUDIES)}", repr(study)))
    number = read_count("--seed", seed)
    folder = make_folder(f"{study}-output" if out is None else out)
    if study == "jia2014":
        _jia2014(folder, number)
    else:
        _kao2006(folder, number, figures)


def _jia2014(folder: Path, seed: int) -> None:
    from northdown.evaluation import reproduce_j14_table as j14

    print(f"{_STUDIES['jia2014']}\n")
    with console.steps(j14.STEPS) as tell:
        table = j14.table_1(seed, progress=tell)
    _show(table)
    _write_tables(folder, _STUDIES["jia2014"], [f"Seed {seed}."], [table])
    _written(folder, ["report.md", "table-1.csv"])


def _kao2006(folder: Path, seed: int, figures: bool) -> None:
    from northdown.evaluation import kao2006
    from northdown.evaluation.kao2006.figures import COUNT

    stated = kao2006.DOCUMENTED.stated()
    print(f"{_STUDIES['kao2006']}\n\nConstants (all but the first are not printed in K06):")
    console.facts((f"  {name}", text) for name, text in stated)
    drawn: list[tuple[str, str]] = []
    with console.steps(kao2006.STEPS + (COUNT if figures else 0)) as tell:
        results = kao2006.reproduce(seed, progress=tell)
        if figures:
            drawn = _draw(folder, results, tell)
    tables = results.tables()
    for table in tables:
        if table.key != "claims":
            _show(table)
    print("\nWhat K06 claims")
    for claim in results.claims:
        verdict = "held" if claim.held else "DID NOT HOLD"
        console.paragraph(f"- {claim.text} (section {claim.source}): {verdict}. {claim.finding}.")
    head = [f"Seed {seed}. Constants, of which all but the first are not printed in K06:", ""]
    head += [f"- {name}: {text}" for name, text in stated]
    _write_tables(folder, _STUDIES["kao2006"], head, tables, drawn)
    names = ["report.md", *(f"{table.key}.csv" for table in tables)]
    _written(folder, [*names, f"figures/ ({len(drawn)} figures)"] if drawn else names)


def _draw(folder: Path, results: Results, tell: Callable[[str], None]) -> list[tuple[str, str]]:
    """Draw the figures; their titles and the paths of their files in the folder."""
    from northdown import plots

    done = []
    try:
        for made in plots.kao2006(results):
            tell(f"figure {made.number}")
            chapter, number = made.number.split(".")
            name = f"figures/figure-{chapter}.{int(number):02d}.png"
            make_folder(str(folder / "figures"))
            plots.save(made.figure, folder / name, dpi=100.0)
            done.append((made.title, name))
    except MissingDependencyError as problem:
        console.warn(f"warning: no figures: {problem}")
    return done


def _show(table: PrintedTable) -> None:
    print(f"\n{table.title}\n")
    console.table(table.header, table.rows, left=table.left)
    for note in table.notes:
        console.paragraph(note)


def _write_tables(
    folder: Path,
    title: str,
    head: Iterable[str],
    tables: Iterable[PrintedTable],
    figures: Iterable[tuple[str, str]] = (),
) -> None:
    """Write each table as CSV, and all of them with the figures as one page in Markdown."""
    parts = [f"# {title}\n", "\n".join(head) + "\n"]
    for table in tables:
        _write(folder / f"{table.key}.csv", table.csv())
        parts.append(table.markdown())
    drawn = [f"### {caption}\n\n![{caption}]({name})\n" for caption, name in figures]
    _write(folder / "report.md", "\n".join([*parts, *(["## Figures\n", *drawn] if drawn else [])]))


def _write(path: Path, text: str) -> None:
    with atomic_write(path) as file:
        file.write(text.encode())


def _written(folder: Path, names: Iterable[str]) -> None:
    print(f"\nWritten to {console.one_line(str(folder))}:")
    console.facts((f"  {name}", "") for name in names)
