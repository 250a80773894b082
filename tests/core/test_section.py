"""Sections of files: their values, and one sentence for each invalid value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import pytest
from pydantic import Field

from bywire.core.errors import InputError, ParameterError, UnitError, UnknownNameError
from bywire.core.quantities import Unit
from bywire.core.section import Hint, Name, Names, Section, Table
from raising import raises


class Inner(Section):
    """A section of a section."""

    delay: Annotated[float, Unit("s"), Field(ge=0)] = 0.0
    share: Annotated[float | None, Unit("1"), Field(ge=0.001, lt=0.5)] = None


class Whole(Section):
    """A file."""

    name: Name
    kind: Literal["grid", "corners"] = "grid"
    count: Annotated[int, Field(ge=1, le=9)] = 1
    seed: Annotated[int | None, Field(ge=0, le=9)] = None
    file: Annotated[str, Hint("write a path")] = ""
    is_cut: bool = False
    only: Names = ()
    inner: Inner = Inner()
    each: tuple[Inner, ...] = ()
    by_name: Annotated[Mapping[str, Inner], Field(default_factory=dict)]
    texts: Annotated[Mapping[str, str], Field(default_factory=dict)]
    vary: Table


def whole(**content: Any) -> Whole:
    return Whole.read({"name": "a", **content}, "a file")


def test_a_file_is_read_into_si() -> None:
    found = whole(
        inner={"delay": "5 ms", "share": "10 %"},
        each=[{"delay": "1 s"}],
        by_name={"x": {"delay": 0}},
        only=["a", "b"],
        vary={"motor.R_m": {"sd": "5 %"}},
    )
    assert (found.inner.delay, found.inner.share) == (0.005, 0.1)
    assert (found.each[0].delay, found.by_name["x"].delay) == (1.0, 0.0)
    assert (found.only, found.vary) == (("a", "b"), {"motor.R_m": {"sd": "5 %"}})
    assert found.inner.given == {"delay": 0.005, "share": 0.1}
    assert (found.kind, found.seed, found.texts) == ("grid", None, {})


@pytest.mark.parametrize(
    ("content", "kind", "message"),
    [
        ({"cuont": 1}, UnknownNameError, "unknown key of a file 'cuont': did you mean 'count'? Va"),
        ({"name": "  "}, ParameterError, "name = '  ' must be a string"),
        ({"name": 3}, ParameterError, "name = 3 must be a string"),
        ({"kind": "grdi"}, UnknownNameError, "unknown kind 'grdi': did you mean 'grid'?"),
        ({"kind": 3}, UnknownNameError, "unknown kind '3'"),
        ({"count": 10}, ParameterError, "count = 10 must be a whole number from 1 to 9"),
        ({"count": True}, ParameterError, "count = true must be a whole number from 1 to 9"),
        ({"count": "1"}, ParameterError, "count = '1' must be a whole number"),
        ({"seed": -1}, ParameterError, "seed = -1 must be a whole number from 0 to 9"),
        ({"file": 1}, ParameterError, "file = 1: write a path"),
        ({"is_cut": 1}, ParameterError, "is_cut = 1 must be true or false"),
        ({"only": "a"}, ParameterError, "only = 'a' must be a list of names"),
        ({"only": [1]}, ParameterError, "only = [1] must be a list of names"),
        ({"inner": 1}, ParameterError, "[inner] must be a section with key = value lines"),
        ({"inner": {"dely": 1}}, UnknownNameError, "unknown key of [inner] 'dely': did you mean"),
        ({"inner": {"delay": 5}}, UnitError, "[inner] delay = 5 has the wrong unit: a pure number"),
        ({"inner": {"delay": "5 bar"}}, UnitError, "[inner] delay = '5 bar' has the wrong unit"),
        ({"inner": {"delay": "-5 ms"}}, ParameterError, "[inner] delay = '-5 ms' must be >= 0 ms"),
        ({"inner": {"delay": True}}, UnitError, "[inner] delay = true must be one number"),
        (
            {"inner": {"share": "90 %"}},
            ParameterError,
            "[inner] share = '90 %' must be >= 0.1 % and < 50 %",
        ),
        ({"inner": {"share": 0.9}}, ParameterError, "share = 0.9 must be >= 0.001 and < 0.5"),
        ({"each": {"delay": 0}}, ParameterError, "[[each]] must be a list"),
        ({"each": [{"delay": -1}]}, UnitError, "[[each]] delay = -1 has the wrong unit"),
        ({"by_name": {"x": 1}}, ParameterError, "[by_name.x] must be a section"),
        ({"by_name": {"x": {"delay": "-1 s"}}}, ParameterError, "[by_name.x] delay = '-1 s' must"),
        ({"texts": {"x": 1}}, ParameterError, "[texts] x = 1 must be a string"),
        ({"vary": 1}, ParameterError, "[vary] must be a section"),
    ],
)
def test_what_does_not_fit_is_refused(
    content: dict[str, Any], kind: type[InputError], message: str
) -> None:
    with pytest.raises(kind) as caught:
        whole(**content)
    assert message in str(caught.value)
    assert "pydantic" not in str(caught.value)


def test_what_is_missing_is_named() -> None:
    with raises(ParameterError, name="name"):
        Whole.read({}, "a file")
