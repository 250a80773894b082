"""Figs. 5 and 6 of Roberts et al. (2003): what comes out, and what does not."""

from __future__ import annotations

import math
import re

import pytest

from bywire.brakes.wedge.paper import fig6 as roberts2003_fig6


@pytest.fixture(scope="module")
def items(wedge_paper):
    shown = re.compile(r"fig[56]\.")
    return {item.id: item for item in wedge_paper.reproduction.items if shown.match(item.id)}


def test_what_disagrees_has_its_cause(items, wedge_paper):
    wrong = {name for name, item in items.items() if item.agrees is False}
    assert wrong == {"fig5.wedge", "fig6.wedge", "fig6.friction"}
    causes = wedge_paper.reproduction.causes
    explained = [item.id for cause in causes for item in cause.explained(items.values())]
    assert set(explained) == wrong


def test_friction_takes_more_off_smaller_amplitudes(items):
    lost = [items[f"fig5.friction.{size}"].computed for size in ("0.5", "1", "2")]
    assert lost == pytest.approx([-4.5, -1.5, -0.5], abs=0.1)


def test_the_current_limit_sets_in_where_the_acceleration_needs_it(items):
    """At a torque of K_T i_max the shaft swings by K_T i_max / (J w^2), friction left out."""
    par = roberts2003_fig6.frequency.parameters()
    torque = par.motor_1.K_ref * par.control.position.i_max
    for size in (0.25, 0.5, 1.0):
        f = math.sqrt(torque / (par.motor_1.J_M * size)) / (2.0 * math.pi)
        assert items[f"fig6.onset.{size:g}"].computed == pytest.approx(f, rel=0.25)
        assert items[f"fig6.roll_off.{size:g}"].computed == pytest.approx(-40.0, abs=1.0)
        assert items[f"fig6.kink.{size:g}"].computed > 30.0


def test_below_the_onset_there_are_two_responses(items):
    rest, above = (items[f"fig6.jump.from_{where}"].computed for where in ("rest", "above"))
    assert rest == pytest.approx(0.93, abs=0.02)
    assert above > 1.2


def test_readings_of_the_screws_loss_differ_at_high_frequency(items):
    for f in (60, 100):
        by_load = items[f"fig6.efficiency.load.{f}"].computed
        by_drive = items[f"fig6.efficiency.drive.{f}"].computed
        assert 0.5 < by_load - by_drive < 3.0
