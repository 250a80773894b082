"""A study says what was tested: the bench file, its faults, and what is changed of it."""

from __future__ import annotations

import bywire
from bywire.report.document import Details, Listing, Paragraph, TableBlock

BENCH = """
experiment = "hard-braking"
parameters = "dardanelli2010"
[options]
duration = "40 ms"
settle = "10 ms"
[[faults]]
fault = "pressure.stuck-at-last"
onset = "10 ms"
lasts = "5 ms"
"""
TEXT = """
[set]
"options.p_to" = "30 bar"
[vary]
"motor.R_m" = "+-5 %"
[design]
kind = "corners"
"""
SENTENCE = (
    "fault pressure.stuck-at-last, from 10 ms to 15 ms: pressure sensor is stuck at its last value"
)


def test_a_study_says_which_bench_with_which_faults_and_changes_was_tested(study, tmp_path):
    found = bywire.run_study(study(TEXT, BENCH), tmp_path / "out", {"motor.L_m": "+20%"}, workers=1)
    document = found.document()
    assert "to 30 bar" in document.summary
    assert "with the fault pressure.stuck-at-last;" in document.summary
    (tested,) = (each for each in document.page if each.title == "Tested bench")
    source, faults, changes, options = tested.blocks
    assert isinstance(source, Paragraph)
    assert isinstance(faults, Listing)
    assert isinstance(changes, TableBlock)
    assert isinstance(options, Details)
    said = "Bench: bench.toml; the study sets options.p_to = 30 bar, motor.L_m = +20%."
    assert source.text == said
    assert list(faults.texts) == [SENTENCE]
    changed = {row[0].text: row[1].text for row in changes.table.rows}
    assert changed["options.p_to"] == "30 bar"
    assert {"motor.L_m", "options.duration", "options.settle"} < changed.keys()
    assert any(isinstance(each, Listing) and SENTENCE in each.texts for each in document.brief)

    bench = document.facts["bench"]
    assert bench["file"] == "bench.toml"
    assert bench["set"] == {"options.p_to": "30 bar", "motor.L_m": "+20%"}
    assert bench["options"]["p_to"] == 30e5
    assert bench["changes"]["options.p_to"] == {"value": "30 bar", "instead_of": "37 bar"}
    (fault,) = bench["faults"]
    assert (fault["fault"], fault["onset"], fault["end"]) == ("pressure.stuck-at-last", 0.01, 0.015)


def test_a_file_that_is_edited_while_its_cases_are_computed_changes_nothing(study, tmp_path):
    path = study()
    run = bywire.run_study(
        path, tmp_path / "out", cases=64, progress=lambda *_: path.write_text("edited = true")
    )
    assert run.as_object()["bench"]["file"] == "bench.toml"
    assert run.write(tmp_path / "report")
