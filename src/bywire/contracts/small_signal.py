"""Contract of a model's linear model: it is what small motions of the plant do."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.linalg import expm

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import Friction, linearize
from bywire.contracts.evidence import Evidence, NotCheckedError, measured
from bywire.contracts.probe import states
from bywire.contracts.trial import Trial
from bywire.core.errors import InputError, SolverError
from bywire.core.signals import signals_of
from bywire.core.typing import Array
from bywire.simulation.run import simulate

SMALL = (1e-4, 1e-5)
"""of the controllers' moves: what is nonlinear falls from one to the next"""
MISMATCH = 0.02
"""by how much the responses may differ, of the larger one's largest value"""
AT_REST = 1e-3
"""of usual magnitudes in a second: a start that drifts so slowly is an equilibrium"""


def is_its_linear_model(trial: Trial) -> Iterator[Evidence]:
    """Find whether the linear model of the plant gives its response to small moves.

    Without dry friction where the start is an equilibrium of the smooth equations; else with what
    has friction held fast.
    """
    start = trial.start
    linear, removed = _linear(trial)
    names = start.state._fields
    period, step = start.period, start.step / 4
    place = trial.place("balance", "wire")
    try:
        base = states(simulate(trial.drive.run(0.0, step, not removed)), names)
        runs = [states(simulate(trial.drive.run(s, step, not removed)), names) for s in SMALL]
    except SolverError as error:
        raise NotCheckedError(f"the small run from {start.known} fails: {error}") from error
    wanted = _response(linear, trial.drive.rows[: len(base)], period)
    deviations = [(run - base) / share for run, share in zip(runs, SMALL, strict=True)]
    nominal = [abs(s.nominal) for s in signals_of(trial.model.State).values()]
    moving = 0
    for k, name in enumerate(names):
        exact, size = wanted[:, k], float(np.abs(wanted[:, k]).max())
        floor = 1e-11 * max(float(np.abs(base[:, k]).max()), nominal[k]) / SMALL[-1]
        size = max(size, float(np.abs(deviations[-1][:, k]).max()))
        if size <= floor / MISMATCH:
            continue
        moving += 1
        off = min(float(np.abs(run[:, k] - exact).max()) for run in deviations) / size
        how = "without dry friction" if removed else "with what has friction held"
        text = f"{name} differs from its linear response by {off:.1e} of its largest value, {how}"
        yield measured(off, MISMATCH, text, place)
    if not moving:
        raise NotCheckedError(f"from {start.known} the controllers move no state")


def _linear(trial: Trial) -> tuple[LinearModel, bool]:
    """Return the linear model, and whether dry friction is removed in it."""
    start = trial.start
    reasons = []
    nominal = np.array([s.nominal for s in signals_of(trial.model.State).values()])
    choices: tuple[Friction, ...] = ("removed", "stuck") if trial.model.frictions else ("removed",)
    for friction in choices:
        try:
            linear = linearize(
                trial.model, start.par, start.state, start.memory,
                inputs=start.memory._fields, outputs=(), friction=friction,
            )  # fmt: skip
        except InputError as error:
            reasons.append(str(error))
            continue
        drift = float(np.abs(linear.rate / nominal).max())
        if drift <= AT_REST:
            return linear, friction == "removed"
        name = linear.states[int(np.argmax(np.abs(linear.rate / nominal)))]
        reasons.append(f"at {start.known} {name} is not at rest")
    raise NotCheckedError("; ".join(dict.fromkeys(reasons)))


def _response(linear: LinearModel, inputs: Array, period: float) -> Array:
    """Return the states under inputs that are held for a sample time, shape (rows, states)."""
    n, m = linear.B.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = linear.A, linear.B
    over = expm(block * period)
    ahead, driven = over[:n, :n], over[:n, n:]
    rows = [np.zeros(n)]
    for held in inputs[:-1]:
        rows.append(ahead @ rows[-1] + driven @ held)
    return np.array(rows)
