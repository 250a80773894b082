"""Exact sensitivities versus central differences: smooth runs, contacts, stick and slip."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from bywire.bench.bench import Bench
from bywire.bench.experiment import as_run
from bywire.core.errors import UnknownNameError
from bywire.simulation import compiler
from bywire.simulation.emit_tangents import emit_tangents
from bywire.simulation.engine import prepare
from bywire.simulation.run import Run, simulate
from bywire.simulation.sensitivity import simulate_with_sensitivities
from bywire.simulation.stages import build_stages
from systems.three_contacts import heart
from systems.thrown_body import FORCE, THROWN_AT, thrown
from systems.towed_body import PULL, towed
from systems.two_mass import rig

Array = NDArray[np.float64]


def open_loop(
    overrides: dict[str, float], options: dict[str, object], start: float, slope: float
) -> Run:
    bench = Bench(
        "motor-open-loop",
        "dardanelli2010",
        overrides=overrides,
        options=options,
        stimulus={
            "kind": "ramp",
            "start": start,
            "end": 5.0,
            "slope": slope,
            "t_start": 0.0,
            "t_hold": 0.0,
            "after": "stay",
        },
    )
    return as_run(bench.cases()[0], bench.step)


def differences(run: Run, name: str, share: float, signals: tuple[str, ...]) -> Array:
    """Return central differences times the parameter's value, shape (rows, signals)."""
    value = run.par.leaves()[name]
    up, down = (
        simulate(replace(run, par=run.par.replace({name: value * (1.0 + s * share)})), signals)
        for s in (1.0, -1.0)
    )
    return (up.values - down.values) / (2.0 * share)


def test_smooth_run() -> None:
    """Sliding under a voltage ramp: nine parameters, which take two groups of directions."""
    options = {"source": "voltage", "p_start": 10e5, "add_holding": True, "duration": 0.05}
    run = open_loop({"drive.T_source": 1e-3}, options, 1.0, 20.0)
    run = replace(run, state=run.state._replace(omega=20.0))
    signals = ("i", "omega", "p_mc", "p_pd", "E_copper", "E_stored")
    names = (
        "motor.R_m",
        "motor.K_e",
        "seal.T_pr",
        "seal.f_cfr_p",
        "fluid.beta",
        "caliper.K_pd",
        "gear.J_mot",
        "master_cylinder.A_mc",
        "fluid.nu",
    )
    result = simulate_with_sensitivities(run, names, signals)
    assert np.all(result.trajectory.values[:, 1] > 10.0)
    for k, name in enumerate(names):
        wanted = differences(run, name, 1e-5, signals)
        computed = result.derivatives[:, :, k] * run.par.leaves()[name]
        scale = np.abs(wanted).max(axis=0) + 1e-6 * np.abs(result.trajectory.values).max(axis=0)
        assert np.abs(computed - wanted).max() > 0.0
        assert (np.abs(computed - wanted).max(axis=0) / scale).max() < 1e-5, name
        assert np.abs(wanted).max() > 0.0


def test_first_slips_of_the_ramp() -> None:
    """Angles after three jumps, within 2 per cent.

    The current must move nearly continuously: where it is held for long, a jump begins at a tick,
    which moves with the parameters in differences but not in derivatives (up to 10 per cent off
    at 0.1 ms).
    """
    options = {"source": "current", "duration": 4.5, "record": 1e-2}
    run = open_loop({"drive.T_source": 20e-6}, options, 0.0, 0.2)
    names = ("seal.T_pr", "seal.f_cfr_p", "seal.k_brk_p", "motor.K_e", "caliper.K_pd")
    result = simulate_with_sensitivities(run, names, ("theta", "stuck"))
    stuck = result.trajectory["stuck"] > 0.0
    rests = np.flatnonzero(np.diff(stuck.astype(int)) == 1) + 15  # the later jumps have ended too
    assert rests.size >= 3
    for name in names:
        wanted = differences(run, name, 1e-2, ("theta",))[rests, 0]
        computed = result.of("theta", name)[rests] * run.par.leaves()[name]
        np.testing.assert_allclose(computed, wanted, rtol=0.02, err_msg=name)


HEART = (("X_1", "X_2", "x"), ("F_S0", "loss", "mu", "g", "K_S", "M_S", "k_p"))
RIG = (("x_1", "x_2"), ("F_c1", "m_1", "k_wall", "mu", "damping"))


@pytest.mark.parametrize(
    ("run", "signals", "names"),
    [
        (heart(0.012, record=1e-3), *HEART),
        (heart(0.008, record=1e-3, stiffer=300.0, tau=0.0), HEART[0], ("F_S0", "K_S", "M_S")),
        (rig(0.005, record=1e-3), *RIG),
        (rig(0.005, record=1e-3, rare=True, k_wall=1.5e9), *RIG),
    ],
    ids=["heart", "repeated passes", "rig", "rare contact"],
)
def test_contacts_and_frictions(run: Run, signals: tuple[str, ...], names: tuple[str, ...]) -> None:
    """Selections of contact sets, sweeps, signs and repetitions are differentiated as taken.

    Up to the first reversal, which moves in time: see below.
    """
    every = next(every for _, every in (HEART, RIG) if set(names) <= set(every))  # one kernel
    result = simulate_with_sensitivities(run, every, signals)
    assert result.trajectory.status == "done"
    for name in names:
        wanted = differences(run, name, 1e-7, signals)
        computed = result.derivatives[:, :, every.index(name)] * run.par.leaves()[name]
        scale = np.abs(wanted).max() + 1e-7 * np.abs(result.trajectory.values).max()
        assert np.abs(computed - wanted).max() < 1e-4 * scale, name


def test_reversals_that_move_in_time() -> None:
    """Where a sliding body turns round: large differences, which do not see the substeps' grid.

    Tiny ones see a body that turns in the same substep, and are up to 20 per cent off here.
    """
    run = rig(0.006, 1e-6, record=1e-3)
    result = simulate_with_sensitivities(run, RIG[1], RIG[0])
    for k, name in enumerate(RIG[1][:3]):
        wanted = differences(run, name, 1e-2, RIG[0])[-1]
        computed = result.derivatives[-1, :, k] * run.par.leaves()[name]
        np.testing.assert_allclose(computed, wanted, rtol=0.03, err_msg=name)


@pytest.mark.parametrize("step", [20e-6, 5e-6])
def test_reversal_under_a_constant_force(step: float) -> None:
    """Closed form: a body thrown against force and friction, back under force less friction."""
    run = thrown(step)
    result = simulate_with_sensitivities(run, ["m", "T", "initial.v"], ("x", "v"))
    m, T, F, v_0, t = run.par.m, run.par.T, -FORCE, THROWN_AT, 0.1
    there, back = (F + T) / m, (F - T) / m  # decelerations
    t_r = v_0 / there
    assert 0.0 < t_r < 0.9 * t
    np.testing.assert_allclose(result.trajectory["v"][-1], -back * (t - t_r), rtol=1e-9)
    # v = -(F - T) (t/m - v_0 / (F + T))
    by_m, by_T = back * t / m, (t / m - v_0 / (F + T)) - (F - T) * v_0 / (F + T) ** 2
    by_v = (F - T) / (F + T)
    found = [result.of("v", name)[-1] for name in result.parameters]
    np.testing.assert_allclose(found, [by_m, by_T, by_v], rtol=1e-8)


def sampled_throw(m: float, T: float, g: float, v: float) -> tuple[float, float]:
    """Return speed after 0.1 s and the first instant of standstill under F - g v, sampled."""
    stops = 0.0
    for tick in range(10):
        force, left = FORCE - g * v, 1e-2
        if v > 0.0:
            t = min(v * m / (T - force), left)
            v, left = v + (force - T) / m * t, left - t
            v, stops = (0.0, tick * 1e-2 + t) if left else (v, stops)
        if v <= 0.0:
            assert abs(force) > T  # it never rests
            v += (force + T) / m * left
    return v, stops


@pytest.mark.parametrize("early", [0.02, 0.5, 0.98])
def test_reversal_in_the_last_substep_before_a_tick(early: float) -> None:
    """The tick samples the speed behind it, and what it commands stays."""
    run, g = thrown(20e-6), 4.0
    m, T, at = run.par.m, run.par.T, 0.03 - early * run.step
    v_0 = brentq(lambda v: sampled_throw(m, T, g, v)[1] - at, 0.15, 0.25, xtol=1e-16)
    run = replace(run, par=run.par.replace({"g": g}), state=run.state._replace(v=v_0))
    result = simulate_with_sensitivities(run, ["m", "T", "g", "initial.v"], ("v",))
    point = np.array([m, T, g, v_0])
    assert result.trajectory["v"][-1] == pytest.approx(sampled_throw(*point)[0], rel=1e-8)
    for k, name in enumerate(result.parameters):
        # Differences of the closed form, which is smooth while the order of events is the same.
        d = np.eye(4)[k] * 1e-7 * early * (1.0 - early) * point
        wanted = (sampled_throw(*(point + d))[0] - sampled_throw(*(point - d))[0]) / (2.0 * d[k])
        assert result.of("v", name)[-1] == pytest.approx(wanted, rel=2e-5), name


def test_breakaway_of_coupled_bodies_is_of_first_order_in_derivatives() -> None:
    """Closed form: behind the breakaway x = V s - V/w sin(w s), which begins at s = t - T/(k V)."""
    errors = []
    for step in (20e-6, 10e-6, 5e-6):
        run = towed(step)
        result = simulate_with_sensitivities(run, ["T"], ("x",))
        k, w = run.par.k, np.sqrt(run.par.k / run.par.m)
        s = result.trajectory.time[1:] - run.par.T / (k * PULL)
        moved = PULL * s - PULL / w * np.sin(w * s)
        np.testing.assert_allclose(result.trajectory["x"][1:], moved, rtol=2e-3 * (step / 20e-6))
        by_T = -(1.0 - np.cos(w * s)) / k
        errors.append(np.abs(result.of("x", "T")[1:] - by_T).max() / np.abs(by_T).max())
    assert errors[0] < 0.02
    assert errors[2] < 0.6 * errors[0]


def test_initial_state_that_depends_on_a_parameter() -> None:
    """Derivatives of the initial state add to those of the run."""
    options = {"source": "voltage", "p_start": 10e5, "add_holding": True, "duration": 0.02}
    run = open_loop({"drive.T_source": 1e-3}, options, 1.0, 20.0)
    run = replace(run, state=run.state._replace(omega=20.0))
    start = np.array(run.state)
    slope = np.array([1.0, 0.5, 3.0, 1e4, 2e4, *np.zeros(start.size - 5)])
    name, value, share = "motor.R_m", run.par.motor.R_m, 1e-5
    result = simulate_with_sensitivities(run, [name], ("p_pd", "i"), slope[:, None])
    up, down = (
        simulate(
            replace(
                run,
                par=run.par.replace({name: value * (1.0 + s * share)}),
                state=type(run.state)(*(start + s * share * value * slope)),
            ),
            ("p_pd", "i"),
        ).values
        for s in (1.0, -1.0)
    )
    wanted = (up - down) / (2.0 * share * value)
    error = np.abs(result.derivatives[:, :, 0] - wanted).max(axis=0)
    assert (error / np.abs(wanted).max(axis=0)).max() < 1e-5


def test_unknown_parameter() -> None:
    with pytest.raises(UnknownNameError, match="F_S0"):
        simulate_with_sensitivities(heart(0.001), ["F_S"], ["x"])


def test_initial_states_and_offsets_of_the_stimulus_are_directions_too() -> None:
    options = {"source": "voltage", "p_start": 10e5, "add_holding": True, "duration": 0.02}
    run = open_loop({"drive.T_source": 1e-3}, options, 1.0, 20.0)
    run = replace(run, state=run.state._replace(omega=20.0))
    signals = ("p_pd", "i", "omega")
    names = ("initial.omega", "motor.R_m", "stimulus.v_set")
    result = simulate_with_sensitivities(run, names, signals)

    def shifted(name: str, by: float) -> Array:
        kind, last = name.split(".")
        if kind == "motor":
            own = replace(run, par=run.par.replace({name: run.par.leaves()[name] + by}))
        elif kind == "initial":
            own = replace(run, state=run.state._replace(**{last: getattr(run.state, last) + by}))
        else:
            column = run.model.Stimulus._fields.index(last)
            add = by * np.eye(len(run.model.Stimulus._fields))[column]
            own = replace(run, stimulus=lambda t: run.stimulus(t) + add)
        return simulate(own, signals).values

    for k, name in enumerate(names):
        wanted = (shifted(name, 1e-4) - shifted(name, -1e-4)) / 2e-4
        error = np.abs(result.derivatives[:, :, k] - wanted).max(axis=0)
        assert (error / np.abs(wanted).max(axis=0)).max() < 1e-5, name
    with pytest.raises(UnknownNameError, match=r"initial\.omega"):
        simulate_with_sensitivities(run, ["initial.omgea"], signals)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="asks gcc what it did")
def test_the_lanes_of_a_substep_are_vectorized(tmp_path: Path) -> None:
    """Friction chooses by truth values that all lanes share, which compilers stumble over."""
    run = thrown(20e-6)
    program = prepare(run.model, run.par).program
    source = tmp_path / "kernel.c"
    source.write_text(emit_tangents(build_stages(program, (0, 1)), 8), encoding="utf-8")
    flags = (*compiler._COMMON, *compiler.VECTOR, "-fopt-info-vec-optimized")
    done = subprocess.run(
        ["gcc", *flags, str(source), "-o", str(tmp_path / "kernel.so")],
        capture_output=True,
        text=True,
        check=True,
    )
    lines = source.read_text(encoding="utf-8").splitlines()
    substep = max(k for k, line in enumerate(lines, 1) if "#pragma omp simd" in line)
    told = re.findall(r"kernel\.c:(\d+):\d+: optimized: loop vectorized", done.stderr)
    assert any(int(line) > substep for line in told), done.stderr
