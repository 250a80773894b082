"""One declaration defines the command, form, public name, completion and reference."""

from __future__ import annotations

import importlib
import inspect
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import bywire
from bywire.cli import app, main
from bywire.core import callers
from bywire.core.errors import ParameterError
from bywire.server import task
from bywire.server.contents import Contents
from bywire.server.exchange import RefusedError
from bywire.server.pages import index_page, task_page
from bywire.server.place import Place
from bywire.usecases import use_cases
from bywire.usecases.declare import DECLARED

sys.path.insert(0, str(Path(__file__).parents[2] / "docs"))

from site_pages import commands, python_names

SUMMARY = "Count the letters of a loop's name."


@pytest.fixture(autouse=True)
def declared(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Register the use case, and remove it after the test."""
    monkeypatch.setattr(callers, "_flags", dict(callers._flags))
    cached = (app.program, task.tasks)
    monkeypatch.setattr(bywire, "_names", bywire._Names(bywire.__file__))
    use_cases()
    sys.modules.pop("usecases.letters", None)
    importlib.import_module("usecases.letters")
    for each in cached:
        each.cache_clear()
    yield
    del DECLARED["count_letters"]
    for each in cached:
        each.cache_clear()


def typed(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    """Return the exit status of a command."""
    monkeypatch.setattr(sys, "argv", ["bywire", *words])
    with pytest.raises(SystemExit) as done:
        main.main()
    assert isinstance(done.value.code, int)
    return done.value.code


def test_it_is_a_command(monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    assert typed(monkeypatch, "--help") == 0
    assert f"{SUMMARY} Exits with status 1 where there are none." in capsys.readouterr().out
    assert typed(monkeypatch, "letters", "--help") == 0
    text = capsys.readouterr().out
    for each in (
        "Loop (see 'bywire list loops').",
        "--set",
        "--often",
        "Number of times",
        "--out",
        "--json",
    ):
        assert each in text
    assert typed(monkeypatch, "letters", "slip", "--often", "2", "--json") == 0
    assert '"count": 8' in capsys.readouterr().out
    assert typed(monkeypatch, "letters", "slip", "--often", "0") == 1


def test_errors_are_worded_for_their_reader(monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    assert typed(monkeypatch, "letters", "slip", "--often", "10") == 2
    assert capsys.readouterr().err == "bywire: error: --often = 10: at most 9, for slip too\n"
    with pytest.raises(ParameterError, match=r"^times = 10: at most 9"):
        bywire.count_letters("slip", times=10)
    with pytest.raises(ParameterError, match=r"^times = 'two' must be a whole number"):
        bywire.count_letters("slip", times="two")


def test_it_is_a_public_function() -> None:
    assert "count_letters" in bywire.__all__
    assert "count_letters" in dir(bywire)
    assert bywire.count_letters("slip", times=3).count == 12
    signature = inspect.signature(bywire.count_letters)
    assert str(signature.parameters["overrides"]) == (
        "overrides: 'Mapping[str, Any]' = mappingproxy({})"
    )


def test_it_has_a_form(tmp_path: Path) -> None:
    made = task.tasks()["letters"]
    place = Place(tmp_path)
    page = task_page(made, Contents(), {}, 1)
    for each in (
        "Letters of a loop",
        SUMMARY.replace("'", "&#x27;"),
        "Times",
        '<option value="slip">',
    ):
        assert each in page
    assert "Letters of a loop" in index_page("folder", Contents(), {}, 1)
    asked = made.read({"loop": "slip", "often": "3", "set": "motor.R_m=1 ohm"}, place)
    assert made.compute(asked, tmp_path, lambda *_: None).count == 12
    with pytest.raises(RefusedError, match="at most 9") as refused:
        made.read({"loop": "slip", "often": "10"}, place)
    assert refused.value.field == "often"


def test_it_completes() -> None:
    (loop, changes, *_) = app.program().commands["letters"].params
    assert [each.value for each in loop.shell_complete(None, "slip")] == ["slip"]
    assert changes._custom_shell_complete is not None


def test_the_reference_describes_it() -> None:
    assert "## bywire letters\n" in commands.page()
    assert ":: bywire.count_letters\n" in python_names.page()


def test_every_use_case_is_known_to_type_checkers() -> None:
    """A new use case adds one line to the stub, in addition to its module."""
    stub = Path(bywire.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    for name, case in use_cases().items():
        if name != "count_letters":
            line = f"from {case.public.__module__} import {name} as {name}\n"
            assert line in stub, line


def test_every_use_case_says_what_it_does_once() -> None:
    """The docstring is the only place in the file that contains the summary."""
    for case in use_cases().values():
        assert re.fullmatch(r"[A-Z].{10,92}\.", case.summary), case.name
        text = Path(inspect.getfile(inspect.unwrap(case.public))).read_text(encoding="utf-8")
        assert text.count(case.summary) == 1


def test_the_command_line_loads_no_computation() -> None:
    code = (
        "import sys; from bywire.cli.app import program; program(); "
        "print({'numpy', 'pydantic', 'casadi', 'bywire.api'} & {*sys.modules})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
