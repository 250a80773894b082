"""Ticks remembered while a figure is drawn: the same picture, and an axis as it was."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest
from matplotlib.axis import Axis
from matplotlib.figure import Figure

from bywire.report import drawing, style
from bywire.report.drawing import drawn

PASSES = 3  # a layout measures axes as they are made and once moved, and then they are drawn


def aligned() -> Figure:
    figure, rows = style.new_figure(4.0, [1.0, 2.0, 1.0])
    for k, axes in enumerate(rows):
        axes.plot([0.0, 1.0], [0.0, 10.0 ** (3 * k)])
        axes.set_ylabel("y")
        axes.set_title("title", loc="left")
    figure.align_ylabels(rows)
    return figure


def logarithmic() -> Figure:
    figure, (axes,) = style.new_figure(3.0)
    axes.loglog([1.0, 5e4], [1e-3, 1e3])
    axes.grid(True, which="minor")
    return figure


def named() -> Figure:
    figure, (axes,) = style.new_figure(3.0)
    axes.plot(range(3))
    axes.set_xticks(range(3), ["one", "two", "a longer three"], rotation=35, ha="right")
    axes.xaxis.get_major_ticks()[1].label1.set_color("red")
    axes.twinx().plot([1.0, 2.0], [1e6, 1.00001e6])
    return figure


def round_() -> Figure:
    figure = Figure(layout="constrained")
    figure.add_subplot(projection="polar").plot(np.linspace(0.0, 6.0), np.linspace(0.0, 3.0))
    return figure


STRAIGHT = [aligned, logarithmic, named]


@pytest.mark.parametrize("make", [*STRAIGHT, round_])
def test_a_figure_is_the_same_to_the_byte(
    make: Callable[[], Figure], monkeypatch: pytest.MonkeyPatch
) -> None:
    lean = drawn(make(), 160)
    monkeypatch.setattr(drawing, "lean_ticks", nullcontext)
    assert drawn(make(), 160) == lean


@pytest.mark.parametrize("make", STRAIGHT)
def test_an_axis_is_left_as_it_was(make: Callable[[], Figure]) -> None:
    figure = make()
    each = [axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)]
    counts = [(len(axis.majorTicks), len(axis.minorTicks)) for axis in each]
    first = drawn(figure, 160)
    spines = [spine for axes in figure.axes for spine in axes.spines.values()]
    ticks = [tick for axis in each for tick in (*axis.majorTicks, *axis.minorTicks)]
    for artist in (*each, *spines, *ticks, *(tick.label1 for tick in ticks)):
        methods = {name for name in vars(artist) if hasattr(type(artist), name)}
        assert not {name for name in methods if callable(getattr(type(artist), name))}
    assert [(len(axis.majorTicks), len(axis.minorTicks)) for axis in each] == counts
    assert drawn(figure, 160) == first
    for axis in each:
        axis.set_tick_params(labelsize=20.0)
    assert drawn(figure, 160) != first


def test_ticks_are_computed_once_for_each_size_of_their_axes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    computed: Counter[int] = Counter()
    compute: Any = Axis._update_ticks  # type: ignore[attr-defined]

    def counted(axis: Axis) -> Any:
        computed[id(axis)] += 1
        return compute(axis)

    monkeypatch.setattr(Axis, "_update_ticks", counted)
    figure = aligned()
    drawn(figure, 160)
    assert len(computed) == 2 * len(figure.axes)
    assert max(computed.values()) <= PASSES
