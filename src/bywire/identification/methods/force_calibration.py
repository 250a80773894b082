"""Force over current of a screw drive: calibration line, friction to either side, offset.

For a brake without a force sensor: what force a current means, and how far friction may be off.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from pydantic import Field

from bywire.assemblies.wedge_parameters import WedgeParameters
from bywire.bench.experiments import force_cycle
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Frequency, Unit
from bywire.identification.drive_train import force_current
from bywire.identification.drive_train.common_axis import on_common_axis
from bywire.identification.drive_train.force_current import Reading, Squeeze, branches, law, squeeze
from bywire.identification.lack_of_fit import lack_of_fit
from bywire.identification.least_squares import Problem, estimate
from bywire.identification.method import Curve, Effort, Identified, Method
from bywire.identification.simulated_record import Sensor, sensed, turned
from bywire.plant import roller_screw, servo_motor
from bywire.plant.axial_bearing import AngularSpeed

Array = NDArray[np.float64]

_LAW = len(force_current.NAMES)


class Options(ParameterSet):
    """Which part of the motion counts, and the synthetic noise."""

    cutoff: Frequency
    """low-pass of the speed"""
    slowest: AngularSpeed
    """speed of one motor toward the other that counts as motion"""
    margin: Duration
    """time left out at either end of a motion"""
    window: Duration
    """time over which signals are averaged"""
    sigma_i: Annotated[float, Unit("A", 0.02), Field(ge=0)]
    """noise of the measured currents in synthetic measurements"""
    sigma_F: Annotated[float, Unit("N", 5.0), Field(ge=0)]
    """noise of the force sensor in synthetic measurements"""


def identify(
    data: xr.Dataset, par: WedgeParameters, options: Options, effort: Effort
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
    one = squeeze(data, par, reading, "the record")
    unknowns = force_current.unknowns(par) + force_current.waves_unknowns(par, "sensor")
    scatter = _scatter(one)

    def evaluate(values: Array) -> tuple[Array, Array]:
        i, columns, _ = law(one.F, one.way, values)
        e = i + one.waves @ values[_LAW:] - one.i
        return e / scatter, np.hstack((columns, one.waves)) / scatter

    best = estimate(Problem(unknowns, evaluate))
    told = {u.label: u.start for u in unknowns} | dict(zip(best.names, best.values, strict=True))
    values = np.array([told[u.label] for u in unknowns])
    return Identified(
        estimates={"force over current": best},
        parameters={},
        figures=_figures(values, one, par),
        checks=(
            lack_of_fit(
                "current_left_over", evaluate(values)[0], np.ones(one.i.size),
                np.hstack((branches(one, 3, one.F), one.waves)), len(best.values),
                "whether current over force bends in a way that the law does not",
            ),
        ),
        curves=(_curve(one, values),),
        notes=(
            "half widths hold at the mean speed of the test; at rest the force may be anywhere "
            "between",
            "how the bearings' friction changes with speed is taken from the parameter set",
        ),
    )  # fmt: skip


def _scatter(one: Squeeze) -> float:
    """Return a rough scatter of the current; it drops out of the result."""
    return max(float(np.median(np.abs(np.diff(one.i)))), 1e-9)


def _figures(
    values: Array, one: Squeeze, par: WedgeParameters
) -> dict[str, tuple[float, str]]:
    K = 0.5 * sum(servo_motor.torque_constant(m) for m in (par.motor_1, par.motor_2))
    per = K / roller_screw.slope(par.screw)
    top = float(np.abs(one.F).max())
    half = float(values[2] + values[3] * top + values[4] * top**2)
    return {
        "force_per_current": (float(values[1]), "N/A"),
        "largest_force": (top, "N"),
        "half_width_at_largest_force": (half, "A"),
        "eta_f": (float(1.0 / (per * (1.0 / values[1] + values[3]))), "1"),
        "eta_b": (float(per * (1.0 / values[1] - values[3])), "1"),
    }


def _curve(one: Squeeze, values: Array) -> Curve:
    measured = one.i - one.waves @ values[_LAW:]
    # Compression and tension apart: nothing was read right at the kink between them.
    groups = [(k, (one.way == sign) & ((one.F > 0.0) == closed))
              for k, sign in enumerate((1.0, -1.0)) for closed in (True, False)]  # fmt: skip
    groups = [(k, rows) for k, rows in groups if rows.any()]
    F, seen = on_common_axis([one.F[g] for _, g in groups], [measured[g] for _, g in groups])
    table = np.full((2, 3, F.size), np.nan)
    for (k, _), row in zip(groups, seen, strict=True):
        table[0, k] = np.where(np.isfinite(row), row, table[0, k])
    for k, sign in enumerate((1.0, -1.0, 0.0)):
        table[1, k] = law(F, np.full(F.size, sign), values)[0]
    attrs = {"units": "A", "long_name": "current, cogging taken off"}
    return Curve(
        "current-over-force",
        "Current over force, closing and opening, with the calibration line between.",
        xr.Dataset(
            {name: (("direction", "F"), rows, attrs)
             for name, rows in zip(("measured", "modeled"), table, strict=True)},
            {"direction": ["closing", "opening", "mean line"],
             "F": ("F", F, {"units": "N", "long_name": "force"})},
        ),
        "F",
    )  # fmt: skip


def synthetic(par: WedgeParameters, options: Options, seed: int) -> xr.Dataset:
    """Return the force cycle on the sensor, simulated, with the sensors' noise."""
    experiment = force_cycle.EXPERIMENT
    case = experiment.cases(par, experiment.defaults, None)[0]
    random = np.random.default_rng(seed)
    sensors = {name: Sensor(name, options.sigma_i) for name in ("i_1", "i_2")}
    sensors |= {name: Sensor(name) for name in ("q_1", "q_2")}
    sensors["y_F"] = Sensor("y_F", options.sigma_F)
    return sensed(turned(case, random.uniform(0.0, 2.0 * np.pi)), sensors, random)


def truth(par: WedgeParameters, options: Options) -> dict[str, float]:
    """Return the line and the growth of the friction that the laws of screw and bearing mean."""
    known = {u.label: u.start for u in force_current.unknowns(par)}
    return {name: known[name] for name in ("offset", "force_per_current", "half_width_slope")}


METHOD = Method(
    name="force-calibration",
    assembly="wedge-brake",
    summary="force over current of the screw drive: line, friction to either side, offset",
    experiment="force-cycle",
    signals={"i_1": "A", "i_2": "A", "q_1": "rad", "q_2": "rad", "y_F": "N"},
    options=Options,
    defaults=Options(
        cutoff=20.0, slowest=0.2, margin=0.05, window=0.02, sigma_i=0.02, sigma_F=5.0
    ),
    identify=identify,
    synthetic=synthetic,
    simulated=("sigma_i", "sigma_F"),
    truth=truth,
)
