"""Tandem master cylinder with two circuits: pressures, failed circuits, and balances."""

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
from bywire.plant import (
    brake_fluid,
    cup_seal,
    end_stop,
    master_cylinder,
    orifice,
    reservoir_port,
    stiffening_caliper,
    tandem_master_cylinder,
)
from bywire.simulation.run import Run, Trajectory, simulate
from systems.fluids import FLUID, flat

BAR, CM3 = 1e5, 1e-6
A = 0.25 * math.pi * 23.8e-3**2
STROKE = 18e-3


class Parameters(ParameterSet):
    """Two pistons, and two equal circuits except for their reservoir ports."""

    pistons: tandem_master_cylinder.Parameters
    seal: cup_seal.Parameters
    chamber: master_cylinder.Parameters
    stop: end_stop.Parameters
    port_1: reservoir_port.Parameters
    port_2: reservoir_port.Parameters
    line: orifice.Parameters
    caliper: stiffening_caliper.Parameters
    fluid: brake_fluid.Parameters
    T_s: Duration


class Stimulus(NamedTuple):
    """Force of the push rod."""

    F_rod: Annotated[float, Signal("N", "force of the push rod", 1e3)]


class Tandem(Assembly[Parameters, Stimulus]):
    """The cylinder with a caliper on each circuit."""

    name: ClassVar[str] = "tandem"
    Memory: ClassVar[Any] = Stimulus
    Stimulus: ClassVar[Any] = Stimulus
    frictions = ("v_1", "v_2")
    limits = ("p_1", "p_2")
    shared = ("fluid",)
    E_source = Integral("J", "energy of the push rod", role=Role("source", "push rod"))
    pistons = Part(tandem_master_cylinder)
    chamber_1 = Part(master_cylinder, par="chamber", state={"p": "p_1"}, loss="E_damping")
    chamber_2 = Part(master_cylinder, par="chamber", state={"p": "p_2"}, loss="E_damping")
    seal_1 = Part(cup_seal, par="seal")
    seal_2 = Part(cup_seal, par="seal")
    stop_1 = Part(end_stop, par="stop", work="W_stop_1", loss="E_stop", which="1")
    stop_2 = Part(end_stop, par="stop", work="W_stop_2", loss="E_stop", which="2")
    port_1 = Part(reservoir_port)
    port_2 = Part(reservoir_port)
    line_1 = Part(orifice, par="line", loss="E_line")
    line_2 = Part(orifice, par="line", loss="E_line")
    pads_1 = Part(stiffening_caliper, par="caliper", state={"p": "p_c1"})
    pads_2 = Part(stiffening_caliper, par="caliper", state={"p": "p_c2"})
    E_seals = Integral("J", "friction of the seals", role=Role("sink", "seals"))
    E_port = Integral("J", "energy lost to the reservoir", role=Role("sink", "reservoir"))
    V_1 = Integral("m**3", "volume that circuit 1 receives from the reservoir")
    V_2 = Integral("m**3", "volume that circuit 2 receives from the reservoir")
    load_1 = Wire("N", "load between the pistons", 1e3)
    load_2 = Wire("N", "load on the floating piston", 1e3)

    def wire(self, w: Any) -> None:
        """Connect pistons, chambers, ports, lines and calipers."""
        y = tandem_master_cylinder.output(w.pistons.x, w.pistons.par)
        x = w.pistons.x
        stroke = w.par.chamber
        w.stop_1.u = end_stop.Input(y.x_c1, y.v_c1, 0.0 * stroke.x_rest, stroke.x_end)
        w.stop_2.u = end_stop.Input(x.x_2, x.v_2, 0.0 * stroke.x_rest, stroke.x_end)
        w.seal_1.u = cup_seal.Input(x.v_1, w.chamber_1.x.p)
        w.seal_2.u = cup_seal.Input(x.v_2, w.chamber_2.x.p)
        w.line_1.u = orifice.Input(w.chamber_1.x.p, w.pads_1.x.p, 1.0)
        w.line_2.u = orifice.Input(w.chamber_2.x.p, w.pads_2.x.p, 1.0)
        q_1 = orifice.flow(w.line_1.u, w.par.line, w.par.fluid)
        q_2 = orifice.flow(w.line_2.u, w.par.line, w.par.fluid)
        w.pads_1.u = stiffening_caliper.Input(q_1)
        w.pads_2.u = stiffening_caliper.Input(q_2)
        w.port_1.u = reservoir_port.Input(y.x_c1, w.chamber_1.x.p)
        w.port_2.u = reservoir_port.Input(x.x_2, w.chamber_2.x.p)
        leak_1 = reservoir_port.output(w.port_1.u, w.port_1.par).G * w.chamber_1.x.p
        leak_2 = reservoir_port.output(w.port_2.u, w.port_2.par).G * w.chamber_2.x.p
        w.chamber_1.u = master_cylinder.Input(y.x_c1, y.v_c1, q_1 + leak_1)
        w.chamber_2.u = master_cylinder.Input(x.x_2, x.v_2, q_2 + leak_2)
        force_1 = master_cylinder.output(w.chamber_1.x, w.chamber_1.u, stroke).force
        force_2 = master_cylinder.output(w.chamber_2.x, w.chamber_2.u, stroke).force
        w.load_1 = force_1 + end_stop.load(w.stop_1.f)
        w.load_2 = force_2 + end_stop.load(w.stop_2.f)
        w.pistons.u = tandem_master_cylinder.Input(w.m.F_rod, w.load_1, w.load_2)

    def friction(self, w: Any) -> tuple[tuple[float, float], ...]:
        """Return the bounds of both seals."""
        seals = [cup_seal.output(seal.u, seal.par) for seal in (w.seal_1, w.seal_2)]
        return tuple((-seal.F_p, seal.F_n) for seal in seals)

    def power(self, w: Any) -> dict[str, float]:
        """Return the powers of push rod, seals and reservoir."""
        x, fluid = w.pistons.x, w.par.fluid
        makeup = w.reaction[2:4]
        ports = zip((w.port_1, w.port_2), (w.chamber_1, w.chamber_2), makeup, strict=True)
        losses, volumes = [], []
        for port, chamber, q in ports:
            gained = brake_fluid.convected_power(q, chamber.x.p, fluid)
            losses.append(reservoir_port.power_loss(port.u, port.par, fluid) - gained)
            volumes.append(q - reservoir_port.output(port.u, port.par).G * chamber.x.p)
        return {
            "E_source": w.m.F_rod * x.v_1,
            "E_seals": -w.reaction[0] * x.v_1 - w.reaction[1] * x.v_2,
            "E_port": losses[0] + losses[1],
            "V_1": volumes[0],
            "V_2": volumes[1],
        }

    def tasks(self, par: Parameters) -> tuple[Task, ...]:
        """Return the hold."""
        return (Task("hold", par.T_s, lambda x, m, u, p: Stimulus(*u)),)


def parameters(changes: dict[str, Any] | None = None) -> Parameters:
    """Return a bore of 23.8 mm, springs of 80 and 60 N, seals of 40 N; all other values chosen."""
    port = {"law": "makeup", "x_port": 1e-3, "G_port": 1e-9}
    groups = {
        "pistons": {
            "m_1": 0.2,
            "m_2": 0.1,
            "F_s1": 80.0,
            "k_s1": 0.0,
            "F_s2": 60.0,
            "k_s2": 0.0,
        },
        "seal": {"F_pr": 40.0, "f_p": 0.0, "f_n": 0.0, "k_brk": 1.0, "v_S": 1e-3, "mu": 0.0},
        "chamber": {
            "A_mc": A,
            "s_mc": 22e-3,
            "x_rest": 1e-6,
            "x_end": STROKE,
            "x_nominal": 5e-3,
            "k_damp": 50.0,
        },
        "stop": {"k_stop": 2e7, "tau_stop": 2e-5},
        "port_1": port,
        "port_2": port,
        "line": {"d": 2e-3, "C_d": 0.65, "Re_cr": 100.0},
        "caliper": {"V_1": 0.35 * CM3, "p_1": 4 * BAR, "c": 0.011 * CM3 / BAR},
        "fluid": FLUID,
    }
    return Parameters.create(flat(groups) | {"T_s": 1e-3} | (changes or {}))


def pressed(par: Parameters, step: float = 1e-5) -> Trajectory:
    """Return a slow ramp to 2200 N in 1.1 s, then back to zero in the same time."""

    def stimulus(t: Any) -> Any:
        return np.clip(2000.0 * np.minimum(t, 2.2 - t), 0.0, None)[:, None]

    start = Tandem().rest(par)
    return simulate(Run(Tandem(), par, *start, stimulus, 2.4, step))


@pytest.fixture(scope="module")
def healthy() -> Trajectory:
    """Return the ramp of a cylinder without failures."""
    return pressed(parameters())


def at(result: Trajectory, name: str, t: float) -> float:
    """Return a signal at a time."""
    return float(np.interp(t, result.time, result[name]))


def residual(result: Trajectory) -> float:
    """Return the residual of the energy balance, relative to the energy of the push rod."""
    sinks = ("damping", "line", "seals", "port", "stop", "stored")
    rest = result["E_source"] - sum(result[f"E_{name}"] for name in sinks)
    return float(np.abs(rest - rest[0]).max() / result["E_source"].max())


def test_pressures_while_the_pistons_move(healthy):
    """2000 N moving in: 42.26 and 41.81 bar; closed. The force is held for 1 ms, which is 2 N."""
    inward = (2000.0 - 80.0 - 40.0) / A, (2000.0 - 60.0 - 2 * 40.0) / A
    assert [p / BAR for p in inward] == pytest.approx([42.26, 41.81], abs=0.005)
    found = [at(healthy, name, 1.0) for name in ("p_1", "p_2")]
    assert found == pytest.approx(inward, abs=2.0 / A)
    outward = (2000.0 - 80.0 + 40.0) / A, (2000.0 - 60.0 + 2 * 40.0) / A
    found = [at(healthy, name, 1.2) for name in ("p_1", "p_2")]
    assert found == pytest.approx(outward, abs=3.0 / A)
    assert residual(healthy) < 1e-8


def test_the_springs_stiffnesses_count():
    par = parameters({"pistons.k_s1": 4e3, "pistons.k_s2": 3e3})
    result = pressed(par)
    x_1, x_2 = (at(result, name, 1.0) for name in ("x_1", "x_2"))
    p_1 = (1880.0 - 4e3 * (x_1 - x_2)) / A
    p_2 = p_1 + (80.0 + 4e3 * (x_1 - x_2) - 60.0 - 3e3 * x_2 - 40.0) / A
    found = [at(result, name, 1.0) for name in ("p_1", "p_2")]
    assert found == pytest.approx([p_1, p_2], abs=2.0 / A)


def test_stops_carry_the_force_of_a_failed_circuit(healthy):
    """Piston 1 runs to piston 2, or piston 2 to the end. The other circuit keeps its pressure."""
    first = pressed(parameters({"port_1.law": "leaking"}))
    assert at(first, "p_1", 1.0) < 0.01 * BAR
    assert at(first, "x_1", 1.0) - at(first, "x_2", 1.0) == pytest.approx(STROKE, abs=0.1e-3)
    assert at(first, "p_2", 1.0) == pytest.approx((2000.0 - 60.0 - 80.0) / A, abs=2.0 / A)
    second = pressed(parameters({"port_2.law": "leaking"}))
    assert at(second, "p_2", 1.0) < 0.01 * BAR
    assert at(second, "x_2", 1.0) == pytest.approx(STROKE, abs=0.1e-3)
    assert at(second, "p_1", 1.0) == pytest.approx((2000.0 - 80.0 - 40.0) / A, abs=2.0 / A)
    for failed in (first, second):
        assert at(failed, "x_1", 1.0) > at(healthy, "x_1", 1.0) + 0.8 * STROKE
        assert residual(failed) < 2e-6


def test_each_circuit_keeps_its_fluid(healthy):
    """Swept volume and makeup are in the calipers, except for the compression in the chamber."""
    for travel, volume, p_c, p in (
        (healthy["x_1"] - healthy["x_2"], "V_1", "p_c1", "p_1"),
        (healthy["x_2"], "V_2", "p_c2", "p_2"),
    ):
        pads = stiffening_caliper.State(healthy[p_c])
        given = A * travel + healthy[volume]
        taken = stiffening_caliper.volume(pads, parameters().caliper)
        squeezed = A * (22e-3 - travel) * healthy[p] / 1.5e9
        assert np.abs(given - taken - squeezed).max() < 5e-3 * CM3


@pytest.mark.parametrize("fault", tandem_master_cylinder.FAULTS, ids=lambda fault: fault.name)
def test_a_weak_spring_raises_its_pressure(fault, healthy):
    nominal = parameters().flat()
    changes = {f"pistons.{n}": fault.value * nominal[f"pistons.{n}"] for n in fault.scaled}
    result = pressed(parameters(changes))
    gain = at(result, "p_1", 1.0) + at(result, "p_2", 1.0)
    gain = gain - at(healthy, "p_1", 1.0) - at(healthy, "p_2", 1.0)
    assert gain == pytest.approx({"spring-1": 72.0, "spring-2": 54.0}[fault.name] / A, rel=0.02)
