"""Pads with hysteresis: closed forms of Maxwell slip, in an assembly and in two copies of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
import pytest

import bywire
from bywire.authoring import (
    Assembly,
    Duration,
    Integral,
    ParameterSet,
    Part,
    Role,
    Shown,
    Signal,
    Task,
    zeros,
)
from bywire.core.errors import ModelError
from bywire.core.quantities import Length
from bywire.plant import end_stop, pad_hysteresis, shaft
from bywire.simulation.ensemble import simulate_ensemble
from bywire.simulation.run import Run, Trajectory, simulate
from systems import pad_press
from systems.pad_press import PADS, PAR, PadPress, Stimulus, TwoParameters, TwoPresses
from systems.pad_press import Parameters as PressParameters

AMPLITUDE = 1e-4
QUARTER = 20
"""ticks of a quarter of a cycle"""


class RigParameters(ParameterSet):
    """Pads, and the sample time of the motion."""

    pads: pad_hysteresis.Parameters
    T_s: Duration


class Motion(NamedTuple):
    """Speed of compression, and load."""

    v: Annotated[float, Signal("m/s", "speed of the press", 0.01)]
    load: Annotated[float, Signal("N", "load", 1e3)]


class Rig(Assembly[RigParameters, Motion]):
    """Pads in a press that moves at a given speed."""

    name: ClassVar[str] = "pads-in-a-press"
    Memory: ClassVar[Any] = Motion
    Stimulus: ClassVar[Any] = Motion
    E_source = Integral("J", "energy of the press", role=Role("source", "press"))
    pads = Part(pad_hysteresis, loss="E_pads", output=("F_hysteresis",))
    slip_1 = Shown("m/s", "slip speed of the first spring")

    def wire(self, w: Any) -> None:
        """Pass on the motion."""
        w.pads.u = pad_hysteresis.Input(w.m.v, w.m.load)

    def power(self, w: Any) -> dict[str, float]:
        """Return the power of the press."""
        return {"E_source": pad_hysteresis.power_in(w.pads.x, w.pads.u, w.pads.par)}

    def record(self, w: Any) -> dict[str, float]:
        """Return the slip speed of a spring."""
        return {"slip_1": w.pads.slip.z_1}

    def tasks(self, par: RigParameters) -> tuple[Task, ...]:
        """Return the hold."""
        return (Task("hold", par.T_s, lambda x, m, u, p: Motion(*u)),)


def moved(pads: pad_hysteresis.Parameters, load: float, cycles: int = 2) -> Trajectory:
    """Return virgin loading to AMPLITUDE, then whole cycles between it and its opposite."""
    par = RigParameters(pads=pads, T_s=1e-3)
    speed = AMPLITUDE / (QUARTER * par.T_s)

    def stimulus(t: Any) -> Any:
        tick = np.rint(t / par.T_s).astype(int)
        ahead = (tick + QUARTER) // (2 * QUARTER) % 2 == 0
        return np.column_stack([np.where(ahead, speed, -speed), np.full(t.size, load)])

    duration = (4 * cycles + 1) * QUARTER * par.T_s
    start, memory = Rig().rest(par)
    return simulate(Run(Rig(), par, start, memory, stimulus, duration, 2e-5, par.T_s))


def cycle_loss(result: Trajectory, cycle: int) -> float:
    """Return the loss of a cycle, counted from 0."""
    first = (1 + 4 * cycle) * QUARTER
    return float(result["E_pads"][first + 4 * QUARTER] - result["E_pads"][first])


def test_rows_of_the_specification() -> None:
    """Springs of 4, 3, 2, 1 kN/mm and 50, 150, 300, 400 N, moved by 0.1 mm either way."""
    result = moved(PADS, 0.0)
    assert result["F_hysteresis"][QUARTER] == pytest.approx(500.0, rel=1e-12)
    pairs = ((4e6, 50.0), (3e6, 150.0), (2e6, 300.0), (1e6, 400.0))
    closed = 4.0 * sum(W * max(AMPLITUDE - W / k, 0.0) for k, W in pairs)
    assert closed == pytest.approx(47.5e-3, rel=1e-12)
    for cycle in (0, 1):
        assert cycle_loss(result, cycle) == pytest.approx(closed, rel=1e-11)
    residual = result["E_source"] - result["E_pads"] - result["E_stored"]
    assert np.abs(residual).max() < 1e-12 * result["E_source"][-1]
    assert np.all(np.diff(result["E_pads"]) >= 0.0)


def test_slip_forces_in_proportion_to_the_load() -> None:
    by_load = PADS.replace({"law": "load"})
    twice = PADS.replace({name: 2.0 * getattr(PADS, name) for name in ("W_1", "W_2", "W_3", "W_4")})
    found, expected = moved(by_load, 2.0 * PADS.F_ref), moved(twice, 0.0)
    for name in ("F_hysteresis", "z_1", "E_pads"):
        scale = np.abs(expected[name]).max()
        np.testing.assert_allclose(found[name], expected[name], rtol=0.0, atol=1e-12 * scale)
    for load in (0.0, -100.0):
        unloaded = moved(by_load, load)
        assert np.all(unloaded["F_hysteresis"] == 0.0)
        assert np.all(unloaded["E_pads"] == 0.0)


def test_without_hysteresis_nothing_acts() -> None:
    result = moved(PADS.replace({"law": "off"}), 1e3)
    for name in ("F_hysteresis", "z_1", "z_4", "E_pads"):
        assert np.all(result[name] == 0.0)


def test_slip_is_recorded() -> None:
    result = moved(PADS, 0.0)
    speed = AMPLITUDE / (QUARTER * 1e-3)
    assert result["slip_1"][QUARTER] == pytest.approx(speed, rel=1e-9)
    assert result["slip_1"][QUARTER + 2] == 0.0


def test_faults_scale_all_slip_forces() -> None:
    names = {name for fault in pad_hysteresis.FAULTS for name in fault.scaled}
    assert names == {"W_1", "W_2", "W_3", "W_4"}


# --- In a brake


def pressed(model: Any, par: Any, count: int, step: float = 2e-5) -> Trajectory:
    """Return a run that presses and releases."""
    state, memory = zeros(model.State), zeros(model.Memory)

    def stimulus(t: Any) -> Any:
        return np.repeat((4.0 * np.sin(20.0 * t) ** 2)[:, None], count, axis=1)

    return simulate(Run(model, par, state, memory, stimulus, 0.2, step))


def test_two_in_one_run_as_one_alone() -> None:
    alone = pressed(PadPress(), PAR, len(Stimulus._fields))
    other = PAR.replace({"pads.W_2": 120.0})
    both = pressed(TwoPresses(), TwoParameters(left=PAR, right=PAR), 1)
    mixed = pressed(TwoPresses(), TwoParameters(left=PAR, right=other), 1)
    other_alone = pressed(PadPress(), other, 1)
    for name in ("theta", "z_1", "z_4", "F"):
        scale = np.abs(alone[name]).max()
        for result, side, expected in (
            (both, "left", alone),
            (both, "right", alone),
            (mixed, "left", alone),
            (mixed, "right", other_alone),
        ):
            off = np.abs(result[f"{side}_{name}"] - expected[name]).max()
            assert off < 1e-4 * scale, (name, side)
    for result in (both, mixed):
        for side in ("left", "right"):
            parts = [result[f"E_{side}_{n}"] for n in ("pads", "damping", "friction", "stored")]
            residual = result[f"E_{side}_source"] - sum(parts)
            assert np.abs(residual).max() < 1e-11 * result[f"E_{side}_source"][-1]


class ContactParameters(PressParameters):
    """A press whose pads are reached after a gap."""

    stop: end_stop.Parameters
    gap: Length


class Clearance(PadPress):
    """The slip forces follow the contact force of the pads."""

    name: ClassVar[str] = "press-with-clearance"
    stop = Part(end_stop, work="W_stop", loss="E_stop", output={"far": "F_stop"})

    def wire(self, w: Any) -> None:
        """Connect the parts."""
        lead, gap = w.par.lead, w.par.gap
        w.travel, v = lead * w.shaft.x.theta, lead * w.shaft.x.omega
        w.stop.u = end_stop.Input(w.travel, v, -1.0 * gap, gap)
        w.pads.u = pad_hysteresis.Input(v, w.stop.f.far)
        hysteresis = pad_hysteresis.output(w.pads.x, w.pads.par).F_hysteresis
        w.F = end_stop.load(w.stop.f) + hysteresis
        w.shaft.u = shaft.Input(w.m.T - lead * w.F, 0.0)

    def record(self, w: Any) -> dict[str, float]:
        """Return no energy of a caliper."""
        return {}


def test_slip_forces_follow_a_contact() -> None:
    par = ContactParameters(
        **dict(PAR.replace({"pads.law": "load"})),
        stop=end_stop.Parameters(k_stop=1e7, tau_stop=1e-5),
        gap=1e-4,
    )
    residuals = []
    for step in (2e-5, 1e-5):
        result = pressed(Clearance(), par, 1, step)
        assert result.status == "done"
        names = ("pads", "damping", "friction", "stop", "stored")
        residual = result["E_source"] - sum(result[f"E_{name}"] for name in names)
        residuals.append(np.abs(residual).max() / np.ptp(result["E_source"]))
    assert residuals[0] < 1e-5
    assert residuals[1] < residuals[0] / 3.0
    is_open = result["F_stop"] == 0.0
    assert 0.1 < np.mean(is_open) < 0.9
    assert np.abs(result["F_hysteresis"][is_open]).max() < 1e-9
    assert result["F_hysteresis"].max() > 100.0
    run = result.run
    lanes = simulate_ensemble(run, {"k_p": np.array([0.4, 0.4])}, result.names)
    np.testing.assert_array_equal(lanes.values[1], simulate(run).values)


def test_stops_follow_from_the_parts() -> None:
    assert PadPress.stops == ("z_1", "z_2", "z_3", "z_4")
    assert TwoPresses.stops[4:] == ("right_z_1", "right_z_2", "right_z_3", "right_z_4")
    assert TwoPresses.reaction_places["right"] == (1, 6, 7, 8, 9)


def test_mistakes_are_named() -> None:
    with pytest.raises(ModelError, match=r"Listed.stops follows from the elements that define"):

        class Listed(Rig):
            stops = ("z_1",)

    class Early(Rig):
        def wire(self, w: Any) -> None:
            w.pads.u = pad_hysteresis.Input(w.pads.slip.z_1, w.m.load)

    par = RigParameters(pads=PADS, T_s=1e-3)
    with pytest.raises(ModelError, match=r"Rig.pads: slip has no value here"):
        Early().balance(zeros(Rig.State), zeros(Rig.State), Motion(0.0, 0.0), par, ())

    class Without(PadPress):
        def record(self, w: Any) -> dict[str, float]:
            return {"travel": w.shaft.slip.theta}

    with pytest.raises(ModelError, match=r"PadPress.shaft: shaft has no slip"):
        Without().output(
            zeros(PadPress.State), PadPress.Memory(0.0), PAR, (), (0.0,) * 5, zeros(PadPress.Flow)
        )


@pytest.fixture(scope="module")
def press() -> None:
    bywire.load_system(str(pad_press.__file__))


def test_all_contracts_hold(press: None) -> None:
    findings = bywire.check("pad-press").findings
    assert [str(f) for f in findings if f.outcome == "broken"] == []
    held = {(f.contract, f.subject) for f in findings if f.outcome == "holds"}
    of_model = {name for name, subject in held if subject == "pad-press (press-one)"}
    assert of_model >= {"units", "order of the step", "exact rest", "energy of a run", "engines"}
    assert of_model >= {"lanes", "linear model", "derivatives of a run"}
    assert ("energy of a run", "pad-press (press-by-load)") in held


@pytest.mark.parametrize("parameters", ["press-one", "press-by-load"])
def test_a_bench_estimates_its_error(parameters: str, press: None) -> None:
    """The estimate from one more step is that of the difference from a much finer step."""
    bench = bywire.Bench("press-and-release", parameters)
    largest = bywire.run(bench).kpi("output_max")
    fine = bywire.run(replace(bench, step=1e-6)).kpi("output_max")
    assert largest.error is not None
    assert abs(largest.value - fine.value) < 2.0 * largest.error + 1e-9 * fine.value
    assert largest.error < 1e-6 * fine.value


def test_start_at_a_preload_keeps_its_books() -> None:
    run = Run(
        PadPress(),
        PAR,
        PadPress.state(
            shaft=shaft.State(2.0, 0.0), pads=pad_hysteresis.State(1e-5, 2e-5, -1e-5, 0.0)
        ),
        PadPress.Memory(0.2),
        lambda t: 2.5 + 0.0 * t[:, None],
        0.1,
    )
    result = simulate(replace(run, step=1e-5))
    parts = sum(result[f"E_{name}"] for name in ("pads", "damping", "friction", "stored"))
    residual = result["E_source"] - parts
    assert np.abs(residual - residual[0]).max() < 1e-12
