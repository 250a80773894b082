"""Warnings of many cases are the same as those of single cases for any varied parameter."""

from __future__ import annotations

import numpy as np
import pytest

import bywire
from bywire.bench.ensemble import changed, key_figures_of
from bywire.bench.recording import Rows
from bywire.brakes.motorcycle import watch
from bywire.core import watching
from bywire.core.catalog import PARAMETER_SETS
from run_once import run_once

SET = "dardanelli2010"


@pytest.mark.parametrize("name", ["fluid.nu", "pipeline.Re_max"])
def test_a_case_that_warns_by_what_varies_is_heard(name):
    bench = bywire.Bench("hard-braking", SET)
    usual = bench.par.value(name)
    benches = [changed(bench, {name: share * usual}) for share in (1.0, 1e-5, 1.1)]
    said = key_figures_of(benches).warnings
    assert [any("not laminar" in text for text in texts) for texts in said].count(True) == 1
    assert said[1] == tuple(run_once(benches[1]).warnings)


def test_elements_that_look_at_what_varies_are_silent_together(monkeypatch):
    bench = bywire.Bench("hard-braking", SET)
    given = []
    silent_parts = watching.silent_parts
    monkeypatch.setattr(
        "bywire.core.watching.silent_parts",
        lambda *of: given.append(silent_parts(*of)) or given[-1],
    )
    key_figures_of([changed(bench, {"motor.R_m": R, "fluid.nu": 1e-5 * R}) for R in (1.0, 1.1)])
    assert given[-1] == {"chamber", "pads", "line", "heat", "pressure_sensor", "current_sensor"}


def test_books_are_those_of_single_runs_though_rows_tell_their_ends_alone():
    """A nearly frictionless pipe opens them; see the test of a single run."""
    bench = bywire.Bench("hard-braking", SET)
    benches = [changed(bench, {"pipeline.k_lf": k}) for k in (32.0, 3.2e-19, 3.2e-15)]
    said = key_figures_of(benches).warnings
    assert [list(each) for each in said] == [list(run_once(each).warnings) for each in benches]
    opened = [any("energy balance has an error" in text for text in each) for each in said]
    assert opened == [False, True, True]


def test_stops_warn_in_the_cases_that_are_looked_at_and_in_no_other():
    """Free, temporarily at the far stop, pulled against the near stop, and released at the end."""
    force = np.zeros((4, 9))
    force[1, 3:5], force[2, -1], force[3, 2:5] = 40.0, -60.0, -60.0
    signals = {"F_stop": force, "at_stop": np.sign(force), "i": np.full(force.shape, -1.0)}
    signals["p_pd"] = np.full(force.shape, 2e4)
    rows = Rows(np.arange(9.0), signals, {name: {} for name in signals})
    par = PARAMETER_SETS.find("dardanelli2010").parameters()
    warns = [bool(watch.stop_warnings(rows.case(k), par)) for k in range(4)]
    assert watch.cases_at_stops(rows) == np.flatnonzero(warns).tolist() == [1, 2]
