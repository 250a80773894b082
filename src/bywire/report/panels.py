"""Styles of lines and panels of recordings, also without a brake's declaration; no plotting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from bywire.core.arguments import checked
from bywire.core.registry import Kind, instances
from bywire.report.wording import clean

if TYPE_CHECKING:
    import xarray as xr


class Role(Enum):
    """Meaning of a line, which determines its style in every figure."""

    MAIN = "main"
    SECOND = "second"
    SET_POINT = "set point"
    MEASURED = "measured"
    SIMULATED = "simulated"
    LIMIT = "limit"


# --- Panels

_NO_PANEL = ("E_", "W_", "t_", "noise_")  # prefixes of names: cumulative signals, and noise
_LINES = 2  # line styles of different set points in a panel
_LONGEST = 20  # characters that fit along a low panel
_SIMILAR = 50.0  # ratio of two signals' sizes beyond which one of them would look like zero
_QUANTITIES = {
    "N": "force",
    "N*m": "torque",
    "Pa": "pressure",
    "m": "travel",
    "m/s": "speed",
    "rad": "angle",
    "rad/s": "speed",
    "A": "current",
    "V": "voltage",
    "W": "power",
    "K": "temperature",
    "m**3/s": "flow",
}
"""ordinates by SI unit, for signals whose labels have no word in common"""


@checked
@dataclass(frozen=True)
class Trace:
    """A variable and the meaning of its line."""

    variable: str
    role: Role = Role.MAIN


@checked
@dataclass(frozen=True)
class Panel:
    """One panel of stacked time traces.

    Parameters
    ----------
    quantity
        Label of the ordinate, without its unit and short enough for low panels.
    traces
        Lines of one unit, with the judged line first. Variables that are missing in a recording are
        left out.
    saturation
        Variable that is 1 while the quantity is saturated.
    saturated
        Legend of the saturation.
    limit
        Parameter of the recording that bounds the first trace on both sides. Its lines are drawn if
        the trace comes near them.
    levels
        Names of a mode's values 0, 1, 2, ...; the mode is drawn in steps.
    height
        Relative height.
    """

    quantity: str
    traces: tuple[Trace, ...]
    saturation: str | None = None
    saturated: str = "saturated"
    limit: str | None = None
    levels: tuple[str, ...] = ()
    height: float = 1.0


@checked
@dataclass(frozen=True)
class Panels:
    """The panels of a brake, or of a rig.

    ``name``: name in messages; ``assemblies``: names of the models whose recordings they show;
    ``panels``: from top to bottom.
    """

    name: str
    assemblies: tuple[str, ...]
    panels: tuple[Panel, ...]


PANELS = Kind("panels", ("panels",), instances(Panels))
"""the panels of every brake, in the module ``panels`` of its package"""


def declared_panels(recording: xr.Dataset) -> list[Panels]:
    """Return the panels declared for the model of a recording; all if it names no model."""
    known, model = list(PANELS.all().values()), recording.attrs.get("model")
    return [each for each in known if model is None or model in each.assemblies]


def panels_by_unit(recording: xr.Dataset) -> tuple[Panel, ...]:
    """Return panels for a recording of any model: signals of one unit and size, two per panel.

    A set point (attribute ``set_point_of``) is drawn with its signal. Cumulative signals (energies,
    times) and modes, which are 0 or 1, have no panel.
    """
    names = [str(name) for name in recording.data_vars if _is_drawn(recording, str(name))]
    targets = {name: str(recording[name].attrs.get("set_point_of", "")) for name in names}
    lines = [name for name in names if targets[name] not in names]
    groups: list[list[str]] = []
    for name in lines:
        known = (group for group in groups if _fits(recording, group, name))
        group = next(known, None)
        if group is None:
            groups.append([name])
        else:
            group.append(name)
    panels = []
    for shown in groups:
        roles = zip(shown, (Role.MAIN, Role.SECOND), strict=False)
        traces = [Trace(name, role) for name, role in roles]
        traces += [Trace(n, Role.SET_POINT) for n in names if targets[n] in shown]
        panels.append(Panel(_quantity(recording, shown), tuple(traces)))
    return tuple(panels)


def _fits(recording: xr.Dataset, group: Sequence[str], name: str) -> bool:
    """Return whether a signal has the unit and the size of a group that has room."""
    units = {recording[each].attrs.get("units", "1") for each in (*group, name)}
    sizes = [_size(recording, each) for each in (*group, name)]
    return len(group) < _LINES and len(units) == 1 and max(sizes) <= _SIMILAR * min(sizes)


def _size(recording: xr.Dataset, name: str) -> float:
    return float(np.nanmax(np.abs(recording[name].values), initial=0.0))


def _is_drawn(recording: xr.Dataset, name: str) -> bool:
    if name.startswith(_NO_PANEL) or recording[name].dims != ("time",):
        return False
    values = recording[name].values
    is_mode = recording[name].attrs.get("units", "1") == "1" and np.isin(values, (0.0, 1.0)).all()
    return not is_mode


def _quantity(recording: xr.Dataset, names: Sequence[str]) -> str:
    """Return the label of an ordinate: a label, or the last words that two labels have in common.

    Without common words, it is the quantity of the unit. If that is too long for a panel's height,
    the signals' names are used; the legend has the labels.
    """
    unit = str(recording[names[0]].attrs.get("units", "1"))
    labels = [clean(recording[name].attrs.get("long_name", name)).split() for name in names]
    shared: list[str] = []
    for words in zip(*(reversed(label) for label in labels), strict=False):
        if len(set(words)) > 1:
            break
        shared.insert(0, words[0])
    other = labels[0] if len(labels) == 1 or unit not in _QUANTITIES else [_QUANTITIES[unit]]
    text = " ".join(shared or other)
    return text if len(text) <= _LONGEST else ", ".join(names)
