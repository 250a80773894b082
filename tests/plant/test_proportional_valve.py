"""Proportional inlet valve: held pressure difference, hysteresis, and oscillation of the needle."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
import pytest

from bywire.authoring import Assembly, Duration, Integral, ParameterSet, Part, Role, Signal, Task
from bywire.core.errors import ParameterError
from bywire.plant import (
    brake_fluid,
    end_stop,
    orifice,
    proportional_valve,
    stiffening_caliper,
)
from bywire.simulation.run import Run, Trajectory, simulate
from raising import raises
from systems.fluids import FLUID, flat

BAR, CM3 = 1e5, 1e-6


class Parameters(ParameterSet):
    """Valve, its seat and stop, caliper, and an orifice through which fluid leaves."""

    valve: proportional_valve.Parameters
    stop: end_stop.Parameters
    caliper: stiffening_caliper.Parameters
    outlet: orifice.Parameters
    fluid: brake_fluid.Parameters
    T_s: Duration


class Stimulus(NamedTuple):
    """Current, pressure of the master cylinder, and opening of the outlet."""

    i_valve: Annotated[float, Signal("A", "valve current", 1.0)]
    p_m: Annotated[float, Signal("Pa", "pressure of the master cylinder", 5e6)]
    open: Annotated[float, Signal("1", "opening of the outlet", 0.5, low=0.0, high=1.0)]


class Wheel(Assembly[Parameters, Stimulus]):
    """A wheel brake behind the valve."""

    name: ClassVar[str] = "proportional-wheel"
    Memory: ClassVar[Any] = Stimulus
    Stimulus: ClassVar[Any] = Stimulus
    frictions = ("v",)
    shared = ("fluid",)
    E_source = Integral("J", "energy of master and coil", role=Role("source", "master and coil"))
    losses: ClassVar[dict[str, str]] = {"E_valve": "throttling", "E_needle": "power_loss"}
    valve = Part(proportional_valve, loss=losses, output=("q",))
    stop = Part(end_stop, work="W_stop", loss="E_stop")
    caliper = Part(stiffening_caliper)
    outlet = Part(orifice, loss="E_outlet")
    E_friction = Integral("J", "friction of the needle", role=Role("sink", "needle friction"))
    V_given = Integral("m**3", "volume from the master cylinder, minus outflow")

    def wire(self, w: Any) -> None:
        """Connect valve and caliper."""
        x, fluid = w.valve.x, w.par.fluid
        far = w.valve.par.lift
        w.stop.u = end_stop.Input(x.x, x.v, 0.0 * far, far)
        w.valve.u = proportional_valve.Input(
            w.m.i_valve, w.m.p_m, w.caliper.x.p, end_stop.load(w.stop.f)
        )
        w.outlet.u = orifice.Input(w.caliper.x.p, 0.0 * w.m.p_m, w.m.open)
        q = proportional_valve.output(x, w.valve.u, w.valve.par, fluid).q
        w.caliper.u = stiffening_caliper.Input(q - orifice.flow(w.outlet.u, w.outlet.par, fluid))

    def friction(self, w: Any) -> tuple[tuple[float, float], ...]:
        """Return the bounds of the needle's friction."""
        F = proportional_valve.friction(w.valve.par)
        return ((-F, F),)

    def power(self, w: Any) -> dict[str, float]:
        """Return the power of master cylinder and coil."""
        y = proportional_valve.output(w.valve.x, w.valve.u, w.valve.par, w.par.fluid)
        h = brake_fluid.convected_power(y.q, w.m.p_m, w.par.fluid)
        return {
            "E_source": h + y.P_coil,
            "E_friction": -w.reaction[0] * w.valve.x.v,
            "V_given": w.caliper.u.q,
        }

    def tasks(self, par: Parameters) -> tuple[Task, ...]:
        """Return the hold."""
        return (Task("hold", par.T_s, lambda x, m, u, p: Stimulus(*u)),)


def parameters(changes: dict[str, Any] | None = None) -> Parameters:
    """Return a seat of 0.5 mm and 60 bar/A, all values chosen."""
    flow = {"C_d": 0.65, "Re_cr": 100.0}
    groups = {
        "valve": {
            "alpha": 0.8,
            "lift": 2e-4,
            "m": 5e-3,
            "k_s": 2e3,
            "F_s0": 1.0,
            "d": 2.0,
            "F_h": 0.02,
            "G": 60 * BAR,
        },
        "valve.seat": flow | {"d": 0.5e-3},
        "stop": {"k_stop": 2e5, "tau_stop": 2e-5},
        "caliper": {"V_1": 0.0, "p_1": 4 * BAR, "c": 0.011 * CM3 / BAR},
        "outlet": flow | {"d": 0.25e-3},
        "fluid": FLUID,
    }
    return Parameters.create(flat(groups) | {"T_s": 1e-3} | (changes or {}))


def driven(
    par: Parameters, stimulus: Any, duration: float, step: float = 1e-5, p: float = 0.0
) -> Trajectory:
    """Return a run from a closed valve at a caliper pressure."""
    start = Wheel.state(caliper=stiffening_caliper.State(p))
    rest = Stimulus(*stimulus(np.zeros(1))[0])
    return simulate(Run(Wheel(), par, start, rest, stimulus, duration, step))


def residual(result: Trajectory) -> float:
    """Return the residual of the energy balance, relative to the energy of the source."""
    sinks = ("valve", "needle", "stop", "outlet", "friction", "stored")
    rest = result["E_source"] - sum(result[f"E_{name}"] for name in sinks)
    return float(np.abs(rest - rest[0]).max() / np.abs(result["E_source"]).max())


def constant(i: float, p_m: float, opened: float) -> Any:
    """Return constant inputs."""
    return lambda t: np.tile([i, p_m, opened], (t.size, 1))


@pytest.mark.parametrize("current", [1.2, 1.6, 2.0])
def test_the_current_holds_a_pressure_difference(current):
    """Filling through the valve ends within the friction below G i - F_s0/A_s."""
    par = parameters()

    def ramp(t: Any) -> Any:
        return np.column_stack(
            [np.full_like(t, current), np.minimum(50 * BAR * t, 150 * BAR), 0 * t]
        )

    result = driven(par, ramp, 3.2)
    A = proportional_valve.area(par.valve)
    held = proportional_valve.held_pressure(current, par.valve)
    assert held == pytest.approx(60 * BAR * current - 1.0 / A)
    difference = (result["p_m"] - result["p"])[result.time > 2.0]
    spring = par.valve.k_s * result["x"][result.time > 2.0] / A
    assert held < (difference - spring).max() < held + 0.02 / A
    assert difference.min() > held - 0.02 / A - BAR  # while the needle is closing
    assert residual(result) < 1e-9


def test_hysteresis_is_twice_the_friction_per_area():
    par = parameters({"valve.F_h": 0.05, "caliper.c": 1.0})  # constant pressures

    def triangle(t: Any) -> Any:
        i = 1.1 - 0.3 * np.abs(t - 1.0)
        return np.column_stack([i, np.full_like(t, 40 * BAR), 0 * t])

    result = driven(par, triangle, 2.0, p=20 * BAR)
    A, x, i = proportional_valve.area(par.valve), result["x"], result["i_valve"]
    rising, falling = (result.time > 0.1) & (result.time < 0.95), result.time > 1.05
    closing = np.interp(-1e-4, -x[rising], i[rising])
    opening = np.interp(1e-4, x[falling], i[falling])
    assert (closing - opening) * par.valve.G == pytest.approx(2 * 0.05 / A, rel=0.015)
    middle = 0.5 * (closing + opening)
    difference = proportional_valve.held_pressure(middle, par.valve) + par.valve.k_s * 1e-4 / A
    assert difference == pytest.approx(20 * BAR, rel=5e-3)


def test_a_needle_without_damping_oscillates():
    """The border of the limit cycle is that of the linear model, d = 0.32 N s/m."""
    par = parameters({"valve.F_h": 0.0})
    calm = driven(
        parameters({"valve.F_h": 0.0, "valve.d": 2.0}), constant(1.6, 120 * BAR, 1.0), 0.4
    )
    x, p = calm["x"][-1], calm["p"][-1]
    q = orifice.flow(orifice.Input(p, 0.0, 1.0), par.outlet, par.fluid)
    q_x, q_p = q / x, 0.5 * q / (120 * BAR - p) + 0.5 * q / p
    c, m, k, A = par.caliper.c, par.valve.m, par.valve.k_s, proportional_valve.area(par.valve)
    border = max(np.roots([c * q_p, k * c * c + m * q_p * q_p, -m * c * A * q_x]))
    assert border == pytest.approx(0.316, abs=1e-3)
    swings = {}
    for share in (0.0, 0.9, 1.3):
        run = parameters({"valve.F_h": 0.0, "valve.d": share * border})
        result = driven(run, constant(1.6, 120 * BAR, 1.0), 1.0, p=60 * BAR)
        late = result.time > 0.9
        swings[share] = float(np.ptp(result["x"][late]))
        assert residual(result) < 1e-8
    assert swings[0.0] > 0.9e-4  # from the seat to half the lift
    assert swings[0.9] > 0.3e-4
    assert swings[1.3] < 1e-6
    held = driven(parameters({"valve.d": 0.9 * border}), constant(1.6, 120 * BAR, 1.0), 1.0, p=p)
    assert np.ptp(held["x"][held.time > 0.9]) < 1e-6  # by friction, from a start at rest


def test_the_brake_keeps_its_fluid():
    result = driven(parameters(), constant(0.0, 60 * BAR, 0.0), 0.3)
    assert result["p"][-1] == pytest.approx(60 * BAR, rel=1e-3)
    stored = stiffening_caliper.volume(stiffening_caliper.State(result["p"]), parameters().caliper)
    assert np.abs(stored - result["V_given"]).max() < 1e-8 * CM3


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"valve.F_s0": 0.3}, "F_s0"),
        ({"valve.seat.d": 0.0}, "valve.seat.d"),
        ({"valve.alpha": 2.0}, "valve.alpha"),
    ],
)
def test_a_valve_that_cannot_work_is_rejected(changes, name):
    with raises(ParameterError, name=name):
        parameters(changes)


def test_a_valve_needs_a_seat():
    values = {k: v for k, v in parameters().valve.flat().items() if k != "seat.d"}
    with raises(ParameterError, name="seat.d"):
        proportional_valve.Parameters.create(values)
    assert math.isclose(proportional_valve.area(parameters().valve), math.pi * 0.25e-3**2)


@pytest.mark.parametrize(("k_stop", "warned"), [(2e5, False), (10.0, True)])
def test_a_needle_that_passes_its_seat_is_reported(k_stop, warned):
    """The current presses the needle on its seat with 3 N, which a stiff seat carries."""
    par = parameters({"stop.k_stop": k_stop})
    result = driven(par, constant(3.0, 0.0, 0.0), 0.05)
    x = proportional_valve.State(result["x"], result["v"])
    texts = proportional_valve.watch(result.time, x, par.valve)
    assert len(texts) == warned
    assert all(text.startswith("the needle passes its seat or its stop at t =") for text in texts)
    assert all("Connect an end_stop from 0 to lift" in text for text in texts)
