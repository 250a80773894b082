"""Figure: energy balance of sources and sinks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import TYPE_CHECKING

from bywire.bench.energy_ledger import Ledger, actuator_ledger, ledger
from bywire.core.errors import ParameterError
from bywire.core.quantities import readable_unit
from bywire.core.units import convert
from bywire.report import style
from bywire.report.channel import channel
from bywire.report.wording import amount, part_text

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS = {
    "E_copper": style.VERMILLION,
    "E_copper_moving": style.VERMILLION,
    "E_copper_holding": "#F2A679",
    "E_standby": "#8B5A2B",
    "E_gear": style.GREEN,
    "E_seal": style.ORANGE,
    "E_damping": style.PURPLE,
    "E_pipeline": style.SKY,
    "E_supply": style.YELLOW,
    "E_stop": style.GRAY,
    "E_port": "#8B5A2B",
    "E_shaft": style.GREEN,
    "E_caliper": style.YELLOW,
    "E_stored": style.BLUE,
}
"""fixed colors of energies in every figure; other energies use the remaining colors"""
SOURCE_COLORS = ("#4A4A4A", "#9A9A9A", "#C4C4C4")
SMALL = 1e-3
"""fraction of the total energy below which entries are merged into the rest"""
NEGLIGIBLE = 1e-9
"""fraction below which the rest is not drawn"""
REST_COLOR = "#E4E4E4"


@dataclass(frozen=True)
class Entry:
    """A segment of a bar: label, energy [J, not negative] and color."""

    label: str
    energy: float
    color: str


def energy_balance(
    recording: xr.Dataset,
    *,
    source: str | Mapping[str, str] | None = None,
    sinks: Mapping[str, str] | None = None,
) -> Figure:
    """Draw two stacked bars of equal length: sources and sinks of the energy.

    Every entry is signed, and its sign decides the side. A source that receives energy is among the
    sinks. A negative gear loss and an emptied store are among the sources. A hatched segment shows
    the residual of the energy balance.

    Parameters
    ----------
    recording
        Recording with energies [J]; the difference between end and start counts.
    source
        Variable with the energy from the source, or labels of several sources by variable. Default:
        the sources of the recording's brake.
    sinks
        Labels of the sinks by variable. Default: the sinks of the recording's brake. Variables that
        are missing in the recording are left out.

    Raises
    ------
    UnknownNameError
        When the recording has no such source.
    ParameterError
        When no energy flows.
    """
    books = actuator_ledger(recording)
    if source is not None or sinks is not None:
        named = {source: "source"} if isinstance(source, str) else source
        for name in named or ():
            channel(recording, name)
        books = Ledger(
            books.sources if named is None else ledger(recording, named, {}).sources,
            books.sinks if sinks is None else ledger(recording, {}, sinks).sinks,
        )
    return ledger_bars(books)


def ledger_bars(books: Ledger) -> Figure:
    """Draw a ledger in the form of `energy_balance`.

    Raises
    ------
    ParameterError
        When no energy flows.
    """
    given, taken = _sides(books)
    total = max(sum(e.energy for e in given), sum(e.energy for e in taken))
    if not total > 0:
        raise ParameterError("energy_balance: no energy flows in the recording")
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
    unit = readable_unit(total, "J")
    axes.xaxis.set_major_formatter(lambda energy, _: f"{convert(energy, 'J', unit):g}")
    axes.set_xlabel(style.unit_label("energy", unit))
    style.legend_above(axes)
    return figure


def _sides(books: Ledger) -> tuple[list[Entry], list[Entry]]:
    """Return the sources and the sinks of energy."""
    given: list[Entry] = []
    taken: list[Entry] = []
    for entry, color in zip(books.sources, cycle(SOURCE_COLORS)):
        back = "back to the source" if len(books.sources) == 1 else f"{entry.label} (takes)"
        gives = entry.energy > 0
        side = given if gives else taken
        side.append(Entry(entry.label if gives else back, abs(entry.energy), color))
    colors = _colors([entry.name for entry in books.sinks])
    for entry in books.sinks:
        takes = entry.energy > 0
        suffix = "" if takes else " (gives)"
        side = taken if takes else given
        side.append(Entry(entry.label + suffix, abs(entry.energy), colors[entry.name]))
    return given, taken


def _gathered(entries: list[Entry], total: float) -> list[Entry]:
    """Return the entries of the legend, with small ones merged into one."""
    large = [entry for entry in entries if entry.energy >= SMALL * total]
    small = [e for e in entries if NEGLIGIBLE * total < e.energy < SMALL * total]
    if len(small) < 2:
        return large + small
    return [*large, Entry("rest", sum(entry.energy for entry in small), REST_COLOR)]


def _colors(sinks: Sequence[str]) -> dict[str, str]:
    """Return a color for every variable; colors differ as long as the palette suffices."""
    known = {COLORS[name] for name in sinks if name in COLORS}
    left = cycle([c for c in dict.fromkeys(COLORS.values()) if c not in known] or [style.BLACK])
    colors: dict[str, str] = {}
    for name in sinks:
        usual = COLORS.get(name)
        colors[name] = next(left) if usual is None or usual in colors.values() else usual
    return colors


def _stack(axes: Axes, row: float, entries: list[Entry], total: float) -> None:
    left = 0.0
    for entry in entries:
        share = part_text(100 * entry.energy / total, "%", 100.0)
        label = f"{entry.label}: {part_text(entry.energy, 'J', total)} ({share})"
        axes.barh(
            row,
            entry.energy,
            left=left,
            height=0.62,
            color=entry.color,
            linewidth=0,
            label=style.plain(label),
        )
        left += entry.energy


def _draw_missing(axes: Axes, missing: float, total: float) -> None:
    """Draw the difference to the longer bar."""
    if abs(missing) <= 1e-6 * total:
        return
    axes.barh(
        0.0 if missing > 0 else 1.0,
        abs(missing),
        left=total - abs(missing),
        height=0.62,
        facecolor="white",
        edgecolor=style.BLACK,
        hatch="///",
        linewidth=0.8,
        label=f"not accounted for: {amount(abs(missing), 'J', 2)}",
    )
