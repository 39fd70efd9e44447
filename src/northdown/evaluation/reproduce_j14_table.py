"""J14's table 1 beside what the simulated board gives."""

from __future__ import annotations

from collections.abc import Callable

from northdown.evaluation import reproduce_j14 as j14
from northdown.evaluation.printed_table import PrintedTable

STEPS = 4
"""How often `table_1` calls `progress`."""


def table_1(
    seed: int = 0, *, duration: float = 7200.0, progress: Callable[[str], object] | None = None
) -> PrintedTable:
    """Simulate the board, run the filters, and set their errors beside J14's.

    Parameters
    ----------
    seed : int
        Of the sensors' noise.
    duration : float
        s; the first minute is left out.
    progress : callable, optional
        Called with what comes next.
    """
    tell = progress or (lambda _: None)
    tell("J14's board")
    recording = j14.board(duration, seed)
    found = {}
    for name, chosen in j14.filters().items():
        tell(name)
        found[name] = j14.statistics(j14.angle_errors(chosen.run(recording), recording))
    rows = []
    for angle in j14.ANGLES:
        for name, rows_of in found.items():
            ours, theirs = rows_of[angle], j14.PUBLISHED[angle].get(name)
            cells = [f"{v:.4f}" for v in (ours.std, ours.bias, ours.error)]
            printed = [f"{v:.4f}" for v in theirs] if theirs else [""] * 3
            ratio = f"{ours.error / theirs[2]:.2f}" if theirs else ""
            rows.append((angle, name, *printed, *cells, ratio))
    header = (
        "angle",
        "filter",
        *(f"{a} {b}" for a in ("J14", "ours") for b in ("std", "bias", "error")),
        "error ratio",
    )
    note = "Degrees. The sensors are simulated from their data sheets; J14's recording is not public."
    return PrintedTable("table-1", f"J14 table 1: {duration:g} s at rest", header, rows, [note], 2)
