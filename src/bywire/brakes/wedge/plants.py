"""The wedge brake's plant and its simplified models."""

from __future__ import annotations

from typing import cast

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.loop import Plant, PlantPoint, Quantity
from bywire.brakes.wedge.linear import (
    INPUTS,
    OUTPUTS,
    force_for_current,
    full,
    mechanical,
    rigid,
)
from bywire.brakes.wedge.loops.moment import COUNTED, MOMENT
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.start import force_for
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet

_FORCE = Quantity("normal force", "N", 2e3)
_CURRENT = Quantity("current", "A", 0.05)
_AT = (MOMENT, _FORCE, _CURRENT)
"""braking moment, normal force, mean current of both motors without friction"""


def whole(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return the whole plant at an operating point, see `bywire.brakes.wedge.linear.full`.

    Raises
    ------
    ParameterError
        When the point does not exist.
    """
    brake = cast(WedgeParameters, par)
    if at.quantity is _CURRENT:
        if not abs(at.value) < brake.drive.i_max:
            raise ParameterError(
                f"current = {at.value:g} A is not valid: its size must be < drive.i_max = "
                f"{brake.drive.i_max:g} A"
            )
        F_N = force_for_current(at.value, brake)
    elif at.quantity is MOMENT:
        at.quantity.require_positive(at.value, COUNTED)
        F_N = force_for(at.value, brake)
    else:
        F_N = at.value
    with at.named(unless=_FORCE):
        return full(brake, F_N, at.friction, at.speed)


def mechanical_model(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return six states, with what the drives add to the rotors' inertia."""
    return mechanical(whole(par, at), corrected=True)


def with_its_outputs(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return the whole plant with the same outputs."""
    return whole(par, at).channels(outputs=OUTPUTS)


def rigid_model(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return two states: travel and velocity of the wedge; both motors are driven as one."""
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
    summary="rotors and wedge alone: drives quasi-static, with the inertia they seem to add",
    at=_AT,
    model=mechanical_model,
    band=150.0,
    whole=with_its_outputs,
)
RIGID = Plant(
    name="wedge-rigid",
    assembly="wedge-brake",
    summary="rotors and wedge as one body: drives ideal, screws and interfaces stiff",
    at=_AT,
    model=rigid_model,
    band=150.0,
    whole=driven_as_one,
)
