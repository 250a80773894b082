"""Studies of which no case has a result: a report that says so and why, and no figure."""

from __future__ import annotations

import pytest

import bywire
from bywire.core.errors import ParameterError, UnknownNameError
from raising import raises

VARY = """
[vary]
"master_cylinder.x_end" = { kind = "uniform", low = "11 mm", high = "12 mm" }
[design]
"""
LIMIT = '[requirements]\npeak_current = "<= 25 A'


@pytest.mark.parametrize(
    ("design", "requirements"),
    [
        ('kind = "monte-carlo"\ncases = 64', ""),
        ('kind = "monte-carlo"\ncases = 64', LIMIT + '"'),
        ('kind = "morris"\ncases = 64', LIMIT + '"'),
        ('kind = "worst-case"\ncases = 64', LIMIT + '"'),
        ('kind = "subset-simulation"\ncases = 640\ncases_per_level = 640', LIMIT + ' with 90 %"'),
    ],
)
def test_a_study_without_any_result_says_why_and_fails(study, tmp_path, design, requirements):
    if "subset" in design:
        pytest.importorskip("openturns")
    if "morris" in design:
        pytest.importorskip("SALib")
    path = study(f"{VARY}{design}\n{requirements}", bench=BENCH)
    run = bywire.run_study(path, tmp_path / "out")
    assert (run.status, run.holds) == ("failed", False)
    assert run.findings.failed == len(run.cases) > 0
    assert any("cases have no result" in text for text in run.warnings)
    assert "must be < the chamber length" in " ".join(str(run).split())
    names = {each.name for each in run.write(tmp_path / "report")}
    assert "report.html" in names
    assert not [name for name in names if name.endswith((".png", ".toml", ".nc"))]
    if requirements:
        with raises(ParameterError, name="peak_current"):
            run.worst("peak_current")
        with pytest.raises(UnknownNameError, match="did you mean 'peak_current'"):
            run.worst("peak_curent")


def test_key_figures_that_no_case_has_are_no_result(tmp_path):
    """The wheel stands before its hold begins."""
    path = tmp_path / "study.toml"
    path.write_text(
        'bench = "corner-stop"\n[vary]\n"options.v_0" = "+-5 %"\n[design]\ncases = 64\n'
        '[set]\n"options.v_0" = "10 km/h"\n"options.t_hold" = "0.1 s"\n'
    )
    with pytest.warns(match="no key figure is defined in any case"):
        run = bywire.run_study(path, tmp_path / "out")
    assert (run.status, run.findings.failed) == ("failed", 0)
    assert run.write(tmp_path / "report")


BENCH = """
experiment = "hard-braking"
parameters = "dardanelli2010"
[options]
duration = "40 ms"
settle = "10 ms"
"""
