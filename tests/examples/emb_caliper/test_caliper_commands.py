"""Every command with the caliper, as its user would call it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import bywire as toolkit
from bywire.report.live_page.sliders import SLIDERS
from few_starts import few_starts
from undrawn import undrawn

TRUE = {"friction.C": 0.0304, "friction.G": 1.17e-5, "rotor.D": 3.95e-4}


def test_list_shows_what_it_brings(command: Any) -> None:
    code, out, _ = command("list", "emb-caliper")
    assert code == 0
    for name in (
        "emb42v-modified",
        "slow-strokes",
        "clamp-force",
        "emb-plant",
        "friction-strokes",
        "screw-lead",
        "F_cl",
    ):
        assert name in out, name


def test_bench_with_requirements(command: Any, tmp_path: Path) -> None:
    bench = tmp_path / "apply.toml"
    bench.write_text(
        'experiment = "clamp-step"\nparameters = "emb42v"\n[set]\ncaliper.clearance = "0.2 mm"\n'
        '[options]\nF_to = "15 kN"\n[requirements]\nrise_time = "<= 120 ms"\n'
        'overshoot = "<= 3 %"\n',
        encoding="utf-8",
    )
    with undrawn():
        code, out, err = command("run", bench, "--out", tmp_path / "out")
    assert code == 0, err
    assert "rise_time" in out
    names = {path.name for path in (tmp_path / "out").rglob("*")}
    assert "report.html" in names
    assert any("step-response" in name for name in names)


@pytest.mark.parametrize("name", ["step_from_5kN", "hysteresis"])  # the third is replayed below
def test_benches_of_generic_experiments_run(name: str, command: Any, caliper: Path) -> None:
    code, out, err = command("run", caliper / "benches" / f"{name}.toml")
    assert code == 0, err
    assert "peak_current" in out


def test_its_own_recording_is_replayed(command: Any, caliper: Path, tmp_path: Path) -> None:
    bench = caliper / "benches" / "follow_sine.toml"
    with undrawn():
        assert command("run", bench, "--out", tmp_path)[0] == 0
    code, out, err = command(
        "replay", tmp_path / "run.nc", "--bench", bench, "--input", "F_set=F_ref", "--json"
    )
    assert code == 0, err
    assert "F_cl" in out


def test_linearize_and_margins(command: Any) -> None:
    code, out, _ = command("linearize", "emb-plant", "--at", "7.5 A", "--json")
    assert code == 0
    assert json.loads(out)["outputs"]
    crossovers = []
    for loop in ("clamp-force", "motor-speed", "motor-current"):
        code, out, err = command("margins", loop, "--json")
        assert code == 0, err
        crossovers.append(json.loads(out)["margins"]["crossover"])
    assert crossovers == pytest.approx([7.49, 30.0, 257.0], rel=0.01)  # [Hz], a cascade


@pytest.mark.parametrize(
    "loop",
    # The others lie within it.
    [
        "clamp-force",
        *(pytest.param(one, marks=pytest.mark.trust) for one in ("motor-speed", "motor-current")),
    ],
)
def test_loops_agree_with_their_linear_models(loop: str, caliper: Path) -> None:
    found = toolkit.agreement(loop, parameters="emb42v")
    assert found.holds
    assert "dry friction" in found.differences.largest


def test_design_meets_what_is_required_from_low_to_high_force(command: Any) -> None:
    with few_starts():
        code, out, err = command(
            "design",
            "clamp-force",
            "--linear-only",
            "--require",
            "bandwidth >= 5 Hz",
            "--require",
            "phase margin >= 60 deg",
            "--over",
            "at=2 kN:30 kN:2",
        )
    assert code == 0, err
    assert "requirements met on the linear model" in out


def test_identification_recovers_the_friction_within_its_intervals(
    command: Any, emb: Any, par: Any
) -> None:
    method = emb("methods.friction_strokes").METHOD
    data = method.synthetic(par, method.defaults, 3)
    from bywire.identification.method import Effort

    start = par.replace(
        {"friction.C": 0.02, "friction.G": 2e-5, "rotor.D": 1e-3, "friction.T_s": 0.05}
    )
    found = method.identify(data, start, method.defaults, Effort())
    (best,) = found.estimates.values()
    for name, value, (low, high) in zip(best.names, best.values, best.intervals(0.99), strict=True):
        assert low <= TRUE[name] <= high, name
        assert value == pytest.approx(TRUE[name], rel=0.02)
    assert all(check.holds for check in found.checks)
    code, out, err = command("identify", "friction-strokes", "--synthetic", "1")
    assert code == 0, err
    assert "friction.G" in out
    code, out, err = command("identify", "clamp-force-strokes", "--synthetic", "1")
    assert code == 0, err
    assert "ecu.estimator.G_hat" in out


def test_workers_know_a_brake_that_was_loaded_by_path(command: Any) -> None:
    code, out, err = command("identify", "friction-strokes", "--study", "2")
    assert code in (0, 1), err
    assert "2 simulated experiments" in out


def test_wrong_sign_is_told(emb: Any, par: Any) -> None:
    from bywire.core.errors import ParameterError
    from bywire.identification.method import Effort

    method = emb("methods.friction_strokes").METHOD
    data = method.synthetic(par, method.defaults, 1)
    for signal in ("i", "F_cl"):
        data[signal] = -data[signal]
    with pytest.raises(ParameterError, match="sign = -1"):
        method.identify(data, par, method.defaults, Effort())


def test_study_finds_the_lead_within_the_current_limit(command: Any) -> None:
    code, out, err = command(
        "study", "screw-lead", "--set", "leads=4", "--set", "clearances=2", "--json"
    )
    assert code == 0, err
    kpis = json.loads(out)["kpis"]
    assert kpis["lead_fastest"]["value"] <= 0.018 + 1e-9


@pytest.mark.parametrize(("source", "agreeing"), [("strathmann2015", 4), ("line2008", 4)])
def test_sources_agree(source: str, agreeing: int, command: Any) -> None:
    code, out, err = command("reproduce", source, "--json")
    assert code == 0, err
    verdicts = [item["agrees"] for item in json.loads(out)["items"]]
    assert verdicts.count(True) == agreeing
    assert verdicts.count(False) == 0


def test_check_finds_nothing_broken(caliper: Path) -> None:
    found = toolkit.check("emb-caliper", system=caliper)
    assert not [str(f) for f in found.findings if f.outcome == "broken"]


def test_energies_of_a_brake_of_ones_own_have_colors_of_their_own() -> None:
    from bywire.report.energy_balance import COLORS, _colors

    sinks = (
        "E_supply",
        "E_copper_moving",
        "E_copper_holding",
        "E_viscous",
        "E_friction",
        "E_caliper",
        "E_stored",
    )
    colors = _colors(sinks)
    assert len(set(colors.values())) == len(sinks)
    assert colors["E_copper_moving"] == COLORS["E_copper_moving"]


def test_benches_of_the_caliper_are_compared(command, tmp_path):
    """The brake has its own panels. Differences have the units of parameters and options."""
    bench = tmp_path / "soft.toml"
    bench.write_text(
        'experiment = "clamp-step"\nparameters = "emb42v"\n[set]\nmotor.R_m = "0.2 ohm"\n',
        encoding="utf-8",
    )
    given = (bench, "clamp-step", "--out", tmp_path / "out")
    with undrawn():
        status, out, err = command("compare", *given, "--json")
    assert status == 0, err
    found = json.loads(out)
    assert [row["name"] for row in found["settings"]] == ["motor.R_m"]
    assert found["settings"][0]["unit"] == "ohm"
    assert (tmp_path / "out" / "overlay.png").is_file()


def test_what_fails_in_it_is_known_and_can_be_put_in(command: Any, tmp_path: Path) -> None:
    code, out, _ = command("list", "faults")
    assert code == 0
    for name in ("encoder.offset", "bridge.stuck", "force.frozen", "F_set.lost", "motor.hot"):
        assert name in out, name
    changes = ("--set", "options.duration=0.3 s", "--fault", "bridge.stuck@0.2 s")
    code, out, err = command("run", "clamp-step", *changes, "--json")
    assert code == 0, err
    campaign = tmp_path / "small.toml"
    campaign.write_text(
        'bench = "clamp-step"\n[campaign]\nonly = ["motor.*", "bridge.stuck"]\nhealthy = 4\n'
        'onset = "0.15 s"\n[[criteria]]\nname = "loss"\nsignal = "F_cl"\nbelow_share = "80 %"\n'
        'lasting = "20 ms"\n'
    )
    code, out, err = command("faults", campaign, "--json")
    assert code == 0, err
    kinds = {each["fault"]: each["class"] for each in json.loads(out)["faults"]}
    assert set(kinds) == {"motor.hot", "motor.demagnetized", "bridge.stuck"}


def test_what_stands_first_in_its_pages_are_its_parameters(par):
    shown = SLIDERS.find("emb-caliper").parameters
    assert shown
    assert set(shown) <= par.leaves().keys()
