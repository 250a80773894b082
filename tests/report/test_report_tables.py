"""Tables have the same content as text and as HTML, in practical units."""

from __future__ import annotations

import math
from typing import NamedTuple

from bywire.api.run_faults import Quantity, record_data, record_table
from bywire.core.catalog import chosen, paper
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Fraction, Length, Resistance
from bywire.report.answer import frame_of
from bywire.report.page import table_html
from bywire.report.subject import parameter_rows
from bywire.report.tables import (
    KpiRow,
    ParameterRow,
    ReproductionRow,
    Table,
    kpi_table,
    parameter_table,
    reproduction_table,
    text_table,
    verdict_table,
)
from bywire.report.terminal import table_text

KPIS = kpi_table(
    [
        KpiRow("steady_state_error", 1.2e4, "Pa", "mean of the last 0.2 s", "<= 0.1 bar", "missed"),
        KpiRow("overshoot", 0.034, "1", "fraction of the step", "<= 0.15", "met"),
        KpiRow("settling_time", float("nan"), "s", "never settles"),
    ]
)


class Wire(ParameterSet):
    """A parameter set of the test."""

    R: Resistance
    """resistance"""
    L: Length
    """length"""
    fill: Fraction
    """fraction of copper"""
    law: str
    """selected law"""


def texts(table: Table) -> list[list[str]]:
    return [[cell.text for cell in row] for row in table.rows]


def test_key_figures_are_shown_with_unit_limit_and_result() -> None:
    assert texts(KPIS) == [
        ["steady_state_error", "0.12 bar", "<= 0.1 bar", "missed", "mean of the last 0.2 s"],
        ["overshoot", "0.034", "<= 0.15", "met", "fraction of the step"],
        ["settling_time", "not defined", "-", "-", "never settles"],
    ]


def test_limits_are_left_out_where_there_are_none() -> None:
    table = kpi_table([KpiRow("rise_time", 0.0423817, "s", "10 to 90 %")])
    assert [column.heading for column in table.columns] == ["name", "value", "definition"]
    assert texts(table) == [["rise_time", "42.38 ms", "10 to 90 %"]]


def test_statements_without_value_or_verdict_show_a_dash() -> None:
    table = reproduction_table(
        [
            ReproductionRow("gain", 10.1, 10.098, "bar/A", "0.5 %", True, "calibrated"),
            ReproductionRow("pole", 0.866, 1.3, "Hz", 0.01, False),
            ReproductionRow("area", None, 0.068, "1"),
            ReproductionRow("overshoot", 15.0, 5.1, "%", "<=", True, "", "requirement"),
        ]
    )
    assert texts(table) == [
        ["gain", "", "10.1 bar/A", "10.1 bar/A", "0.5 %", "yes", "calibrated"],
        ["pole", "", "0.866 Hz", "1.3 Hz", "0.01 Hz", "no", ""],
        ["area", "", "-", "0.068", "-", "-", ""],
        ["overshoot", "requirement", "<= 15 %", "5.1 %", "-", "yes", ""],
    ]


def test_verdicts_without_notes_are_narrow() -> None:
    rows = [
        ReproductionRow("overshoot", 15.0, 5.1, "%", "<=", True, "a long note", "requirement"),
        ReproductionRow("pole", 0.866, 1.3, "Hz", 0.01, False),
        ReproductionRow("area", None, 0.068, "1"),
    ]
    assert texts(verdict_table(rows)) == [
        ["overshoot", "requirement", "<= 15 %", "5.1 %", "agrees"],
        ["pole", "", "0.866 Hz", "1.3 Hz", "disagrees"],
        ["area", "", "-", "0.068", "-"],
    ]


def test_parameters_are_shown_in_display_units_with_range_and_origin() -> None:
    wire = Wire(R=0.4, L=0.009, fill=0.9, law="paper")
    cited = {"R": chosen(0.35, "a guess"), "L": paper(0.009, "Table 1")}
    assert texts(parameter_table(parameter_rows(wire, cited))) == [
        ["R", "0.4 Ω", "> 0 Ω", "override", "cited: 0.35 in SI (chosen, a guess)"],
        ["L", "9 mm", "> 0 mm", "paper", "Table 1"],
        ["fill", "0.9", "> 0 and <= 1", "", ""],
        ["law", "paper", "selected law", "", ""],
    ]


def test_tables_and_choices_may_be_parameters() -> None:
    values = {"V": (1e-6, 2e-6), "on": True, "none": ()}
    rows = [ParameterRow(name, value, "m**3") for name, value in values.items()]
    assert [row[1] for row in texts(parameter_table(rows))] == ["1 ml, 2 ml", "True", "empty"]


def test_text_is_aligned_and_wrapped() -> None:
    lines = table_text(KPIS, width=70).splitlines()
    assert max(map(len, lines)) <= 70
    assert lines[0].split() == ["name", "value", "limit", "verdict", "definition"]
    assert lines[2].startswith("steady_state_error     0.12 bar  <= 0.1 bar  missed")
    assert table_text(text_table(["a", "b"], [])) == "a  b\n-  -"


def test_text_cannot_steer_a_terminal() -> None:
    assert "\x1b" not in table_text(text_table(["a"], [["\x1b[2J\x07"]]))


def test_html_tells_good_from_bad_without_color_too() -> None:
    html = table_html(KPIS)
    assert '<td class="good">✓ met</td>' in html
    assert '<td class="bad">✗ missed</td>' in html
    assert '<td class="number">0.12 bar</td>' in html


def test_html_is_escaped() -> None:
    html = table_html(text_table(["<i>"], [['<script>alert("x")</script>&']]))
    assert "&lt;i&gt;" in html
    assert "<td>&lt;script&gt;alert(&quot;x&quot;)&lt;/script&gt;&amp;</td>" in html


class Run(NamedTuple):
    """A row of a result."""

    name: str
    delay: float
    seen: tuple[float, ...]


def test_a_quantity_is_stated_once_for_table_json_and_frame() -> None:
    quantities: tuple[Quantity[Run], ...] = (
        Quantity(lambda run: run.name, "run", "run"),
        Quantity(lambda run: run.delay, "delay", "delay", "s"),
        Quantity(
            lambda run: list(run.seen),
            "seen",
            "seen within",
            "s",
            lambda run: f"{max(run.seen):g} s at most",
            lambda run: max(run.seen),
        ),
        Quantity(lambda run: len(run.seen), "times"),
    )
    rows = [Run("a", 0.25, (1.0, 2.0)), Run("", math.nan, (3.0,))]
    table = record_table(rows, quantities)
    texts = [[cell.text for cell in row] for row in table.rows]
    assert texts == [["a", "250 ms", "2 s at most"], ["-", "not defined", "3 s at most"]]
    assert record_data(rows[0], quantities) == {
        "run": "a",
        "delay": 0.25,
        "seen": [1.0, 2.0],
        "times": 2,
    }
    frame = frame_of(table)
    assert frame["seen within"].to_list() == [2.0, 3.0]
    assert frame["delay"].to_list()[0] == 0.25
    assert frame.attrs["units"] == {"delay": "s", "seen within": "s"}


def test_frames_say_the_units_of_rows_that_differ_in_them() -> None:
    rows = [KpiRow("p", 2.5e6, "Pa"), KpiRow("t", None, "s")]
    frame = frame_of(kpi_table(rows))
    assert frame["value"].to_list()[0] == 2.5e6
    assert math.isnan(frame["value"].to_list()[1])
    assert frame["value unit"].to_list() == ["Pa", "s"]
    assert frame.attrs["units"] == {}
    assert list(frame_of(kpi_table([])).columns) == ["name", "value", "definition"]
