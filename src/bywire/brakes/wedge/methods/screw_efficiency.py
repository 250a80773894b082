"""Roller-screw efficiency, driving and back-driven, from a load sweep (Roberts 2003).

Current and speed of both motors and the force between them give two torque balances. Friction
proportional to the force belongs to the screw. Friction at zero force, and friction proportional
to the force squared, belong to the bearings.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from bywire.brakes.wedge.case import turned
from bywire.brakes.wedge.experiments.screw_efficiency import LOAD_SWEEP
from bywire.brakes.wedge.methods.force_calibration import (
    SIGNALS,
    SIMULATED,
    RigOptions,
    drive_sensors,
)
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.shaft_rig import DrivenShaft
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.core.units import shown
from bywire.data.labeled import at_own_places, over
from bywire.identification.differentiation import differentiated
from bywire.identification.equation import (
    Equation,
    Motions,
    motions,
    steady_dynamics,
    window_residuals,
)
from bywire.identification.estimate import Estimate
from bywire.identification.measured import wrong_sign
from bywire.identification.method import Check, Curve, Effort, Identified, Method
from bywire.identification.residuals import lack_of_fit
from bywire.identification.trust import sensed
from bywire.identification.unknown import parameters_of
from bywire.plant import axial_bearing, roller_screw, servo_motor
from bywire.plant.axial_bearing import AngularSpeed


@dataclass(frozen=True)
class Stroke:
    """Means over one motion.

    Parameters
    ----------
    side
        Motor, 1 or 2.
    omega
        Speed [rad/s].
    F
        Magnitude of the force [N].
    drives
        True if the screw drives the load, false if the load drives the screw back.
    torque
        Motor torque in the direction of motion [N m].
    error
        Residual torque of the fit [N m].
    """

    side: int
    omega: float
    F: float
    drives: bool
    torque: float
    error: float


def _strokes(shaft: Motions, residuals: Array, par: WedgeParameters, side: int) -> list[Stroke]:
    """Return a shaft's motions with the residual torque of each."""
    K_T, read = servo_motor.torque_constant(par.motor_1), []
    motion = np.array([w.motion for w in shaft.windows])
    for number in np.unique(motion):
        rows_of = [w.rows for w in shaft.windows if w.motion == number]
        rows = shaft.data.isel(time=slice(rows_of[0].start, rows_of[-1].stop))
        omega, F = float(rows["omega"].mean()), float(rows["F"].mean())
        sign = 1.0 if omega > 0.0 else -1.0
        torque = sign * K_T * float(rows["i"].mean())
        error = sign * float(residuals[motion == number].mean())
        read.append(Stroke(side, omega, abs(F), F * omega < 0.0, torque, error))
    return read


def _fits(strokes_read: list[Stroke], best: Estimate) -> Check:
    """Check whether a separate curve for each shaft and direction fits better."""
    F = np.array([s.F for s in strokes_read]) / max(s.F for s in strokes_read)
    kind = [(s.side, s.drives) for s in strokes_read]
    groups = [np.array([each == k for each in kind], dtype=float) for k in sorted(set(kind))]
    e = np.array([s.error for s in strokes_read])
    scatter = {
        k: np.sqrt(np.mean([s.error**2 for s in strokes_read if s.side == k])) for k in (1, 2)
    }
    return lack_of_fit(
        "torque_left_over",
        e,
        np.array([1.0 / scatter[s.side] for s in strokes_read]),
        np.column_stack([g * F**power for g in groups for power in (0, 1, 2)]),
        len(best.values),
        "whether torque versus force deviates from the laws",
    )


_NAMES = ("screw.eta_f", "screw.eta_b", "bearing.C_0", "bearing.C_2")
_SPREAD = 1.5  # minimum ratio of forces that separates friction with and without load
_ADVICE = (
    "Turn the screw slowly in both directions under several forces, as 'bywire run load-sweep' does"
)


class Options(RigOptions):
    """Strokes to use, and the synthetic noise."""

    slowest: AngularSpeed
    """minimum speed of a stroke"""


def identify(
    data: xr.Dataset, par: WedgeParameters, options: Options, effort: Effort
) -> Identified:
    r"""Return efficiencies and bearing friction.

    .. math::
        J \dot\omega = K_T i + T_{COG} - D \omega + F \frac{L}{2\pi}
        - \mathrm{sgn}(\omega)\,(T_{BEARING}(F, \omega) + T_{SCREW}(F))

    Parameters
    ----------
    data
        ``i_1``, ``i_2`` [A], ``q_1``, ``q_2`` [rad], ``y_F`` [N], positive in compression. Torque
        constants, inertias, the lead, and the change of bearing friction with speed must be known.

    Raises
    ------
    ParameterError
        If the screw does not move enough, if the force does not change, or if a sign is wrong.

    References
    ----------
    Roberts et al. (2003), sections "Rollerscrew and bearings", "Roller-screw efficiency".
    """
    # Cogging is above the filter's cutoff frequency, and averages out over a window.
    rig_par = par.replace({"rig.load": "screw", "motor_1.T_cog": 0.0})
    unknowns = parameters_of(rig_par, _NAMES)
    equation = Equation(DrivenShaft(), "omega", "alpha", options.slowest)
    shafts = [_moved(data, rig_par, side, options) for side in ("1", "2")]
    for side, shaft in zip(("1", "2"), shafts, strict=True):
        if not shaft.windows:
            raise ParameterError(
                f"motor {side} (q_{side}) never stays above {options.slowest:g} rad/s "
                f"long enough. {_ADVICE}",
                name=f"q_{side}",
                valid=f"above {options.slowest:g} rad/s",
            )
    _require_loads(shafts)
    _require_losses(shafts, rig_par)
    parts = [window_residuals(equation, rig_par, unknowns, shaft) for shaft in shafts]
    best = steady_dynamics(parts, unknowns, _ADVICE)
    values = best.parameters()
    identified_par = rig_par.replace(values)
    full = np.array([identified_par.leaves()[name] for name in _NAMES])
    strokes_read = [
        stroke
        for part, shaft, side in zip(parts, shafts, (1, 2), strict=True)
        for stroke in _strokes(shaft, part.evaluate(full)[0], identified_par, side)
    ]
    return Identified(
        estimates={"screw and bearings": best},
        parameters=values,
        figures=_figures(identified_par, strokes_read),
        checks=(_fits(strokes_read, best),),
        curves=(_curve(strokes_read),),
        notes=(
            "bearing friction proportional to the force (C_1) looks like a screw loss. The fit "
            f"assumes {shown(par.bearing.C_1, 'N*m/N')}",
            "the change of bearing friction with speed comes from the parameter set",
        ),
    )


def _moved(data: xr.Dataset, par: WedgeParameters, side: str, options: Options) -> Motions:
    """Return one shaft's motions, in terms of motor 1.

    The current includes the differences between the motors, so one equation applies to both.
    """
    motor = par.motor_1 if side == "1" else par.motor_2
    force = -data["y_F"] if side == "1" else data["y_F"]
    seen = xr.Dataset({"theta": data[f"q_{side}"], "i": data[f"i_{side}"], "F": force})
    moved = differentiated(seen, "theta", ("omega", "alpha"), options.cutoff)
    torque = servo_motor.torque_constant(motor) * moved["i"]
    torque = torque + (par.motor_1.J_M - motor.J_M) * moved["alpha"]
    torque = torque + (par.motor_1.D_M - motor.D_M) * moved["omega"]
    moved["i"] = torque / servo_motor.torque_constant(par.motor_1)
    return motions(moved, "omega", options.slowest, options.margin, options.window)


def _require_loads(shafts: list[Motions]) -> None:
    """Require strokes under several forces. They separate the kinds of friction."""
    forces: dict[bool, list[float]] = {True: [], False: []}
    for shaft in shafts:
        F = shaft.means(shaft.data["F"].values)
        drives = F * shaft.means(shaft.data["omega"].values) < 0.0
        for kind, levels in forces.items():
            levels += np.abs(F[drives == kind]).tolist()
    for kind, name in ((True, "eta_f"), (False, "eta_b")):
        seen = forces[kind]
        if not seen or max(seen) < _SPREAD * min(seen):
            word = "driving" if kind else "driven back"
            never = f"the screw is never {word}"
            near = f"while the screw is {word}, the force stays near {max(seen):.3g} N"
            cause = near if seen else never
            raise ParameterError(
                f"the data do not separate screw.{name} from bearing.C_0, because {cause}. "
                f"{_ADVICE}",
                name=f"screw.{name}",
            )


def _require_losses(shafts: list[Motions], par: WedgeParameters) -> None:
    """Require that the screw loses power, both when it drives and when it is driven back."""
    k, K_T = roller_screw.slope(par.screw), servo_motor.torque_constant(par.motor_1)
    for side, shaft in zip(("1", "2"), shafts, strict=True):
        omega, F, i = (shaft.means(shaft.data[n].values) for n in ("omega", "F", "i"))
        loss = np.sign(omega) * (K_T * i + k * F)
        for kind, word in ((True, "driving"), (False, "driven back")):
            least = float(np.median(loss[(F * omega < 0.0) == kind]))
            if least < 0.0:
                raise wrong_sign(
                    f"i_{side}",
                    "y_F",
                    f"if q_{side} is from the right shaft, the screw would add {-least:.3g} N*m "
                    "while "
                    f"{word}",
                )


def _figures(par: WedgeParameters, strokes_read: list[Stroke]) -> dict[str, tuple[float, str]]:
    """Return the efficiency of the whole drive, including bearings, at the maximum load."""
    k = roller_screw.slope(par.screw)
    top = max((s for s in strokes_read if s.drives), key=lambda s: s.F, default=None)
    speed = float(np.median([abs(s.omega) for s in strokes_read]))
    bearing = axial_bearing.friction(axial_bearing.Input(0.0, speed), par.bearing)
    figures = {"bearing_torque_without_load": (float(bearing), "N*m")}
    if top is not None:
        figures["eta_with_bearings"] = (k * top.F / (top.torque - top.error), "1")
        figures["eta_with_bearings_at"] = (top.F, "N")
    return figures


def _curve(strokes_read: list[Stroke]) -> Curve:
    """Return motor torque versus force in both directions."""
    ways = [[s for s in strokes_read if s.drives is drives] for drives in (True, False)]
    F, table = at_own_places(
        [np.array([s.F for s in way]) for way in ways],
        [np.array([(s.torque, s.torque + s.error) for s in way]).T for way in ways],
    )
    return Curve(
        "torque-over-force",
        "Motor torque in steady motion versus the force between the screws, one point per stroke.",
        over(
            ("F", F, "N", "force"),
            {"measured": table[0], "modeled": table[1]},
            "N*m",
            "motor torque in the direction of motion",
            ("direction", ("driving", "driven back")),
            along="stroke",
        ),
        "F",
    )


def synthetic(par: WedgeParameters, options: Options, seed: int) -> xr.Dataset:
    """Return the simulated load sweep, with sensor noise."""
    case = LOAD_SWEEP.cases(par, LOAD_SWEEP.defaults, None)[0]
    random = np.random.default_rng(seed)
    begun = turned(case, random.uniform(0.0, 2.0 * np.pi))
    return sensed(begun, drive_sensors(options), random)


METHOD = Method(
    name="screw-efficiency",
    assembly="wedge-brake",
    summary="roller screw efficiency, driving and back-driven, without bearing friction",
    experiment="load-sweep",
    signals=SIGNALS,
    options=Options,
    defaults=Options(
        cutoff=120.0, slowest=5.0, margin=0.05, window=0.05, sigma_i=0.02, sigma_F=5.0
    ),
    identify=identify,
    synthetic=synthetic,
    simulated=SIMULATED,
    unknowns=_NAMES,
)
