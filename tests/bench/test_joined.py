"""Benches that are set up together: equal to benches that are set up alone, in every bit."""

from dataclasses import replace

import numpy as np
import pytest

from bywire.bench import joined
from bywire.bench.bench import Bench
from bywire.bench.ensemble import changed, key_figures_of
from bywire.bench.experiment import FaultyCase
from bywire.bench.joined import JoinedBenches, in_groups

CASES = 12
VARIED = {
    "hard-braking": ("motor.R_m", "caliper.K_pd", "supply.V_bat"),
    "current-step": ("motor.K_e", "motor.R_m"),
}


def made(name: str, spread: float = 0.05, **more: list[float]):
    """Return a bench, columns of numbers around its own, and the function for one bench."""
    bench, random = Bench(name), np.random.default_rng(3)
    columns = {
        each: bench.par.value(each) * (1.0 + spread * random.uniform(-1.0, 1.0, CASES))
        for each in VARIED.get(name, ())
    } | {each: np.array(values) for each, values in more.items()}

    def alone(k: int) -> Bench:
        return changed(bench, {n: float(c[k]) for n, c in columns.items()}, seed=100 + k)

    return bench, columns, alone


def groups(bench, columns, alone):
    return list(in_groups(bench, columns, [100 + k for k in range(CASES)], alone))


@pytest.mark.parametrize("name", ["hard-braking", "current-step"])
def test_joined_benches_have_the_figures_of_each(name):
    bench, columns, alone = made(name)
    ((places, benches),) = groups(bench, columns, alone)
    assert isinstance(benches, JoinedBenches)
    assert places.tolist() == list(range(CASES))
    together, each = key_figures_of(benches), key_figures_of(list(map(alone, range(CASES))))
    for one, other in zip(together.figures, each.figures, strict=True):
        assert one.values.tobytes() == other.values.tobytes()
    assert together.kpis(5) == each.kpis(5)
    assert together.warnings == each.warnings


def test_invalid_cases_do_not_hold_up_the_others():
    R = np.linspace(0.3, 0.4, CASES)
    R[[2, 7]] = -1.0
    bench, columns, alone = made("hard-braking", **{"motor.R_m": R})
    (valid, benches), (invalid, none) = sorted(
        groups(bench, columns, alone), key=lambda g: g[1] is None
    )
    assert (invalid.tolist(), none) == ([2, 7], None)
    assert isinstance(benches, JoinedBenches)
    assert benches[1:4][1].par.motor.R_m == R[valid[2]]


def test_cases_are_grouped_by_the_branches_of_their_setup():
    ends = np.full(CASES, Bench("hard-braking").par.master_cylinder.x_end)
    ends[4:9] = 0.14e-3  # before the initial pressure
    bench, columns, alone = made("hard-braking", **{"master_cylinder.x_end": ends})
    kinds = {tuple(places.tolist()): benches for places, benches in groups(bench, columns, alone)}
    assert kinds[4, 5, 6, 7, 8] is None
    assert isinstance(kinds[0, 1, 2, 3, 9, 10, 11], JoinedBenches)


def test_what_differs_when_set_up_together_is_set_up_alone(monkeypatch):
    bench, columns, alone = made("hard-braking")
    column_wise = joined._column_wise
    monkeypatch.setattr(joined, "_column_wise", lambda numbers, n: column_wise(numbers, n) + 1e-9)
    ((_, benches),) = groups(bench, columns, alone)
    assert benches is None


def test_runs_with_faults_are_set_up_alone():
    bench, columns, alone = made("hard-braking")
    fault = {"fault": "supply.under-voltage", "onset": "0.1 s"}
    faulty = replace(bench, faults=[fault])
    assert isinstance(faulty.cases()[0], FaultyCase)
    ((_, benches),) = groups(faulty, columns, alone)
    assert benches is None
