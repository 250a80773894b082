"""Surfaces by their names, as parameters of a road."""

from __future__ import annotations

from bywire.plant.road import SURFACES, SurfaceName


def laid(
    prefix: str, first: SurfaceName, further: SurfaceName | None = None
) -> dict[str, float]:
    """Return the parameters of the road below a prefix, of some surface and of a further one.

    The further one is the first, unless given; own ones stay as they are.
    """
    names = {"first": first, "further": first if further is None else further}
    return {
        f"{prefix}.{stretch}.{key}": value
        for stretch, name in names.items()
        if name != "own"
        for key, value in SURFACES[name]._asdict().items()
    }
