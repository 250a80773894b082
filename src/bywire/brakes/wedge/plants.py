"""Linear models of the wedge brake: whole, mechanical, rigid, all from the same Jacobians."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, cast

import numpy as np

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import Friction, equilibrium, linearize
from bywire.analysis.loop import Plant, PlantPoint, Point, Quantity
from bywire.analysis.reduction import residualized
from bywire.brakes.wedge.control import Stimulus
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.loops import COUNTED, MOMENT, beyond
from bywire.brakes.wedge.model import WedgeBrake, force_for, memory_at, state_at, travel_for
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.errors import not_valid
from bywire.core.parameters import ParameterSet
from bywire.core.signals import zeros
from bywire.plant import roller_screw, servo_motor

Par = WedgeParameters

MECHANICAL_STATES = ("theta_1", "omega_1", "theta_2", "omega_2", "x", "v")
"""states of rotors and wedge"""
INPUTS = ("i_1_ref", "i_2_ref")
OUTPUTS = ("F_N", "x", "theta_1", "theta_2", "M_B")
SMOOTH: dict[str, Any] = {
    "motor_1.T_cog": 0.0,
    "motor_2.T_cog": 0.0,
    "flywheel.runout": 0.0,
    "flywheel.law": "driven",
}
"""overrides that remove torques and travels that alternate within small motions, because a linear
model neglects them"""
_FREE = 1e3
_RECORDING = ("phi", "y_P")  # states for display only


def point(par: Par, F_N: float, speed: float = 0.0) -> Point:
    """Return the brake in equilibrium at a normal force, preloaded between its screws.

    Parameters
    ----------
    par
        Parameters. The model neglects cogging and runout, and the disc keeps its speed.
    F_N
        Normal force [N], > 0. The wedge is on the side to which the disc turns.
    speed
        Speed of both motors [rad/s] in steady motion, positive toward clamping.

    Raises
    ------
    ParameterError
        If the force is not positive, if the travel exceeds the end stop, if the currents exceed
        the drives' limit, or if there is no equilibrium.
    """
    smooth = par.replace({**SMOOTH, "command.mode": "current"})
    x = travel_for(F_N, smooth)
    if not F_N > 0.0:
        raise not_valid("normal force", f"{F_N:g} N", "> 0 N")
    if not x < smooth.wedge.x_stop:
        limit = f"wedge.x_stop = {smooth.wedge.x_stop * 1e3:g} mm"
        raise beyond("normal force", f"{F_N:g} N", f"{x * 1e3:.3g} mm of wedge travel", limit)
    turning = -1.0 if smooth.flywheel.Omega_0 < 0.0 else 1.0
    # Beyond the limit the drives do not respond, so the search for the currents uses no limit.
    free = smooth.replace({"drive.i_max": _FREE * smooth.drive.i_max})
    state, memory = equilibrium(
        WedgeBrake(),
        free,
        state_at(turning * x, smooth),
        memory_at(turning * x, smooth),
        given=("x",),
        inputs=INPUTS,
        running=("Omega", "phi"),
        tied=("theta_1", "theta_2"),
    )
    most = max(abs(getattr(memory, name)) for name in INPUTS)
    if most > smooth.drive.i_max:
        needed = f"{most:.3g} A in a motor even without friction"
        limit = f"drive.i_max = {smooth.drive.i_max:g} A"
        raise beyond("normal force", f"{F_N:g} N", needed, limit)
    moving = turning * speed
    state = state._replace(
        omega_1=moving, omega_2=moving, v=moving * roller_screw.slope(smooth.screw)
    )
    return Point(WedgeBrake(), smooth, state, memory, zeros(Stimulus))


def force_for_current(i: float, par: Par) -> float:
    """Return the normal force [N] that a current [A] in each motor holds without friction.

    Raises
    ------
    ParameterError
        At the neutral point, where no current is needed, and for currents with the wrong sign.
    """
    tan, mu_B = wedge.slope(par.wedge), par.wedge.mu_B
    need = tan - mu_B if par.flywheel.Omega_0 else tan
    per = 2.0 * par.motor_1.K_ref / roller_screw.slope(par.screw)
    if need == 0.0 or not i / need > 0.0:
        valid = "0 A at every force" if need == 0.0 else f"{'>' if need > 0 else '<'} 0 A"
        advice = f"because tan(alpha) - mu_B = {need:.3g}. Specify the normal force or the moment"
        raise not_valid("current", f"{i:g} A", valid, advice)
    return per * i / need


def full(par: Par, F_N: float, friction: Friction = "removed", speed: float = 0.0) -> LinearModel:
    """Return the whole plant: drives, windings, rotors, wedge, disc, moment sensor.

    Parameters
    ----------
    par, F_N, speed
        As in `point`.
    friction
        As in `linearize`. The pads always slide on the turning disc.

    Returns
    -------
    LinearModel
        The inputs are both current demands. The outputs are normal force, travels, braking moment,
        and measured moment.
    """
    at = point(par, F_N, speed)
    kinds: dict[str, Friction] = dict.fromkeys(WedgeBrake.frictions, friction)
    if cast(Any, at.state).Omega != 0.0 and friction == "stuck":
        kinds["Omega"] = "sliding"
    whole = linearize(
        at.model,
        at.par,
        at.state,
        at.memory,
        inputs=INPUTS,
        outputs=(*OUTPUTS, "y_M"),
        friction=kinds,
    )
    return whole.reduced(whole.live)


def mechanical(whole: LinearModel, *, corrected: bool = False) -> LinearModel:
    r"""Return rotors and wedge, with the currents equal to their demands.

    Parameters
    ----------
    whole
        From `full`.
    corrected
        Whether to include the drives' first lag behind the rotors. The integral term has to follow
        the back-EMF, which acts like an inertia :math:`K_T^2/(V_{dc} k_i)` on each rotor.

    Returns
    -------
    LinearModel
        Model with states `MECHANICAL_STATES` and outputs `OUTPUTS`. The disc keeps its speed.
    """
    kept = tuple(name for name in whole.states if name not in (*_RECORDING, "Omega", "y_M"))
    moving = whole.channels(outputs=OUTPUTS).reduced(kept, held=True)
    slow = residualized(moving, MECHANICAL_STATES, corrected=corrected)
    return replace(slow, name="wedge, mechanical")


def rigid(mechanical: LinearModel, par: Par) -> LinearModel:
    r"""Return rotors and wedge as one body, with rigid screws and interfaces.

    .. math:: A_r = (T^T M T)^{-1} T^T M A T, \quad
        (\theta_1, \omega_1, \theta_2, \omega_2, x, v) = T (x, v)

    The forces between the bodies do no work on this motion and drop out.

    ``mechanical``: result of `mechanical`; ``par``: the same parameters.

    Notes
    -----
    For equal motors without damping its poles are
    :math:`\sigma^2 = K_{cal} \tan\alpha (\mu_B - \tan\alpha)/M` with
    :math:`M = M_W + J_{M,1} (2\pi/L)^2 + J_{M,2} (2\pi/L)^2`.
    """
    k = roller_screw.slope(par.screw)
    T = np.zeros((6, 2))
    T[[0, 2], 0] = T[[1, 3], 1] = 1.0 / k
    T[4, 0] = T[5, 1] = 1.0
    masses = [
        1.0,
        servo_motor.mass(par.motor_1)[-1],
        1.0,
        servo_motor.mass(par.motor_2)[-1],
        1.0,
        par.wedge.M_W,
    ]
    # Project travel and velocity separately, because a length has no mass.
    split = np.zeros((2, 6))
    for row, columns in ((0, [0, 2, 4]), (1, [1, 3, 5])):
        split[row, columns] = T[columns, row] * np.array(masses)[columns]
    left = np.linalg.solve(split @ T, split)  # inverse of T weighted by the masses
    return replace(
        mechanical,
        name="wedge, rigid",
        A=left @ mechanical.A @ T,
        B=left @ mechanical.B,
        C=mechanical.C @ T,
        states=("x", "v"),
        state_units=("m", "m/s"),
        rate=left @ mechanical.rate,
    )


def rigid_rate(par: Par) -> complex:
    """Return the rigid model's growth rate [1/s] in closed form, real above neutral."""
    tan, k = wedge.slope(par.wedge), roller_screw.slope(par.screw)
    M = par.wedge.M_W + (par.motor_1.J_M + par.motor_2.J_M) / k**2
    square = par.caliper.K_cal * tan * (par.wedge.mu_B - tan) / M
    return complex(math.sqrt(square)) if square >= 0.0 else 1j * math.sqrt(-square)


# --- Plants

_FORCE = Quantity("normal force", "N", 2e3)
_CURRENT = Quantity("current", "A", 0.05)
_AT = (MOMENT, _FORCE, _CURRENT)
"""braking moment, normal force, mean current of both motors without friction"""


def whole(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return the whole plant at an operating point (see `full`).

    Raises
    ------
    ParameterError
        If the point does not exist.
    """
    brake = cast(WedgeParameters, par)
    if at.quantity is _CURRENT:
        if not abs(at.value) < brake.drive.i_max:
            valid = f"smaller in magnitude than drive.i_max = {brake.drive.i_max:g} A"
            raise not_valid("current", f"{at.value:g} A", valid)
        F_N = force_for_current(at.value, brake)
    elif at.quantity is MOMENT:
        at.quantity.require_positive(at.value, COUNTED)
        F_N = force_for(at.value, brake)
    else:
        F_N = at.value
    with at.named(unless=_FORCE):
        return full(brake, F_N, at.friction, at.speed)


def mechanical_model(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return the model with six states and the drives' apparent inertia on the rotors."""
    return mechanical(whole(par, at), corrected=True)


def with_its_outputs(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return the whole plant with the same outputs."""
    return whole(par, at).channels(outputs=OUTPUTS)


def rigid_model(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return the model with two states, wedge travel and velocity. Both motors act as one."""
    body = rigid(mechanical(whole(par, at)), cast(WedgeParameters, par))
    return body.together(INPUTS)


def driven_as_one(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return the whole plant with the same input and outputs."""
    return whole(par, at).channels(outputs=OUTPUTS).together(INPUTS)


WHOLE = Plant(
    name="wedge-plant",
    assembly="wedge-brake",
    summary="drives, windings, rotors, brake heart, wedge, caliper, disc, moment sensor",
    at=_AT,
    model=whole,
    band=150.0,
)
MECHANICAL = Plant(
    name="wedge-mechanical",
    assembly="wedge-brake",
    summary="only rotors and wedge, with quasi-static drives and their apparent inertia",
    at=_AT,
    model=mechanical_model,
    band=150.0,
    whole=with_its_outputs,
)
RIGID = Plant(
    name="wedge-rigid",
    assembly="wedge-brake",
    summary="rotors and wedge as one body, with ideal drives, rigid screws and interfaces",
    at=_AT,
    model=rigid_model,
    band=150.0,
    whole=driven_as_one,
)
