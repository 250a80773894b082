"""What a design keeps to so that an ECU can run it, and what its stages show meanwhile."""

from __future__ import annotations

import itertools
import tomllib

import pytest

import bywire
from bywire.analysis.loop import LOOPS
from bywire.synthesis.designer import piece, stage, suffixed
from few_starts import few_starts
from undrawn import undrawn

SET = {"ecu.pressure.k_i": "5e-5 A/(Pa*s)", "ecu.pressure.b": "1", "ecu.pressure.k_p": "8e-6 A/Pa"}
REQUIRED = ("phase margin >= 60 deg",)


def designed(changes=None, **options):
    with few_starts():
        return bywire.design(
            "pressure",
            overrides={**SET, **(changes or {})},
            require=REQUIRED,
            linear_only=True,
            **options,
        )


@pytest.fixture(scope="module")
def default():
    return designed()


def test_the_filter_is_no_faster_than_the_sampling_and_the_set_point_is_not_differentiated(
    default, tmp_path
):
    assert default.gains.keys() == {"ecu.pressure.k_d", "ecu.pressure.tau_d"}
    assert default.gains["ecu.pressure.tau_d"] >= default.case.par.ecu.T_s
    assert default.case.par.ecu.pressure.c == 0.0
    assert "limited for an ECU: ecu.pressure.tau_d >= 1 ms, ecu.pressure.c = 0" in str(default)
    assert default.as_object()["kept_for_the_ecu"] == {
        "ecu.pressure.tau_d": [1e-3, 1e-2],
        "ecu.pressure.c": [0.0, 0.0],
    }
    with undrawn():
        default.write(tmp_path)
    bench = tomllib.loads((tmp_path / "pressure-design.toml").read_text(encoding="utf-8"))
    assert bench["set"]["ecu"]["pressure"]["c"] == "0"


def test_on_request_both_are_free():
    found = designed(free_derivative=True)
    assert found.gains.keys() == {"ecu.pressure.k_d", "ecu.pressure.tau_d", "ecu.pressure.c"}
    assert "kept for an ECU" not in str(found)
    assert not found.limits


def test_what_the_user_sets_stays():
    found = designed({"ecu.pressure.tau_d": "56 us", "ecu.pressure.c": "1"})
    assert found.gains.keys() == {"ecu.pressure.k_d"}
    assert (found.case.par.ecu.pressure.tau_d, found.case.par.ecu.pressure.c) == (56e-6, 1.0)
    assert not found.limits


def test_the_filter_follows_the_sample_time():
    loop = LOOPS.find("pressure")
    par = bywire.parameters("dardanelli2010").replace({"ecu.T_s": 2e-3})
    assert loop.realizable(par)["ecu.pressure.tau_d"][0] == 2e-3
    assert LOOPS.find("current").realizable(par) == {}


def test_every_stage_tells_its_share_from_nothing_to_all():
    shown: list[tuple[str, float]] = []
    bywire.design(
        "moment",
        require=("crossover >= 5 Hz", "phase margin >= 60 deg"),
        linear_only=True,
        progress=lambda *state: shown.append(state),
    )
    stages = {label: [share for name, share in shown if name == label] for label, _ in shown}
    assert stages
    for shares in stages.values():
        assert all(0.0 <= a <= b <= 1.0 for a, b in itertools.pairwise(shares))
        assert shares[-1] == 1.0
        assert len(shares) > 5


def test_shares_of_stages():
    shown: list[tuple[str, float]] = []
    report = stage(suffixed(lambda *state: shown.append(state), "low"), "design")
    piece(report, 1, 4)(0.5)
    report(1.7)
    assert shown == [("design, low", 0.375), ("design, low", 1.0)]
    stage(None, "design")(0.5)
    assert suffixed(None, "low") is None
