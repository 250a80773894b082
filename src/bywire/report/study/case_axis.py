"""What an axis shows of the cases of a study: numbers in a readable unit, or choices by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axis import Axis

from bywire.core.typing import Array
from bywire.report import style
from bywire.report.readable_axis import CHARACTER, Scale, few_labels, scale_of

_JITTER = 0.3  # how far points of a choice lie from its place, of the distance of two
_GOLDEN = 0.5 * (5.0**0.5 - 1.0)  # its multiples are spread evenly, however many there are
_LONGEST = 24  # characters of a choice that have room


@dataclass(frozen=True)
class CaseAxis:
    """An axis over the cases.

    Parameters
    ----------
    name, unit
        What it shows, and its SI unit, or ``"%"``.
    values
        Value of each case, shape (cases,), NaN where there is none; of choices the place of each
        case's among them.
    choices
        The names of choices, in the order of their places; none of numbers.
    """

    name: str
    unit: str
    values: Array
    choices: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """What the axis says: names of parameters, which have dots, as they are."""
        return self.name if "." in self.name else self.name.replace("_", " ")

    @property
    def scale(self) -> Scale:
        """How the values are written."""
        return Scale(1.0, "") if self.choices else scale_of(self.values, self.unit)

    @property
    def shown(self) -> Array:
        """The values as they are written."""
        return self.scale(self.values)

    @property
    def apart(self) -> Array:
        """The values as points show them: those of a choice beside each other, the same always."""
        if not self.choices:
            return self.shown
        places = np.arange(self.values.size) * _GOLDEN % 1.0
        return self.values + _JITTER * (2.0 * places - 1.0)

    @property
    def names(self) -> list[str]:
        """The choices as they are written at an axis."""
        return [style.plain(each, _LONGEST) for each in self.choices]

    def entitled(self, gap: str = " ") -> str:
        """Return the label of the axis; ``gap`` stands between name and unit."""
        return style.plain(self.label, 40) if self.choices else self.scale.label(self.label, gap)

    def write_at(self, axis: Axis, room: float) -> None:
        """Label an abscissa that shows it, about ``room`` long [inch], once its data are drawn."""
        if not self.choices:
            few_labels(axis, room)
            return
        axis.axes.set_xlim(-0.6, len(self.choices) - 0.4)
        is_long = max(map(len, self.names)) + 2 > room / (len(self.choices) * CHARACTER)
        axis.set_ticks(range(len(self.choices)), self.names)
        if is_long:
            for label in axis.get_ticklabels():
                label.set(rotation=30, ha="right", rotation_mode="anchor")


def choice_axis(name: str, values: Sequence[str], choices: Sequence[str]) -> CaseAxis:
    """Return the axis of a structural choice.

    Parameters
    ----------
    name
        What is chosen.
    values
        The choice of each case.
    choices
        All that there are, in their order.
    """
    places = {choice: k for k, choice in enumerate(choices)}
    return CaseAxis(name, "", np.array([places[each] for each in values], float), tuple(choices))
