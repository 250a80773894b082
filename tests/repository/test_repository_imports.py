"""Where libraries are imported, and what a start of the program loads."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest
from repository_sources import MODULES, PACKAGE, importers, imports, label, tree

HEAVY = ("casadi", "matplotlib", "pint", "scipy", "xarray", "netCDF4", "control", "pandas")


def loaded(*lines: str) -> set[str]:
    """Return the heavy libraries that some lines load in a fresh interpreter."""
    report = f"print(*[m for m in {HEAVY!r} if m in sys.modules], file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(["import sys", *lines, report])],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return set(done.stderr.split())


def command(*arguments: str) -> tuple[str, ...]:
    """Return the lines of a program that is a command; what it says goes nowhere."""
    return (
        f"sys.argv = ['bywire', *{arguments!r}]",
        "from io import StringIO",
        "from bywire.cli.main import main",
        "stderr, sys.stderr = sys.stderr, StringIO()",
        "try:",
        "    main()",
        "except SystemExit:",
        "    sys.stderr = stderr",
    )


def test_import_loads_no_heavy_library():
    assert loaded("import bywire", "bywire.__version__, dir(bywire)") == set()


@pytest.mark.parametrize("arguments", [["--help"], ["run", "--help"], ["--version"]], ids=" ".join)
def test_help_loads_no_heavy_library(arguments):
    assert loaded(*command(*arguments)) == set()


@pytest.mark.parametrize("experiment", ["hard-braking", "moment-pulses"])
def test_a_run_loads_no_library_but_that_of_symbols(experiment):
    """Loading xarray and SciPy would double the time of a short run."""
    assert loaded(*command("run", experiment)) <= {"casadi"}


def test_a_written_run_loads_those_of_figures_and_files(tmp_path):
    heavy = loaded(*command("run", "hard-braking", "--out", str(tmp_path / "run")))
    assert heavy <= {"casadi", "matplotlib", "netCDF4"}


def test_the_gate_of_loading_can_fail():
    assert loaded("import bywire", "bywire.load") >= {"casadi"}


@pytest.mark.parametrize("library", ["pint", "astropy", "unyt", "quantities"])
def test_no_open_dictionary_of_units_is_used(library):
    """It reads Nm as a yarn count and ma as a thousandth of a year."""
    assert importers(library) == set()


@pytest.mark.parametrize("library", ["matplotlib", "plotly"])
def test_figures_have_one_home(library):
    """Other layers may name a Figure in an annotation, which loads nothing."""
    homes = {Path(path).parts for path in importers(library, typing_too=False)}
    assert all(
        home[0] == "report" or (home[0] == "brakes" and home[2].removesuffix(".py") == "figures")
        for home in homes
    )


@pytest.mark.parametrize("folder", ["core", "plant", "control", "simulation"])
def test_recordings_are_unknown_below_the_bench(folder):
    assert not [path for path in importers("xarray") if path.startswith(f"{folder}/")]


def test_recordings_are_known_in_the_bench():
    assert "bench/recording.py" in importers("xarray")


def test_the_wheel_needs_no_benchmarks():
    assert importers("benchmarks") == set()


@pytest.mark.parametrize("library", ["pickle", "marshal", "shelve", "dill", "cloudpickle", "yaml"])
def test_nothing_reads_formats_that_execute(library):
    assert importers(library) == set()


def test_nothing_is_evaluated():
    for path in MODULES:
        calls = [node.func for node in ast.walk(tree(path)) if isinstance(node, ast.Call)]
        names = {function.id for function in calls if isinstance(function, ast.Name)}
        found = names & {"eval", "exec", "compile", "__import__", "breakpoint", "input"}
        assert not found, label(path)


def test_imports_are_found_inside_functions_and_for_typing():
    module = tree(PACKAGE / "core" / "errors.py")
    assert "inspect" in set(imports(module))
    assert "inspect" in set(imports(module, typing_too=False))
    assert "typing" in set(imports(module))
