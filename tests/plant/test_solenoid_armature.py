"""Coil and armature of a solenoid valve: force, switching times, energy, and faults."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bywire.authoring import Assembly, Duration, Integral, ParameterSet, Part, Role, Signal, Task
from bywire.core.errors import ParameterError
from bywire.plant import brake_fluid, end_stop, orifice, solenoid_armature
from bywire.simulation.run import Run, Trajectory, simulate
from raising import raises
from systems.fluids import FLUID, flat

BAR = 1e5
LOSSES = {"E_coil": "copper_loss", "E_armature": "damping_loss", "E_valve": "throttling"}


class Parameters(ParameterSet):
    """Valve, and its seat and stop."""

    valve: solenoid_armature.Parameters
    stop: end_stop.Parameters
    fluid: brake_fluid.Parameters
    T_s: Duration


class Stimulus(NamedTuple):
    """Voltage and pressures."""

    v_coil: Annotated[float, Signal("V", "voltage of the coil", 10.0)]
    p_a: Annotated[float, Signal("Pa", "pressure before the valve", 5e6)]
    p_b: Annotated[float, Signal("Pa", "pressure behind the valve", 5e6)]


class Valve(Assembly[Parameters, Stimulus]):
    """A valve between two pressures."""

    name: ClassVar[str] = "valve-between-pressures"
    Memory: ClassVar[Any] = Stimulus
    Stimulus: ClassVar[Any] = Stimulus
    frictions = ("v",)
    shared = ("fluid",)
    E_source = Integral("J", "energy of coil and fluid", role=Role("source", "coil and fluid"))
    valve = Part(solenoid_armature, loss=LOSSES, output=("i", "F_m", "q", "opening"))
    stop = Part(end_stop, work="W_stop", loss="E_stop")
    E_friction = Integral("J", "friction of the armature", role=Role("sink", "friction"))

    def wire(self, w: Any) -> None:
        """Connect the valve."""
        ends = solenoid_armature.travel_ends(w.valve.par)
        w.stop.u = end_stop.Input(w.valve.x.x, w.valve.x.v, ends.near, ends.far)
        load = end_stop.load(w.stop.f)
        w.valve.u = solenoid_armature.Input(w.m.v_coil, w.m.p_a, w.m.p_b, load)

    def friction(self, w: Any) -> tuple[tuple[float, float], ...]:
        """Return the bounds of the friction."""
        F = solenoid_armature.friction(w.valve.par)
        return ((-F, F),)

    def power(self, w: Any) -> dict[str, float]:
        """Return the power of coil and fluid."""
        fluid, convected = w.par.fluid, brake_fluid.convected_power
        y = solenoid_armature.output(w.valve.x, w.valve.u, w.valve.par, fluid)
        through = convected(y.q, w.m.p_a, fluid) - convected(y.q, w.m.p_b, fluid)
        return {
            "E_source": w.m.v_coil * y.i + through,
            "E_friction": -w.reaction[0] * w.valve.x.v,
        }

    def tasks(self, par: Parameters) -> tuple[Task, ...]:
        """Return the hold."""
        return (Task("hold", par.T_s, lambda x, m, u, p: Stimulus(*u)),)


def parameters(changes: dict[str, Any] | None = None) -> Parameters:
    """Return an outlet valve with a seat of 0.6 mm and a coil of 4.5 ohm, all values chosen."""
    groups = {
        "valve": {
            "unpowered": "closed",
            "alpha": 0.8,
            "travel": 2.5e-4,
            "g_0": 4e-4,
            "k_m": 1.2e-7,
            "L_0": 1e-3,
            "R": 4.5,
            "m": 3e-3,
            "d": 1.0,
            "k": 2e3,
            "F_s0": 4.0,
            "F_h": 0.2,
            "dirt": 0.0,
        },
        "valve.seat": {"d": 0.6e-3, "C_d": 0.65, "Re_cr": 100.0},
        "stop": {"k_stop": 5e6, "tau_stop": 2.5e-5},
        "fluid": FLUID,
    }
    return Parameters.create(flat(groups) | {"T_s": 1e-4} | (changes or {}))


def rest(par: Parameters) -> tuple[Any, Stimulus]:
    """Return the armature on its near end, which carries the spring."""
    near = solenoid_armature.travel_ends(par.valve).near
    x = near - par.valve.F_s0 / par.stop.k_stop
    state = Valve.state(valve=solenoid_armature.State(0.0, x, 0.0))
    return state, Stimulus(0.0, 0.0, 0.0)


def switched(
    par: Parameters, p: float = 60 * BAR, v: float = 12.0, step: float = 1e-5
) -> Trajectory:
    """Return 10 ms with voltage, from t = 2 ms, and 8 ms without."""

    def stimulus(t: Any) -> Any:
        on = (t > 1.9999e-3) & (t < 11.9999e-3)
        return np.column_stack([np.where(on, v, 0.0), np.full_like(t, p), 0 * t])

    return simulate(Run(Valve(), par, *rest(par), stimulus, 0.02, step, par.T_s))


def residual(result: Trajectory) -> float:
    """Return the residual of the energy balance, relative to the energy of the source."""
    sinks = ("coil", "armature", "valve", "stop", "friction", "stored")
    left = result["E_source"] - sum(result[f"E_{name}"] for name in sinks)
    return float(np.abs(left - left[0]).max() / result["E_source"].max())


def crossing(result: Trajectory, name: str, level: float, after: float) -> float:
    """Return the first time after which a signal crosses a level."""
    t, y = result.time, result[name] - level
    k = next(k for k in range(1, len(t)) if t[k] > after and y[k - 1] * y[k] <= 0 != y[k - 1])
    return float(t[k - 1] + (t[k] - t[k - 1]) * y[k - 1] / (y[k - 1] - y[k]))


def reference(par: Parameters, p: float, v: float = 12.0) -> list[float]:
    """Return the times of half travel after switching on and off, from SciPy."""
    valve, stop = par.valve, par.stop
    A_s = orifice.area(valve.seat)

    def rate(t: float, y: Any) -> list[float]:
        psi, x, speed = y
        gap = valve.g_0 - x
        i = psi / (valve.L_0 + 2.0 * valve.k_m / gap)
        lift = x if valve.unpowered == "closed" else valve.travel - x
        opened = min(4.0 * max(lift, 0.0) * np.sin(valve.alpha) / valve.seat.d, 1.0)
        fluid = A_s * (1.0 - opened) * p * (1.0 + 0.5 * p / par.fluid.beta)
        fluid = fluid if valve.unpowered == "closed" else -fluid
        near = max(-x - stop.tau_stop * speed, 0.0) * stop.k_stop
        far = max(x - valve.travel + stop.tau_stop * speed, 0.0) * stop.k_stop
        spring = valve.F_s0 + valve.k * x + valve.d * speed
        force = valve.k_m * i * i / gap**2 + fluid - spring + near - far
        return [(v if 2e-3 <= t < 12e-3 else 0.0) - valve.R * i, speed, force / valve.m]

    def halfway(t: float, y: Any) -> float:
        return float(y[1] - 0.5 * valve.travel)

    state, crossings = [0.0, rest(par)[0].x, 0.0], []
    for start, end in ((0.0, 2e-3), (2e-3, 12e-3), (12e-3, 20e-3)):
        tight = {"method": "Radau", "rtol": 1e-9, "atol": 1e-12}
        part = solve_ivp(rate, (start, end), state, events=halfway, **tight)
        state = part.y[:, -1]
        crossings += list(part.t_events[0])
    return crossings


@pytest.mark.parametrize("unpowered", ["closed", "open"])
@pytest.mark.parametrize("p", [0.0, 60 * BAR])
def test_switching_times_are_those_of_an_independent_integration(unpowered, p):
    par = parameters({"valve.F_h": 0.0, "valve.unpowered": unpowered, "T_s": 2e-5})
    on, off = reference(par, p)
    result = switched(par, p)
    half = 0.5 * par.valve.travel
    assert crossing(result, "x", half, 2e-3) == pytest.approx(on, abs=1e-6)
    assert crossing(result, "x", half, 12e-3) == pytest.approx(off, abs=1e-6)
    assert residual(result) < 2e-6
    assert residual(switched(par, p, step=5e-6)) < 0.3 * residual(result)


def test_force_and_current_of_the_attracted_armature():
    par = parameters()
    result = switched(par, 0.0)
    k = int(np.searchsorted(result.time, 11e-3))
    i, x = result["i"][k], result["x"][k]
    assert i == pytest.approx(12.0 / 4.5, rel=1e-3)
    assert result["F_m"][k] == pytest.approx(1.2e-7 * i * i / (4e-4 - x) ** 2, rel=1e-12)
    spring = 4.0 + 2e3 * x
    assert x - par.valve.travel == pytest.approx((result["F_m"][k] - spring) / 5e6, abs=0.21 / 5e6)


def test_the_armatures_motion_induces_a_voltage():
    """Without it, as in L di/dt = v - R i, the field would gain the mechanical work twice."""
    par = parameters()
    result = switched(par, 0.0)
    k = int(np.argmax(result["v"]))
    x = solenoid_armature.State(result["psi"][k], result["x"][k], result["v"][k])
    L, gap = solenoid_armature.inductance(x, par.valve), par.valve.g_0 - x.x
    induced = result["i"][k] * 2.0 * par.valve.k_m / gap**2 * x.v
    assert induced > 0.2 * 12.0
    assert induced * result["i"][k] == pytest.approx(2.0 * result["F_m"][k] * x.v)
    assert x.psi == pytest.approx(L * result["i"][k])


def test_pressure_helps_to_open_and_delays_closing():
    closed = {p: switched(parameters(), p * BAR) for p in (0, 60)}
    opened = {p: switched(parameters({"valve.unpowered": "open"}), p * BAR) for p in (0, 60)}
    half = 1.25e-4
    on = {k: crossing(r, "x", half, 2e-3) for k, r in closed.items()}
    assert on[60] < on[0] - 0.3e-3
    off = {k: crossing(r, "x", half, 12e-3) for k, r in opened.items()}
    assert off[60] < off[0] - 0.1e-3


def test_friction_separates_the_currents_of_motion():
    """A slow voltage: the armature leaves at F_s0 + F_h, and returns from the far end."""
    par = parameters({"T_s": 1e-3})

    def stimulus(t: Any) -> Any:
        v = 12.0 * np.clip(np.minimum(t, 2.0 - t), 0.0, None)
        return np.column_stack([v, 0 * t, 0 * t])

    result = simulate(Run(Valve(), par, *rest(par), stimulus, 2.0, 1e-5, 1e-3))
    valve = par.valve
    on = int(np.flatnonzero(result["x"] > 0.5 * valve.travel)[0])
    leaves = np.sqrt((valve.F_s0 + valve.F_h) / valve.k_m) * valve.g_0
    assert result["v_coil"][on] / valve.R == pytest.approx(leaves, rel=0.01)
    off = int(np.flatnonzero(result["x"][1000:] < 0.5 * valve.travel)[0]) + 1000
    gap = valve.g_0 - valve.travel
    spring = valve.F_s0 + valve.k * valve.travel
    returns = np.sqrt((spring - valve.F_h) / valve.k_m) * gap
    assert result["v_coil"][off] / valve.R == pytest.approx(returns, rel=0.02)


@pytest.mark.parametrize(
    ("fault", "moves", "closes"),
    [("stuck", False, True), ("broken-wire", False, True), ("leaking", True, False)],
)
def test_faults(fault, moves, closes):
    mode = next(f for f in solenoid_armature.FAULTS if f.name == fault)
    nominal = parameters().flat()
    changes = {f"valve.{mode.replaced}": mode.value} if mode.replaced else {}
    changes |= {f"valve.{name}": mode.value * nominal[f"valve.{name}"] for name in mode.scaled}
    result = switched(parameters(changes))
    assert (result["x"].max() > 2e-4) == moves
    assert (result["opening"][-1] == 0.0) == closes


@pytest.mark.parametrize(
    ("changes", "name"),
    [({"valve.travel": 5e-4}, "travel"), ({"valve.seat.d": 0.0}, "valve.seat.d")],
)
def test_a_valve_that_cannot_work_is_rejected(changes, name):
    with raises(ParameterError, name=name):
        parameters(changes)


@pytest.mark.parametrize(
    ("k_stop", "v", "text"),
    [
        (5e6, 12.0, ""),
        (10.0, 0.0, "the armature leaves its near end"),
        (5e4, 12.0, "the armature closes its air gap"),
    ],
)
def test_a_missing_or_soft_stop_is_reported(k_stop, v, text):
    """The spring presses with 4 N on the near end, and the magnetic force with 40 N on the far."""
    par = parameters({"stop.k_stop": k_stop})
    result = switched(par, p=0.0, v=v)
    x = solenoid_armature.State(result["psi"], result["x"], result["v"])
    texts = solenoid_armature.watch(result.time, x, par.valve)
    assert bool(texts) == bool(text)
    assert any(each.startswith(text) for each in texts) == bool(text)
    assert all("Connect an end_stop" in each for each in texts)
