"""One substep versus closed forms: linear, nonlinear, held by friction, at a limit."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import root

from bywire.core.model import Model, Task
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.signals import Signal
from bywire.simulation.program import Program, build_program
from bywire.simulation.run import Run, simulate
from systems import nonlinear_drive, oscillator

Array = NDArray[np.float64]
H = 1e-2
EXACT = 1e-13


class Held(NamedTuple):
    """Force and inflow."""

    F: Annotated[float, Signal("N", "force")]
    q: Annotated[float, Signal("m3/s", "inflow")]


class State(NamedTuple):
    """Level of a vessel that cannot fall below zero, velocity of a rubbing body."""

    level: Annotated[float, Signal("m", "level")]
    v: Annotated[float, Signal("m/s", "velocity")]


class Reactions(NamedTuple):
    """Contributions of friction and limit."""

    friction: Annotated[float, Signal("N", "friction")]
    makeup: Annotated[float, Signal("m3/s", "inflow that keeps the level at zero")]


class Parameters(ParameterSet):
    """Mass of the body, area of the vessel, bounds of the friction."""

    m: Annotated[float, Unit("kg")]
    A: Annotated[float, Unit("m2")]
    low: Annotated[float, Unit("N")]
    high: Annotated[float, Unit("N")]


class RubbingAndLimited(Model):
    """m dv/dt = F + friction; A dlevel/dt = q + makeup."""

    name = "rubbing-and-limited"
    State, Memory, Stimulus, Flow, Output = State, Held, Held, Reactions, State
    frictions = ("v",)
    limits = ("level",)

    def tasks(self, par: Parameters) -> tuple[Task, ...]:
        return (Task("hold", 1e-2, lambda x, m, u, p: u),)

    def mass(self, xe: State, par: Parameters) -> State:
        return State(par.A, par.m)

    def balance(self, x: State, xe: State, m: Held, par: Parameters, contact: Any) -> State:
        return State(m.q, m.F)

    def bounds(self, x: State, xe: State, m: Held, par: Parameters, contact: Any) -> Any:
        return ((par.low, par.high),)

    def powers(
        self, x: State, xe: Any, rate: Any, m: Held, par: Any, contact: Any, reaction: Any
    ) -> Reactions:
        return Reactions(*reaction)

    def output(self, x: State, *_: Any) -> State:
        return x


PARAMETERS = Parameters(m=0.5, A=2.0, low=-3.0, high=4.0)


class Result(NamedTuple):
    """``scheme.Pass`` in numbers."""

    x: Array
    d: Array
    reaction: Array
    flow: Array
    jump: Array
    flag: float
    doubt: float


def substep(
    program: Program, par: ParameterSet, x: object, d: object, m: object, exact: bool = False
) -> Result:
    """Return a pass's results for a state, a predicted half increment and a memory."""
    leaves = [par.leaves()[name] for name in program.parameter_names]
    values = (program.exact if exact else program.fast)(x, d, m, leaves, H)
    *vectors, flag, doubt = (np.array(value).ravel() for value in values)
    return Result(*vectors, float(flag[0]), float(doubt[0]))


@pytest.fixture(scope="module")
def body() -> Program:
    return build_program(RubbingAndLimited(), PARAMETERS)


both = pytest.mark.parametrize("exact", [False, True])


@both
def test_a_linear_system_takes_the_midpoint_rule_whatever_was_predicted(exact: bool) -> None:
    """(I - hA/2)^-1 (I + hA/2) x; flows are taken in the middle."""
    par = oscillator.PARAMETERS
    program = build_program(oscillator.Oscillator(), par)
    A, x = np.array([[0.0, 1.0], [-par.k / par.m, 0.0]]), np.array([0.1, 3.0])
    end = np.linalg.solve(np.eye(2) - 0.5 * H * A, (np.eye(2) + 0.5 * H * A) @ x)
    for predicted in ([0.0, 0.0], [0.7, -20.0]):
        result = substep(program, par, x, predicted, [0.0], exact)
        np.testing.assert_allclose(result.x, end, rtol=EXACT)
        np.testing.assert_allclose(result.d, 0.5 * (end - x), rtol=EXACT)
        assert result.flow == pytest.approx([0.125 * par.m * (x[1] + end[1]) ** 2], rel=EXACT)
        assert result.flag == 0.0


@both
def test_nonlinear_rows_get_one_newton_step_from_the_predicted_midpoint(exact: bool) -> None:
    """Their error is of second order in that of the prediction, and zero with it."""
    par, model, v = nonlinear_drive.PARAMETERS, nonlinear_drive.NonlinearDrive(), 6.0
    program, x = build_program(model, par), np.array([2.0, 0.8, 30.0])
    mass = np.array(model.mass(None, par))

    def left(d: Array) -> Array:
        middle = nonlinear_drive.State(*(x + d))
        f = model.balance(middle, middle, nonlinear_drive.Memory(v), par, ())
        return 2.0 / H * mass * d - np.array(f)

    solved = root(left, np.zeros(3), tol=1e-13).x
    np.testing.assert_allclose(left(solved), 0.0, atol=1e-10)
    errors = []
    for share in (0.0, 0.1, 0.2):
        predicted = solved + share * np.array([1.0, 0.2, 3.0])
        result = substep(program, par, x, predicted, [v], exact)
        # The voltage balance and the angle's rate are linear: they hold however wrong the drag is.
        np.testing.assert_allclose(left(result.d)[:2], 0.0, atol=1e-10)
        np.testing.assert_allclose(result.x, x + 2.0 * result.d, rtol=EXACT)
        errors.append(np.abs(result.d - solved).max())
    assert errors[0] < 1e-12
    assert errors[2] / errors[1] == pytest.approx(4.0, rel=0.05)


RESTS = [(0.0, 0.0), (0.0, 2.9), (0.0, -3.9)]
SLIDES = [(0.0, 3.1), (0.0, -4.1), (0.1, 0.0), (-0.1, 0.0), (2.0, 9.0), (2.0, -9.0), (-2.0, -9.0)]
TURNS = [(0.01, 0.0), (0.01, -4.0), (-0.01, 3.0), (0.01, -9.0), (-0.02, 12.0)]


@both
@pytest.mark.parametrize(("v", "F"), [*RESTS, *SLIDES, *TURNS])
def test_friction_holds_exactly_or_opposes_the_motion_at_its_bound(
    body: Program, v: float, F: float, exact: bool
) -> None:
    """A moving body keeps its initial friction, and the pass reports where the motion reverses."""
    m, (low, high) = PARAMETERS.m, (PARAMETERS.low, PARAMETERS.high)
    pushed = min(F + high, 0.0) + max(F + low, 0.0)  # at rest
    friction = low if v > 0.0 else high if v < 0.0 else pushed - F
    wanted = v + H * (F + friction) / m
    result = substep(body, PARAMETERS, [1.0, v], [0.0, 0.3], [F, 0.0], exact)
    assert result.x[1] == pytest.approx(wanted, rel=1e-12, abs=0.0)
    assert result.d[1] == pytest.approx(0.5 * (wanted - v), rel=1e-12, abs=1e-17)
    assert result.reaction[0] == pytest.approx(friction, rel=1e-12, abs=1e-12)
    assert (result.x[1] == 0.0) == ((v, F) in RESTS)
    assert (result.flag > 0.0) == ((v, F) in TURNS)
    assert (result.jump[0], result.doubt) == (pytest.approx(0.5 * H * (high - low) / m), 0.0)


@pytest.mark.parametrize("engine", ["auto", "virtual-machine"])
@pytest.mark.parametrize(("v", "F"), TURNS)
def test_a_substep_is_cut_where_the_motion_turns(v: float, F: float, engine: str) -> None:
    """Uniform deceleration to rest, and on from there if friction cannot hold: a closed form."""
    m, (low, high) = PARAMETERS.m, (PARAMETERS.low, PARAMETERS.high)
    before = low if v > 0.0 else high
    stops = -v * m / (F + before)
    pushed = min(F + high, 0.0) + max(F + low, 0.0)
    model, held = RubbingAndLimited(), Held(F, 0.0)
    run = Run(model, PARAMETERS, State(1.0, v), held, lambda t: np.tile(held, (t.size, 1)), H, H, H)
    result = simulate(run, engine=engine)
    end = pushed * (H - stops) / m
    assert result["v"][-1] == pytest.approx(end, rel=1e-9, abs=0.0)


@both
def test_a_bound_on_the_wrong_side_of_zero_is_zero(body: Program, exact: bool) -> None:
    """Friction never drives: with bounds 1 and 4 N it only acts against falling velocities."""
    for low, high, v in ((1.0, 4.0, 2.0), (-3.0, -1.0, -2.0)):
        par = PARAMETERS.replace({"low": low, "high": high})
        result = substep(body, par, [1.0, v], [0.0, 0.0], [0.0, 0.0], exact)
        assert result.x[1] == v
        assert result.reaction[0] == pytest.approx(0.0, abs=EXACT)


@pytest.mark.parametrize("q", [-4.25, -4.0, -3.75, 0.0, 1.5])
def test_a_limit_adds_just_what_keeps_its_state_at_zero(body: Program, q: float) -> None:
    """From 0.02 m, 2 m2 empty within 10 ms by 4 m3/s: what is drawn beyond that is made up."""
    level = 0.02
    free = level + H * q / PARAMETERS.A
    fast = substep(body, PARAMETERS, [level, 0.0], [0.0, 0.0], [0.0, q])
    assert fast.x[0] == pytest.approx(free, abs=1e-15)
    assert (fast.flag > 0.0) == (q < -4.0)
    assert fast.reaction.tolist() == [0.0, 0.0]
    exact = substep(body, PARAMETERS, [level, 0.0], [0.0, 0.0], [0.0, q], exact=True)
    assert exact.x[0] == pytest.approx(max(free, 0.0), abs=1e-15)
    assert exact.reaction[1] == pytest.approx(max(-4.0 - q, 0.0), abs=1e-12)
    assert exact.flow == pytest.approx(exact.reaction)
    assert exact.flag == 0.0
    assert (exact.x[0] == 0.0) == (q <= -4.0)


def test_away_from_its_limit_a_state_feels_nothing_of_it(body: Program) -> None:
    """Not even the rounding of its balance, which some of these inflows leave."""
    for q in np.linspace(-3.9, 1.5, 60):
        result = substep(body, PARAMETERS, [0.02, 0.0], [0.0, 0.0], [0.0, q], exact=True)
        assert 0.0 < result.x[0] < 1.0
        assert result.reaction[1] == 0.0
