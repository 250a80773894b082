"""Contracts of a model's runs: order of the step, and one result of every engine."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from bywire.contracts.evidence import Evidence, NotCheckedError, measured
from bywire.contracts.probe import states
from bywire.contracts.start import Start
from bywire.contracts.trial import LARGE, Trial, constants, lanes
from bywire.core.errors import SolverError
from bywire.core.signals import signals_of
from bywire.core.typing import Array
from bywire.simulation.compiler import find_compiler
from bywire.simulation.run import simulate

ORDER = 2.0
SHORTFALL = 0.3
"""by how much the observed order may fall short of two; a model of first order is off by one"""
HALVINGS = 4
SMOOTH_SHARES = (1.0, 0.3, 0.1)
SHARES = (1.0, 0.5, 0.25, 0.12, 0.06, 0.03)
"""of the controllers' moves: where stick and slip change instants, one run's errors scatter"""
SCATTER = 0.2
"""least standard error of the order of one run: a few errors may lie on a line by chance"""
ROUNDING = 1e-12
"""of a state's largest or usual magnitude: differences below it tell nothing of the step"""
AGREEMENT = 1e-9
"""by how much engines may differ, of the largest value of a signal in the run, which counts at
least a thousandth of the usual one"""
_VIRTUAL = 0.02  # length [s] of the run that is repeated without a compiler


def is_of_second_order(trial: Trial) -> Iterator[Evidence]:
    """Find whether every state of the plant converges with the square of the substep.

    Without dry friction, and with it: a substep in which a velocity turns round is cut there.
    """
    orders = list(_orders(trial, False, ORDER))
    if not orders:
        raise NotCheckedError(f"from {trial.start.known} no state moves enough to tell it")
    yield from orders
    if trial.model.frictions:
        yield from _orders(trial, True, ORDER)


def _orders(trial: Trial, frictions: bool, wanted: float) -> Iterator[Evidence]:
    """Yield what is found of every state that moves enough to tell it."""
    start = trial.start
    steps = [start.step / 2**k for k in range(HALVINGS + 1)]
    names = start.state._fields
    nominal = np.array([abs(s.nominal) for s in signals_of(trial.model.State).values()])
    errors = []
    for share in SHARES if frictions else SMOOTH_SHARES:
        try:
            runs = [
                states(simulate(trial.drive.run(share, step, frictions)), names) for step in steps
            ]
        except SolverError:  # what runs away without its friction
            continue
        floor = ROUNDING * np.maximum(np.abs(runs[-1]).max(axis=0), nominal)
        changes = [np.sqrt(np.mean((a - b) ** 2, axis=0)) for a, b in pairwise(runs)]
        errors.append(np.where(changes > floor, changes, np.nan))
    for k, name in enumerate(names if errors else ()):
        order, doubt = _observed(np.array(errors)[:, :, k])
        if doubt < SHORTFALL:
            how = "with" if frictions else "without"
            text = (
                f"{name} converges with order {order:.2f} +- {doubt:.2f} in the substep {how} dry "
                f"friction, wanted is {wanted:g}"
            )
            place = trial.place("balance", "wire")
            yield measured(max(wanted - order - doubt, 0.0), SHORTFALL, text, place)


def _observed(errors: Array) -> tuple[float, float]:
    """Return the order with which errors fall, and twice its standard error.

    The mean over the runs, those counting most whose errors lie on a line.

    Parameters
    ----------
    errors
        Of every run at every halving of the step, shape (runs, halvings).
    """
    logs = np.log2(errors)
    logs = logs[np.isfinite(logs).all(axis=1)]
    if not logs.size:
        return math.nan, math.inf
    halving = np.arange(HALVINGS) - 0.5 * (HALVINGS - 1)
    spread = float(np.sum(halving**2))
    slopes = logs @ halving / spread
    rest = logs - logs.mean(axis=1, keepdims=True) - slopes[:, None] * halving
    variances = np.sum(rest**2, axis=1) / (HALVINGS - 2) / spread + SCATTER**2
    total = float(np.sum(1.0 / variances))
    return -float(np.sum(slopes / variances)) / total, 2.0 / math.sqrt(total)


def has_agreeing_engines(trial: Trial) -> Iterator[Evidence]:
    """Find whether the compiled kernel and the virtual machine compute one run."""
    if find_compiler() is None:
        raise NotCheckedError("there is no C compiler: install the extra bywire[compiler]")
    run = trial.start.run(LARGE, duration=_duration(trial.start))
    compiled = simulate(run, engine="compiled")
    virtual = simulate(run, engine="virtual-machine")
    yield from _agree(
        compiled.values, virtual.values, type(trial.model).Output, "the virtual machine", trial
    )


def has_agreeing_lanes(trial: Trial) -> Iterator[Evidence]:
    """Find whether an ensemble's lanes compute what the single run does."""
    if find_compiler() is None:
        raise NotCheckedError("there is no C compiler: install the extra bywire[compiler]")
    run = trial.large_run(frictions=True)
    name, value = next(iter(constants(run)))
    lane = lanes(run, {name: [value]})[0]
    yield from _agree(simulate(run).values, lane, run.model.Output, "a lane", trial)


def _duration(start: Start) -> float:
    return max(_VIRTUAL, 2.0 * start.period)


def _agree(
    first: Array, second: Array, signals: Any, what: str, trial: Trial
) -> Iterator[Evidence]:
    known = signals_of(signals)
    for k, (name, signal) in enumerate(known.items()):
        scale = max(float(np.abs(first[:, k]).max()), 1e-3 * abs(signal.nominal))
        off = float(np.abs(first[:, k] - second[:, k]).max()) / scale
        text = f"{name} of {what} is off by {off:.1e} of its largest value"
        yield measured(off, AGREEMENT, text, trial.place("output", "record"))
