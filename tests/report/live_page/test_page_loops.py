"""Loops in a page: Bode diagrams and margins are those of `bywire.margins` at any values."""

from __future__ import annotations

import numpy as np
import pytest
from page_benches import BENCHES, VARIED, needs_node, tried

import bywire
from bywire.analysis.loop import LOOPS
from bywire.analysis.margins import figures_at, margins_of
from bywire.export.loop_source import loop_source

SAME = 1e-9
CANCELED = 1e-12  # of a loop gain, beside the 1 that matters
NAMES = {"gain", "phase", "crossover", "delay", "disk", "sensitivity", "complementary"}
BENCH_OF = {
    "pressure": (BENCHES["motorcycle"], VARIED["motorcycle"]),
    "moment": (BENCHES["wedge"], (*VARIED["wedge"], "flywheel.Omega_0")),
    "current": (bywire.Bench("current-step", "dardanelli2010"), VARIED["motorcycle"][:2]),
}


@needs_node
@pytest.mark.parametrize("name", sorted(BENCH_OF))
def test_loops_follow_the_parameters(name, tmp_path):
    bench, varied = BENCH_OF[name]
    loop, leaves, rng = LOOPS.find(name), bench.par.leaves(), np.random.default_rng(3)
    page = bywire.page(bench, tmp_path / "page.html", vary=varied[:2])
    cases = [{}] + [{n: leaves[n] * rng.uniform(0.8, 1.25) for n in varied} for _ in range(3)]
    answers = tried(page, tmp_path, *({"kind": "loops", "changes": each} for each in cases))
    found = set()
    for changes, each in zip(cases, answers, strict=True):
        (made,) = each["answer"]
        figures = figures_at(loop, bench.with_overrides(changes).par, loop.at.default)
        wanted, given = margins_of(figures), made["margins"]
        np.testing.assert_allclose(made["frequency"], figures.frequencies, rtol=1e-12)
        L = 10 ** (np.array(made["decibel"]) / 20) * np.exp(1j * np.radians(made["phase"]))
        # Far above the crossover terms of 1 cancel to nothing, in both to their last bits.
        assert (np.abs(L - figures.L) <= SAME * np.abs(figures.L) + CANCELED).all()
        assert given["isStable"] == wanted.stable
        for margin in NAMES:
            assert given[margin] == pytest.approx(getattr(wanted, margin), rel=SAME), margin
        found.add(round(wanted.phase, 6))
    assert len(found) == len(cases)


@needs_node
def test_an_unstable_loop_has_no_margins(tmp_path):
    bench = BENCHES["motorcycle"].with_overrides({"ecu.pressure.k_p": 1e-3})
    page = bywire.page(bench, tmp_path / "page.html")
    (made,) = tried(page, tmp_path, {"kind": "loops", "changes": {}})
    assert made["answer"][0]["margins"] == {"isStable": False}
    assert not bywire.margins("pressure", overrides={"ecu.pressure.k_p": 1e-3}).margins[0].stable


@needs_node
def test_where_a_contact_closes_there_is_no_loop(tmp_path):
    page = bywire.page(BENCHES["motorcycle"], tmp_path / "page.html")
    reached = {"master_cylinder.x_end": 1e-4}
    (made,) = tried(page, tmp_path, {"kind": "loops", "changes": reached})
    assert "contact" in made["answer"][0]["reason"]
    with pytest.raises(bywire.BywireError):
        bywire.margins("pressure", overrides=reached)


def test_what_cannot_follow_parameters_is_left_out():
    par = BENCHES["wedge"].par
    assert loop_source(LOOPS.find("drive-current"), par) is None  # analog
    assert loop_source(LOOPS.find("moment"), par) is not None
