"""Contracts of a model: units, runs, energies, sensitivities, and dry friction at rest."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from bywire.bench.energy_ledger import Ledger, actuator_ledger, further_ledgers
from bywire.bench.faults.modes import modes_of
from bywire.bench.recording import record
from bywire.contracts.dimensioned import Dimensioned, fits
from bywire.contracts.element_contracts import set_keeps_its_ranges, set_survives_json
from bywire.contracts.evidence import (
    Contract,
    Demand,
    Demands,
    Evidence,
    NotCheckedError,
    measured,
    place_of,
)
from bywire.contracts.small_signal import is_its_linear_model, is_linear_beside_its_corners
from bywire.contracts.trial import LARGE, Start, Trial, constants, lanes, states
from bywire.core.errors import ParameterError, SolverError
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.signals import Signal, signals_of
from bywire.core.typing import Array
from bywire.simulation.compiler import find_compiler
from bywire.simulation.contacts import contact_forces
from bywire.simulation.run import Run, simulate
from bywire.simulation.sensitivity import simulate_with_sensitivities
from bywire.simulation.symbols import SX

SLOW_SHARES = (1.0, 0.1, 1e-2, 1e-3, 1e-4)
"""fractions of the controllers' moves, tried until all velocities with dry friction stay at rest"""
INSIDE = 0.9
"""fraction of a friction's bounds within which friction holds a force at the start"""
SLOW = (1e-4, 1e-3, 1e-2)
"""speeds at which smooth forces are negligible, relative to the usual speed"""
HIDDEN = 0.1
"""maximum excess over a force proportional to speed, relative to the force at the usual speed"""
GROWN = 0.3
"""the same limit for the bounds of dry friction, up to a tenth of the usual speed"""


def rests_exactly(trial: Trial) -> Iterator[Evidence]:
    """Check that velocities with dry friction are exactly zero below breakaway, not just small."""
    start, place = trial.start, trial.place("bounds", "friction")
    if not trial.model.frictions:
        raise NotCheckedError("the model declares no dry friction")
    names = start.state._fields
    yield from _contain_zero(trial)
    holds = _holds_at_start(trial)
    waiting = {name for name, share in holds.items() if share < INSIDE}
    if not waiting:
        raise NotCheckedError(f"at {start.known}, dry friction does not hold any velocity at zero")
    for amount in SLOW_SHARES:
        run = states(simulate(trial.drive.run(amount)), names)
        for name in sorted(waiting):
            if not run[:, names.index(name)].any():
                waiting.discard(name)
                text = f"{name} stays exactly zero at {amount:g} of the controllers' moves"
                yield Evidence(True, text, place=place)
    for name in sorted(waiting):  # other loads, such as disc runout, may move the body later
        first = float(run[1, names.index(name)])
        text = (
            f"{name} is {first:.2g} after one sample time at {SLOW_SHARES[-1]:g} of the "
            f"controllers' moves, but {holds[name]:.2g} of its friction would hold it at zero"
        )
        yield Evidence(first == 0.0, text, place=place)


def _holds_at_start(trial: Trial) -> dict[str, float]:
    """Return the fraction of dry friction that holds each velocity that is zero at the start."""
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
    """Check that balances do not jump when a velocity reverses, which would be hidden friction."""
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
        text = (
            f"at low speed, the smooth force against {name} exceeds a proportional force by "
            f"{sooner:.2g} of the force at the usual speed"
        )
        if sooner > HIDDEN:
            text += ". Declare this friction in frictions and bounds to prevent creep"
        yield measured(sooner, HIDDEN, text, place)


def _contain_zero(trial: Trial) -> Iterator[Evidence]:
    """Check that the bounds of each friction include zero."""
    start, model = trial.start, trial.model
    contact = _forces(trial, SX(ca.DM(list(start.state))))
    bounds = model.bounds(start.state, start.state, start.memory, start.par, contact)
    for name, pair in zip(model.frictions, bounds, strict=True):
        low, high = (float(ca.evalf(SX(value))) for value in pair)
        text = f"the friction of {name} is between {low:.3g} and {high:.3g}"
        if not low <= 0.0 <= high:
            text += ". The bounds must satisfy low <= 0 <= high"
        yield Evidence(low <= 0.0 <= high, text, place=trial.place("bounds", "friction"))


def _same_at_rest(trial: Trial, name: str) -> Evidence:
    """Check that a friction's bounds at rest are as wide as at low speed."""
    nominal = signals_of(trial.model.State)[name].nominal
    rest, far = (_bounds_at(trial, name, r * nominal) for r in (0.0, 1.0))
    slow = {r: _bounds_at(trial, name, r * nominal) for r in (*SLOW, 0.1)}
    sooner = max((width - rest) / far - r if far else 0.0 for r, width in slow.items())
    text = (
        f"at low speed, the friction bounds of {name} grow by {sooner:.2g} more than in proportion "
        "to speed"
    )
    if sooner > GROWN:
        text += ", so the body creeps. Use the same bounds at rest"
    return measured(sooner, GROWN, text, trial.place("bounds", "friction"))


def _bounds_at(trial: Trial, name: str, speed: float) -> float:
    """Return the distance between a friction's bounds at a speed of its own velocity."""
    start, model = trial.start, trial.model
    x = start.state._replace(**{name: speed})
    contact = _forces(trial, SX(ca.DM(list(x))))
    bounds = model.bounds(x, x, start.memory, start.par, contact)
    low, high = bounds[model.frictions.index(name)]
    return float(ca.evalf(SX(high) - SX(low)))


def _change(trial: Trial, contact: tuple[float, ...], name: str, speed: float) -> float:
    """Return the difference of a velocity's balance between the two directions."""
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


# --- Contracts of a model and of its parameter sets: units, runs, energies, sensitivities

OFF = 0.37
"""distance from the start to the evaluation point, in usual magnitudes, which avoids zeros"""


def has_its_units(trial: Trial) -> Iterator[Evidence]:
    """Check that the model's functions have the dimensions of its signals."""
    model, start = trial.model, trial.start
    par = with_units(start.par)
    x, m = _moved_signals(start.state), _moved_signals(start.memory)
    second = Dimensioned(1.0, "s")
    contact = _contact(model, x, par)
    mass, balance = model.mass(x, par), model.balance(x, x, m, par, contact)
    states = signals_of(model.State)
    for name in states:
        unit = f"({states[name].unit})/s"
        rate = getattr(balance, name) / _at_least_one(getattr(mass, name))
        yield _fits(f"the rate of {name}", rate, unit, trial, "balance", "wire")
    bounds = model.bounds(x, x, m, par, contact)
    for name, pair in zip(model.frictions, bounds, strict=True):
        for value in pair:
            rate, unit = value / _at_least_one(getattr(mass, name)), f"({states[name].unit})/s"
            what = f"the bound of {name} divided by its mass"
            yield _fits(what, rate, unit, trial, "bounds", "friction")
    reaction = tuple(
        _at_least_one(getattr(mass, name)) * Dimensioned(0.1, states[name].unit) / second
        for name in (*model.frictions, *model.limits, *model.stops)
    )
    widths = model.widths(x, x, m, par, contact)
    for name, value in zip(model.stops, widths, strict=True):
        yield _fits(f"width of {name}", value, states[name].unit, trial, "widths", "wire")
    rates = type(x)(*(Dimensioned(0.1, s.unit) / second for s in states.values()))
    powers = model.powers(x, x, rates, m, par, contact, reaction)
    for name, signal in signals_of(model.Flow).items():
        unit = f"({signal.unit})/s"
        yield _fits(f"the power of {name}", getattr(powers, name), unit, trial, "powers", "power")
    flow = _carrying(model.Flow, {n: 0.1 * s.nominal for n, s in signals_of(model.Flow).items()})
    recorded = model.output(x, m, par, contact, reaction, flow)
    yield from _all_fit("recorded ", recorded, signals_of(model.Output), trial, "record")
    u = _moved_signals(start.stimulus)
    for task in model.tasks(start.par):
        held = task.tick(x, m, u, par)
        place = place_of(task.tick)
        for evidence in _all_fit(f"{task.name}: ", held, signals_of(model.Memory), trial, "tasks"):
            yield Evidence(evidence.holds, evidence.text, place=place)


def with_units(par: ParameterSet) -> ParameterSet:
    """Return a parameter set whose numbers have units."""
    known = leaf_fields(type(par))
    values = {}
    for name, value in par.leaves().items():
        leaf = known.get(name) or known[name.rpartition(".")[0]]  # a node of a table
        values[name] = Dimensioned(value, leaf.unit.symbol)
    return par.with_leaves(values)


def _moved_signals(signals: Any) -> Any:
    kind: Any = type(signals)
    known = signals_of(kind)
    values = {n: s.within(getattr(signals, n) + OFF * s.nominal) for n, s in known.items()}
    return _carrying(kind, values)


def _carrying(kind: Any, values: Mapping[str, float]) -> Any:
    known = signals_of(kind)
    return kind(*(Dimensioned(values[name], signal.unit) for name, signal in known.items()))


def _contact(model: Any, x: Any, par: Any) -> tuple[Any, ...]:
    """Return contact forces of either sign: overlaps divided by compliances."""
    forces: list[Any] = []
    for group, matrix in zip(model.gap(x, x, par), model.compliance(par), strict=True):
        forces += [d / matrix[k][k] for k, d in enumerate(group)]
    return tuple(forces)


def _at_least_one(mass: Any) -> Any:
    return mass if isinstance(mass, Dimensioned) else Dimensioned(float(mass))


def _all_fit(
    prefix: str, values: Sequence[Any], known: Mapping[str, Signal], trial: Trial, member: str
) -> Iterator[Evidence]:
    for (name, signal), value in zip(known.items(), values, strict=True):
        yield _fits(f"{prefix}{name}", value, signal.unit, trial, "output", member)


def _fits(what: str, value: Any, unit: str, trial: Trial, *members: str) -> Evidence:
    text = f"{what} is {value}, but its unit is {unit}"
    return Evidence(fits(value, unit), text, place=trial.place(*members))


# --- Energy balance: a run's energy input equals losses plus stored energy

RESIDUAL = 1e-6
"""maximum residual after subtraction of the numerical error, relative to the energy turnover"""
ENERGY_SHARES = (LARGE, 0.05)


def closes_its_energy(trial: Trial) -> Iterator[Evidence]:
    """Check that the energy balances of a large and of a small run close.

    The numerical error is proportional to the square of the step. The check computes this error
    from the residuals at two steps, and subtracts it.
    """
    place = trial.place("powers", "power")
    for share in ENERGY_SHARES:
        run = trial.start.run(share)
        coarse, fine = (_ledgers(replace(run, step=run.step / n)) for n in (1, 2))
        turned = {book: each for book, each in fine.items() if each.turnover}
        if not turned:
            raise NotCheckedError(
                "the recording contains no energies (E_source, losses E_..., E_stored) that change "
                f"in a run from {trial.start.known}"
            )
        size = "large" if share == LARGE else "small"
        for book, each in turned.items():
            before = coarse[book].closing_error if book in coarse else each.closing_error
            left = (4.0 * each.closing_error - before) / 3.0 / each.turnover
            where = f" in the balance {book!r}" if book else ""
            text = (
                f"the residual{where} of a {size} run is {abs(left):.1e} of the "
                f"{each.turnover:.3g} J transferred"
            )
            yield measured(abs(left), RESIDUAL, text, place)


def _ledgers(run: Run) -> dict[str, Ledger]:
    """Return the energy balances of a run by name; the first balance has an empty name."""
    recording = record(run, simulate(run), 0.0, 0.0, {})
    first = actuator_ledger(recording)
    return {"": first, **further_ledgers(recording)}


# --- Sensitivities: exact derivatives of a run equal finite differences

PARAMETERS = 8
"""number of tested parameters, which have the largest effect on the states"""
INFLUENCE = 1e-3
"""relative change of a parameter for ranking its influence"""
DIFFERENCE = 1e-6
"""relative step of the finite differences"""
SLOPE = 1e-3
"""maximum median error of a derivative over time, relative to the largest one of all states"""


def has_its_derivatives(trial: Trial) -> Iterator[Evidence]:
    """Check that derivatives of states with respect to parameters equal finite differences.

    The runs have no dry friction and no controllers that round. The times of breakaway and reversal
    depend on a parameter. Exact derivatives include this effect to within a few percent, but finite
    differences do not.
    """
    if find_compiler() is None:
        raise NotCheckedError("there is no C compiler. Install the extra bywire[compiler]")
    run = trial.large_run(frictions=False)
    names = [f"x_{name}" for name in trial.model.State._fields]
    chosen = _strongest(trial, run)
    if not chosen:
        raise NotCheckedError(f"from {trial.start.known}, no parameter affects any state")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # converters warn, but these runs contain only the plant
        exact = simulate_with_sensitivities(run, tuple(chosen), names)
    at = run.par.leaves()
    ahead = {name: [at[name]] * 2 * len(chosen) for name in chosen}
    for k, name in enumerate(chosen):
        ahead[name][2 * k : 2 * k + 2] = [_moved(run, name, sign * DIFFERENCE) for sign in (1, -1)]
    values = lanes(run, ahead)[:, :, : len(names)]
    whose = "the plant alone" if trial.rounds else "the run"
    nominal = np.array([abs(s.nominal) for s in signals_of(trial.model.State).values()])
    for k, name in enumerate(chosen):
        width = ahead[name][2 * k] - ahead[name][2 * k + 1]
        differences = (values[2 * k] - values[2 * k + 1]) / width / nominal
        slopes = exact.derivatives[:, :, k] / nominal
        rounding = np.abs(values[2 * k]).max(axis=0) * 1e-12 / width / nominal
        largest = float(max(np.abs(slopes).max(), np.abs(differences).max()))
        if largest * SLOPE <= rounding.max():
            continue  # rounding hides the effect of this parameter on the states
        # Use the median, because the times of closing contacts move, which fixed steps hide.
        off = np.median(np.abs(slopes - differences), axis=0) / largest
        j = int(np.argmax(off))
        state = trial.model.State._fields[j]
        text = (
            f"the median error of d({state})/d({name}) of {whose} without dry friction is "
            f"{off[j]:.1e} of the largest derivative, in usual magnitudes"
        )
        yield measured(float(off[j]), SLOPE, text, trial.place("balance", "wire"))


def _strongest(trial: Trial, run: Run) -> list[str]:
    """Return the parameters whose relative changes have the largest effect on the states."""
    known = dict(constants(run))
    cases: dict[str, float] = {}
    for name in known:
        try:
            value = _moved(run, name, INFLUENCE)
            for number in (value, _moved(run, name, -DIFFERENCE)):  # a value may be at its limit
                run.par.replace({name: number})
        except ParameterError:
            continue
        cases[name] = value
    if not cases:
        return []
    table = {
        name: [known[name], *(cases[name] if other == name else known[name] for other in cases)]
        for name in cases
    }
    count = len(trial.model.State._fields)
    values = lanes(run, table)[:, :, :count]
    nominal = np.array([s.nominal for s in signals_of(trial.model.State).values()])
    size = np.maximum(np.ptp(values[0], axis=0), 1e-3 * np.abs(nominal))
    moved = (np.abs(values[1:] - values[0]) / size).max(axis=1).mean(axis=1)
    order = np.argsort(-moved)[:PARAMETERS]
    names = list(cases)
    return [names[k] for k in order if moved[k] > 1e-9]


def _moved(run: Run, name: str, share: float) -> float:
    value = run.par.leaves()[name]
    return value + share * (abs(value) or leaf_fields(type(run.par))[name].unit.nominal)


# --- Runs: order of convergence, and equal results of all engines

ORDER = 2.0
SHORTFALL = 0.3
"""maximum shortfall of the observed order; the order of an invalid model is one instead of two"""
HALVINGS = 4
SMOOTH_SHARES = (1.0, 0.3, 0.1)
SHARES = (1.0, 0.5, 0.25, 0.12, 0.06, 0.03)
"""fractions of the controllers' moves; several, because the errors of a run with stick-slip vary"""
SCATTER = 0.2
"""minimum standard error of a run's order, because a few errors may fit a line by chance"""
ROUNDING = 1e-12
"""minimum difference due to the step, relative to a state's largest or usual magnitude"""
AGREEMENT = 1e-9
"""maximum difference between engines, relative to a signal's largest value in the run or to a
thousandth of its usual magnitude, whichever is larger"""
_VIRTUAL = 0.02  # length [s] of the run that is repeated without a compiler


def is_of_second_order(trial: Trial) -> Iterator[Evidence]:
    """Check that each state of the plant converges with the square of the substep.

    This applies without and with dry friction, because a substep is cut where a velocity reverses.
    """
    orders = list(_orders(trial, False, ORDER))
    if not orders:
        raise NotCheckedError(f"from {trial.start.known}, no state moves enough for the check")
    yield from orders
    if trial.model.frictions:
        yield from _orders(trial, True, ORDER)


def _orders(trial: Trial, frictions: bool, expected: float) -> Iterator[Evidence]:
    """Yield the evidence for each state that moves enough for a check."""
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
        except SolverError:  # without its friction, the model diverges
            continue
        floor = ROUNDING * np.maximum(np.abs(runs[-1]).max(axis=0), nominal)
        changes = [np.sqrt(np.mean((a - b) ** 2, axis=0)) for a, b in pairwise(runs)]
        errors.append(np.where(changes > floor, changes, np.nan))
    for k, name in enumerate(names if errors else ()):
        order, doubt = _observed(np.array(errors)[:, :, k])
        if doubt < SHORTFALL:
            how = "with" if frictions else "without"
            text = (
                f"{how} dry friction, {name} converges with the substep at an order of "
                f"{order:.2f} +- {doubt:.2f}; the expected order is {expected:g}"
            )
            place = trial.place("balance", "wire")
            yield measured(max(expected - order - doubt, 0.0), SHORTFALL, text, place)


def _observed(errors: Array) -> tuple[float, float]:
    """Return the order of convergence, and twice its standard error.

    The order is the mean over the runs, weighted by how well their errors fit a line.

    Parameters
    ----------
    errors
        Errors of each run after each halving of the step, shape (runs, halvings).
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
    """Check that the compiled kernel and the virtual machine compute the same run."""
    if find_compiler() is None:
        raise NotCheckedError("there is no C compiler. Install the extra bywire[compiler]")
    run = trial.start.run(LARGE, duration=_duration(trial.start))
    compiled = simulate(run, engine="compiled")
    virtual = simulate(run, engine="virtual-machine")
    yield from _agree(
        compiled.values, virtual.values, type(trial.model).Output, "the virtual machine", trial
    )


def has_agreeing_lanes(trial: Trial) -> Iterator[Evidence]:
    """Check that an ensemble's lanes and a single run give the same results."""
    if find_compiler() is None:
        raise NotCheckedError("there is no C compiler. Install the extra bywire[compiler]")
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
        text = f"the error of {name} in {what} is {off:.1e} of its largest value"
        yield measured(off, AGREEMENT, text, trial.place("output", "record"))


# --- All of them

OF_A_SET: dict[str, Contract] = {
    "round trip": set_survives_json,
    "refusals": set_keeps_its_ranges,
}
"""contracts of each parameter set"""


def has_faults_of_what_is_there(trial: Trial) -> Iterator[Evidence]:
    """Check that a model's failure modes refer to known signals, tasks and parameters."""
    start = trial.start
    modes = modes_of(start.model, start.par)
    yield Evidence(True, f"{len(modes)} failure modes refer to known signals, tasks and parameters")
    for mode in modes.values():
        if mode.changes is not None and not mode.lacks(start.par):
            for name in mode.changes(start.par, mode.value):
                try:
                    start.par.value(name)
                except (AttributeError, LookupError, ValueError):
                    text = f"the fault {mode.name} changes {name}, but the model has no parameter "
                    text += "with this name"
                    yield Evidence(False, text)


OF_A_MODEL: dict[str, Contract] = {
    "units": has_its_units,
    "order of the step": is_of_second_order,
    "exact rest": rests_exactly,
    "hidden friction": hides_no_friction,
    "energy of a run": closes_its_energy,
    "engines": has_agreeing_engines,
    "lanes": has_agreeing_lanes,
    "linear model": is_its_linear_model,
    "linear model on kinks": is_linear_beside_its_corners,
    "derivatives of a run": has_its_derivatives,
    "faults": has_faults_of_what_is_there,
}
"""contracts of each model with a start and a parameter set"""


def demands_on_set(name: str, par: ParameterSet) -> Demands:
    """Yield all contracts of a parameter set."""
    for contract, test in OF_A_SET.items():
        yield Demand(contract, name, par, test)


OF_ITS_NUMBERS = ("exact rest", "hidden friction", "energy of a run")
"""model contracts that depend on a parameter set's numbers"""


def demands_on_model(name: str, trial: Trial, of_numbers: bool = False) -> Demands:
    """Yield all contracts of a model, or only those that depend on its numbers."""
    for contract, test in OF_A_MODEL.items():
        if not of_numbers or contract in OF_ITS_NUMBERS:
            yield Demand(contract, name, trial, test, trial.place())
