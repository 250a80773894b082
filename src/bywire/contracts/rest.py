"""Contracts of dry friction: rest is exact, and no friction hides in the smooth equations."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import casadi as ca
import numpy as np

from bywire.contracts.evidence import Evidence, NotCheckedError, measured
from bywire.contracts.trial import Trial, states
from bywire.core.signals import signals_of
from bywire.simulation.contacts import contact_forces
from bywire.simulation.run import simulate
from bywire.simulation.symbols import SX

SHARES = (1.0, 0.1, 1e-2, 1e-3, 1e-4)
"""of the controllers' moves, until what has dry friction rests all through the run"""
INSIDE = 0.9
"""of a friction's bounds: a force within holds at the start"""
SLOW = (1e-4, 1e-3, 1e-2)
"""of a usual speed: what is so slow feels next to nothing of a smooth force"""
HIDDEN = 0.1
"""of the force up to the usual speed, by which it may come sooner than in proportion to speed"""
GROWN = 0.3
"""the same of a dry friction's bounds, up to a tenth of the usual speed"""


def rests_exactly(trial: Trial) -> Iterator[Evidence]:
    """Find whether velocities with dry friction are zero, not small, below breakaway."""
    start, place = trial.start, trial.place("bounds", "friction")
    if not trial.model.frictions:
        raise NotCheckedError("the model declares no dry friction")
    names = start.state._fields
    yield from _contain_zero(trial)
    holds = _holds_at_start(trial)
    waiting = {name for name, share in holds.items() if share < INSIDE}
    if not waiting:
        raise NotCheckedError(f"at {start.known} nothing is held by dry friction")
    for amount in SHARES:
        run = states(simulate(trial.drive.run(amount)), names)
        for name in sorted(waiting):
            if not run[:, names.index(name)].any():
                waiting.discard(name)
                text = f"{name} is exactly zero at {amount:g} of the controllers' moves"
                yield Evidence(True, text, place=place)
    for name in sorted(waiting):  # what else loads it may move it later, as a disc's run-out does
        first = float(run[1, names.index(name)])
        text = (
            f"{name} is {first:.2g} after a sample time at {SHARES[-1]:g} of the controllers' "
            f"moves, where {holds[name]:.2g} of its friction would hold it"
        )
        yield Evidence(first == 0.0, text, place=place)


def _holds_at_start(trial: Trial) -> dict[str, float]:
    """Return for all that stands how much of its dry friction the start takes."""
    start, model = trial.start, trial.model
    x, shares = start.state, {}
    contact = _forces(trial, SX(ca.DM(list(x))))
    balance = model.balance(x, x, start.memory, start.par, contact)
    bounds = model.bounds(x, x, start.memory, start.par, contact)
    for name, pair in zip(model.frictions, bounds, strict=True):
        if getattr(x, name) == 0.0:
            low, high = (float(ca.evalf(SX(value))) for value in pair)
            needed = -float(ca.evalf(SX(getattr(balance, name))))
            bound = high if needed > 0.0 else low
            shares[name] = needed / bound if bound else math.inf
    return shares


def hides_no_friction(trial: Trial) -> Iterator[Evidence]:
    """Find whether the balance of a velocity jumps where it turns, as hidden friction does."""
    state = signals_of(trial.model.State)
    speeds = [n for n, s in state.items() if s.unit in ("rad/s", "m/s")]
    if not speeds:
        raise NotCheckedError("no state is a speed")
    for name in trial.model.frictions:
        yield _same_at_rest(trial, name)
    place = trial.place("balance", "wire")
    contact = _forces(trial, SX(ca.DM(list(trial.start.state))))
    for name in speeds:
        nominal = state[name].nominal
        far = _change(trial, contact, name, nominal)
        shares = [_change(trial, contact, name, r * nominal) / far if far else 0.0 for r in SLOW]
        sooner = max(share - r for share, r in zip(shares, SLOW, strict=True))
        text = f"the smooth force against {name} comes {sooner:.2g} sooner than with its speed"
        if sooner > HIDDEN:
            text += ": declare this friction in frictions and bounds, and it will not creep"
        yield measured(sooner, HIDDEN, text, place)


def _contain_zero(trial: Trial) -> Iterator[Evidence]:
    """Yield whether the bounds of every friction have zero between them."""
    start, model = trial.start, trial.model
    contact = _forces(trial, SX(ca.DM(list(start.state))))
    bounds = model.bounds(start.state, start.state, start.memory, start.par, contact)
    for name, pair in zip(model.frictions, bounds, strict=True):
        low, high = (float(ca.evalf(SX(value))) for value in pair)
        text = f"the friction of {name} is between {low:.3g} and {high:.3g}"
        if not low <= 0.0 <= high:
            text += ": wanted is low <= 0 <= high"
        yield Evidence(low <= 0.0 <= high, text, place=trial.place("bounds", "friction"))


def _same_at_rest(trial: Trial, name: str) -> Evidence:
    """Return whether bounds come up with speed that are not there at rest."""
    nominal = signals_of(trial.model.State)[name].nominal
    rest, far = (_bounds_at(trial, name, r * nominal) for r in (0.0, 1.0))
    slow = {r: _bounds_at(trial, name, r * nominal) for r in (*SLOW, 0.1)}
    sooner = max((width - rest) / far - r if far else 0.0 for r, width in slow.items())
    text = f"the bounds of {name} grow by {sooner:.2g} more than with its speed"
    if sooner > GROWN:
        text += ": so it creeps; a friction must hold as much at rest"
    return measured(sooner, GROWN, text, trial.place("bounds", "friction"))


def _bounds_at(trial: Trial, name: str, speed: float) -> float:
    """Return the width between the bounds of a friction at a speed of its own velocity."""
    start, model = trial.start, trial.model
    x = start.state._replace(**{name: speed})
    contact = _forces(trial, SX(ca.DM(list(x))))
    bounds = model.bounds(x, x, start.memory, start.par, contact)
    low, high = bounds[model.frictions.index(name)]
    return float(ca.evalf(SX(high) - SX(low)))


def _change(trial: Trial, contact: tuple[float, ...], name: str, speed: float) -> float:
    """Return by how much the balance of a velocity differs between both directions."""
    start, forces = trial.start, []
    for sign in (1.0, -1.0):
        x = start.state._replace(**{name: sign * speed})
        balance = trial.model.balance(x, x, start.memory, start.par, contact)
        forces.append(float(ca.evalf(SX(getattr(balance, name)))))
    change = abs(forces[0] - forces[1])
    return change if change > 1e-12 * max(map(abs, forces)) else 0.0


def _forces(trial: Trial, column: Any) -> tuple[float, ...]:
    """Return the contact forces at a state."""
    forces = contact_forces(trial.model, trial.start.par, column)
    return tuple(float(f) for f in np.asarray(ca.evalf(forces)).ravel())
