"""Scenarios of the wedge brake, run by the package and by the independent reference."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brakes.wedge.wedge_runs import IDEAL, brake, drive
from bywire.simulation.run import Trajectory
from reference import karnopp_wedge

Array = NDArray[np.float64]

RECORD = 2e-4
COMPARED = ("x", "F_N", "i_1", "omega_1", "M_B", "f_1", "f_2")
UNEVEN = {
    "bearing.C_1": 1e-5,
    "screw.eta_b": 0.55,
    "control.position.c": 0.5,
    "drive.G_sense": 0.97,
    "drive.V_dc": 12.0,
    "motor_1.dT": 40.0,
    "motor_2.J_M": 1.5e-4,
    "motor_2.D_M": 3e-4,
    "motor_2.T_cog": 0.02,
    "wedge.k_return": 2e4,
}
"""what is zero, equal or indifferent in the catalog made to matter"""


@dataclass(frozen=True)
class Scenario:
    """Demand before and after an instant, from the parking position; power off from another."""

    before: float
    after: float
    change: float
    duration: float
    mu_B: float = 0.35
    power_off: float = np.inf
    changes: Mapping[str, Any] = field(default_factory=dict)
    step: float = 2e-6
    """of the reference, which finds a stop within its own step alone [s]"""

    def M_set(self, t: Array) -> Array:
        """Return the moment demand [N m]."""
        return np.where(t < self.change - 1e-9, self.before, self.after)

    def off(self, t: Array) -> Array:
        """Return 1 while the power stages are off."""
        return np.where(t < self.power_off - 1e-9, 0.0, 1.0)


SCENARIOS = {
    "moment pulses": Scenario(200.0, 160.0, 0.2, 0.3),
    "power-off hold": Scenario(500.0, 500.0, 0.0, 0.6, power_off=0.3),
    "release": Scenario(400.0, 0.0, 0.2, 0.5),
    "other direction": Scenario(300.0, 300.0, 0.0, 0.15, changes={"flywheel.Omega_0": -60.0}),
    "uneven motors": Scenario(300.0, 200.0, 0.15, 0.3, changes=UNEVEN),
    "screw friction by torque, driven disc": Scenario(
        300.0, 200.0, 0.15, 0.3, changes={"screw.law": "drive", "flywheel.law": "driven"}
    ),
    "weak pads": Scenario(500.0, 300.0, 0.2, 0.4, mu_B=0.2),
    "beyond the neutral point": Scenario(500.0, 300.0, 0.2, 0.4, mu_B=0.6),
    "scheduled offset": Scenario(
        500.0, 300.0, 0.15, 0.3, mu_B=0.2, changes={"control.offset.law": "scheduled"}
    ),
    "disc stops, pads dropped": Scenario(
        300.0, 300.0, 0.0, 0.4, changes={"flywheel.Omega_0": 2.0}, step=1e-6
    ),
    "disc stops, pads stick": Scenario(
        300.0,
        300.0,
        0.0,
        0.4,
        # The reference finds a stop to 1 nm only, where this speed is lower.
        changes={
            "flywheel.Omega_0": 2.0,
            "wedge_friction.stopped_disc": "stick",
            "flywheel.Omega_still": 1e-3,
        },
        step=1e-6,
    ),
    "runaway to the end stop": Scenario(950.0, 950.0, 0.0, 0.6, mu_B=0.6, power_off=0.3),
}


@cache
def package(name: str, step: float = 20e-6) -> Trajectory:
    """Return a scenario as the package computes it, rows at the position control's ticks."""
    s = SCENARIOS[name]
    par = brake(IDEAL | dict(s.changes), s.mu_B)
    return drive(par, s.duration, step, RECORD, M_set=s.M_set, power_off=s.off)


@cache
def reference(
    name: str,
    band: float = 0.0,
    step: float | None = None,
    changes: tuple[tuple[str, float], ...] = (),
) -> dict[str, Array]:
    """Return a scenario as the reference computes it, with other parameters if wanted."""
    return simulated(SCENARIOS[name], band, step, dict(changes))


def simulated(
    s: Scenario,
    band: float = 0.0,
    step: float | None = None,
    changes: Mapping[str, Any] | None = None,
) -> dict[str, Array]:
    """Return any scenario as the reference computes it; see ``karnopp_wedge.run``."""
    values = brake(IDEAL | dict(s.changes), s.mu_B).replace(dict(changes or {})).flat()
    return karnopp_wedge.run(values, s.duration, band, step or s.step, s.M_set, s.off)


def rms(a: Any, b: Any, signal: str) -> float:
    """Return the root mean square of the difference of one signal, without the first row.

    The package records forces of a substep, and none precedes the start.
    """
    return float(np.sqrt(np.mean((a[signal] - b[signal])[1:] ** 2)))
