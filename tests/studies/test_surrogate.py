"""Surrogates: a polynomial comes back, the error is that of new cases, what lies beyond refused."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from bywire.core.catalog import parameters
from bywire.core.errors import ParameterError, UnknownNameError
from bywire.studies.findings import Findings
from bywire.studies.study_file import read_study
from bywire.studies.surrogate import surrogate_of
from raising import raises

pytest.importorskip("openturns")
VARY = """
[vary]
"motor.R_m" = { kind = "normal", sd = "4 %" }
"motor.K_e" = "+-5 %"
"""
CHOICE = '"adc.law" = { kind = "discrete", values = ["ideal", "quantized"] }'
WIDTHS = {"motor.R_m": 0.04, "motor.K_e": 0.05}
NOMINAL = parameters("dardanelli2010").flat()


def scaled(cases: pd.DataFrame) -> list[np.ndarray]:
    """Return what varies in the quick study, in widths of its distributions."""
    return [(cases[n] / NOMINAL[n] - 1.0) / width for n, width in WIDTHS.items()]


@pytest.fixture
def findings(study):
    """Return a function that gives the quick study made-up figures."""

    def made(figure, count: int = 4, design: str = "", vary: str = VARY) -> Findings:
        plan = read_study(study(vary + design))
        chunks = [pd.DataFrame(plan.values(k)) for k in range(count)]
        cases = pd.concat(chunks, ignore_index=True)
        return Findings(plan, cases.assign(peak_current=figure(cases)), ())

    return made


def test_a_polynomial_comes_back(findings):
    def cubic(cases):
        r, k = scaled(cases)
        return 20.0 + r - 2.0 * k + 0.3 * r * r * k

    made = findings(cubic)
    surrogate = surrogate_of(made, "peak_current")
    assert surrogate.degree >= 3
    assert surrogate.rms < 1e-6
    assert surrogate.explained == pytest.approx(1.0, abs=1e-9)
    row = made.cases.iloc[7]
    told = surrogate({name: row[name] for name in surrogate.nominal})
    assert told == pytest.approx(row["peak_current"], abs=1e-6)


def test_its_error_is_that_of_new_cases(findings):
    """Noise of 0.1 A, and a kink that no polynomial follows."""
    rng = np.random.default_rng(5)

    def kinked(cases):
        r, k = scaled(cases)
        return 20.0 + r + np.abs(k) + 0.1 * rng.standard_normal(len(cases))

    surrogate = surrogate_of(findings(kinked), "peak_current")
    others = findings(kinked, 40).cases.iloc[4 * 64 :]
    inside = np.all(
        [others[n].between(surrogate.low[n], surrogate.high[n]) for n in surrogate.nominal], axis=0
    )
    others = others[inside]
    told = surrogate({name: others[name].to_numpy() for name in surrogate.nominal})
    rms = np.sqrt(np.mean((told - others["peak_current"]) ** 2))
    assert surrogate.rms == pytest.approx(rms, rel=0.15)
    assert rms > 0.1
    told_share = 1.0 - rms**2 / others["peak_current"].var()
    assert surrogate.explained == pytest.approx(told_share, abs=0.02)


def test_what_it_does_not_know_is_refused(findings):
    def figure(cases):
        return scaled(cases)[0]

    surrogate = surrogate_of(findings(figure), "peak_current")
    with raises(ParameterError, name="motor.R_m", value="0.9 ohm", valid="ohm to 0."):
        surrogate({"motor.R_m": 0.9})
    with pytest.raises(UnknownNameError, match=r"motor\.K_e"):
        surrogate({"motor.K_x": 0.9})
    few = findings(figure)
    with raises(ParameterError, name="peak_current", value="12", valid="30"):
        surrogate_of(Findings(few.plan, few.cases[:12], ()), "peak_current")
    with pytest.raises(ParameterError, match="same in all cases"):
        surrogate_of(findings(lambda cases: 1.0), "peak_current")
    with pytest.raises(UnknownNameError, match="peak_current"):
        surrogate_of(findings(figure), "peak_curent")
    with pytest.raises(ParameterError, match="between them"):
        surrogate_of(findings(figure, 1, "[design]\nkind = 'corners'\n"), "peak_current")


def test_a_choice_has_no_polynomial(study):
    plan = read_study(study(VARY + CHOICE))
    with raises(ParameterError, name="adc.law"):
        surrogate_of(Findings(plan, pd.DataFrame(), ()), "peak_current")


SINGLE = VARY + '"supply.V_bat" = { kind = "discrete", values = ["11 V", "12.6 V", "14 V"] }\n'


def test_nothing_is_told_between_single_values(findings):
    """A quadratic through three voltages hits them all; the figure between them is another one."""

    def jagged(cases):
        return scaled(cases)[0] + cases["supply.V_bat"].map({11.0: 4.0, 12.6: 0.0, 14.0: 9.0})

    surrogate = surrogate_of(findings(jagged, vary=SINGLE), "peak_current")
    told = surrogate({"motor.R_m": NOMINAL["motor.R_m"], "supply.V_bat": np.array([11.0, 14.0])})
    assert told == pytest.approx([4.0, 9.0], abs=1e-6)
    with raises(ParameterError, value="12.2 V", valid="11 V, 12.6 V, 14 V") as refused:
        surrogate({"supply.V_bat": 12.2})
    assert "the nearest is 12.6 V" in str(refused.value)
    assert NOMINAL["supply.V_bat"] == 12.0  # none of the cases': it is taken for the nearest
    assert surrogate.nominal["supply.V_bat"] == 12.6


def test_the_ends_that_cases_have_shown_are_known_however_they_are_rounded(findings):
    surrogate = surrogate_of(findings(lambda cases: scaled(cases)[0]), "peak_current")
    end = surrogate.high["motor.R_m"]
    above = float(np.nextafter(end, 1.0))
    assert surrogate({"motor.R_m": above}) == pytest.approx(surrogate({"motor.R_m": end}))


def test_what_is_no_mapping_of_numbers_is_refused(findings):
    surrogate = surrogate_of(findings(lambda cases: scaled(cases)[0]), "peak_current")
    with pytest.raises(ParameterError, match=r"\[\] must map names of quantities to numbers"):
        surrogate([])
    assert surrogate({"motor.R_m": []}).shape == (0,)
