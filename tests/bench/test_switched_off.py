"""Only parameters that a choice switches off are rejected."""

from __future__ import annotations

from pathlib import Path

import pytest

import bywire
from bywire.bench.bench import Bench, parameters_read, switches_of
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import ParameterError
from bywire.core.model import ASSEMBLIES
from bywire.simulation.engine import prepare
from bywire.simulation.stages import build_stages

OFF = r"fluid.V_air = 0.5 ml would have no effect because fluid.air = 'none'. Either set fluid.air"
ON = {"fluid.V_air": 5e-8, "fluid.air": "caliper"}
NAMES = sorted(PARAMETER_SETS.all())


@pytest.mark.parametrize("name", NAMES)
def test_all_that_a_kernel_reads_counts_as_read(name: str) -> None:
    """Traced equations may read more, because a product with zero is removed from the graph."""
    found = PARAMETER_SETS.find(name)
    par, model = found.parameters(), ASSEMBLIES.find(found.assembly)()
    stages = build_stages(prepare(model, par).program)
    roots = [n for each in (stages.fast, stages.exact) for nodes in each.values() for n in nodes]
    roots += [*stages.posed, *stages.output, *(n for task in stages.ticks for n in task)]
    leaves, read = list(par.leaves()), stages.graph.read_by(roots)
    in_kernel = {n for k, n in enumerate(leaves) if stages.graph.leaf("p", k) in read}
    traced = parameters_read(model, par)
    assert traced is not None
    assert in_kernel <= traced
    assert len(in_kernel) > 0.9 * len(traced)


def test_a_parameter_that_a_choice_switches_off_is_refused(tmp_path: Path) -> None:
    """In Python, in a file, over a range and in a study alike; switched on, it counts."""
    with pytest.raises(ParameterError, match=OFF):
        Bench("hard-braking", "dardanelli2010", overrides={"fluid.V_air": 5e-7})
    file = tmp_path / "bench.toml"
    file.write_text(
        'experiment = "hard-braking"\nparameters = "dardanelli2010"\n'
        '[set]\n"fluid.V_air" = "0.5 ml"\n'
    )
    with pytest.raises(ParameterError, match=OFF):
        bywire.load(file)
    with pytest.raises(ParameterError, match=r"fluid\.V_air = .* would have no effect"):
        bywire.run("hard-braking", over="fluid.V_air=0.1ml:0.5ml:3")
    study = tmp_path / "study.toml"
    plain = tmp_path / "plain.toml"
    plain.write_text('experiment = "hard-braking"\nparameters = "dardanelli2010"\n')
    study.write_text('bench = "plain.toml"\n[vary]\n"fluid.V_air" = "0.1 .. 0.5 ml"\n')
    with pytest.raises(ParameterError, match=r"fluid\.V_air = .* would have no effect"):
        bywire.run_study(study, tmp_path / "out")
    Bench("hard-braking", "dardanelli2010", overrides=ON)


@pytest.mark.parametrize(
    ("experiment", "name", "changes"),
    [
        ("hard-braking", "dardanelli2010", {"motor_heat.T_most": 400.0}),  # a limit of warnings
        ("hard-braking", "dardanelli2010", {"vapor.water": 0.02}),  # of a figure
        ("hard-braking", "dardanelli2010", {"fluid.V_air": 0.0}),  # what the set has
        ("pedal-tracking", "dardanelli2010", {"pedal.k_spring": 5e3}),  # of the rider's demand
        ("seal-stribeck", "dardanelli2010", {"seal.c": 4.0}),  # of an experiment without runs
        ("rear-lift", "sport600", {"vehicle.road.first.D": 1.1}),
        ("straight-stop", "sport600", {"ecu.rules.slip_keep": 0.4, "ecu.abs": "rules"}),
    ],
)
def test_what_counts_anywhere_is_taken(experiment: str, name: str, changes: dict) -> None:
    Bench(experiment, name, overrides=changes)


@pytest.mark.parametrize(
    ("experiment", "name", "parameter", "switch", "other"),
    [
        ("straight-stop", "sport600", "ecu.rules.slip_keep", "ecu.abs", "rules"),
        ("straight-stop", "sport600", "front.heat.C_d", "front.heat.law", "lumped"),
        ("hard-braking", "dardanelli2010", "ecu.schedule.low.k_p", "ecu.schedule.law", "regions"),
        ("moment-pulses", "roberts2003", "flywheel.K_drive", "flywheel.law", "driven"),
    ],
)
def test_what_switches_a_parameter_on_is_named(
    experiment: str, name: str, parameter: str, switch: str, other: str
) -> None:
    found = switches_of(parameter, Bench(experiment, name).cases())
    assert other in next(each.others for each in found if each.name == switch)


def test_a_pattern_passes_over_what_is_switched_off() -> None:
    bench = Bench("hard-braking", "dardanelli2010")
    changed = bench.with_overrides({"caliper.*": "+5%"})
    assert changed.par.caliper.K_pd == pytest.approx(1.05 * bench.par.caliper.K_pd)
    assert changed.par.caliper.V_hot == bench.par.caliper.V_hot  # of fluid at constant temperature
    Bench("hard-braking", "dardanelli2010", overrides={"caliper.*": "+5%"})
