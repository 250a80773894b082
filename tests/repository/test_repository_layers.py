"""Imports run downward only: the contract in ``.importlinter`` holds, and can fail."""

from __future__ import annotations

import ast
import configparser
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from repository_sources import MODULES, PACKAGE, ROOT, imports, label, offenders, tree

CONTRACT = ROOT / ".importlinter"
SYMBOLIC = ("casadi", "numpy", "scipy", "xarray", "pint", "matplotlib")


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the linter on the package that lies in a folder."""
    code = "import sys; from importlinter.cli import lint_imports_command as run; run()"
    return subprocess.run(
        [sys.executable, "-c", code, "--config", str(CONTRACT), "--no-cache"],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder), "PYTHONIOENCODING": "utf-8"},
    )


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a copy of the package."""
    folder = tmp_path_factory.mktemp("copy")
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, folder / "bywire", ignore=ignored)
    return folder


SEEDED = {  # imports that must not be, by the file that has them
    "core/errors.py": "from bywire.bench.bench import Bench",
    "plant/dc_motor.py": "from bywire.simulation.run import simulate",
    "control/current_pi.py": "import bywire.plant.dc_motor",
    "bench/bench.py": "def late():\n    from bywire.report.drawing import save_figure",
    "report/page.py": "from bywire.cli import main",
    "bench/running.py": "from bywire.brakes.wedge.model import WedgeBrake",
    "cli/main.py": "from bywire.brakes import wedge",
    "brakes/wedge/model.py": "from bywire.brakes.motorcycle import ecu",
}
CIRCLES = {
    "bench/experiment.py": "def late():\n    from bywire.bench.running import run",
    "core/signals.py": "from bywire.core.assembly import Assembly",
}


@contextmanager
def seeded(copy: Path, lines: dict[str, str]) -> Iterator[None]:
    """Add lines to files of the copy."""
    before = {copy / "bywire" / module: "" for module in lines}
    for path, line in zip(before, lines.values(), strict=True):
        before[path] = path.read_text(encoding="utf-8")
        path.write_text(f"{before[path]}\n\n{line}\n", encoding="utf-8")
    try:
        yield
    finally:
        for path, text in before.items():
            path.write_text(text, encoding="utf-8")


def test_contract_can_fail(copy):
    """That it is kept, the recipe of the tests asks the linter itself."""
    with seeded(copy, SEEDED | CIRCLES):
        done = lint(copy)
    assert done.returncode == 1
    assert "BROKEN" in done.stdout
    named = [module.removesuffix(".py").replace("/", ".") for module in SEEDED]
    assert [name for name in named if f"bywire.{name} -> " not in done.stdout] == []
    # Which import would have to go is the linter's choice; the package of the circle is not.
    packages = [module.rpartition("/")[0].replace("/", ".") for module in CIRCLES]
    assert [
        each for each in packages if f"cycles are allowed in bywire.{each}" not in done.stdout
    ] == []


def test_folder_without_a_layer_is_refused(copy):
    stray = copy / "bywire" / "helpers"
    stray.mkdir()
    (stray / "__init__.py").write_text('"""No layer."""\n', encoding="utf-8")
    try:
        done = lint(copy)
    finally:
        shutil.rmtree(stray)
    assert done.returncode == 1
    assert "helpers" in done.stdout


def test_every_folder_is_a_package():
    """The linter does not look into folders without ``__init__.py``."""
    folders = {path.parent for path in MODULES}
    assert [label(f) for f in sorted(folders) if not (f / "__init__.py").is_file()] == []


def test_every_layer_of_the_contract_exists():
    contract = configparser.ConfigParser()
    contract.read(CONTRACT, encoding="utf-8")
    layers = contract["importlinter:contract:layers"]["layers"].replace("|", "\n").split()
    assert contract["importlinter:contract:layers"]["exhaustive"] == "true"
    there = {path.stem for path in PACKAGE.glob("*.py")}
    there |= {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert set(layers) <= there - {"__init__"}


def ranks() -> dict[str, int]:
    """Return how deep every room lies: what is below has the larger number."""
    contract = configparser.ConfigParser()
    contract.read(CONTRACT, encoding="utf-8")
    layers = contract["importlinter:contract:layers"]["layers"].strip().splitlines()
    return {room.strip(): k for k, line in enumerate(layers) for room in line.split("|")}


NAMED = {
    "src/bywire/core/brake.py": "where our brakes stand, which the registry finds like anybody's",
    "src/bywire/core/sources.py": "rooms whose files shape models, of which it loads none",
    "src/bywire/bench/computation.py": "rooms whose definitions count, of which it loads none",
    "src/bywire/api/new.py": "files that are copied and not run",
}


def named_above(room: str, module: ast.Module) -> list[str]:
    """Return the modules of rooms above that a module of a room names in a text.

    By its name it could be loaded where the linter does not see it.
    """
    depth = ranks()
    texts = [n.value for n in ast.walk(module) if isinstance(n, ast.Constant)]
    dotted = [t for t in texts if isinstance(t, str) and re.fullmatch(r"bywire(\.\w+)+(:\w+)?", t)]
    return [text for text in dotted if depth.get(text.split(".")[1], 99) < depth[room]]


def test_no_text_names_a_room_above() -> None:
    rooms = {path: path.relative_to(PACKAGE).parts[0] for path in MODULES}
    named = {
        label(path): above
        for path, room in rooms.items()
        if room in ranks() and (above := named_above(room, tree(path)))
    }
    assert named.keys() == NAMED.keys()


def test_the_gate_of_named_rooms_can_fail() -> None:
    text = "home = 'bywire.export.controller.in_the_loop:double'"
    assert named_above("simulation", ast.parse(text)) == [text[8:-1]]
    assert named_above("api", ast.parse(text)) == []


def equations() -> list[Path]:
    """Return the files of equations: elements, laws, and what calls ``core.ops`` in a brake."""
    folders = ("plant", "control", "brakes/*/elements", "brakes/*/laws")
    listed = {path for folder in folders for path in PACKAGE.glob(f"{folder}/*.py")}
    calling = re.compile(r"^from bywire\.core(?: import .*\bops\b|\.ops )", re.MULTILINE)
    for path in PACKAGE.glob("brakes/*/**/*.py"):
        room = path.relative_to(PACKAGE).parts[2]
        if room != "methods" and calling.search(path.read_text("utf-8")):
            listed.add(path)
    return sorted(listed)


def numeric(module: ast.Module) -> list[str]:
    """Return the numeric libraries that a module imports."""
    return sorted({name.split(".")[0] for name in imports(module)} & {*SYMBOLIC})


def test_equations_know_no_library():
    """Equations call ``core.ops``, so that they run on floats, symbols and quantities alike."""
    files = {label(path) for path in equations()}
    assert {"src/bywire/plant/dc_motor.py", "src/bywire/brakes/motorcycle/ecu.py"} <= files
    assert offenders(numeric, equations()) == {}


def test_the_gate_of_libraries_can_fail():
    assert numeric(ast.parse("def f():\n    from scipy.linalg import expm")) == ["scipy"]
