"""The caliper's force-travel table: forces, energy, order of the step, invalid tables."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from wedge_runs import FRICTIONLESS, IDEAL, TAN_ALPHA, brake, drive, residual

from bywire.bench import bench_file
from bywire.brakes.wedge.elements.wedge_caliper import compliance, normal_force, travel
from bywire.brakes.wedge.model import WedgeBrake, memory_at, state_at, travel_for
from bywire.core.errors import ParameterError
from bywire.simulation.run import Run, simulate

LINEAR = {"caliper.n_table": (0.0, 1e-4), "caliper.F_table": (0.0, 3e3)}
PROGRESSIVE = {
    "caliper.n_table": (0.0, 5e-5, 1e-4, 2e-4, 4e-4),
    "caliper.F_table": (0.0, 500.0, 1500.0, 4500.0, 12e3),
}


def tabled(table, others=None):
    return brake({"caliper.law": "table", **(others or IDEAL), **table})


def curve(n, table=PROGRESSIVE):
    """Return the forces of the progressive table within its nodes."""
    return np.interp(n, table["caliper.n_table"], table["caliper.F_table"])


def on_and_off(t):
    return np.where(t < 0.15, 500.0, 30.0)


def test_collinear_nodes_are_the_linear_law():
    nodes = PROGRESSIVE["caliper.n_table"]
    five = {"caliper.n_table": nodes, "caliper.F_table": tuple(30e6 * n for n in nodes)}
    linear = drive(brake(IDEAL), 0.3, M_set=on_and_off)
    assert linear["F_N"].max() > 5e3
    other = drive(tabled(five), 0.3, M_set=on_and_off)
    for name in linear.names:
        np.testing.assert_allclose(
            other[name], linear[name], atol=1e-9 * np.abs(linear[name]).max(), rtol=0.0
        )


@pytest.mark.parametrize("force", [0.0, 1500.0, 9e3])
def test_two_nodes_are_enough(force):
    linear, table = brake().caliper, tabled(LINEAR).caliper
    assert compliance(table) == pytest.approx(compliance(linear), rel=1e-12)
    assert normal_force(force, table) == pytest.approx(force, rel=1e-12)
    assert travel(force, table) == pytest.approx(travel(force, linear), rel=1e-12)


def test_held_force_and_energy_follow_the_curve():
    free = FRICTIONLESS | {"flywheel.law": "coasting"}
    run = drive(tabled(PROGRESSIVE, free), 0.8, M_set=lambda t: 700.0 + 0.0 * t)
    n = run["x"][-1] * TAN_ALPHA - 0.2e-3
    assert PROGRESSIVE["caliper.n_table"][-2] < n < PROGRESSIVE["caliper.n_table"][-1]
    assert run["F_N"][-1] == pytest.approx(curve(n), rel=1e-6)
    assert run["M_B"][-1] == pytest.approx(700.0, abs=0.01)
    assert run["F_M"][-1] == pytest.approx((TAN_ALPHA - 0.35) * curve(n), abs=0.1)
    nodes = np.append([m for m in PROGRESSIVE["caliper.n_table"] if m < n], n)
    stored = sum(0.5 * (curve(a) + curve(b)) * (b - a) for a, b in pairwise(nodes))
    assert run["U_caliper"][-1] == pytest.approx(stored, rel=1e-6)


@pytest.mark.parametrize("force", [300.0, 1500.0, 9e3])
def test_start_states_stand_on_the_curve(force):
    depth = travel_for(force, tabled(PROGRESSIVE)) * TAN_ALPHA - 0.2e-3
    assert curve(depth) == pytest.approx(force, rel=1e-9)


def test_beyond_its_end_the_table_goes_on_with_its_last_slope():
    depth = travel_for(19.5e3, tabled(PROGRESSIVE)) * TAN_ALPHA - 0.2e-3
    assert depth == pytest.approx(6e-4, rel=1e-9)


def test_step_is_of_second_order_across_nodes_and_energy_closes():
    """Nodes are passed within substeps. The error of each falls like the other errors."""
    par = tabled(PROGRESSIVE)
    runs = [drive(par, 0.3, step, M_set=on_and_off) for step in (40e-6, 20e-6, 10e-6)]
    # No node needs another pass. Only reversals of the motion do, equally often in any step.
    assert len({run.repeated for run in runs}) == 1
    left = [float(np.abs(residual(run)).max()) for run in runs]
    assert left[1] < 1e-6 * runs[1]["E_source"].max()
    for coarse, fine in pairwise(left):
        assert coarse / fine == pytest.approx(4.0, rel=0.15)
    for name in ("x", "omega_1"):
        rms = [float(np.sqrt(np.mean((a[name] - b[name]) ** 2))) for a, b in pairwise(runs)]
        assert rms[0] / rms[1] == pytest.approx(4.0, rel=0.15), name
    heat = runs[1]["E_caliper"]
    assert np.diff(heat).min() > -1e-7
    assert heat[-1] > 1e-5


def test_both_directions_are_alike():
    still = IDEAL | {"flywheel.runout": 0.0}
    forward, backward = (
        drive(tabled(PROGRESSIVE, still | {"flywheel.Omega_0": Omega}), 0.3, M_set=on_and_off)
        for Omega in (60.0, -60.0)
    )
    assert forward["F_N"].max() > 5e3
    np.testing.assert_allclose(backward["x"], -forward["x"], atol=1e-12)
    np.testing.assert_allclose(backward["F_N"], forward["F_N"], atol=1e-4)


@pytest.mark.parametrize(("last", "doubted"), [(12e3, False), (3e8, True)])
def test_every_slope_counts_where_the_step_is_judged(last, doubted):
    """A parked brake touches with the first slope. The start warns of the slopes ahead."""
    stiffening = PROGRESSIVE | {"caliper.F_table": (0.0, 500.0, 1500.0, 4500.0, last)}
    par = tabled(stiffening | {"caliper.tau_cal": 0.0, "heart.tau_heart": 1e-3})
    still = np.zeros(len(WedgeBrake.Stimulus._fields))
    run = Run(
        WedgeBrake(),
        par,
        state_at(0.0, par),
        memory_at(0.0, par),
        lambda t: np.tile(still, (t.size, 1)),
        1e-3,
    )
    assert bool(simulate(run).doubt) == doubted


BAD = [
    ("", "", "n_table = 0 nodes must be of 2 nodes or more", "law = 'linear'"),
    ("0 mm, 0.1 mm, 0.05 mm", "0 N, 1 kN, 2 kN", "n_table.2 = 50 um", "> 0.1 mm"),
    ("0 mm, 0.1 mm, 0.1 mm", "0 N, 1 kN, 2 kN", "n_table.2 = 0.1 mm", "> 0.1 mm"),
    ("0 mm, 0.1 mm, 0.2 mm", "0 N, 3 kN, 2 kN", "F_table.2 = 2 kN", "> 3 kN"),
    ("0 mm, 0.1 mm, 0.2 mm", "0 N, 3 kN, 3 kN", "F_table", "does not rise"),
    ("0 mm, 0.1 mm, 0.2 mm", "0 N, 3 kN", "n_table = 3 nodes", "F_table, 2 nodes"),
    ("0 mm, 0.1 mm", "", "n_table = 2 nodes", "F_table, 0 nodes"),
    ("0.1 mm, 0.2 mm", "0 N, 3 kN", "n_table.0 = 0.1 mm", "0 mm"),
    ("0 mm", "0 N", "n_table = 1 nodes", "2 nodes or more"),
    ("0 mm, 0.1 mm", "0 N, -3 kN", "caliper.F_table.1 = -3 kN", ">= 0 kN"),
]


@pytest.mark.parametrize("where", ["file", "command line"])
@pytest.mark.parametrize("bad", BAD, ids=lambda bad: f"{bad[0]}; {bad[1]}")
def test_what_is_no_table_is_refused(tmp_path, bad, where):
    given = {"caliper.law": "table", "caliper.n_table": bad[0], "caliper.F_table": bad[1]}
    changes = {name: value for name, value in given.items() if value}
    lines = ['experiment = "moment-pulses"', 'parameters = "roberts2003"']
    if where == "file":
        lines += ["[set]", *(f'{name} = "{value}"' for name, value in changes.items())]
    path = tmp_path / "bench.toml"
    path.write_text("\n".join(lines))
    with pytest.raises(ParameterError) as refusal:
        bench_file.read(path, {} if where == "file" else changes)
    message = str(refusal.value)
    assert len(message.splitlines()) == 1
    for part in ("caliper", *bad[2:]):
        assert part in message
