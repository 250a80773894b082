"""Figure: where the energy came from and where it went."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import cycle
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bywire.core.errors import ParameterError
from bywire.report import style
from bywire.report.channel import channel
from bywire.report.wording import amount

if TYPE_CHECKING:
    import xarray as xr

BRAKE_SOURCE = {"E_source": "source"}
BRAKE_SINKS = {
    "E_copper": "copper",
    "E_gear": "gear and screw",
    "E_seal": "seal friction",
    "E_damping": "fluid damping",
    "E_pipeline": "pipeline",
    "E_supply": "supply",
    "E_stop": "end stops",
    "E_port": "reservoir port",
    "E_stored": "stored",
}
"""energies of the motorcycle brake: integrals over the run, and what is stored"""

WEDGE_SOURCE = {
    "W_electric": "electrical",
    "W_disc": "disc on wedge",
    "W_runout": "run-out",
}
WEDGE_SINKS = {
    "E_copper": "copper",
    "E_shaft": "bearings and screws",
    "E_wedge": "friction on the wedge",
    "E_damping": "motor damping",
    "E_heart": "brake heart",
    "E_caliper": "caliper damping",
    "E_line": "damping of screws and sensor",
    "E_stop": "end stops",
    "E_stored": "stored",
}
"""energies of the wedge brake and its rigs; of the brake the disc gives most, so it stands apart"""

COLORS = {
    "E_copper": style.VERMILLION,
    "E_gear": style.GREEN,
    "E_seal": style.ORANGE,
    "E_damping": style.PURPLE,
    "E_pipeline": style.SKY,
    "E_supply": style.YELLOW,
    "E_stop": style.GRAY,
    "E_port": "#8B5A2B",
    "E_shaft": style.GREEN,
    "E_wedge": style.ORANGE,
    "E_heart": style.SKY,
    "E_caliper": style.YELLOW,
    "E_line": style.SKY,
    "E_stored": style.BLUE,
}
"""the same energy has the same color in every figure; others take what a figure leaves over"""
SOURCE_COLORS = ("#4A4A4A", "#9A9A9A", "#C4C4C4")
SMALL = 1e-3
"""share of the energy turned over below which entries are drawn together as the rest"""
NEGLIGIBLE = 1e-9
"""share below which even the rest is not drawn"""
REST_COLOR = "#E4E4E4"


@dataclass(frozen=True)
class Entry:
    """One piece of a bar: what it is, its energy [J, not negative] and its color."""

    label: str
    energy: float
    color: str


def energy_balance(
    recording: xr.Dataset,
    *,
    source: str | Mapping[str, str] | None = None,
    sinks: Mapping[str, str] | None = None,
) -> Figure:
    """Draw two stacked bars of equal length: where energy came from and where it went.

    Every entry is signed and stands on the side that its sign says: a source that takes energy
    back is among the receivers, a gear loss below zero and an emptied store are among the givers.
    What the books do not explain is drawn as a hatched piece.

    Parameters
    ----------
    recording
        Recording with energies [J]; of each the difference between end and start counts.
    source
        Variable with the energy that came from the source; or label by variable of several
        sources; by default what the recording's brake has.
    sinks
        Label by variable of every place where energy went; by default those of the recording's
        brake. Variables a recording lacks are left out.

    Raises
    ------
    ParameterError
        When no energy was turned over.
    """
    if source is None:
        source = WEDGE_SOURCE if "W_disc" in recording.data_vars else BRAKE_SOURCE
    named = {source: "source"} if isinstance(source, str) else source
    if sinks is None:
        sinks = WEDGE_SINKS if "E_shaft" in recording.data_vars else BRAKE_SINKS
    given, taken = _sides(recording, named, sinks)
    total = max(sum(e.energy for e in given), sum(e.energy for e in taken))
    if not total > 0:
        raise ParameterError("energy_balance: the recording turned over no energy")
    figure, (axes,) = style.new_figure(2.9)
    _stack(axes, 1.0, _gathered(given, total), total)
    _stack(axes, 0.0, _gathered(taken, total), total)
    missing = sum(e.energy for e in given) - sum(e.energy for e in taken)
    _draw_missing(axes, missing, total)
    axes.set_yticks([1.0, 0.0], ["came from", "went to"])
    axes.set_ylim(-0.5, 1.5)
    axes.set_xlim(0.0, 1.02 * total)
    axes.tick_params(axis="y", length=0)
    axes.grid(False, axis="y")
    axes.spines["left"].set_visible(False)
    axes.set_xlabel(style.axis_label("energy", "J"))
    style.legend_above(axes)
    return figure


def _sides(
    recording: xr.Dataset, sources: Mapping[str, str], sinks: Mapping[str, str]
) -> tuple[list[Entry], list[Entry]]:
    """Return the givers and the receivers of energy."""
    given: list[Entry] = []
    taken: list[Entry] = []
    for (variable, label), color in zip(sources.items(), cycle(SOURCE_COLORS)):
        change = _change(recording, variable)
        back = "back to the source" if len(sources) == 1 else f"{label} (takes)"
        side = given if change > 0 else taken
        side.append(Entry(label if change > 0 else back, abs(change), color))
    colors = _colors(sinks)
    for variable, label in sinks.items():
        if variable not in recording.data_vars:
            continue
        change = _change(recording, variable)
        side = taken if change > 0 else given
        suffix = "" if change > 0 else " (gives)"
        side.append(Entry(label + suffix, abs(change), colors[variable]))
    return given, taken


def _gathered(entries: list[Entry], total: float) -> list[Entry]:
    """Return the entries worth a place in the legend, small ones gathered into one."""
    large = [entry for entry in entries if entry.energy >= SMALL * total]
    small = [e for e in entries if NEGLIGIBLE * total < e.energy < SMALL * total]
    if len(small) < 2:
        return large + small
    return [*large, Entry("rest", sum(entry.energy for entry in small), REST_COLOR)]


def _colors(sinks: Mapping[str, str]) -> dict[str, str]:
    """Return a color for every variable; unknown ones take those that are left over."""
    left = cycle([color for name, color in COLORS.items() if name not in sinks] or [style.BLACK])
    return {name: COLORS[name] if name in COLORS else next(left) for name in sinks}


def _change(recording: xr.Dataset, variable: str) -> float:
    values = channel(recording, variable).values
    return float(values[-1] - values[0])


def _stack(axes: Axes, row: float, entries: list[Entry], total: float) -> None:
    left = 0.0
    for entry in entries:
        share = f"{100 * entry.energy / total:.3g} %"
        label = f"{entry.label}: {amount(entry.energy, 'J', 3)} ({share})"
        axes.barh(
            row, entry.energy, left=left, height=0.62, color=entry.color, linewidth=0,
            label=style.plain(label),
        )
        left += entry.energy


def _draw_missing(axes: Axes, missing: float, total: float) -> None:
    """Draw what the shorter bar lacks."""
    if abs(missing) <= 1e-6 * total:
        return
    axes.barh(
        0.0 if missing > 0 else 1.0, abs(missing), left=total - abs(missing), height=0.62,
        facecolor="white", edgecolor=style.BLACK, hatch="///", linewidth=0.8,
        label=f"not accounted for: {amount(abs(missing), 'J', 2)}",
    )
