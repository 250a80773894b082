"""Moment loop of the wedge brake, around position and current loops."""

from __future__ import annotations

from typing import cast

from bywire.analysis.loop import Loop, Point, Quantity
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.laws import moment_control
from bywire.brakes.wedge.loops.causes import CAUSES, DRIVE_LIMITS
from bywire.brakes.wedge.model import WedgeBrake, state_at
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.start import force_for, memory_at, travel_for
from bywire.core import ops
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.signals import zeros
from bywire.plant import roller_screw

MOMENT = Quantity("moment", "N*m", 200.0)
COUNTED = ", counted against the disc's rotation whatever its direction"
"""what is said of a moment that is not positive"""


def point(par: ParameterSet, value: float) -> Point:
    """Return the brake that holds a moment [N m].

    Screws and references stand where the wedge is in balance: the actuation force presses both
    contacts of the heart, and the currents carry it.

    Raises
    ------
    ParameterError
        When the moment is not positive, beyond the wedge's travel or the drives' current, or
        when the disc stands.

    Notes
    -----
    The wedge stands on the side to which the disc turns; the moment counts in that direction.
    """
    closed = cast(WedgeParameters, par.replace({"command.mode": "moment"}))
    _require_braking(value, closed)
    x = travel_for(force_for(value, closed), closed)
    _require_reachable(value, x, closed)
    turning = ops.where(closed.flywheel.Omega_0 < 0, -1.0, 1.0)
    x *= turning
    memory = memory_at(x, closed)._replace(mode=moment_control.MOMENT, M_set=value, M_meas=value)
    state = state_at(x, closed)._replace(y_M=turning * value)
    return Point(
        WedgeBrake(), closed, state, memory, zeros(WedgeBrake.Stimulus)._replace(M_set=value)
    )


def _require_braking(value: float, par: WedgeParameters) -> None:
    MOMENT.require_positive(value, COUNTED)
    if not ops.is_symbol(par.flywheel.Omega_0) and par.flywheel.Omega_0 == 0.0:
        raise ParameterError(
            "flywheel.Omega_0 = 0 rad/s: a standing disc has no braking moment to control; set it "
            "to the speed at which the loop works"
        )


def _require_reachable(value: float, x: float, par: WedgeParameters) -> None:
    if ops.is_symbol(x):
        return
    if not x < par.wedge.x_stop:
        raise ParameterError(
            f"moment = {value:g} N*m needs {x * 1e3:.3g} mm of wedge travel: it must be below "
            f"wedge.x_stop = {par.wedge.x_stop * 1e3:g} mm; ask for less"
        )
    force = abs(wedge.slope(par.wedge) - par.wedge.mu_B) * force_for(value, par)
    i = 0.5 * force * roller_screw.slope(par.screw) / par.motor_1.K_ref
    if i > par.drive.i_max:
        raise ParameterError(
            f"moment = {value:g} N*m needs {i:.3g} A in each motor even without friction: "
            f"drive.i_max = {par.drive.i_max:g} A"
        )


LOOP = Loop(
    name="moment",
    assembly="wedge-brake",
    summary="moment control, 1 kHz around 5 kHz",
    at=MOMENT,
    inputs=("M_set",),
    output="y_M",
    cut="rate",
    point=point,
    causes=CAUSES,
    band=(0.5, 100.0),
    amplitudes=(0.5, 20.0),
    # The law knows f_c over slope_hat alone: one of them is enough.
    tunables={"control.moment.f_c": (0.3, 60.0)},
    sustained=CAUSES["run-out, disc slowing"],
    proof="moment-pulses",
    saturations=DRIVE_LIMITS,
)
