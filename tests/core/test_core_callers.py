"""Messages contain flags for commands, and arguments for function calls."""

from __future__ import annotations

import ast
import inspect
import pickle
from pathlib import Path
from typing import Any

import pytest

import bywire
from bywire.core.callers import command_line, name_flag, option
from bywire.core.errors import BywireError, ParameterError, UnknownNameError
from bywire.usecases import use_cases


@pytest.mark.parametrize(
    ("argument", "value", "typed", "called"),
    [
        ("over", None, "--over", "over"),
        ("overrides", None, "--set", "overrides"),
        ("overrides", {"parameters": "NAME"}, "--set parameters=NAME", None),
        ("inputs", {"STIMULUS": "SIGNAL"}, "--input STIMULUS=SIGNAL", None),
        ("side", "above", "--side above", 'side="above"'),
        ("force", True, "--force", "force=True"),
        ("states", None, "--estimate-start", "states"),
    ],
)
def test_a_flag_is_an_argument_in_a_program(
    argument: str, value: Any, typed: str, called: str | None
) -> None:
    use_cases()
    assert option(argument, value) == called or called is None
    with command_line():
        assert option(argument, value) == typed
    if called is None:
        (pair,) = value.items()
        assert option(argument, value) == f'{argument}={{"{pair[0]}": "{pair[1]}"}}'


def test_an_argument_has_one_flag() -> None:
    use_cases()
    with pytest.raises(ValueError, match="'overrides' already has the flag --set, not --change"):
        name_flag("overrides", "--change")


def test_messages_name_arguments_that_there_are() -> None:
    """Each ``option("NAME")`` in the package is an argument of a use case."""
    known = {name for case in use_cases().values() for name in case.takes}
    known |= {n for c in use_cases().values() for n in inspect.signature(c.public).parameters}
    named = {}
    for path in sorted(Path(bywire.__file__).parent.rglob("*.py")):
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "option":
                first = call.args[0]
                if isinstance(first, ast.Constant):
                    named[first.value] = path.name
    assert len(named) > 20
    assert {name: file for name, file in named.items() if name not in known} == {}


def said_by(call: Any, kind: type[BywireError]) -> str:
    with pytest.raises(kind) as caught:
        call()
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    return str(caught.value)


def test_errors_of_functions_name_their_arguments() -> None:
    called = said_by(lambda: bywire.run("step"), ParameterError)
    assert 'overrides={"parameters": "NAME"}' in called
    assert "--" not in called
    with command_line():
        assert "--set parameters=NAME" in said_by(lambda: bywire.run("step"), ParameterError)
    unknown = said_by(lambda: bywire.margins("xyzzy"), UnknownNameError)
    assert "--system" not in unknown
    assert "bywire.load_system" in unknown
