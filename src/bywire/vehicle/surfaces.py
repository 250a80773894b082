"""Road surfaces by name, as parameters of a road."""

from __future__ import annotations

from bywire.plant import adhesion, road
from bywire.plant.road import SURFACES, SurfaceName


def laid(prefix: str, first: SurfaceName, further: SurfaceName | None = None) -> dict[str, float]:
    """Return a road's parameters, under a prefix, for a first and a second surface.

    By default, the second surface is the first one. ``"own"`` changes no parameter.
    """
    names = {"first": first, "further": first if further is None else further}
    return {
        f"{prefix}.{stretch}.{key}": value
        for stretch, name in names.items()
        if name != "own"
        for key, value in SURFACES[name]._asdict().items()
    }


def surface_name(place: float, ways: road.Parameters) -> str:
    """Return the name of the surface at a position [m], ignoring the factor on its adhesion."""
    numbers = adhesion.surface_of(ways.further if road.share(place, ways) > 0.5 else ways.first)
    return next((name for name, known in SURFACES.items() if known == numbers), "own")
