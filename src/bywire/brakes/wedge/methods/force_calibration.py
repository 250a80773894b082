"""Force over current of a screw drive: calibration line, friction to either side, offset.

For a brake without a force sensor: what force a current means, and how far friction may be off.
"""

from __future__ import annotations

import numpy as np
import xarray as xr

from bywire.brakes.wedge.experiments import force_cycle
from bywire.brakes.wedge.methods.drive_train import cogging_waves, force_current
from bywire.brakes.wedge.methods.drive_train.force_current import (
    Reading,
    Squeeze,
    branches,
    law,
    squeeze,
)
from bywire.brakes.wedge.methods.drive_train.rig_measurement import (
    SIGNALS,
    SIMULATED,
    RigOptions,
    drive_sensors,
)
from bywire.brakes.wedge.methods.turned import turned
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.typing import Array
from bywire.data.labeled import at_own_places, over
from bywire.identification.least_squares import Problem, estimate
from bywire.identification.method import Curve, Effort, Identified, Method
from bywire.identification.residuals import lack_of_fit
from bywire.identification.trust import sensed
from bywire.plant import roller_screw, servo_motor

_GAP = np.full((2, 1), np.nan)
_LAW = len(force_current.NAMES)


def identify(
    data: xr.Dataset, par: WedgeParameters, options: RigOptions, effort: Effort
) -> Identified:
    r"""Return the line of force over current and the friction around it.

    .. math:: i = i_0 + F/c \pm (w_0 + w_1 |F| + w_2 F^2)

    with the upper sign while the screws close; cogging of known order is fitted beside it.

    Parameters
    ----------
    data
        ``i_1``, ``i_2`` [A], ``q_1``, ``q_2`` [rad], ``y_F`` [N]: two motors that squeeze and let
        go slowly. A motor that only holds may stand still.

    Raises
    ------
    ParameterError
        When they move one way only.

    References
    ----------
    Roberts et al. (2003), section "Rollerscrew and bearings": loss of the screw, bearing friction.
    """
    reading = Reading(options.cutoff, options.slowest, options.margin, options.window)
    cycle = squeeze(data, par, reading, "the record")
    unknowns = force_current.unknowns(par) + cogging_waves.unknowns(par, "sensor")
    scatter = _scatter(cycle)

    def evaluate(values: Array) -> tuple[Array, Array]:
        i, columns, _ = law(cycle.F, cycle.way, values)
        e = i + cycle.waves @ values[_LAW:] - cycle.i
        return e / scatter, np.hstack((columns, cycle.waves)) / scatter

    best = estimate(Problem(unknowns, evaluate))
    known = {u.label: u.start for u in unknowns} | dict(zip(best.names, best.values, strict=True))
    values = np.array([known[u.label] for u in unknowns])
    return Identified(
        estimates={"force over current": best},
        parameters={},
        figures=_figures(values, cycle, par),
        checks=(
            lack_of_fit(
                "current_left_over",
                evaluate(values)[0],
                np.ones(cycle.i.size),
                np.hstack((branches(cycle, 3, cycle.F), cycle.waves)),
                len(best.values),
                "whether current over force bends in a way that the law does not",
            ),
        ),
        curves=(_curve(cycle, values),),
        notes=(
            "half widths hold at the mean speed of the test; at rest the force may be anywhere "
            "between",
            "how the bearings' friction changes with speed is taken from the parameter set",
        ),
    )


def _scatter(cycle: Squeeze) -> float:
    """Return a rough scatter of the current; it drops out of the result."""
    return max(float(np.median(np.abs(np.diff(cycle.i)))), 1e-9)


def _figures(values: Array, cycle: Squeeze, par: WedgeParameters) -> dict[str, tuple[float, str]]:
    K = 0.5 * sum(servo_motor.torque_constant(m) for m in (par.motor_1, par.motor_2))
    per = K / roller_screw.slope(par.screw)
    top = float(np.abs(cycle.F).max())
    half = float(values[2] + values[3] * top + values[4] * top**2)
    return {
        "force_per_current": (float(values[1]), "N/A"),
        "largest_force": (top, "N"),
        "half_width_at_largest_force": (half, "A"),
        "eta_f": (float(1.0 / (per * (1.0 / values[1] + values[3]))), "1"),
        "eta_b": (float(per * (1.0 / values[1] - values[3])), "1"),
    }


def _curve(cycle: Squeeze, values: Array) -> Curve:
    measured = cycle.i - cycle.waves @ values[_LAW:]
    places, rows = [], []
    for sign in (1.0, -1.0):
        F, i = cycle.F[cycle.way == sign], measured[cycle.way == sign]
        # A gap at zero force: nothing was read right at the kink there.
        places.append(np.append(F, 0.0))
        branch = np.array((i, law(F, np.full(F.size, sign), values)[0]))
        rows.append(np.append(branch, _GAP, axis=1))
    line = np.array((cycle.F.min(), 0.0, cycle.F.max()))
    places.append(line)
    rows.append(np.array((np.full(3, np.nan), law(line, np.zeros(3), values)[0])))
    F, table = at_own_places(places, rows)
    return Curve(
        "current-over-force",
        "Current over force, closing and opening, with the calibration line between.",
        over(
            ("F", F, "N", "force"),
            {"measured": table[0], "modeled": table[1]},
            "A",
            "current, cogging taken off",
            ("direction", ("closing", "opening", "mean line")),
        ),
        "F",
    )


def synthetic(par: WedgeParameters, options: RigOptions, seed: int) -> xr.Dataset:
    """Return the force cycle on the sensor, simulated, with the sensors' noise."""
    experiment = force_cycle.EXPERIMENT
    case = experiment.cases(par, experiment.defaults, None)[0]
    random = np.random.default_rng(seed)
    begun = turned(case, random.uniform(0.0, 2.0 * np.pi))
    return sensed(begun, drive_sensors(options), random)


def truth(par: WedgeParameters, options: RigOptions) -> dict[str, float]:
    """Return the line and the growth of the friction that the laws of screw and bearing mean."""
    known = {u.label: u.start for u in force_current.unknowns(par)}
    return {name: known[name] for name in ("offset", "force_per_current", "half_width_slope")}


METHOD = Method(
    name="force-calibration",
    assembly="wedge-brake",
    summary="force over current of the screw drive: line, friction to either side, offset",
    experiment="force-cycle",
    signals=SIGNALS,
    options=RigOptions,
    defaults=RigOptions(
        cutoff=20.0, slowest=0.2, margin=0.05, window=0.02, sigma_i=0.02, sigma_F=5.0
    ),
    identify=identify,
    synthetic=synthetic,
    simulated=SIMULATED,
    truth=truth,
    further={**force_current.MEANINGS, **cogging_waves.meanings("sensor")},
)
