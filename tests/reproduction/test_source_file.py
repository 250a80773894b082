"""Files of a source: what is said once stands everywhere, and what does not fit is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import pytest

from bywire.bench.stated import StatedFigure, StatedLevel, StatedRange
from bywire.core.catalog import chosen
from bywire.core.errors import InputError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.reproduction.item import Allowance, Fact, compared
from bywire.reproduction.source_file import SourceFile

SETS = """
citation = "A. Author, {title}, 2020"
assembly = "lever"
[places]
size = "motors of this size"
title = "A lever"
[groups.motor]
R = { chosen = 0.4, where = "{size}, warm" }
[values.left]
group = "motor"
K = { paper = 2e-2, where = "Table 1" }
[values.right]
group = "motor"
K = { formula = "same", where = "that of the left one" }
[[sets]]
name = "lever-1"
summary = "as printed"
[[sets]]
name = "lever-2"
base = "lever-1"
summary = "colder"
[sets.values.left]
R = { derived = 0.3, where = "0.3 % per kelvin" }
"""
STATEMENTS = """
[places]
test = "section 'Test'"
[tolerances.drawn]
what = "levels"
size = 0.05
unit = "share"
reason = "a line's width"
[statements.held]
value = 20
unit = "bar"
where = "{test}: held"
tolerance = "drawn"
[statements.top]
value = 25.0
unit = "bar"
where = "top of Fig. 1"
kind = "axis"
tolerance = "<="
[statements.quick]
value = 0.1
unit = "s"
where = "{test}: quick"
read_as = "within a blink"
note = "from the demand on"
[statements.table1]
where = "Table 1"
tolerance = "drawn"
a = { value = 1.0, unit = "1" }
b = { value = 2.0, unit = "m", tolerance = ">=" }
[[levels]]
name = "held"
of = "held"
unit = "Pa"
experiment = "test"
signal = "p"
label = "held"
options = ["p_to"]
[[levels]]
name = "axis"
of = "held"
to = "top"
unit = "Pa"
where = "Fig. 1, ends of its axis"
experiment = "test"
signal = "p"
label = "within the axis"
[[figures]]
name = "top"
of = "top"
experiment = "test"
figure = "peak"
"""


class Motor(ParameterSet):
    R: Annotated[float, Unit("ohm")]
    K: Annotated[float, Unit("Wb")]


class Lever(ParameterSet):
    left: Motor
    right: Motor


def source(folder: Path, text: str) -> SourceFile:
    file = folder / "source.toml"
    file.write_text(text, encoding="utf-8")
    return SourceFile(file)


def test_sets_keep_the_place_of_every_value(tmp_path: Path) -> None:
    file = source(tmp_path, SETS)
    first, second = file.sets(Lever, file.values({"same": lambda par: par.left.K}))
    assert (first.name, first.assembly, first.summary) == ("lever-1", "lever", "as printed")
    assert first.source == "A. Author, A lever, 2020"
    assert first.values["left.R"] == chosen(0.4, "motors of this size, warm")
    assert first.parameters().flat() == {
        "left.R": 0.4,
        "left.K": 0.02,
        "right.R": 0.4,
        "right.K": 0.02,
    }
    assert first.values["right.K"].kind == "derived"
    assert second.parameters().flat() == {**first.parameters().flat(), "left.R": 0.3}


def test_statements_have_place_kind_and_tolerance(tmp_path: Path) -> None:
    facts = source(tmp_path, STATEMENTS).facts
    drawn = Allowance("levels", 0.05, "share", "a line's width")
    assert facts["held"] == Fact(20.0, "bar", "section 'Test': held", "printed", drawn)
    assert facts["top"].tolerance == "<="
    assert facts["quick"].where == "section 'Test': quick; read as: within a blink"
    assert (facts["quick"].kind, facts["quick"].tolerance) == ("reading", None)
    assert facts.table("table1") == {
        "a": Fact(1.0, "1", "Table 1", tolerance=drawn),
        "b": Fact(2.0, "m", "Table 1", tolerance=">="),
    }


def test_what_is_compared_is_judged_as_stated(tmp_path: Path) -> None:
    facts = source(tmp_path, STATEMENTS).facts
    item = compared("held", facts["held"], 20.9)
    assert (item.agrees, item.tolerance) == (True, 1.0)
    assert compared("top", facts["top"], 25.1).agrees is False
    assert compared("held", facts["held"], 20.9, 0.1).agrees is False
    assert compared("held", facts["held"], 20.9, None).agrees is None
    note = compared("quick", facts["quick"], 0.05, note="warm").note
    assert note == "section 'Test': quick; read as: within a blink; from the demand on; warm"


def test_statements_show_beside_curves_and_key_figures(tmp_path: Path) -> None:
    file = source(tmp_path, STATEMENTS)
    where = "section 'Test': held; tolerance ours: a line's width"
    assert file.levels() == (
        StatedLevel("held", "test", "p", 20e5, "held", where, ("p_to",), 1e5),
        StatedRange("axis", "test", "p", 20e5, 25e5, "within the axis", "Fig. 1, ends of its axis"),
    )
    place = "top of Fig. 1: the curve stays within the axis"
    assert file.figures() == (StatedFigure("top", "test", "peak", 25.0, place, (), "<="),)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('citations = "x"', "'citations': did you mean 'citation'"),
        ('citation = "{titel}"\nplaces.title = "A"', "unknown place 'titel': did you mean 'title'"),
        (
            "[groups.motor]\nR = 0.4",
            'groups.motor.R is not valid. Write { chosen = ..., where = "..." }',
        ),
        (
            '[groups.motor]\nR = { where = "here" }',
            "groups.motor.R needs exactly one of paper, derived",
        ),
        (
            '[groups.motor]\nR = { guess = 1.0, where = "here" }',
            "groups.motor.R needs exactly one of",
        ),
        ('[groups.a]\ngroup = "b"', "groups.a.group: group of values 'b'"),
        ('[tolerances.a]\nwhat = "x"\nunit = "1"\nreason = "y"', "tolerances.a: size is missing"),
        ('[statements.a]\nunit = "1"\nwhere = "x"', "statements.a: value is missing"),
        ('[statements.a]\nvalue = "1"\nunit = "1"\nwhere = "x"', "value = '1' must be a number"),
        ('[statements.a]\nvalue = 1\nunit = "1"\nwere = "x"', "'were': did you mean 'where'"),
        (
            '[statements.a]\nvalue = 1\nunit = "1"\nwhere = "x"\nkind = "read"',
            "statements.a: unknown kind of statement 'read': did you mean 'reading'",
        ),
        (
            '[statements.a]\nvalue = 1\nunit = "1"\nwhere = "x"\ntolerance = "b"',
            "statements.a: tolerance 'b'",
        ),
    ],
)
def test_what_does_not_fit_is_refused_with_its_place(
    tmp_path: Path, text: str, message: str
) -> None:
    with pytest.raises(InputError) as refused:
        source(tmp_path, text)
    assert message in str(refused.value)
    assert "source.toml" in str(refused.value)


def test_an_unknown_statement_is_refused_with_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="unknown statement 'hold': did you mean 'held'"):
        _ = source(tmp_path, STATEMENTS).facts["hold"]
