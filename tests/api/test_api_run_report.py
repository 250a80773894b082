"""Report of a run, with verdict and changes first, and figures before tables."""

from __future__ import annotations

from pathlib import Path

import bywire
from bywire.core.errors import UnknownNameError
from raising import raises

QUICK = {"options.duration": "40 ms", "options.settle": "10 ms"}


def test_what_was_changed_and_the_verdict_come_first_and_figures_before_tables():
    result = bywire.run(
        "hard-braking",
        {**QUICK, "motor.R_m": "0.5 ohm", "requirements.overshoot": "<= 15 %"},
        estimate_error=False,
    )
    titles = [section.title for section in result.document().page]
    assert titles == [
        "Outcome",
        "Figures",
        "Key figures",
        "Energy",
        "Schematic",
        "Settings",
    ]
    required, changed = [block.table for block in result.document().page[0].blocks[:2]]
    assert [row[0].text for row in required.rows] == ["overshoot"]
    assert [[cell.text for cell in row[:3]] for row in changed.rows] == [
        ["motor.R_m", "0.5 Ω", "0.35 Ω"],
        ["options.duration", "40 ms", "1.2 s"],
        ["options.settle", "10 ms", "1 s"],
    ]


def test_errors_of_temperatures_are_differences():
    result = bywire.run("hard-braking", QUICK)
    tables = result.document().page[-1].blocks
    (errors,) = [
        b for b in tables if getattr(b, "title", "").startswith("Numerical error of recorded")
    ]
    rows = {row[1].text: row[2].text for row in errors.blocks[0].table.rows}
    assert rows["T_winding"] == "0 K"


def test_a_run_of_the_cited_set_says_that_nothing_was_changed():
    result = bywire.run("seal-stribeck", estimate_error=False)
    said, _ = [block.text for block in result.document().page[0].blocks]
    assert said.startswith("Nothing was changed: all parameters are those of dardanelli2010")


def test_a_figure_of_the_report_is_drawn_by_its_name():
    result = bywire.run("hard-braking", estimate_error=False)
    assert len(result.plot("time-traces").axes) > len(result.plot("step-response").axes) > 0
    first = result.plot().axes[0].get_ylabel()
    assert first == result.plot("step-response").axes[0].get_ylabel() != ""
    with raises(UnknownNameError, name="figure", value="nyquist", valid="time-traces"):
        result.plot("nyquist")
    assert bywire.margins("pressure").plot("pressure-nyquist").axes


def test_a_run_without_requirements_counts_the_undefined_key_figures():
    changes = {"motor.R_m": "+50 %", "ecu.dither.waveform": "off"}
    banner = bywire.run("hard-braking", changes).document().banner
    assert banner.text == "done, no requirements; 3 of 14 key figures not defined"


def test_report_and_terminal_state_the_origins_of_the_parameters(tmp_path: Path) -> None:
    result = bywire.run("hard-braking", estimate_error=False)
    text = (
        "38 printed in a source, 3 derived from other values, 6 calibrated to match a source, 88 "
    )
    assert f"values of dardanelli2010: {text}" in " ".join(str(result).split())
    result.write(tmp_path)
    assert f"Values of dardanelli2010: {text}" in (tmp_path / "report.html").read_text()
