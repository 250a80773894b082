"""A motor at the rear wheel of the two-wheeler, with the pressure loops as friction brakes."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest

import bywire
from bywire.bench.energy_ledger import actuator_ledger, further_ledgers
from bywire.bench.experiment import Case, as_run
from bywire.bench.recording import record
from bywire.brakes.two_wheeler import ecu, model
from bywire.brakes.two_wheeler.case import on_surface
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core import ops
from bywire.core.model import Task
from bywire.core.signals import joined
from bywire.plant import brake_disc
from bywire.simulation.compiler import find_compiler
from bywire.simulation.run import simulate
from bywire.vehicle import RegeneratingTwoWheeler, regeneration

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
Memory: Any = joined(__name__, "Memory", ecu.Memory, regeneration.Memory)


class Parameters(TwoWheelerParameters):
    """The two-wheeler with its motor."""

    regeneration: regeneration.Parameters


class ElectricTwoWheeler(RegeneratingTwoWheeler[Parameters, Any], model.TwoWheelerByWire):
    """The rider's rear demand is shared by motor and pressure loop."""

    name: ClassVar[str] = "electric-two-wheeler"
    Memory: ClassVar = Memory
    Stimulus: ClassVar = ecu.Stimulus
    records: ClassVar = (
        *model.TwoWheelerByWire.records,
        *("p_r_most", "T_m", "T_m_ref", "T_limit", "T_brake", "soc", "E_recovered", "E_drive"),
        *("E_charged", "E_battery", "E_battery_loss"),
    )

    def slip_acts(self, m):
        return ops.where(m.p_r_ref < 0.9 * m.p_r_most, 1.0, 0.0)

    def demands(self, m, u, par):
        return _gain(par) * m.p_r_ref, 0.0

    def cold_torques(self, w):
        # The loop of the rear brake follows what the blending law leaves.
        front, _ = super().cold_torques(w)
        return front, w.m.T_brake

    def tasks(self, par) -> tuple[Task, ...]:
        blending, *others = super().tasks(par)
        return (*others, blending)


def _gain(par):
    return brake_disc.torque_per_pressure(par.rear.disc)


def run(surface="dry-asphalt", p_front=0.0, p_rear=40e5, duration=4.0, v=20.0, **changes):
    base = bywire.parameters("sport600")
    drive = bywire.parameters("roberts2003-corner-electric").regeneration
    par = Parameters(**dict(base), regeneration=drive).replace(
        {**on_surface(surface), "regeneration.blending.T_least": 0.0, **changes}
    )
    state, memory = model.at_speed(v, par)
    start = ElectricTwoWheeler.State(**state._asdict(), T_m=0.0, soc=0.5)
    held = Memory(**memory._asdict(), **regeneration.awake(v))

    def demand(t):
        return {"p_f_set": np.where(t >= 0, p_front, 0.0), "p_r_set": np.where(t >= 0, p_rear, 0.0)}

    case = Case("run", ElectricTwoWheeler(), par, start, held, demand, duration)
    each = as_run(case, 20e-6)
    return record(each, simulate(each), 0.0, 0.0, {}), par


@pytest.fixture(scope="module")
def dry():
    return run()


def test_the_motor_brakes_the_rear_wheel(dry):
    recording, par = dry
    there = recording.sel(time=2.0, method="nearest")
    assert float(there["T_m"]) == pytest.approx(_gain(par) * 40e5, rel=1e-3)
    assert float(there["T_r"]) == pytest.approx(0.0, abs=0.1)


def test_the_books_of_vehicle_and_battery_close(dry):
    recording, _ = dry
    for each in (actuator_ledger(recording), *further_ledgers(recording).values()):
        assert abs(each.closing_error) < 1e-6 * each.turnover, each
    assert float(recording["E_recovered"][-1]) > 1e4


def test_slip_control_takes_the_motor_out_within_50_ms():
    # The disc of a stronger rear brake exceeds the adhesion of snow.
    recording, _ = run("snow", duration=2.0)
    acts = recording["p_r_ref"].values < 0.9 * recording["p_r_most"].values
    first = int(np.argmax(acts))
    assert acts.any()
    assert float(recording["T_m"].max()) > 50.0
    t = float(recording["time"][first])
    after = recording.sel(time=slice(t + 0.052, t + 0.3))
    assert float(after["T_m_ref"].max()) == 0.0


def test_without_a_motor_the_equations_are_the_same():
    """A motor that the battery stops leaves the vehicle as it is without one."""
    recording, _ = run(p_rear=0.0, p_front=20e5, **{"regeneration.battery.P_max": 0.0})
    assert float(np.abs(recording["T_m"]).max()) == 0.0
    assert float(recording["E_recovered"][-1]) == 0.0
