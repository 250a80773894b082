"""Linear models where an operation is on its corner: both slopes in closed form, side by side."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from bywire.analysis.linear.corners import REACH, CornerError, read_sides, taking
from bywire.analysis.linear.linearize import linearize
from bywire.analysis.linear.sampled_loops import closed_loop, open_loop
from bywire.core.errors import ParameterError
from bywire.core.model import Task
from bywire.core.ops import clip, fabs, floor, fmax, fmin, interpolate, sqrt, where
from systems.sampled_lag import LAG, Memory, SampledLag, State, Stimulus

Law = Callable[[Any], Any]


class BentLag(SampledLag):
    """``tau y' = drive - law(y)``, its controller's error through a law of its own."""

    def __init__(self, plant: Law = lambda y: y, control: Law = lambda e: e) -> None:
        self.plant, self.control = plant, control

    def balance(self, x, xe, m, par, contact):
        """Return what drives the lag."""
        return State(m.drive - self.plant(x.y))

    def tasks(self, par):
        """Return the controller."""

        def tick(x, m, u, p):
            return Memory(x.y, p.k * self.control(u.wanted - x.y))

        return (Task("law", par.T_s, tick),)


def slope(law: Law, at: float = 0.0) -> float:
    """Return the slope that a linear model has of a law in its plant."""
    model = linearize(
        BentLag(law), LAG, State(at), Memory(0.0, law(at)), inputs=("drive",), outputs=("y",)
    )
    return float(-model.A[0, 0] * LAG.tau)


BENT: dict[str, tuple[Law, float, float]] = {
    "maximum": (lambda y: fmax(y, 0.0), 1.0, 0.0),
    "minimum": (lambda y: fmin(2.0 * y, 0.0), 0.0, 2.0),
    "maximum that comes second": (lambda y: fmax(0.0, y), 0.0, 1.0),
    "magnitude": (lambda y: fabs(y), 1.0, -1.0),
    "Python's magnitude": (lambda y: abs(y), 1.0, -1.0),
    "choice": (lambda y: where(y > 0.0, 3.0 * y, y), 3.0, 1.0),
    "choice with the corner in it": (lambda y: where(y >= 0.0, 3.0 * y, y), 3.0, 1.0),
    "limit": (lambda y: clip(y + 1.0, -1.0, 1.0), 0.0, 1.0),
    "edge of a dead band": (lambda y: (y + 0.5) - clip(y + 0.5, -0.5, 0.5), 1.0, 0.0),
    "table": (lambda y: interpolate(y, (-1.0, 0.0, 1.0), (-4.0, 0.0, 1.0)), 1.0, 4.0),
    "jump": (lambda y: y + where(y > 0.0, 1.0, 0.0), 1.0, 1.0),
    "quantizer": (lambda y: y + floor(y), 1.0, 1.0),
    "power of a magnitude": (lambda y: fabs(y) ** 1.0, 1.0, -1.0),
}
SMOOTH: dict[str, tuple[Law, float]] = {
    "dead band of nothing": (lambda y: y - clip(y, -0.0, 0.0), 1.0),
    "bends that cancel": (lambda y: fmax(y, 0.0) - fmax(-y, 0.0), 1.0),
    "square of a magnitude": (lambda y: y + fabs(y) * y, 1.0),
    "sides of equal slope": (lambda y: where(y > 0.0, 2.0 * y, y + y), 2.0),
    "value at a point": (lambda y: y + where(y == 0.0, 0.0, y), 2.0),
    "parabola at its vertex": (lambda y: 1.0 + y * y, 0.0),
    "a bend elsewhere": (lambda y: fmax(y, -1e-6), 1.0),
}


@pytest.mark.parametrize("name", BENT)
def test_sides_that_differ_are_refused_with_their_line_and_taken_where_stated(name: str) -> None:
    law, above, below = BENT[name]
    with pytest.raises(CornerError, match=r"linear/test_corners\.py:\d+, .*kink at"):
        slope(law)
    for side, wanted in (("above", above), ("below", below)):
        with taking(side):
            assert slope(law) == pytest.approx(wanted, abs=1e-7)


@pytest.mark.parametrize("name", SMOOTH)
def test_sides_that_agree_are_the_model(name: str) -> None:
    law, wanted = SMOOTH[name]
    assert slope(law) == pytest.approx(wanted, abs=1e-7)


def test_a_corner_counts_within_what_operating_points_are_solved_to() -> None:
    for distance in (0.0, 0.01 * REACH, -0.01 * REACH):
        with pytest.raises(CornerError):
            slope(lambda y: fmax(y, 0.0), distance)
    for distance, wanted in ((10.0 * REACH, 1.0), (-10.0 * REACH, 0.0)):
        assert slope(lambda y: fmax(y, 0.0), distance) == wanted


def test_a_place_has_its_own_side() -> None:
    def valve(y: Any) -> Any:
        opening = fmax(y, 0.0)
        back = fmin(5.0 * y, 0.0)
        return opening + back

    first = valve.__code__.co_firstlineno + 1
    # Both test one quantity, which cannot be on two sides: the first operation decides.
    for sides, wanted in (("above, below", 1.0), ("below, above", 5.0)):
        with taking(f"test_corners.py:{first}={sides}"):
            assert slope(valve) == pytest.approx(wanted, abs=1e-7)
    other = f":{first + 1}, "
    with taking(f"test_corners.py:{first}=above"), pytest.raises(CornerError, match=other):
        slope(valve)


def test_what_no_output_feels_has_no_corner_that_counts() -> None:
    """The controller's record of what it read: a peak that is held on its corner at any rest."""

    class Peak(BentLag):
        def tasks(self, par):
            def tick(x, m, u, p):
                return Memory(fmax(x.y, m.seen), p.k * (u.wanted - x.y))

            return (Task("law", par.T_s, tick),)

    at = (LAG, State(0.0), Memory(0.0, 0.0))
    peak = closed_loop(Peak(), *at, inputs=("wanted",), outputs=("y",))
    plain = closed_loop(BentLag(), *at, inputs=("wanted",), outputs=("y",))
    assert peak.response([1.0, 5.0]) == pytest.approx(plain.response([1.0, 5.0]), rel=1e-7)
    with pytest.raises(CornerError):
        closed_loop(Peak(), *at, inputs=("wanted",), outputs=("seen",))


def test_the_corner_of_a_controller_is_refused_and_taken() -> None:
    at = (LAG, State(0.0), Memory(0.0, 0.0))
    bent = BentLag(control=lambda e: where(e > 0.0, 3.0 * e, e))
    with pytest.raises(CornerError, match=r"test_corners\.py:\d+"):
        open_loop(bent, *at, cut="y")
    for side, factor in (("above", 3.0), ("below", 1.0)):
        with taking(side):
            L = open_loop(bent, *at, cut="y")
        plain = open_loop(BentLag(), *at, cut="y")
        assert L.response([1.0]) == pytest.approx(factor * plain.response([1.0]), rel=1e-7)
        assert L.corners[0].startswith(f"{side} the kink of ")
        assert plain.corners == ()


def test_an_infinite_slope_is_refused() -> None:
    with pytest.raises(CornerError, match=r"test_corners\.py:\d+"):
        slope(lambda y: sqrt(fabs(y)))


def test_sides_are_read_from_text() -> None:
    assert read_sides("above").of("a/valve.py:4") == "above"
    sides = read_sides("valve.py:4=below, above")
    assert (sides.of("a/valve.py:4"), sides.of("a/my_valve.py:4")) == ("below", "above")
    for wrong in ("left", "valve.py=above", "valve.py:x=above", "=above", "4=above"):
        with pytest.raises(ParameterError, match="'above' or 'below'"):
            read_sides(wrong)


def test_a_stimulus_of_the_loop_is_its_own_input() -> None:
    with taking("above"):
        found = closed_loop(
            BentLag(control=lambda e: fmax(e, 0.0)),
            LAG,
            State(0.0),
            Memory(0.0, 0.0),
            inputs=("wanted",),
            outputs=("y",),
            stimulus=Stimulus(0.0),
        )
    assert found.B[2, 0] == pytest.approx(LAG.k)


def test_functions_of_a_model_that_is_gone_are_not_those_of_the_next() -> None:
    """Python gives a new law the identity of one that is no longer there."""
    for factor in range(1, 21):
        assert slope(lambda y, k=factor: k * y) == pytest.approx(factor)


def test_a_one_sided_limit_that_is_reached_is_a_corner() -> None:
    class Stopped(BentLag):
        limits = ("y",)

    at = (LAG, State(0.0), Memory(0.0, 0.0))
    with pytest.raises(CornerError, match="y is at its lower limit"):
        linearize(Stopped(), *at, inputs=("drive",), outputs=("y",))
    with taking("above"):
        model = linearize(Stopped(), *at, inputs=("drive",), outputs=("y",))
    assert model.A[0, 0] == -1.0 / LAG.tau
    assert model.corners == ("above the limit of y",)
    away = (LAG, State(1.0), Memory(0.0, 1.0))
    assert linearize(Stopped(), *away, inputs=("drive",), outputs=("y",)).corners == ()
