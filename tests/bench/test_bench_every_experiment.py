"""Every experiment runs from a bench file of two lines and gives its declared results."""

from __future__ import annotations

import json
import math
from contextlib import suppress

import numpy as np
import pytest

import bywire
from bywire.bench.ensemble import key_figures_of, run_benches
from bywire.bench.experiment import EXPERIMENTS
from bywire.bench.kpis.families import FamilyJudge
from bywire.bench.running import run_of
from bywire.bench.stimulus import STIMULI
from bywire.core.brake import brakes
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import InputError
from bywire.report.bench_figures import bench_figures
from bywire.simulation.ensemble import fit_lanes

NAMES = sorted(EXPERIMENTS.all())
PAIRS = [
    (experiment.name, found.name)
    for experiment in EXPERIMENTS.all().values()
    for found in PARAMETER_SETS.all().values()
    if found.assembly == experiment.assembly
]
FIRST = dict(reversed(PAIRS))  # the first parameter set that fits each experiment
LINES = 'experiment = "{}"\nparameters = "{}"\n'
FEWER = {  # experiments with many runs, which are run unchanged in the tests of their brakes
    "static-force": 'mu_B = "0.2, 0.6"',
    "friction-sweep": 'mu_B = "0.2, 0.6"',
    "position-step": 'amplitudes = "0.5 rad"',
    "repeated-stops": "stops = 2",
    "bandwidths": 'f_n = "3 Hz, 40 Hz"',
    "slope-hold": 't_release = "5 s"\nduration = "7 s"',
}
LARGE = (
    "bandwidths",
    "corner-blending",
    "corner-panic",
    "corner-stop",
    "disc-stop",
    "force-cycle",
    "friction-ramp",
    "friction-sweep",
    "moment-pulse-950",
    "position-step",
    "rear-drag",
    "rear-lift",
    "repeated-stops",
    "slope-hold",
    "slow-stop",
    "static-force",
    "stiffness",
)
"""kernels in lanes that no other test needs, and long runs; other experiments of the same models
have their figures computed in the same way, and all that are computed by families are left"""
WARNED = {name: ["retracted stop"] for name in ("pressure-release", "rear-drag")}
"""their port belongs to no model"""
STEP = '[stimulus]\nkind = "step"\nstart = "0 {0}"\nend = "1 {0}"\nt_step = "0.1 s"\n'


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> dict[str, bywire.BenchResult]:
    """Run every experiment once, from a bench file of two lines."""
    folder = tmp_path_factory.mktemp("benches")
    found = {}
    for name in NAMES:
        path = folder / f"{name}.toml"
        driven = EXPERIMENTS.all()[name].driven_unit is not None
        lines = LINES.format(name, FIRST[name])
        fewer = f"[options]\n{FEWER[name]}\n" if name in FEWER else ""
        path.write_text(lines + fewer + (STEP.format("A") if driven else ""))
        found[name] = bywire.run(bywire.load(path), estimate_error=False)
    return found


@pytest.mark.parametrize("name", NAMES)
def test_two_lines_are_enough(results, name):
    result = results[name]
    assert result.status == "done"
    expected = WARNED.get(name, [])
    assert len(result.warnings) == len(expected)
    assert all(part in text for part, text in zip(expected, result.warnings, strict=True))
    assert result.recordings
    for recording in result.recordings.values():
        assert recording.attrs.get("status", "done") == "done"


@pytest.mark.parametrize("name", NAMES)
def test_kpis_are_those_declared(results, name):
    declared = EXPERIMENTS.all()[name].kpis_with(results[name].bench.chosen_options)
    found = {kpi.name: kpi.unit for kpi in results[name].kpis}
    differ = {key for key, _ in found.items() ^ declared.items()}
    assert not differ, f"the experiment's fields judge and kpis differ in {differ}"
    for kpi in results[name].kpis:
        assert kpi.definition.endswith(".")
        assert math.isfinite(kpi.value) or kpi.note


@pytest.mark.parametrize("name", NAMES)
def test_every_figure_it_names_exists(results, name):
    shown = bench_figures(results[name])
    kinds = EXPERIMENTS.all()[name].figures
    assert kinds
    for kind in kinds:
        assert any(figure.name.startswith(kind) for figure in shown)


@pytest.mark.parametrize("name", NAMES)
def test_results_are_json(results, name):
    text = json.dumps(results[name].as_object(), allow_nan=False)
    assert set(json.loads(text)["kpis"]) <= set(EXPERIMENTS.all()[name].kpis)


@pytest.mark.parametrize("name", NAMES)
def test_every_signal_has_unit_and_name(results, name):
    for recording in results[name].recordings.values():
        for variable in recording.variables.values():
            assert variable.attrs["units"]
            assert variable.attrs["long_name"]


@pytest.mark.parametrize("name", NAMES)
def test_recordings_give_the_same_figures_as_their_plain_rows(results, name):
    result = results[name]
    kpis = EXPERIMENTS.all()[name].judge(result.recordings, result.bench.chosen_options)
    exact = {kpi.name: kpi.value for kpi in result.kpis}
    assert {kpi.name: kpi.value for kpi in kpis} == pytest.approx(exact, rel=0, abs=0, nan_ok=True)


def test_all_experiments_judged_by_families_are_put_to_the_test():
    judged = {n for n, each in EXPERIMENTS.all().items() if isinstance(each.judge, FamilyJudge)}
    assert len(judged) >= 3
    assert not judged & set(LARGE)
    left = {EXPERIMENTS.all()[name].assembly for name in NAMES if name not in LARGE}
    corners = {"wedge-corner", "wedge-corner-electric"}
    assert left == {each.assembly for each in EXPERIMENTS.all().values()} - corners


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.trust) if n in LARGE else n for n in NAMES]
)
def test_figures_of_many_cases_are_those_of_their_recordings(results, name):
    """Families evaluate all cases from the required signals only; lanes equal single runs."""
    bench = results[name].bench
    (other,) = random_cases(bench, 1)
    figures = key_figures_of([bench, other])
    alone = (results[name], bywire.run(other, estimate_error=False))
    for k, recorded in enumerate(run_benches([bench, other])):
        assert figures.kpis(k) == recorded.kpis  # to the last digit, reasons too
        assert figures.kpis(k) == alone[k].kpis
        assert list(figures.warnings[k]) == recorded.warnings
        assert [*recorded.bench.outdated, *recorded.warnings] == alone[k].warnings
        assert all(
            "lanes" in each.attrs["engine"]
            for each in recorded.recordings.values()
            if "engine" in each.attrs
        )


@pytest.mark.trust
@pytest.mark.parametrize("name", NAMES)
def test_random_cases_in_lanes_are_those_alone(results, name):
    """Exactly, although 1e-9 would suffice: both kernels have the same order of operations."""
    cases = random_cases(results[name].bench, 1000)
    for begin in range(0, len(cases), 50):
        each = cases[begin : begin + 50]
        figures = key_figures_of(each)
        for k, case in enumerate(each):
            assert figures.kpis(k) == key_figures_of([case]).kpis(0)


def random_cases(bench, count):
    """Return benches with the same plan, ten parameters up to 5 % off, and different noise."""
    rng = np.random.default_rng([count, *bench.experiment.encode()])
    leaves, found = bench.par.leaves(), []
    while len(found) < count:
        names = rng.choice(list(leaves), 10, replace=False)
        values = {n: leaves[n] * rng.uniform(0.95, 1.05) for n in names}
        with suppress(InputError):  # incompatible sample times, crossed ranges
            case = bench.varied(values, {}, int(rng.integers(1000)))
            pairs = zip(bench.cases(), case.cases(), strict=True)
            runs = [[run_of(b, c, 0) for b, c in zip((bench, case), p, strict=True)] for p in pairs]
            if all(map(fit_lanes, runs)):
                found.append(case)
    return found


@pytest.mark.parametrize(("name", "parameters"), PAIRS)
def test_every_parameter_set_of_the_assembly_fits(name, parameters):
    definition = EXPERIMENTS.all()[name]
    stimulus = {"kind": "step", "start": 0, "end": 1, "t_step": 0} if definition.driven_unit else {}
    options = {"stops": 1} if name == "repeated-stops" else {}  # every case runs each of them
    bench = bywire.Bench(name, parameters, options=options, stimulus=stimulus)
    for case in bench.cases():
        assert type(case.par) is type(bench.par)


def test_each_is_found_without_loading_all():
    for brake in brakes().values():
        for name, each in EXPERIMENTS.of(brake.module).items():
            assert EXPERIMENTS.guess(name) is each


@pytest.mark.parametrize("kind", sorted(STIMULI.all()))
@pytest.mark.parametrize(
    ("source", "unit"),
    [
        ("current", "A"),
        ("voltage", "V"),
        ("current-loop", "A"),
        ("current-direct", "A"),
        ("pressure", "bar"),
    ],
)
def test_every_stimulus_drives_the_open_loop(kind, source, unit):
    values = {
        "step": {"start": 0, "end": f"1 {unit}", "t_step": 0.01},
        "ramp": {
            "start": 0,
            "end": f"1 {unit}",
            "slope": f"50 {unit}/s",
            "t_start": 0,
            "t_hold": 0,
            "after": "return",
        },
        "sine": {
            "mean": f"1 {unit}",
            "amplitude": f"1 {unit}",
            "f": "100 Hz",
            "t_start": 0,
            "phase": 0,
        },
        "chirp": {
            "mean": f"1 {unit}",
            "amplitude": f"1 {unit}",
            "f_start": "1 Hz",
            "f_end": "100 Hz",
            "t_sweep": "40 ms",
            "sweep": "linear",
            "t_start": 0,
        },
        "multisine": {
            "mean": f"1 {unit}",
            "amplitude": f"0.1 {unit}",
            "f_base": "10 Hz",
            "n": 5,
            "t_start": 0,
        },
        "table": {"times": "0 s, 20 ms", "values": f"0 {unit}, 1 {unit}", "between": "hold"},
    }
    options = {"source": source, "duration": "50 ms"}
    bench = bywire.Bench(
        "motor-open-loop",
        "dardanelli2010",
        options=options,
        stimulus={"kind": kind, **values[kind]},
    )
    recording = bywire.run(bench).recordings["run"]
    assert float(abs(recording["i"]).max()) > 0.1
