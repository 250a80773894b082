"""What the operating points of the wedge's plants are given by."""

from __future__ import annotations

from typing import cast

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.plant import PlantPoint
from bywire.analysis.loop import Quantity
from bywire.brakes.wedge.linear import force_for_current, full
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.start import force_for
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet

MOMENT = Quantity("moment", "N*m", 200.0)
FORCE = Quantity("normal force", "N", 2e3)
CURRENT = Quantity("current", "A", 0.05)
AT = (MOMENT, FORCE, CURRENT)
"""braking moment, normal force, mean current of both motors without friction"""


def whole(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return the whole plant at an operating point, see `bywire.brakes.wedge.linear.full`.

    Raises
    ------
    ParameterError
        When the point does not exist.
    """
    own = cast(WedgeParameters, par)
    if at.quantity is CURRENT:
        if not abs(at.value) < own.drive.i_max:
            raise ParameterError(
                f"current = {at.value:g} A is not admissible: its size must be < drive.i_max = "
                f"{own.drive.i_max:g} A"
            )
        F_N = force_for_current(at.value, own)
    elif at.quantity is MOMENT:
        if not at.value > 0.0:
            raise ParameterError(
                f"moment = {at.value:g} N*m is no operating point: it must be > 0 N*m, counted "
                "against the disc's rotation whatever its direction"
            )
        F_N = force_for(at.value, own)
    else:
        F_N = at.value
    if at.quantity is FORCE:
        return full(own, F_N, at.friction, at.speed)
    try:
        return full(own, F_N, at.friction, at.speed)
    except ParameterError as error:
        given = f"{at.quantity.name} = {at.value:g} {at.quantity.unit}"
        raise ParameterError(f"{given} is no operating point: {error}") from None
