"""Contract of a model's equations: every member gives the dimensions that its signals say."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from bywire.contracts.dimensioned import Dimensioned, fits
from bywire.contracts.evidence import Evidence, place_of
from bywire.contracts.trial import Trial
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.signals import Signal, signals_of

OFF = 0.37
"""how far from the start equations are evaluated, of usual magnitudes: away from their zeros"""


def has_its_units(trial: Trial) -> Iterator[Evidence]:
    """Find whether the model's members give the dimensions of its signals."""
    model, start = trial.model, trial.start
    par = with_units(start.par)
    x, m = _moved(start.state), _moved(start.memory)
    second = Dimensioned(1.0, "s")
    contact = _contact(model, x, par)
    mass, balance = model.mass(x, par), model.balance(x, x, m, par, contact)
    states = signals_of(model.State)
    for name in states:
        unit = f"({states[name].unit})/s"
        rate = getattr(balance, name) / _at_least_one(getattr(mass, name))
        yield _fits(f"rate of {name}", rate, unit, trial, "balance", "wire")
    bounds = model.bounds(x, x, m, par, contact)
    for name, pair in zip(model.frictions, bounds, strict=True):
        for value in pair:
            rate, unit = value / _at_least_one(getattr(mass, name)), f"({states[name].unit})/s"
            yield _fits(f"bound of {name} over its mass", rate, unit, trial, "bounds", "friction")
    reaction = tuple(
        _at_least_one(getattr(mass, name)) * Dimensioned(0.1, states[name].unit) / second
        for name in (*model.frictions, *model.limits)
    )
    rates = type(x)(*(Dimensioned(0.1, s.unit) / second for s in states.values()))
    powers = model.powers(x, x, rates, m, par, contact, reaction)
    for name, signal in signals_of(model.Flow).items():
        unit = f"({signal.unit})/s"
        yield _fits(f"power of {name}", getattr(powers, name), unit, trial, "powers", "power")
    flow = _carrying(model.Flow, {n: 0.1 * s.nominal for n, s in signals_of(model.Flow).items()})
    recorded = model.output(x, m, par, contact, reaction, flow)
    yield from _all_fit("recorded ", recorded, signals_of(model.Output), trial, "record")
    u = _moved(start.stimulus)
    for task in model.tasks(start.par):
        held = task.tick(x, m, u, par)
        place = place_of(task.tick)
        for evidence in _all_fit(f"{task.name}: ", held, signals_of(model.Memory), trial, "tasks"):
            yield Evidence(evidence.holds, evidence.text, place=place)


def with_units(par: ParameterSet) -> ParameterSet:
    """Return a parameter set whose numbers carry their units."""
    known = leaf_fields(type(par))
    values = {}
    for name, value in par.leaves().items():
        leaf = known.get(name) or known[name.rpartition(".")[0]]  # a node of a table
        values[name] = Dimensioned(value, leaf.unit.symbol)
    return par.with_leaves(values)


def _moved(signals: Any) -> Any:
    kind: Any = type(signals)
    known = signals_of(kind)
    values = {n: s.within(getattr(signals, n) + OFF * s.nominal) for n, s in known.items()}
    return _carrying(kind, values)


def _carrying(kind: Any, values: Mapping[str, float]) -> Any:
    known = signals_of(kind)
    return kind(*(Dimensioned(values[name], signal.unit) for name, signal in known.items()))


def _contact(model: Any, x: Any, par: Any) -> tuple[Any, ...]:
    """Return forces of the contacts: overlaps over compliances, of either sign."""
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
    text = f"{what} is {value}, wanted {unit}"
    return Evidence(fits(value, unit), text, place=trial.place(*members))
