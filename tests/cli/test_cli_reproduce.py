"""``northdown reproduce``."""

from __future__ import annotations

import csv
import functools
import os

import pytest

from northdown import plots
from northdown.evaluation import kao2006, reproduce_j14_table


@pytest.fixture
def quick(monkeypatch):
    """The study with few runs, made once."""
    monkeypatch.setattr(kao2006, "reproduce", lambda seed, progress: results(seed))


_REPRODUCE = kao2006.reproduce


@functools.cache
def results(seed):
    return _REPRODUCE(seed, runs=2, compared=4)


def few_figures(monkeypatch, count=3):
    real = plots.kao2006

    def first(found):
        for k, made in enumerate(real(found)):
            if k == count:
                return
            yield made

    monkeypatch.setattr(plots, "kao2006", first)


def test_tables_are_printed_and_written(run, tmp_path, quick):
    folder = tmp_path / "new" / "out"
    outcome = run("reproduce", "kao2006", "--out", folder, "--no-figures")
    assert (outcome.code, outcome.err) == (0, "")
    tables = results(0).tables()
    assert set(os.listdir(folder)) == {"report.md", *(f"{t.key}.csv" for t in tables)}
    report = (folder / "report.md").read_text(encoding="utf-8")
    for table in tables:
        assert table.markdown() in report
        with open(folder / f"{table.key}.csv", encoding="utf-8", newline="") as file:
            assert list(csv.reader(file)) == [list(table.header), *map(list, table.rows)]
        assert table.title in outcome.out
    for name, text in kao2006.DOCUMENTED.stated():
        assert f"- {name}: {text}" in report
        assert text in outcome.out
    assert "0.0604" in outcome.out or "0.0603691" in outcome.out
    assert "DID NOT HOLD" in outcome.out
    before = report
    assert run("reproduce", "kao2006", "--out", folder, "--no-figures").code == 0
    assert (folder / "report.md").read_text(encoding="utf-8") == before


def test_figures_are_drawn_and_linked(run, tmp_path, quick, monkeypatch):
    few_figures(monkeypatch)
    outcome = run("reproduce", "kao2006", "-o", tmp_path)
    assert (outcome.code, outcome.err) == (0, "")
    names = ["figure-3.04.png", "figure-3.05.png", "figure-3.06.png"]
    assert sorted(os.listdir(tmp_path / "figures")) == names
    report = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert all(f"(figures/{name})" in report for name in names)


def test_interrupted_leaves_nothing_half_written(run, tmp_path, quick, monkeypatch):
    few_figures(monkeypatch)
    real, drawn = plots.save, []

    def stop(figure, path, **options):
        drawn.append(path)
        if len(drawn) == 2:
            # while the second file is open
            monkeypatch.setattr(type(figure), "savefig", _interrupt)
        return real(figure, path, **options)

    monkeypatch.setattr(plots, "save", stop)
    outcome = run("reproduce", "kao2006", "-o", tmp_path)
    assert outcome.code == 130
    assert outcome.err.strip() == "interrupted"
    assert os.listdir(tmp_path) == ["figures"]
    assert os.listdir(tmp_path / "figures") == ["figure-3.04.png"]


def _interrupt(figure, file, **options):
    file.write(b"half")
    raise KeyboardInterrupt


def test_j14_table(run, tmp_path, monkeypatch):
    monkeypatch.setattr(reproduce_j14_table, "table_1", functools.partial(reproduce_j14_table.table_1, duration=90.0))
    outcome = run("reproduce", "jia2014", "-o", tmp_path, "--seed", "3")
    assert (outcome.code, outcome.err) == (0, "")
    assert set(os.listdir(tmp_path)) == {"report.md", "table-1.csv"}
    with open(tmp_path / "table-1.csv", encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    assert [row[:2] for row in rows] == [
        [a, f] for a in ("pitch", "roll", "heading") for f in ("EKF", "UKF", "EKF without bias")
    ]
    first = dict(zip(header, rows[0], strict=True))
    assert first["J14 std"] == "0.0312"
    assert float(first["error ratio"]) == pytest.approx(float(first["ours error"]) / 0.0221, abs=0.01)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nonsense",), "a study out of kao2006, jia2014"),
        (("kao2006", "--seed", "-1"), "--seed"),
        (("kao2006", "--seed", "many"), "'many'"),
        ((), "study"),
    ],
)
def test_mistakes(run, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert words in run("reproduce", *arguments).error.lower()
    assert not os.listdir(tmp_path)


def test_folder_that_is_a_file(run, tmp_path):
    (tmp_path / "taken").write_text("x")
    assert "--out" in run("reproduce", "kao2006", "--out", tmp_path / "taken").error
