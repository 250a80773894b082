"""Ticks of axes made and computed once, while a figure is laid out and drawn.

Matplotlib computes where ticks stand, what they say and which room that takes whenever it asks
how large an axis, its label or a spine is: eleven times for each axis of a figure, and for all
whose labels are aligned as often as for one. To make a tick, of five artists, takes longer than
to draw it. Together that was a third of the time that a figure took.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.text import Text

_COMPUTED = ("_update_ticks", "_get_ticklabel_bboxes")
_MADE = ("_get_tick", "_copy_tick_props")
_PARTS = ("gridline", "tick1line", "tick2line", "label1", "label2")
_LABELS = ("label1", "label2")
_LISTS = ("majorTicks", "minorTicks")
_IS_KNOWN = all(hasattr(Axis, name) for name in (*_COMPUTED, *_MADE)) and hasattr(
    Text, "_get_layout"
)
"""whether this is a matplotlib whose axes compute as those that were read; else they do alone"""


@contextmanager
def lean_ticks(figure: Figure) -> Iterator[None]:
    """Have axes remember their ticks while the block runs, and copy the first where more are due.

    Axes may change in size within it, and in what they span; locators, formatters and the looks
    of ticks may not. Afterwards everything is as matplotlib made it.

    Parameters
    ----------
    figure
        Figure whose axes they are.
    """
    # Ticks around a circle turn their texts by transforms that copies would share.
    straight = [axes for axes in figure.axes if axes.name == "rectilinear" and _IS_KNOWN]
    known = [_Axis(axis) for axes in straight for axis in (axes.xaxis, axes.yaxis)]
    try:
        yield
    finally:
        for each in known:
            each.forget()


class _Axis:
    """An axis whose methods compute only when its place has changed."""

    def __init__(self, axis: Any) -> None:
        self._axis = axis
        self._place: tuple[Any, ...] = ()
        self._known: dict[object, Any] = {}
        self._layouts: dict[object, Any] = defaultdict(dict)
        self._counts = {name: len(vars(axis).get(name, ())) for name in _LISTS}
        self._compute, self._measure, self._make = (
            getattr(axis, name) for name in (*_COMPUTED, _MADE[0])
        )
        self._spines = [s for s in axis.axes.spines.values() if getattr(s, "axis", None) is axis]
        axis._update_ticks, axis._get_ticklabel_bboxes = self._drawn, self._boxes
        axis._get_tick, axis._copy_tick_props = self._tick, lambda first, other: None
        for spine in self._spines:
            self._remember_extent(spine)

    def forget(self) -> None:
        """Give the axis its own methods back, and leave it the ticks that it had."""
        for name in (*_COMPUTED, *_MADE):
            vars(self._axis).pop(name, None)
        for name, count in self._counts.items():
            del vars(self._axis).get(name, [])[max(count, 1) :]
        for spine in self._spines:
            vars(spine).pop("get_window_extent", None)

    def _at_place(self) -> dict[object, Any]:
        """Return what is known of the axis where it stands now."""
        axes = self._axis.axes
        place = (axes.bbox.bounds, axes.get_xlim(), axes.get_ylim(), axes.figure.dpi)
        if place != self._place:
            self._place, self._known = place, {}
        return self._known

    def _drawn(self) -> Any:
        known = self._at_place()
        if "drawn" not in known:
            known["drawn"] = self._compute()
        return known["drawn"]

    def _boxes(self, drawn: list[Any], renderer: Any) -> Any:
        known = self._known
        if drawn is not known.get("drawn"):
            return self._measure(drawn, renderer)
        if "boxes" not in known:
            known["boxes"] = self._measure(drawn, renderer)
        return known["boxes"]

    def _remember_extent(self, spine: Any) -> None:
        measure = spine.get_window_extent

        def extent(renderer: Any = None) -> Any:
            known = self._at_place()
            if spine not in known:
                known[spine] = measure(renderer)
            return known[spine]

        spine.get_window_extent = extent

    def _tick(self, major: bool) -> Any:
        """Return a copy of the first tick, whose artists share all that its place leaves alone."""
        same = vars(self._axis).get(_LISTS[0 if major else 1])
        if not same:
            return self._make(major)
        tick = _twin(same[0])
        for name in _PARTS:
            setattr(tick, name, _twin(getattr(tick, name)))
        for name in _LABELS:
            _remember_layout(getattr(tick, name), self._layouts[major, name])
        return tick


def _remember_layout(label: Any, known: dict[object, Any]) -> None:
    """Have a label lay out its text once for all labels that look like it."""
    lay_out = type(label)._get_layout

    def layout(renderer: Any) -> Any:
        looks = label.get_text(), label.get_rotation()
        if looks not in known:
            known[looks] = lay_out(label, renderer)
        return known[looks]

    label._get_layout = layout


def _twin(artist: Any) -> Any:
    twin = object.__new__(type(artist))
    vars(twin).update(vars(artist))
    return twin
