"""What a user should know of slip control that holds one slip, on the road that it met."""

from __future__ import annotations

from typing import Any, cast

from bywire.core.typing import Array
from bywire.plant import adhesion, road
from bywire.vehicle.surfaces import surface_name

FAR = 2.0
"""slip of the largest adhesion over the slip held from which a stop is remarkable"""


def far_from_peak(
    place: Array,
    acts: Array,
    slip_set: float,
    parameter: str,
    curve: adhesion.Parameters,
    ways: road.Parameters,
) -> list[str]:
    """Return on which surfaces slip control holds far less slip than they hold most at.

    Parameters
    ----------
    place
        Of the wheel along the road [m], row by row.
    acts
        Whether slip control acts, above 0.5.
    slip_set
        Slip that it holds.
    parameter
        What that is called, for instance ``"ecu.slip.slip_set"``.
    curve, ways
        Of tyre and road.

    Returns
    -------
    list of str
        A text for each surface on which it acted, of those whose peak is beyond `FAR` times the
        slip that is held.
    """
    met = place[acts > 0.5]
    is_further = cast("Array", road.share(cast("Any", met), ways)) > 0.5
    texts: dict[str, None] = {}
    for x in (*met[~is_further][:1], *met[is_further][:1]):
        ground = road.surface(float(x), ways)
        peak = float(adhesion.peak_slip(ground, curve))
        if not peak > FAR * slip_set:
            continue
        most, held = (float(adhesion.adhesion(slip, ground, curve)) for slip in (peak, slip_set))
        name = surface_name(float(x), ways)
        surface = "the road" if name == "own" else name
        texts[
            f"slip control holds a slip of {slip_set:.3g} ({parameter}), but {surface} holds most "
            f"at {peak:.3g}: {100.0 * held / most:.0f} % of that is used; a larger set slip, or "
            "rules (abs=rules), brake harder there"
        ] = None
    return list(texts)
