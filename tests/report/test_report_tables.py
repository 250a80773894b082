"""Tables say the same as text and as HTML, in units that people use."""

from __future__ import annotations

from bywire.core.parameters import ParameterSet
from bywire.core.provenance import chosen, paper
from bywire.core.quantities import Fraction, Length, Resistance
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
        KpiRow("overshoot", 0.034, "1", "share of the step", "<= 0.15", "met"),
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
    """share of copper"""
    law: str
    """which law holds"""


def texts(table: Table) -> list[list[str]]:
    return [[cell.text for cell in row] for row in table.rows]


def test_key_figures_are_shown_with_unit_limit_and_result() -> None:
    assert texts(KPIS) == [
        ["steady_state_error", "0.12 bar", "<= 0.1 bar", "missed", "mean of the last 0.2 s"],
        ["overshoot", "0.034", "<= 0.15", "met", "share of the step"],
        ["settling_time", "not defined", "-", "-", "never settles"],
    ]


def test_limits_are_left_out_where_there_are_none() -> None:
    table = kpi_table([KpiRow("rise_time", 0.0423817, "s", "10 to 90 %")])
    assert [column.heading for column in table.columns] == ["name", "value", "definition"]
    assert texts(table) == [["rise_time", "0.04238 s", "10 to 90 %"]]


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
        ["law", "paper", "which law holds", "", ""],
    ]


def test_tables_and_choices_may_be_parameters() -> None:
    values = {"V": (1e-6, 2e-6), "on": True, "none": ()}
    rows = [ParameterRow(name, value, "m**3") for name, value in values.items()]
    assert [row[1] for row in texts(parameter_table(rows))] == ["1 ml, 2 ml", "True", "empty"]


def test_text_is_aligned_and_wrapped() -> None:
    lines = table_text(KPIS, width=70).splitlines()
    assert max(map(len, lines)) <= 70
    assert lines[0].split() == ["name", "value", "limit", "result", "definition"]
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
