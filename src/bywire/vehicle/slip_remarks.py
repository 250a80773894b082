"""Remarks on slip control with a fixed slip set point, on the road's surfaces."""

from __future__ import annotations

from typing import Any, cast

from bywire.core.typing import Array
from bywire.plant import adhesion, road
from bywire.vehicle.surfaces import surface_name

FAR = 2.0
"""minimum ratio of the slip at maximum adhesion to the slip set point that causes a remark"""


def far_from_peak(
    place: Array,
    acts: Array,
    slip_set: float,
    parameter: str,
    curve: adhesion.Parameters,
    ways: road.Parameters,
) -> list[str]:
    """Return remarks on surfaces whose maximum adhesion needs far more slip than the set point.

    Parameters
    ----------
    place
        Position of the wheel along the road [m], row by row.
    acts
        Whether slip control acts, above 0.5.
    slip_set
        Slip set point.
    parameter
        Name of its parameter, for example ``"ecu.slip.slip_set"``.
    curve, ways
        Parameters of tire and road.

    Returns
    -------
    list of str
        A remark for each surface on which slip control acted and whose peak is beyond `FAR` times
        the slip set point.
    """
    places = place[acts > 0.5]
    is_further = cast("Array", road.share(cast("Any", places), ways)) > 0.5
    texts: dict[str, None] = {}
    for x in (*places[~is_further][:1], *places[is_further][:1]):
        ground = road.surface(float(x), ways)
        peak = float(adhesion.peak_slip(ground, curve))
        if not peak > FAR * slip_set:
            continue
        most, held = (float(adhesion.adhesion(slip, ground, curve)) for slip in (peak, slip_set))
        name = surface_name(float(x), ways)
        surface = "the road" if name == "own" else name
        texts[
            f"slip control uses a slip set point of {slip_set:.3g} ({parameter}), but {surface} "
            f"has its maximum adhesion at {peak:.3g}. The wheel uses {100.0 * held / most:.0f} % "
            "of it. A larger set point, or rules (abs=rules), would brake harder there"
        ] = None
    return list(texts)
