"""How the curves of a loop look over a range: by value, the worst one emphasized and named."""

from __future__ import annotations

from collections.abc import Callable

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bywire.analysis.loop_curves import Family, LoopCurve
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.value_scale import value_color, value_scale
from bywire.report.wording import amount

Points = Callable[[LoopCurve], tuple[Array, Array]]


def draw_family(
    axes: Axes, family: Family, points: Points, *, stable_only: bool = False, label: str = ""
) -> None:
    """Draw one line per curve; unstable loops dashed, the worst one on top with its value.

    Parameters
    ----------
    axes
        Where to draw.
    family
        Curves.
    points
        Abscissa and ordinate of a curve.
    stable_only
        Leave out unstable loops, for quantities that mean nothing there.
    label
        What the legend calls a single curve.
    """
    for k, curve in enumerate(family.curves):
        stable = curve.margins.stable
        if stable_only and not stable:
            continue
        top = k == family.worst
        color = (
            style.BLUE
            if not family.name
            else style.VERMILLION
            if top
            else value_color(family.values, k)
        )
        axes.plot(
            *points(curve),
            color=color,
            linestyle="-" if stable else "--",
            linewidth=1.8 if top else 0.9,
            zorder=3.5 if top else 3.0,
            label=_name(family, label) if top else "_",
        )


def value_bar(figure: Figure, panels: list[Axes], family: Family) -> None:
    """Put the scale of the varied parameter beside the panels; nothing for a single curve."""
    if family.name and len(family.curves) >= 2:
        value_scale(figure, panels, family.name, family.unit, family.values)


def _name(family: Family, label: str) -> str:
    curve = family.curves[family.worst]
    state = "" if curve.margins.stable else "unstable"
    if not family.name:
        return style.plain(f"{label}, {state}" if state else label)
    value = amount(family.values[family.worst], family.unit, 3)
    return style.plain(f"worst: {family.name} = {value}" + (f", {state}" if state else ""))
