"""Return pump: fed, starved, with gas, and with faults, between an accumulator and a pressure."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
import pytest

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
from bywire.core import ops
from bywire.plant import accumulator, brake_fluid, dc_motor, orifice, return_pump, shaft
from bywire.simulation.run import Run, Trajectory, simulate
from systems.fluids import PUMP, RIGID, flat

BAR, CM3 = 1e5, 1e-6
SEAT = {"seat.C_d": 0.65, "seat.Re_cr": 100.0}
STORE = {"p_0": 1.5 * BAR, "k": BAR / CM3, "V_max": 3.5 * CM3, "c_stop": 4e-15}


class Parameters(ParameterSet):
    """Motor, pump, a store for each pressure, and an orifice between them."""

    motor: dc_motor.Parameters
    shaft: shaft.Parameters
    pump: return_pump.Parameters
    low: accumulator.Parameters
    high: accumulator.Parameters
    orifice: orifice.Parameters
    fluid: brake_fluid.Parameters
    T_s: Duration


class Stimulus(NamedTuple):
    """Voltage of the motor, and opening of the orifice."""

    v: Annotated[float, Signal("V", "voltage", 12.0)]
    open: Annotated[float, Signal("1", "opening", 0.5, low=0.0, high=1.0)]


class Circuit(Assembly[Parameters, Stimulus]):
    """A closed circuit: fluid flows into the low-pressure store, and the pump returns it."""

    name: ClassVar[str] = "pump-circuit"
    Memory: ClassVar[Any] = Stimulus
    Stimulus: ClassVar[Any] = Stimulus
    shared = ("fluid",)
    frictions = ("omega",)
    E_source = Integral("J", "energy of the battery", role=Role("source", "battery"))
    motor = Part(dc_motor, loss="E_copper")
    shaft = Part(shaft, loss="E_damping")
    pump = Part(
        return_pump, state={"V": "V_pump"}, loss="E_pump", output=return_pump.Output._fields
    )
    low = Part(accumulator, state={"V": "V_low"}, labels={"V": "stored at low pressure"})
    high = Part(accumulator, state={"V": "V_high"}, labels={"V": "stored at high pressure"})
    orifice = Part(orifice, loss="E_orifice")
    T_held = Wire("N*m", "torque that the resting pump holds", 0.1)
    p_low = Wire("Pa", "low pressure", 2e5)
    p_high = Wire("Pa", "high pressure", 2e6)

    def wire(self, w: Any) -> None:
        """Connect motor, pump and stores."""
        fluid = w.par.fluid
        w.p_low = accumulator.pressure(w.low.x, w.low.par, fluid)
        w.p_high = accumulator.pressure(w.high.x, w.high.par, fluid)
        w.motor.u = dc_motor.Input(w.m.v, w.shaft.x.omega)
        w.pump.u = return_pump.Input(w.shaft.x.theta, w.shaft.x.omega, w.p_low, w.p_high)
        y = return_pump.output(w.pump.x, w.pump.u, w.pump.par, fluid)
        w.shaft.u = shaft.Input(dc_motor.output(w.motor.x, w.motor.par).torque - y.torque, 0.0)
        w.T_held = y.friction
        w.orifice.u = orifice.Input(w.p_high, w.p_low, w.m.open)
        q = orifice.flow(w.orifice.u, w.orifice.par, fluid)
        w.low.u = accumulator.Input(q - y.q_s)
        w.high.u = accumulator.Input(y.q_d - q)

    def friction(self, w: Any) -> tuple[tuple[float, float], ...]:
        """Return the bounds of the pump's set-valued load."""
        return ((-w.T_held, w.T_held),)

    def power(self, w: Any) -> dict[str, float]:
        """Return the battery's power, and the pump's loss with the actual set-valued load."""
        omega = w.shaft.x.omega
        load = -w.reaction[0] * omega - w.T_held * ops.fabs(omega)
        return {
            "E_source": w.m.v * w.motor.x.i,
            "E_pump": w.pump.call(return_pump.power_loss) + load,
        }

    def tasks(self, par: Parameters) -> tuple[Task, ...]:
        """Return the hold."""
        return (Task("hold", par.T_s, lambda x, m, u, p: Stimulus(*u)),)


def parameters(changes: dict[str, Any] | None = None) -> Parameters:
    """Return a pump of an anti-lock system, all values chosen."""
    groups = {
        "motor": {"R_m": 0.15, "L_m": 1e-4, "K_e": 0.03},
        "shaft": {"J": 2e-5, "d": 1e-5},
        "pump": PUMP,
        "low": STORE,
        "high": STORE | {"p_0": 40 * BAR, "k": 10 * BAR / CM3, "V_max": 10 * CM3},
        "orifice": {"d": 0.6e-3, "C_d": 0.65, "Re_cr": 100.0},
        "fluid": RIGID,
    }
    return Parameters.create(flat(groups) | {"T_s": 1e-3} | (changes or {}))


def pumped(
    par: Parameters,
    low: float = 1 * CM3,
    v: float = 12.0,
    step: float = 2e-5,
    opened: float = 0.0,
) -> Trajectory:
    """Return 1 s from a volume in the low-pressure store; ``opened``: time open of every 0.2 s."""
    start = Circuit.state(low=accumulator.State(low), high=accumulator.State(4 * CM3))

    def stimulus(t: Any) -> Any:
        is_open = np.where((t + 1e-6) % 0.2 < opened, 1.0, 0.0)
        return np.column_stack([np.full_like(t, v), is_open])

    return simulate(Run(Circuit(), par, start, Stimulus(0.0, 0.0), stimulus, 1.0, step))


def residual(result: Trajectory) -> float:
    """Return the residual of the energy balance, relative to the throughput."""
    sinks = ("E_copper", "E_damping", "E_pump", "E_orifice", "E_stored")
    rest = result["E_source"] - sum(result[name] for name in sinks)
    return float(np.abs(rest - rest[0]).max() / np.ptp(result["E_pump"] + result["E_stored"]))


def missing(result: Trajectory) -> float:
    """Return the largest residual of the volume balance."""
    volume = result["V_low"] + result["V_high"] + result["V_pump"]
    return float(np.abs(volume - volume[0]).max())


def gain(result: Trajectory) -> float:
    """Return the volume at the end minus that at the start [cm^3]."""
    volume = result["V_low"] + result["V_high"] + result["V_pump"]
    return float((volume[-1] - volume[0]) / CM3)


def test_a_pump_that_is_fed_delivers_its_displacement():
    """6.5 mm, eccentricity 1 mm, 3000 rpm: 2 A_p e n = 3.318 cm^3/s, at any pressure."""
    par = parameters({"shaft.J": 10.0, "shaft.d": 0.0, "motor.K_e": 1e-9})
    start = Circuit.state(
        low=accumulator.State(3 * CM3),
        high=accumulator.State(4 * CM3),
        shaft=shaft.State(0.0, 100.0 * math.pi),
    )
    rest = Stimulus(0.0, 0.0)
    run = Run(Circuit(), par, start, rest, lambda t: np.zeros((t.size, 2)), 0.4, 2e-5)
    result = simulate(run)
    closed = return_pump.displacement(par.pump) * 50.0
    assert closed / CM3 == pytest.approx(3.318, rel=1e-4)
    turns = result["theta"][-1] / (2.0 * math.pi)
    delivered = result["V_high"][-1] - result["V_high"][0]
    assert delivered == pytest.approx(return_pump.displacement(par.pump) * round(turns), rel=1e-3)
    assert result["q_d"].max() == pytest.approx(math.pi * closed, rel=1e-3)
    assert result["void"].max() < 1e-6 * CM3


@pytest.mark.parametrize("opened", [0.0, 0.02])
def test_a_starved_pump_does_not_create_fluid(opened):
    residuals = []
    for step in (2e-5, 1e-5):
        result = pumped(parameters(), step=step, opened=opened)
        assert missing(result) < 1e-9 * CM3
        assert result["void"].max() / return_pump.displacement(parameters().pump) > 0.99
        assert result["p_low"].min() > -RIGID["p_atm"]
        assert np.all(np.diff(result["E_pump"]) >= 0.0)
        assert np.ptp(result["V_low"][result.time > 0.95]) < 1e-6 * CM3
        residuals.append(residual(result))
    assert residuals[0] < 5e-6
    assert residuals[1] < 0.3 * residuals[0]


def test_a_pump_at_rest_holds_its_delivery_pressure():
    """Without current, the pressure of the high-pressure store does not turn the shaft."""
    par = parameters({"pump.phase": 2.0, "low.p_0": 0.1 * BAR})
    start = Circuit.state(
        high=accumulator.State(4 * CM3),
        pump=return_pump.State(0.5 * math.cos(2.0) * return_pump.displacement(par.pump)),
    )
    rest = Stimulus(0.0, 0.0)
    result = simulate(Run(Circuit(), par, start, rest, lambda t: np.zeros((t.size, 2)), 0.2))
    assert np.all(result["omega"] == 0.0)
    assert np.ptp(result["V_high"]) < 1e-12 * CM3
    load = (
        result["torque"][-1] - result["friction"][-1],
        result["torque"][-1] + result["friction"][-1],
    )
    arm = return_pump.area(par.pump) * par.pump.e * math.sin(2.0)
    assert load == pytest.approx((arm * (0.1 - 0.2) * BAR, arm * 80.5 * BAR), rel=1e-6)


class Limited(Circuit):
    """The same circuit, with a one-sided limit instead of gas that expands."""

    name: ClassVar[str] = "pump-circuit-with-limit"
    limits = ("V_low",)


def test_a_limit_would_create_what_the_pump_takes():
    start = Limited.state(low=accumulator.State(1 * CM3), high=accumulator.State(4 * CM3))
    run = Run(
        Limited(),
        parameters(),
        start,
        Stimulus(0.0, 0.0),
        lambda t: np.tile([12.0, 0.0], (t.size, 1)),
        1.0,
    )
    assert gain(simulate(run)) > 1.0
    assert abs(gain(pumped(parameters()))) < 1e-9


def test_gas_and_compressible_fluid_reduce_the_flow():
    fluid = {"fluid.beta": 1.5e9}
    u = return_pump.Input(0.0, 100.0 * math.pi, 1.5 * BAR, 120 * BAR)
    for changes, share in ((fluid, 0.0024), (fluid | {"pump.V_gas": 5e-9}, 0.0772)):
        par = parameters(changes)
        lost = return_pump.returned(u, par.pump, par.fluid)
        assert lost / (return_pump.displacement(par.pump) * 50.0) == pytest.approx(share, rel=0.01)
    full = parameters(fluid | {"pump.V_gas": 1e-6})
    assert return_pump.returned(u, full.pump, full.fluid) == pytest.approx(3.318e-6, rel=1e-3)


@pytest.mark.parametrize("fault", return_pump.FAULTS, ids=lambda fault: fault.name)
def test_a_fault_slows_the_return(fault):
    changes = {f"pump.{fault.replaced}": fault.value} if fault.replaced else {}
    nominal = parameters({"pump.V_gas": 1e-9}).flat()
    changes |= {f"pump.{n}": fault.value * nominal[f"pump.{n}"] for n in fault.scaled}
    healthy = pumped(parameters({"pump.V_gas": 1e-9}), low=3 * CM3)
    faulty = pumped(parameters({"pump.V_gas": 1e-9} | changes), low=3 * CM3)
    at = int(np.searchsorted(healthy.time, 0.3))
    assert faulty["V_high"][at] < healthy["V_high"][at] - 0.05 * CM3
    assert missing(faulty) < 1e-9 * CM3


def test_pressures_outside_their_range_are_reported():
    t, rest = np.array([0.0, 1.0]), np.zeros(2)
    par = parameters()
    u = return_pump.Input(rest, rest, rest, np.array([1e5, 260e5]))
    text = "the return pump works against 260 bar, above p_max = 250 bar"
    assert return_pump.watch(t, u, par.pump, par.fluid) == [text]
    u = return_pump.Input(rest, rest, np.array([0.0, -1.1e5]), rest)
    (text,) = return_pump.watch(t, u, par.pump, par.fluid)
    assert text.startswith("the absolute pressure at the pump's suction is below zero at t = 1 s")
    assert return_pump.watch(t, u._replace(p_s=rest), par.pump, par.fluid) == []


def test_pistons_with_equal_phases_between_them_deliver_evenly():
    """Full chambers: 2 and 3 pistons deliver A_p e omega times the known ripple."""
    par = parameters({"fluid.beta": 1e15})
    for count, least, most in ((2, 0.0, 1.0), (3, math.sqrt(0.75), 1.0)):
        total = []
        for theta in np.linspace(0.0, 2.0 * math.pi, 3601):
            flow = 0.0
            for k in range(count):
                pump = par.pump.replace({"phase": 2.0 * math.pi * k / count})
                u = return_pump.Input(theta, 100.0 * math.pi, 2 * BAR, 60 * BAR)
                full = return_pump.area(pump) * pump.e * math.cos(theta + pump.phase)
                flow += return_pump.output(return_pump.State(full), u, pump, par.fluid).q_d
            total.append(flow)
        stroke = return_pump.displacement(par.pump)
        assert np.mean(total[:-1]) == pytest.approx(count * 50.0 * stroke, rel=1e-5)
        largest = 0.5 * stroke * 100.0 * math.pi
        assert min(total) == pytest.approx(least * largest, abs=1e-3 * largest)
        assert max(total) == pytest.approx(most * largest, rel=1e-3)
