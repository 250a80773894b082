"""Roll-back of a caliper's seal: clearance, dragging pads, volume and energy."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
import pytest

from bywire.authoring import Assembly, Duration, Integral, ParameterSet, Part, Role, Signal, Task
from bywire.core.quantities import Length
from bywire.plant import brake_fluid, caliper_piston, end_stop, orifice, seal_rollback
from bywire.simulation.run import Run, Trajectory, simulate
from systems.fluids import FLUID, flat

BAR, CM3 = 1e5, 1e-6
A, K_PADS, GAP = 1.96e-3, 3.5e7, 1e-4


class Parameters(ParameterSet):
    """Caliper with seal and pads, fed through an orifice."""

    piston: caliper_piston.Parameters
    seal: seal_rollback.Parameters
    pads: end_stop.Parameters
    line: orifice.Parameters
    fluid: brake_fluid.Parameters
    gap: Length
    T_s: Duration


class Stimulus(NamedTuple):
    """Pressure in the line."""

    p_line: Annotated[float, Signal("Pa", "pressure in the line", 2e6)]


class Caliper(Assembly[Parameters, Stimulus]):
    """A caliper with running clearance."""

    name: ClassVar[str] = "caliper-with-clearance"
    Memory: ClassVar[Any] = Stimulus
    Stimulus: ClassVar[Any] = Stimulus
    shared = ("fluid",)
    E_source = Integral("J", "energy from the line", role=Role("source", "line"))
    piston = Part(caliper_piston, loss="E_piston")
    seal = Part(seal_rollback, loss="E_seal", output=("F_seal",))
    pads = Part(end_stop, work="W_pads", loss="E_pads", output={"far": "F_pads"})
    line = Part(orifice, loss="E_line")
    V_in = Integral("m**3", "volume from the line")

    def wire(self, w: Any) -> None:
        """Connect line, piston, seal and pads."""
        x = w.piston.x
        w.pads.u = end_stop.Input(x.x, x.v, -10.0 * w.par.gap, w.par.gap)
        w.seal.u = seal_rollback.Input(x.v)
        w.line.u = orifice.Input(w.m.p_line, x.p, 1.0)
        q = orifice.flow(w.line.u, w.line.par, w.par.fluid)
        F_seal = seal_rollback.output(w.seal.x, w.seal.par).F_seal
        w.piston.u = caliper_piston.Input(q, end_stop.load(w.pads.f), F_seal)

    def power(self, w: Any) -> dict[str, float]:
        """Return what flows in."""
        q, fluid = w.piston.u.q, w.par.fluid
        return {"E_source": brake_fluid.convected_power(q, w.m.p_line, fluid), "V_in": q}

    def tasks(self, par: Parameters) -> tuple[Task, ...]:
        """Return the hold."""
        return (Task("hold", par.T_s, lambda x, m, u, p: Stimulus(*u)),)


def parameters(changes: dict[str, Any] | None = None) -> Parameters:
    """Return a caliper with a roll-back of 0.3 mm, all values chosen."""
    groups = {
        "piston": {"A_pd": A, "V_0": 1e-5, "m": 0.3, "d": 1e3, "G_leak": 0.0},
        "seal": {"k": 6e5, "z_max": 3e-4},
        "pads": {"k_stop": K_PADS, "tau_stop": 2e-5},
        "line": {"d": 0.8e-3, "C_d": 0.65, "Re_cr": 100.0},
        "fluid": FLUID,
    }
    return Parameters.create(flat(groups) | {"gap": GAP, "T_s": 1e-3} | (changes or {}))


def braked(par: Parameters, p: float, step: float = 2e-5, times: int = 2) -> Trajectory:
    """Return applications of 0.3 s, with pauses of 0.3 s."""

    def stimulus(t: Any) -> Any:
        phase = t % 0.6
        level = np.clip(np.minimum(phase / 0.1, (0.4 - phase) / 0.1), 0.0, 1.0)
        return (p * level)[:, None]

    start = Caliper.state()
    return simulate(Run(Caliper(), par, start, Stimulus(0.0), stimulus, 0.6 * times, step))


def at(result: Trajectory, name: str, t: float) -> float:
    """Return a signal at a time."""
    return float(np.interp(t, result.time, result[name]))


def residual(result: Trajectory) -> float:
    """Return the residual of the energy balance, relative to the energy of the source."""
    sinks = ("piston", "seal", "pads", "line", "stored")
    left = result["E_source"] - sum(result[f"E_{name}"] for name in sinks)
    return float(np.abs(left - left[0]).max() / result["E_source"].max())


@pytest.mark.parametrize("z_max", [1.5e-4, 3e-4])
def test_the_seal_retracts_the_piston_by_its_roll_back(z_max):
    """The pads yield by n = (A p - k z)/K. The clearance is the roll-back minus n."""
    par = parameters({"seal.z_max": z_max})
    result = braked(par, 20 * BAR)
    n = (A * at(result, "p", 0.25) - at(result, "F_seal", 0.25)) / K_PADS
    farthest, released = at(result, "x", 0.25), at(result, "x", 0.59)
    assert farthest == pytest.approx(GAP + n, rel=1e-3)
    assert at(result, "F_seal", 0.25) == pytest.approx(6e5 * min(z_max, farthest), rel=1e-6)
    clearance = min(z_max - n, GAP)  # without slip, the piston returns to its start
    assert GAP - released == pytest.approx(clearance, rel=0.01)
    assert at(result, "F_pads", 0.59) < 0.1
    assert residual(result) < 1e-5
    assert np.all(np.diff(result["E_seal"]) >= 0.0)


def test_pads_drag_after_they_have_yielded_by_more_than_the_roll_back():
    result = braked(parameters(), 100 * BAR)
    farthest, released = at(result, "x", 0.25), at(result, "x", 0.59)
    drag = at(result, "F_pads", 0.59)
    assert drag == pytest.approx(K_PADS * (released - GAP), rel=1e-3)
    assert drag == pytest.approx(6e5 * (farthest - 3e-4 - released), rel=1e-3)
    assert 100.0 < drag < 200.0


def test_a_clearance_costs_volume_and_the_fluid_is_kept():
    result = braked(parameters(), 100 * BAR)
    first = at(result, "V_in", 0.25)
    second = at(result, "V_in", 0.85) - at(result, "V_in", 0.59)
    closed = A * at(result, "x", 0.59)
    assert first - second == pytest.approx(closed, rel=2e-3)
    kept = result["V_in"] - A * result["x"]
    assert np.abs(kept[[-1]]).max() < 1e-4 * CM3  # at rest, nothing is compressed


@pytest.mark.parametrize(("name", "p"), [("hardened", 20 * BAR), ("swollen", 100 * BAR)])
def test_faults_let_the_pads_drag(name, p):
    fault = next(f for f in seal_rollback.FAULTS if f.name == name)
    nominal = parameters().flat()
    changes = {f"seal.{each}": fault.value * nominal[f"seal.{each}"] for each in fault.scaled}
    faulty, healthy = braked(parameters(changes), p), braked(parameters(), p)
    assert at(faulty, "F_pads", 0.59) > at(healthy, "F_pads", 0.59) + 20.0
    assert residual(faulty) < 1e-5


def test_a_leaking_caliper_loses_its_pressure():
    result = braked(parameters({"piston.G_leak": 1e-11}), 20 * BAR)
    assert at(result, "p", 0.25) < 18 * BAR
    assert residual(result) < 1e-5
