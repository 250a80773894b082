"""Contracts of dry friction: rest is exact, and no friction hides in the smooth equations."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import casadi as ca
import numpy as np

from bywire.contracts.evidence import Evidence, NotCheckedError, measured
from bywire.contracts.probe import states
from bywire.contracts.trial import Trial
from bywire.core.signals import signals_of
from bywire.simulation.contact_set import contact_forces
from bywire.simulation.run import simulate
from bywire.simulation.symbols import SX

SHARES = (1.0, 0.1, 1e-2, 1e-3, 1e-4, 0.0)
"""of the controllers' moves, until what has dry friction rests all through the run"""
INSIDE = 0.9
"""of a friction's bounds: a force within holds at the start"""
NEAR = 1e-4
"""of a usual speed: what is so slow feels a smooth force of next to nothing"""
HIDDEN = 0.03
"""of the force's change up to the usual speed, that may come within `NEAR`"""


def rests_exactly(trial: Trial) -> Iterator[Evidence]:
    """Find whether velocities with dry friction are zero, not small, below breakaway."""
    start, place = trial.start, trial.place("bounds", "friction")
    if not trial.model.frictions:
        raise NotCheckedError("the model declares no dry friction")
    names = start.state._fields
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
            f"{name} is {first:.2g} after a sample time without any move of the controllers, where "
            f"{holds[name]:.2g} of its friction would hold it"
        )
        yield Evidence(first == 0.0, text, place=place)


def _holds_at_start(trial: Trial) -> dict[str, float]:
    """Return for all that stands how much of its dry friction the start takes."""
    start, model = trial.start, trial.model
    x, found = start.state, {}
    contact = _forces(trial, SX(ca.DM(list(x))))
    balance = model.balance(x, x, start.memory, start.par, contact)
    bounds = model.bounds(x, x, start.memory, start.par, contact)
    for name, pair in zip(model.frictions, bounds, strict=True):
        if getattr(x, name) == 0.0:
            low, high = (float(ca.evalf(SX(value))) for value in pair)
            needed = -float(ca.evalf(SX(getattr(balance, name))))
            bound = high if needed > 0.0 else low
            found[name] = needed / bound if bound else math.inf
    return found


def hides_no_friction(trial: Trial) -> Iterator[Evidence]:
    """Find whether the balance of a velocity jumps where it turns, as hidden friction does."""
    state = signals_of(trial.model.State)
    speeds = [n for n, s in state.items() if s.unit in ("rad/s", "m/s")]
    if not speeds:
        raise NotCheckedError("no state is a speed")
    for name in trial.model.frictions:
        yield _same_at_rest(trial, name)
    place = trial.place("balance", "wire")
    for name in speeds:
        near, far = (_change(trial, name, r * state[name].nominal) for r in (NEAR, 1.0))
        share = near / far if far else 0.0
        text = f"{share:.2g} of the smooth force against {name} comes below {NEAR:g} of its speed"
        if share > HIDDEN:
            text += ": declare this friction in frictions and bounds, and it will not creep"
        yield measured(share, HIDDEN, text, place)


def _same_at_rest(trial: Trial, name: str) -> Evidence:
    """Return whether bounds that are zero at rest come up at once when something moves."""
    nominal = signals_of(trial.model.State)[name].nominal
    k = trial.model.frictions.index(name)
    rest, near, far = (_bounds_at(trial, r * nominal)[k] for r in (0.0, NEAR, 1.0))
    share = (near - rest) / far if far else 0.0
    text = f"the bounds of {name} grow by {share:.2g} of themselves below {NEAR:g} of its speed"
    if share > HIDDEN:
        text += ": so it creeps; a friction must hold as much at rest"
    return measured(share, HIDDEN, text, trial.place("bounds", "friction"))


def _bounds_at(trial: Trial, speed: float) -> list[float]:
    """Return the width between the bounds of every friction, each at a speed in turn."""
    start, model = trial.start, trial.model
    found = []
    for k, name in enumerate(model.frictions):
        x = start.state._replace(**{name: speed})
        column = SX(ca.DM(list(x)))
        contact = _forces(trial, column)
        low, high = model.bounds(x, x, start.memory, start.par, contact)[k]
        found.append(float(ca.evalf(SX(high) - SX(low))))
    return found


def _change(trial: Trial, name: str, speed: float) -> float:
    """Return by how much the balance of a velocity differs between both directions."""
    start, forces = trial.start, []
    for sign in (1.0, -1.0):
        x = start.state._replace(**{name: sign * speed})
        contact = _forces(trial, SX(ca.DM(list(start.state))))
        balance = trial.model.balance(x, x, start.memory, start.par, contact)
        forces.append(float(ca.evalf(SX(getattr(balance, name)))))
    change = abs(forces[0] - forces[1])
    return change if change > 1e-12 * max(map(abs, forces)) else 0.0


def _forces(trial: Trial, column: Any) -> tuple[float, ...]:
    """Return the contact forces at a state."""
    forces = contact_forces(trial.model, trial.start.par, column)
    return tuple(float(f) for f in np.asarray(ca.evalf(forces)).ravel())


