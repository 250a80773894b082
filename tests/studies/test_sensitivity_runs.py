"""Simulated studies have the indices of their closed form, from the file to the report."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import bywire
from bywire.core.errors import ParameterError
from bywire.studies.findings import Findings
from raising import raises
from undrawn import drawn_once, undrawn

AXIS = """
experiment = "step"
parameters = "spring-axis-one"
[options]
input = "F_set"
output = "x"
end = "100 N"
duration = "1.2 s"
record = "0.4 ms"
[simulation]
step = "0.1 ms"
[set]
F_c = "0 N"
k_c = "1 nN/m"
T_s = "0.1 ms"
"""
DAMPED = """
bench = "bench.toml"
[vary]
d = { kind = "uniform", low = "40 N*s/m", high = "80 N*s/m" }
m = { kind = "uniform", low = "1.5 kg", high = "2.5 kg" }
[design]
kind = "KIND"
cases = CASES
[requirements]
overshoot = "<= 90 %"
"""


def holds(estimate, true: float) -> bool:
    return estimate.low <= true <= estimate.high


def overshoot(d, m):
    """Of a mass on a spring without dry friction [%]."""
    zeta = d / (2.0 * np.sqrt(1e4 * m))
    return 100.0 * np.exp(-np.pi * zeta / np.sqrt(1.0 - zeta**2))


def first_orders() -> tuple[float, float]:
    """Return the shares of the overshoot's variance that d and m make alone, by quadrature."""
    d, m = np.meshgrid(np.linspace(40, 80, 801), np.linspace(1.5, 2.5, 801), indexing="ij")
    values = overshoot(d, m)
    total = values.var()
    return values.mean(axis=1).var() / total, values.mean(axis=0).var() / total


@pytest.fixture
def axis(tmp_path, spring_axis):
    """Return a function that runs a study of the mass on a spring, and its folder."""

    def run(kind: str, cases: int):
        (tmp_path / "bench.toml").write_text(AXIS)
        path = tmp_path / f"{kind}.toml"
        path.write_text(DAMPED.replace("KIND", kind).replace("CASES", str(cases)))
        return bywire.run_study(path, tmp_path / "out", workers=1), tmp_path / "out"

    return run


def test_a_simulated_study_has_the_shares_of_its_closed_form(axis):
    study, out = axis("sobol-indices", 300)
    assert (len(study.cases), study.status) == (256, "passed")
    indices = {each.quantity: each for each in study.findings.sensitivity("overshoot").drivers}
    for name, first in zip(("d", "m"), first_orders(), strict=True):
        assert holds(indices[name].first, first)
        assert indices[name].first.value == pytest.approx(first, abs=0.05)
        assert holds(indices[name].total, first)  # next to nothing together
    rounded, design, wide = study.notes
    assert "256" in rounded
    assert "300" in rounded
    assert design.startswith("sobol-indices: ")
    assert wide.startswith("overshoot: 64 groups ")
    assert "0.15" in wide
    assert "main influences on overshoot" in str(study)
    with undrawn():
        study.write(out)
    names = {path.name for path in out.iterdir()}
    assert {"sensitivity.png", "scatter-overshoot.png", "worst-overshoot.toml"} <= names
    assert not {"influences.png", "convergence.png"} & names
    written = json.loads((out / "report.json").read_text())["kpis"]["overshoot"]
    assert written["sensitivity"]["d"]["total"]["value"] == indices["d"].total.value
    assert "influences" not in written
    assert bywire.resume_study(out).findings.sensitivity("overshoot").drivers == list(
        indices.values()
    )
    with raises(ParameterError, name="cases", value="512"):
        bywire.resume_study(out, cases=512)
    with pytest.raises(ParameterError, match=">= 256"):
        bywire.run_study(out.with_name("sobol-indices.toml"), out, cases=255)


def test_a_simulated_study_has_the_effects_of_its_closed_form(axis):
    study, out = axis("morris", 50)
    assert (len(study.cases), study.status) == (48, "passed")
    plan = study.plan
    columns = plan.values(0)
    whole = study.cases.assign(overshoot=overshoot(columns["d"], columns["m"]))
    true = Findings(plan, whole, ()).sensitivity("overshoot").drivers
    for each, expected in zip(study.findings.sensitivity("overshoot").drivers, true, strict=True):
        assert each.quantity == expected.quantity
        assert each.mu_star.value == pytest.approx(expected.mu_star.value, rel=5e-3)
        assert each.sigma == pytest.approx(expected.sigma, rel=2e-2)
    d, m = np.meshgrid(np.linspace(40.0, 80.0, 4), np.linspace(1.5, 2.5, 4))
    steps = overshoot(d[:, :2], m[:, :2]) - overshoot(d[:, 2:], m[:, 2:])  # of two thirds
    assert holds(study.findings.sensitivity("overshoot").drivers[0].mu_star, 1.5 * steps.mean())
    with drawn_once():
        study.write(out)  # with its figures
    names = {path.name for path in out.iterdir()}
    assert "sensitivity.png" in names
    assert "scatter-overshoot.png" not in names
    sizes = json.loads((out / "report.json").read_text())["kpis"]["overshoot"]["sensitivity"]["d"]
    assert {*sizes} == {"mu_star", "sigma"}
    cases = study.cases.assign(overshoot=study.cases["overshoot"].where(study.cases["case"] != 3))
    lacking = replace(study, findings=Findings(plan, cases, study.nominal.kpis))
    (section,) = [each for each in lacking.document().sections() if "influences" in each.title]
    (block,) = section.blocks  # the sentence in place of the table
    (missing,) = block.texts
    assert missing.endswith("overshoot: not defined in 1 of 48 cases")
