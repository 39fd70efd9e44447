"""The shape of the package: who may import whom, what importing costs, and what must not occur in the source."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import northdown

ROOT = Path(northdown.__file__).parent
FILES = sorted(ROOT.rglob("*.py"))

# Each part may import from those before it, and from itself.
# fmt: off
LAYERS = [
    "errors", "_validation", "kernels", "frames", "orientation", "fields", "arrays", "checks", "recording", "io",
    "datasets", "estimators", "navigation", "calibration", "simulation", "evaluation", "plots", "report", "live",
    "cli",
]
# fmt: on

# Reading with these runs what a file holds.
UNSAFE = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "marshal", "shelve"}


def module_name(file: Path) -> str:
    parts = file.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def layer(module: str) -> str:
    """Part of the package that a module belongs to."""
    return module.split(".")[1]


def is_module(name: str) -> bool:
    path = ROOT.parent.joinpath(*name.split("."))
    return path.with_suffix(".py").is_file() or path.is_dir()


def imports(file: Path) -> Iterator[tuple[int, str]]:
    """Line and name of each northdown module that a file imports, in functions and for type checking too."""
    package = module_name(file).split(".")
    if file.name != "__init__.py":
        package = package[:-1]
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            start = ".".join([*base, *([node.module] if node.module else [])])
            names = [f"{start}.{a.name}" if is_module(f"{start}.{a.name}") else start for a in node.names]
        else:
            continue
        yield from ((node.lineno, n) for n in names if n.split(".")[0] == "northdown")


def test_every_module_has_its_place() -> None:
    parts = {layer(module_name(f)) for f in FILES if f.parent != ROOT or f.name not in ("__init__.py", "__main__.py")}
    assert parts <= set(LAYERS)


@pytest.mark.parametrize("file", FILES, ids=module_name)
def test_imports_only_downward(file: Path) -> None:
    if file.parent == ROOT and file.name in ("__init__.py", "__main__.py"):
        pytest.skip("the entrance shows everything")
    here = LAYERS.index(layer(module_name(file)))
    upward = [
        f"line {line}: {name}"
        for line, name in imports(file)
        if name != "northdown" and LAYERS.index(layer(name)) > here
    ]
    assert not upward


def test_the_import_finder_sees_all_forms() -> None:
    # the test above would pass on anything if this found nothing
    found = [name for _, name in imports(ROOT / "recording.py")]
    assert {"northdown.checks", "northdown.errors", "northdown.orientation"} <= set(found)
    inside = [name for _, name in imports(ROOT / "checks" / "__init__.py")]
    assert "northdown.checks.time" in inside  # from northdown.checks import time


def unsafe(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and reason of what the source must not hold."""
    for node in ast.walk(tree):
        match node:
            case ast.Assert():
                yield node.lineno, "assert, which -O removes"
            case ast.Call(func=ast.Name(id="eval" | "exec" as name)):
                yield node.lineno, name
            case ast.keyword(arg="allow_pickle", value=value) if ast.unparse(value) != "False":
                yield value.lineno, "allow_pickle"
            case ast.Import(names=names) if UNSAFE & {a.name.split(".")[0] for a in names}:
                yield node.lineno, "unsafe import"
            case ast.ImportFrom(module=str(module)) if module.split(".")[0] in UNSAFE:
                yield node.lineno, "unsafe import"


def test_the_search_finds_what_it_looks_for() -> None:
    lines = ["assert 1", "eval('1')", "f(allow_pickle=True)", "import os, pickle", "from joblib import load"]
    harmless = ["f(allow_pickle=False)", "x.eval()", "import picklejar"]
    found = {line for line, _ in unsafe(ast.parse("\n".join(lines + harmless)))}
    assert found == set(range(1, len(lines) + 1))


@pytest.mark.parametrize("file", FILES, ids=module_name)
def test_nothing_unsafe_in_the_source(file: Path) -> None:
    found = [f"line {line}: {what}" for line, what in unsafe(ast.parse(file.read_text(encoding="utf-8")))]
    assert not found


def modules_after(code: str) -> set[str]:
    """Names of all modules loaded in a new process that has run `code`."""
    script = f"import sys\n{code}\nprint('\\n' + '\\n'.join(['LOADED', *sys.modules]))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=120)
    return set(done.stdout.split("LOADED\n")[1].split())


def test_importing_is_cheap() -> None:
    loaded = modules_after("import northdown")
    assert "northdown" in loaded
    assert not {"numba", "pandas", "matplotlib", "scipy", "pyarrow", "h5py", "pooch"} & loaded


@pytest.mark.skipif(not (ROOT / "cli" / "main.py").exists(), reason="no command line yet")
def test_help_is_cheap() -> None:
    loaded = modules_after("from northdown.cli.main import main\ncode = main(['--help'])\nif code: sys.exit(code)")
    assert "northdown.cli.main" in loaded
    assert not {"numba", "pandas", "matplotlib"} & loaded
