"""Every element of the library has a figure in the reference, from its own functions."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "docs"))

from site_pages import curves, element_figures, elements

ELEMENTS = elements.modules()["Elements"]


def lines(name):
    values = element_figures.VALUES.get(name, {})
    return curves.lines_of(ELEMENTS[name], element_figures.FIGURES[name], values)


def test_every_element_has_a_figure():
    missing = ELEMENTS.keys() - element_figures.FIGURES.keys()
    assert not missing, f"declare them in docs/site_pages/element_figures.py: {sorted(missing)}"
    assert element_figures.FIGURES.keys() <= ELEMENTS.keys()
    assert element_figures.VALUES.keys() <= ELEMENTS.keys()


@pytest.mark.parametrize("name", element_figures.FIGURES)
def test_a_figure_shows_something(name):
    drawn = lines(name)
    assert all(np.all(np.isfinite(line.x)) and np.all(np.isfinite(line.y)) for line in drawn)
    assert any(np.ptp(line.y) > 0.0 for line in drawn)
    assert all(line.label for line in drawn) == (len(drawn) > 1)


def test_the_lines_differ():
    for name, declared in element_figures.FIGURES.items():
        if declared.lines:
            first, *others = lines(name)
            for other in others:
                assert not np.array_equal(first.y, other.y), name


def test_pads_with_hysteresis_return_to_the_outer_loop():
    (loop,) = lines("pad_hysteresis")
    assert loop.y.max() == pytest.approx(500.0)  # the sum of all slip forces
    closed = loop.y[np.isclose(loop.x, 0.15e-3, atol=1e-9)]
    assert closed[-1] == pytest.approx(closed[-2], abs=1.0)  # the minor loop closes


def test_the_flow_of_air_is_choked_below_the_critical_ratio():
    for line, b in zip(lines("air_orifice"), (0.2, 0.3, 0.5), strict=True):
        choked = line.x < b * 8e5
        assert np.ptp(line.y[choked]) < 1e-9 * line.y.max()


def test_an_accumulator_shows_both_stops():
    (line,) = lines("accumulator")
    assert -101_325.0 < line.y.min() < -8e4  # bubbles expand toward vacuum
    assert line.y.max() > 5e5 + 3e5  # the spring reaches 5 bar


def test_a_starved_pump_delivers_less():
    delivered = [np.trapezoid(line.y, line.x) for line in lines("return_pump")]
    full = 2.0 * 66.4e-9  # two strokes of 6.5 mm and 2 mm, mL
    assert delivered[0] == pytest.approx(full, rel=0.02)
    assert delivered[2] < 0.9 * delivered[0]


def test_given_values_are_needed():
    """Parameters of a set replace values that are declared for a figure."""
    in_sets = {
        name
        for name in element_figures.VALUES
        if getattr(ELEMENTS[name], "Parameters", None) in curves.examples()
    }
    assert in_sets == {
        "flux_map",  # sets contain it without tables
        "pad_hysteresis",  # figure with short loops
    }


def test_a_page_shows_the_figure_before_the_equations():
    text = elements.page(ELEMENTS["orifice"])
    assert (
        text.index("figures/orifice.svg") < text.index("Equations") < text.index("Parameters\n--")
    )
