"""Loops in a page: Bode diagrams and margins are those of `bywire.margins` at any values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from page_benches import BENCHES, VARIED, needs_node, tried

import bywire
from bywire.analysis.loop import LOOPS
from bywire.analysis.margins import figures_at, margins_of
from bywire.export.loop_source import loop_source

SAME = 1e-9
CANCELED = 1e-12  # of a loop gain, compared with 1
NAMES = {
    "gain",
    "lower_gain",
    "phase",
    "crossover",
    "delay",
    "disk",
    "sensitivity",
    "complementary",
}
BENCH_OF = {
    "pressure": (BENCHES["motorcycle"], VARIED["motorcycle"]),
    "moment": (BENCHES["wedge"], (*VARIED["wedge"], "flywheel.Omega_0")),
    "current": (bywire.Bench("current-step", "dardanelli2010"), VARIED["motorcycle"][:2]),
    "drive-current": (
        bywire.Bench("current-loop", "roberts2003"),
        ("drive.k_p", "drive.k_i", "motor_1.L_M"),
    ),
}


def case_of(name):
    """Return the run with the values of the bench if there are several."""
    return "parallel_usual" if name == "drive-current" else ""


@needs_node
@pytest.mark.parametrize("name", sorted(BENCH_OF))
def test_loops_follow_the_parameters(name, tmp_path):
    bench, varied = BENCH_OF[name]
    loop, leaves, rng = LOOPS.find(name), bench.par.leaves(), np.random.default_rng(3)
    page = bywire.page(bench, tmp_path / "page.html", vary=varied[:2], case=case_of(name))
    cases = [{}] + [{n: leaves[n] * rng.uniform(0.8, 1.25) for n in varied} for _ in range(3)]
    answers = tried(page, tmp_path, *({"kind": "loops", "changes": each} for each in cases))
    found = set()
    for changes, each in zip(cases, answers, strict=True):
        (made,) = each["answer"]
        figures = figures_at(loop, bench.with_overrides(changes).par, loop.at.default)
        wanted, given = margins_of(figures), made["margins"]
        np.testing.assert_allclose(made["frequency"], figures.frequencies, rtol=1e-12)
        L = 10 ** (np.array(made["decibel"]) / 20) * np.exp(1j * np.radians(made["phase"]))
        # Far above the crossover, terms near 1 cancel in both, except for their last bits.
        assert (np.abs(L - figures.L) <= SAME * np.abs(figures.L) + CANCELED).all()
        assert given["isStable"] == wanted.stable
        for margin in NAMES:
            assert float(given[margin]) == pytest.approx(getattr(wanted, margin), rel=SAME), margin
        found.add(round(wanted.phase, 6))
    assert len(found) == len(cases)


@needs_node
@pytest.mark.parametrize(
    ("name", "gain"),
    [("pressure", {"ecu.pressure.k_p": 1e-3}), ("drive-current", {"drive.k_i": 1e5})],
)
def test_an_unstable_loop_has_no_margins(name, gain, tmp_path):
    bench, _ = BENCH_OF[name]
    page = bywire.page(bench, tmp_path / "page.html", case=case_of(name))
    usual, made = tried(page, tmp_path, *({"kind": "loops", "changes": c} for c in ({}, gain)))
    assert usual["answer"][0]["margins"]["isStable"]
    assert made["answer"][0]["margins"] == {"isStable": False}
    assert not bywire.margins(name, overrides=gain).margins[0].stable


@needs_node
def test_where_a_contact_closes_there_is_no_loop(tmp_path):
    page = bywire.page(BENCHES["motorcycle"], tmp_path / "page.html")
    reached = {"master_cylinder.x_end": 1e-4}
    (made,) = tried(page, tmp_path, {"kind": "loops", "changes": reached})
    assert "contact" in made["answer"][0]["reason"]
    with pytest.raises(bywire.BywireError):
        bywire.margins("pressure", overrides=reached)


@needs_node
def test_corners_and_loops_without_gain_are_said(tmp_path):
    page = bywire.page(BENCHES["motorcycle"], tmp_path / "page.html")
    at = LOOPS.find("pressure").at.default + 101325.0
    gains = {f"ecu.pressure.{name}": 0.0 for name in ("k_p", "k_i", "k_d")}
    cases = ({"pressure_sensor.p_high": at}, {"pressure_sensor.p_high": 1.1 * at}, gains)
    answers = tried(page, tmp_path, *({"kind": "loops", "changes": each} for each in cases))
    corner, usual, none = (each["answer"][0] for each in answers)
    assert "kink of the model" in corner["reason"]
    assert "bywire margins pressure" in corner["reason"]
    assert usual["margins"]["hasLoop"]
    assert none["margins"] == {"isStable": True, "hasLoop": False}


def test_what_cannot_follow_parameters_is_left_out():
    loop, par = LOOPS.find("moment"), BENCHES["wedge"].par

    def branching(moved, value):
        return loop.point(moved, value if moved.wedge.mu_B < 1.0 else 0.5 * value)

    assert loop_source(replace(loop, point=branching), par) is None
    assert loop_source(loop, par) is not None
