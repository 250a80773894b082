"""What the wedge brake's experiments over several friction coefficients share."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, Field

from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.quantities import Unit

FRICTIONLESS = {
    "bearing.C_0": 0.0,
    "bearing.C_1": 0.0,
    "bearing.C_2": 0.0,
    "bearing.T_nu": 0.0,
    "screw.law": "load",
    "screw.eta_f": 1.0,
    "screw.eta_b": 1.0,
    "wedge_friction.mu_int": 0.0,
    "wedge_friction.mu_R": 0.0,
    "encoder.law": "ideal",
}
"""changes that leave the pads on the disc as the brake's only dry friction; without friction the
counts of an encoder would keep the shafts moving"""


def _distinct(values: tuple[float, ...]) -> tuple[float, ...]:
    tags = [tag(value) for value in values]
    for k, value in enumerate(values):
        if tags[k] in tags[:k]:
            raise ValueError(f"{value:g} stands there twice: leave one out")
    return values


Coefficient = Annotated[float, Field(gt=0, le=2, allow_inf_nan=False)]
Coefficients = Annotated[
    tuple[Coefficient, ...],
    Unit("1", 0.35),
    Field(min_length=1, max_length=100),
    AfterValidator(_distinct),
]
"""friction coefficients of the pads, in any order, each once"""


def tag(mu_B: float) -> str:
    """Return what labels and names of key figures call a friction coefficient.

    Examples
    --------
    >>> tag(0.35), tag(0.355)
    ('mu35', 'mu35p5')
    """
    return f"mu{100.0 * mu_B:.10g}".replace(".", "p")


def with_friction(par: WedgeParameters, mu_B: float, known: bool) -> dict[str, Any]:
    """Return the changes that give the pads a friction coefficient.

    Parameters
    ----------
    known
        Whether the moment controller believes in the slope that goes with it; else it keeps its
        own. Its slope keeps its ratio to the brake's, so that a mismatch stays one.
    """
    slope = par.control.moment.slope_hat
    if known and par.wedge.mu_B > 0:
        slope *= mu_B / par.wedge.mu_B
    return {"wedge.mu_B": mu_B, "control.moment.slope_hat": slope}
