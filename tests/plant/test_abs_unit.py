"""An anti-lock unit with pump and valves: the cycle against an independent integration."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bywire.authoring import (
    Assembly,
    Duration,
    Integral,
    ParameterSet,
    Part,
    Role,
    Signal,
    Task,
    Wire,
)
from bywire.plant import (
    accumulator,
    brake_fluid,
    check_valve,
    return_pump,
    shaft,
    solenoid_valve,
    stiffening_caliper,
)
from bywire.simulation.run import Run, Trajectory, simulate
from systems.fluids import PUMP, RIGID, flat

BAR, CM3 = 1e5, 1e-6
P_MASTER = 120 * BAR
SPEED = 2.0 * math.pi * 50.0


class Parameters(ParameterSet):
    """Valves, caliper, accumulator and pump."""

    inlet: solenoid_valve.Parameters
    outlet: solenoid_valve.Parameters
    check: check_valve.Parameters
    caliper: stiffening_caliper.Parameters
    store: accumulator.Parameters
    master: accumulator.Parameters
    pump: return_pump.Parameters
    shaft: shaft.Parameters
    fluid: brake_fluid.Parameters
    T_s: Duration


class Stimulus(NamedTuple):
    """Commands to both coils."""

    hold: Annotated[float, Signal("1", "inlet valve energized", 0.5, low=0.0, high=1.0)]
    release: Annotated[float, Signal("1", "outlet valve energized", 0.5, low=0.0, high=1.0)]


class Unit(Assembly[Parameters, Stimulus]):
    """One wheel's valves, a master cylinder at nearly constant pressure, and a pump that turns."""

    name: ClassVar[str] = "abs-unit"
    Memory: ClassVar[Any] = Stimulus
    Stimulus: ClassVar[Any] = Stimulus
    shared = ("fluid",)
    inlet = Part(solenoid_valve, suffix="_in", loss="E_valves")
    outlet = Part(solenoid_valve, suffix="_out", loss="E_valves")
    check = Part(check_valve, loss="E_valves")
    caliper = Part(stiffening_caliper)
    store = Part(accumulator)
    master = Part(accumulator, state={"V": "V_master"}, labels={"V": "fluid in the master"})
    pump = Part(return_pump, state={"V": "V_pump"}, loss="E_pump", output=("q_s", "q_d", "void"))
    shaft = Part(shaft, loss="E_bearing", outside=True)
    E_shaft = Integral("J", "energy from the shaft", role=Role("source", "shaft"))
    E_sucked = Integral("J", "energy of the fluid that the pump sucks")
    V_given = Integral("m**3", "volume through the inlet, minus that through the check valve")
    V_sucked = Integral("m**3", "volume that the pump sucks")
    V_returned = Integral("m**3", "volume that the pump delivers")
    p_master = Wire("Pa", "pressure of the master cylinder", 5e6)
    p_store = Wire("Pa", "pressure of the accumulator", 2e5)

    def wire(self, w: Any) -> None:
        """Connect valves, accumulator and pump."""
        fluid, p = w.par.fluid, w.caliper.x.p
        master = accumulator.pressure(w.master.x, w.master.par, fluid)
        w.p_master = master
        w.p_store = accumulator.pressure(w.store.x, w.store.par, fluid)
        w.inlet.u = solenoid_valve.Input(w.m.hold, master, p)
        w.outlet.u = solenoid_valve.Input(w.m.release, p, w.p_store)
        w.check.u = check_valve.Input(p, master)
        w.pump.u = return_pump.Input(w.shaft.x.theta, w.shaft.x.omega, w.p_store, master)
        w.shaft.u = shaft.Input(0.0, 0.0)
        q_out = solenoid_valve.flow(w.outlet.x, w.outlet.u, w.outlet.par, fluid)
        w.caliper.u = stiffening_caliper.Input(_given(w) - q_out)
        y = return_pump.output(w.pump.x, w.pump.u, w.pump.par, fluid)
        w.store.u = accumulator.Input(q_out - y.q_s)
        w.master.u = accumulator.Input(y.q_d - _given(w))

    def power(self, w: Any) -> dict[str, float]:
        """Return flows and energies across the boundary."""
        fluid, convected = w.par.fluid, brake_fluid.convected_power
        y = return_pump.output(w.pump.x, w.pump.u, w.pump.par, fluid)
        return {
            "E_shaft": return_pump.shaft_power(w.pump.x, w.pump.u, w.pump.par, fluid),
            "E_sucked": convected(y.q_s, w.p_store, fluid),
            "V_given": _given(w),
            "V_sucked": y.q_s,
            "V_returned": y.q_d,
        }

    def tasks(self, par: Parameters) -> tuple[Task, ...]:
        """Return the hold of the commands."""
        return (Task("coils", par.T_s, lambda x, m, u, p: Stimulus(*u)),)


def _given(w: Any) -> Any:
    """Return the flow from the master cylinder to the wheel."""
    inlet = solenoid_valve.flow(w.inlet.x, w.inlet.u, w.inlet.par, w.par.fluid)
    return inlet - check_valve.flow(w.check.u, w.check.par, w.par.fluid)


def parameters(changes: dict[str, Any] | None = None) -> Parameters:
    """Return the anti-lock unit of `test_abs_cycle`, with the pump of `test_return_pump`."""
    flow = {"C_d": 0.65, "Re_cr": 100.0}
    groups: dict[str, dict[str, Any]] = {
        "pump": PUMP | {"delivery.p_crack": 0.0},
        "check": {"p_crack": 0.0},
        "check.seat": flow | {"d": 1.2e-3},
        "caliper": {"V_1": 0.35 * CM3, "p_1": 4 * BAR, "c": 0.011 * CM3 / BAR},
        "store": {"p_0": 1.5 * BAR, "k": BAR / CM3, "V_max": 3.5 * CM3, "c_stop": 4e-15},
        "master": {"p_0": P_MASTER - 10.0, "k": 1e6, "V_max": 1e-3, "c_stop": 1e-12},
        "shaft": {"J": 1.0, "d": 0.0},
        "fluid": RIGID,
    }
    for name, d, unpowered in (("inlet", 0.5e-3, "open"), ("outlet", 0.6e-3, "closed")):
        # A flat seat, whose opening is the lift relative to a quarter of the diameter
        groups[f"{name}.seat"] = flow | {"d": d}
        groups[name] = {
            "lift": d / 4,
            "alpha": math.pi / 2,
            "t_delay": 1e-3,
            "tau": 1e-3,
            "unpowered": unpowered,
            "low": 0.0,
            "high": 1.0,
        }
    return Parameters.create(flat(groups) | {"T_s": 1e-3} | (changes or {}))


def commands(t: float) -> tuple[bool, bool]:
    """Return whether inlet and outlet are open: fill, then release, hold and pulses; 1 ms late."""
    t = t - 1e-3
    if t < 0.15:
        return t >= 0.0, False
    phase = (t - 0.15) % 0.1
    if phase < 0.02:
        return False, True
    return phase >= 0.04 and (phase - 0.04) % 0.015 < 0.006, False


def cycled(par: Parameters, step: float = 2e-5) -> Trajectory:
    """Return the cycle of 0.95 s."""

    def stimulus(t: Any) -> Any:
        opened = [commands(each + 1e-6) for each in t]
        return np.array([[0.0 if inlet else 1.0, float(outlet)] for inlet, outlet in opened])

    start = Unit.state(
        inlet=solenoid_valve.State(0.0),
        outlet=solenoid_valve.State(0.0),
        shaft=shaft.State(0.0, SPEED),
        master=accumulator.State(10 * CM3),
    )
    return simulate(Run(Unit(), par, start, Stimulus(1.0, 0.0), stimulus, 0.95, step))


@pytest.fixture(scope="module")
def cycle() -> Trajectory:
    """Return the cycle at the default step."""
    return cycled(parameters())


FLUID = parameters().fluid


def turbulent(drop: float, d: float) -> float:
    """Return the flow through an orifice, written independently of `orifice`."""
    rho, nu, C_d = 1070.0, 12e-6, 0.65
    p_cr = 0.5 * rho * (100.0 * nu / (C_d * d)) ** 2
    return C_d * math.pi / 4 * d * d * math.sqrt(2 / rho) * drop / (drop**2 + p_cr**2) ** 0.25


@pytest.fixture(scope="module")
def reference() -> Any:
    """Return the cycle from SciPy: pressure, volumes and energies at the end of each command."""
    A_p, p_atm = math.pi / 4 * 6.5e-3**2, 101_325.0

    def store_pressure(V: float) -> float:
        if V >= 0.0:
            return 1.5 * BAR + BAR / CM3 * V
        P = 1.5 * BAR + p_atm
        return P / (1.0 - V / (4e-15 * P)) - p_atm

    def rate(t: float, y: Any, opened: tuple[bool, bool]) -> list[float]:
        p, V, fluid, lift_in, lift_out = y[:5]
        p_store = store_pressure(V)
        q_in = min(lift_in, 1.0) * turbulent(P_MASTER - p, 0.5e-3)
        q_back = turbulent(max(p - P_MASTER, 0.0), 1.2e-3)
        q_out = min(lift_out, 1.0) * turbulent(p - p_store, 0.6e-3)
        phi = SPEED * t + math.pi / 2
        growth = -A_p * 1e-3 * SPEED * math.sin(phi)
        empty = max(A_p * 1e-3 * math.cos(phi) - fluid, 0.0)
        width = 2e-2 * 2.0 * A_p * 1e-3
        void = empty - 0.5 * width if empty > width else 0.5 * empty * empty / width
        through = growth + void / 5e-5
        most = turbulent(max(p_store + p_atm - 0.2 * BAR, 0.0), 2.5e-3)
        q_s, q_d = min(max(through, 0.0), most), max(-through, 0.0)
        compliance = 0.35 * CM3 / (4 * BAR) * math.exp(-p / (4 * BAR)) + 0.011 * CM3 / BAR
        return [
            (q_in - q_back - q_out) / compliance,
            q_out - q_s,
            q_s - q_d,
            ((1.0 if opened[0] else 0.0) - lift_in) / 1e-3,
            ((1.0 if opened[1] else 0.0) - lift_out) / 1e-3,
            q_in - q_back,
            q_s,
            q_d,
            q_in * (P_MASTER - p) + q_back * (p - P_MASTER) + q_out * (p - p_store),
            p_store * q_s,
        ]

    ticks = 950
    opened = [commands(1e-3 * k + 1e-6) for k in range(ticks)]
    changes = [k for k in range(ticks) if k == 0 or opened[k] != opened[k - 1]]
    state, rows = np.zeros(10), []
    for first, last in zip(changes, [*changes[1:], ticks], strict=True):
        part = solve_ivp(
            rate,
            (1e-3 * first, 1e-3 * last),
            state,
            method="LSODA",
            args=(opened[first],),
            rtol=1e-8,
            atol=[1.0, 1e-13, 1e-14, 1e-9, 1e-9, 1e-13, 1e-13, 1e-13, 1e-9, 1e-9],
            max_step=2e-4,
        )
        state = part.y[:, -1]
        rows.append((last, *state))
    names = ("tick", "p", "V", "V_pump", "in", "out", "given", "sucked", "returned", "lost", "E_s")
    return dict(zip(names, np.array(rows).T, strict=True))


def test_the_cycle_is_that_of_an_independent_integration(cycle, reference):
    k = reference["tick"].astype(int)
    assert len(k) > 50
    for name, there, limit in (
        ("p", "p", 5e-5 * BAR),
        ("V", "V", 1e-5 * CM3),
        ("V_given", "given", 5e-6 * CM3),
        ("V_sucked", "sucked", 2e-5 * CM3),
        ("V_returned", "returned", 2e-5 * CM3),
        ("E_valves", "lost", 5e-5),
    ):
        assert np.abs(cycle[name][k] - reference[there]).max() < limit, name


def test_rows_of_a_pump_with_constant_flow(cycle):
    """The pump's strokes, of 0.066 cm^3, move volumes by less than one stroke."""
    late = cycle["p"][cycle.time > 0.45]
    assert late.min() / BAR == pytest.approx(35.9, rel=0.02)
    assert late.max() / BAR == pytest.approx(76.7, rel=0.02)
    pads = stiffening_caliper.State(cycle["p"][-1])
    wheel = stiffening_caliper.volume(pads, parameters().caliper)
    assert [cycle["V_given"][-1] / CM3, wheel / CM3] == pytest.approx([4.208, 1.089], rel=0.01)
    stroke = return_pump.displacement(parameters().pump)
    assert cycle["V_sucked"][-1] == pytest.approx(2.653 * CM3, abs=stroke)
    assert cycle["V"][-1] == pytest.approx(0.467 * CM3, abs=stroke)
    assert cycle["V"].max() == pytest.approx(0.720 * CM3, abs=stroke)


def missing(result: Trajectory) -> float:
    """Return the largest residual of the volume balance [cm^3]."""
    par = result.run.par.caliper
    wheel = np.array(
        [stiffening_caliper.volume(stiffening_caliper.State(p), par) for p in result["p"]]
    )
    volume = result["V_master"] + result["V"] + result["V_pump"] + wheel
    return float(np.abs(volume - volume[0]).max() / CM3)


def residual(result: Trajectory) -> float:
    """Return the largest residual of the energy balance, relative to the energy of the shaft."""
    left = result["E_shaft"] - result["E_valves"] - result["E_pump"] - result["E_stored"]
    return float(np.abs(left - left[0]).max() / result["E_shaft"][-1])


def test_fluid_is_conserved(cycle):
    """To rounding errors with linear compliances, otherwise with the square of the step."""
    assert missing(cycled(parameters({"caliper.V_1": 0.0}))) < 1e-9
    volume = missing(cycle)
    assert volume < 1e-6
    assert missing(cycled(parameters(), 1e-5)) < 0.3 * volume


def test_energy_is_balanced(cycle):
    assert residual(cycle) < 2e-6
    assert residual(cycled(parameters(), 1e-5)) < 0.3 * residual(cycle)
    assert np.all(np.diff(cycle["E_pump"]) >= 0.0)
    assert np.all(np.diff(cycle["E_valves"]) >= -1e-12)


@pytest.mark.parametrize(
    ("changes", "sign"),
    [({"pump.e": 1e-5}, 1), ({"outlet.high": 0.0}, -1), ({"store.V_max": 0.3 * CM3}, 1)],
)
def test_failures_change_the_released_pressure(changes, sign, cycle):
    """Without pump or with a small store, fluid stays; a stuck outlet does not release."""
    faulty = cycled(parameters(changes))
    if sign > 0:
        stored = accumulator.pressure(accumulator.State(faulty["V"]), faulty.run.par.store, FLUID)
        assert stored.max() > 3.0 * BAR
    else:
        assert faulty["p"][faulty.time > 0.45].min() > 100 * BAR
    assert residual(faulty) < 3e-6
    assert missing(faulty) < 2e-6
