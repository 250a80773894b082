"""Contracts of a model's linearization, which must describe small motions of the plant."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from bywire.analysis.linear.corners import (
    ABOVE,
    BELOW,
    REACH,
    CornerError,
    Kink,
    beside_point,
    kinks_at,
    magnitudes,
    on_stops,
    taking,
)
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import Friction, free_signals, linearize, smooth_point
from bywire.analysis.linear.smooth_functions import SmoothPoint
from bywire.analysis.loop import LOOPS
from bywire.contracts.evidence import Evidence, NotCheckedError, measured
from bywire.contracts.trial import Trial, states
from bywire.core.errors import InputError, SolverError
from bywire.core.signals import signals_of
from bywire.core.typing import Array
from bywire.simulation.run import simulate

SMALL = (1e-4, 1e-5)
"""fractions of the controllers' moves; nonlinear effects decrease from one to the next"""
MISMATCH = 0.02
"""maximum difference of the responses, relative to the largest value of the larger response"""
AT_REST = 1e-3
"""maximum drift of an equilibrium, in usual magnitudes per second"""


def is_its_linear_model(trial: Trial) -> Iterator[Evidence]:
    """Check that the linear model of the plant predicts its response to small motions.

    The model's loops must not be at a kink at their usual operating point.

    If the start is an equilibrium of the smooth equations, the check removes dry friction.
    Otherwise, it holds all velocities with friction at zero.
    """
    start = trial.start
    try:
        linear, removed = _linear(trial)
        _require_loops_off_corners(trial)
    except CornerError as error:
        if not any(loop.is_in(trial.model.name) for loop in LOOPS.all().values()):
            # Nobody linearizes the model there, for example at a pump that rests on its kinks.
            raise NotCheckedError(f"at {start.known}, {error}") from error
        yield Evidence(False, f"at {start.known}, {error}", place=trial.place("balance", "wire"))
        return
    names = start.state._fields
    period, step = start.period, start.step / 4
    place = trial.place("balance", "wire")
    try:
        base = states(simulate(trial.drive.run(0.0, step, not removed)), names)
        runs = [states(simulate(trial.drive.run(s, step, not removed)), names) for s in SMALL]
    except SolverError as error:
        raise NotCheckedError(f"the small run from {start.known} failed: {error}") from error
    expected = _response(linear, trial.drive.rows[: len(base)], period)
    deviations = [(run - base) / share for run, share in zip(runs, SMALL, strict=True)]
    nominal = [abs(s.nominal) for s in signals_of(trial.model.State).values()]
    moving = 0
    for k, name in enumerate(names):
        exact, size = expected[:, k], float(np.abs(expected[:, k]).max())
        floor = 1e-11 * max(float(np.abs(base[:, k]).max()), nominal[k]) / SMALL[-1]
        size = max(size, float(np.abs(deviations[-1][:, k]).max()))
        if size <= floor / MISMATCH:
            continue
        moving += 1
        off = min(float(np.abs(run[:, k] - exact).max()) for run in deviations) / size
        how = "without dry friction" if removed else "with all velocities held by friction"
        text = f"{how}, {name} differs from its linear response by {off:.1e} of its largest value"
        yield measured(off, MISMATCH, text, place)
    if not moving:
        raise NotCheckedError(
            f"starting from {start.known}, the controllers do not change any state"
        )


def _require_loops_off_corners(trial: Trial) -> None:
    """Reject the model's loops whose usual operating point is at a kink."""
    for loop in LOOPS.all().values():
        if loop.is_in(trial.model.name):
            try:
                loop.gain_and_closed(trial.start.par, loop.at.default)
            except CornerError:
                raise
            except InputError:  # the loop is for other choices
                continue


def _linear(trial: Trial) -> tuple[LinearModel, bool]:
    """Return the linear model, and whether dry friction is removed from it."""
    start = trial.start
    reasons = []
    nominal = np.array([s.nominal for s in signals_of(trial.model.State).values()])
    choices: tuple[Friction, ...] = ("removed", "stuck") if trial.model.frictions else ("removed",)
    for friction in choices:
        try:
            linear = linearize(
                trial.model,
                start.par,
                start.state,
                start.memory,
                inputs=start.memory._fields,
                outputs=(),
                friction=friction,
            )
        except CornerError:
            raise
        except InputError as error:
            reasons.append(str(error))
            continue
        drift = float(np.abs(linear.rate / nominal).max())
        if drift <= AT_REST:
            return linear, friction == "removed"
        name = linear.states[int(np.argmax(np.abs(linear.rate / nominal)))]
        reasons.append(f"at {start.known}, {name} is not at rest")
    raise NotCheckedError("; ".join(dict.fromkeys(reasons)))


def _response(linear: LinearModel, inputs: Array, period: float) -> Array:
    """Return the states for inputs that are constant over a sample time, shape (rows, states)."""
    n, m = linear.B.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = linear.A, linear.B
    over = expm(block * period)
    ahead, driven = over[:n, :n], over[:n, n:]
    rows = [np.zeros(n)]
    for held in inputs[:-1]:
        rows.append(ahead @ rows[-1] + driven @ held)
    return np.array(rows)


MOST = 40
"""maximum number of a model's operations to test at their kinks, one per place in the source"""
ONE_SIDED = 1e-3
"""maximum deviation of a linear model from one-sided differences, relative to the largest effect"""
ROUNDING = 1e-14
"""maximum error of the differences of rates"""
_NEWTON = 8


def is_linear_beside_its_corners(trial: Trial) -> Iterator[Evidence]:
    """Check that linear models are valid or rejected when operations are at their kinks.

    The check moves the plant's operating point to the kink of each limit, selection and absolute
    value in its equations. A linear model at a kink must be valid on both sides. If bywire rejects
    it, the models of the two sides must match the equations next to the kink.
    """
    start = trial.start
    try:
        at = smooth_point(trial.model, start.par, (start.state, start.memory, None))
        free = free_signals(at, trial.model.State._fields, trial.model.Memory._fields, ())
        at, _ = on_stops(at, free)
    except InputError as error:
        raise NotCheckedError(f"at {start.known}, {error}") from error
    usual = magnitudes(at)
    kinks = kinks_at(at, free, usual, outputs=False, ticks=False)
    places = {kink.place: kink.order for kink in kinks}
    count = 0
    for place, order in [*places.items()][:MOST]:
        corner = _driven(at, free, usual, order)
        if corner is not None:
            count += 1
            yield _beside(trial, corner, free, place)
    if not count:
        raise NotCheckedError(f"no operation of the plant has a kink near {start.known}")


def _driven(
    at: SmoothPoint, free: NDArray[np.bool_], usual: Array, order: int
) -> SmoothPoint | None:
    """Return the nearest point at which an operation is at its kink, or None."""
    for _ in range(_NEWTON):
        kink = _kink(kinks_at(at, free, usual, outputs=False, ticks=False), order)
        if kink is None or not np.isfinite(kink.excess):
            return None
        c = kink.slope
        if abs(kink.excess) <= 1e-3 * REACH * float(np.abs(c).sum()):
            return _with_its_contacts(at, free)
        by = np.zeros(free.size)
        by[free] = -kink.excess * c / (c @ c) * usual[free]
        at = at.moved(by)
    return None


def _with_its_contacts(at: SmoothPoint, free: NDArray[np.bool_]) -> SmoothPoint | None:
    """Return a point with its closed contacts; None if a contact, limit or stop just touches."""
    model = at.model
    state = cast(NamedTuple, cast(Any, model.State)(*at.state.tolist()))
    memory = cast(NamedTuple, cast(Any, model.Memory)(*at.memory.tolist()))
    if any(getattr(state, name) <= 0.0 for name in model.limits):
        return None
    try:
        return on_stops(smooth_point(model, at.par, (state, memory, None)), free)[0]
    except InputError:
        return None


def _kink(kinks: list[Kink], order: int) -> Kink | None:
    return next((each for each in kinks if each.order == order), None)


def _beside(trial: Trial, at: SmoothPoint, free: NDArray[np.bool_], place: str) -> Evidence:
    """Return evidence that the linear models at a kink match the equations next to it."""
    model = trial.model
    n, m = at.state.size, at.memory.size
    state = cast(NamedTuple, cast(Any, model.State)(*at.state.tolist()))
    memory = cast(NamedTuple, cast(Any, model.Memory)(*at.memory.tolist()))

    def linear() -> Array:
        made = linearize(model, at.par, state, memory, inputs=memory._fields, outputs=())
        return np.hstack([made.A, made.B])

    try:
        sides, how = [linear()], "without a specified side"
    except CornerError:
        sides, how = [], "on a specified side"
        for side in (ABOVE, BELOW):
            with taking(side):
                sides.append(linear())
    by = beside_point(at, free)
    most = 0.0
    for away in (by, -by):
        once, twice = (at.moved(share * away).plant()[4][:, 0] for share in (0.5, 1.0))
        if not (np.isfinite(once).all() and np.isfinite(twice).all()):
            return Evidence(True, f"{place} is at its kink, but a value near it is not finite")
        expected, step = twice - once, 0.5 * away[: n + m]
        size = np.maximum(np.abs(sides[0]), np.abs(sides[-1])) @ np.abs(step)
        rounding = ROUNDING * (np.abs(once) + np.abs(twice))
        # A slope that needs more than a second to change a signal by its magnitude is negligible.
        size = np.maximum(size, rounding / ONE_SIDED + REACH * magnitudes(at)[:n])
        most = max(most, min(float(np.max(np.abs(J @ step - expected) / size)) for J in sides))
    text = f"with {place} at its kink, the error of the linear model {how} is {most:.1e}"
    return measured(most, ONE_SIDED, text, trial.place("balance", "wire"))
