"""Energy balance of a run, from its recording: sources, sinks, closing error and warnings.

The role of an energy in the balance is declared by its signal (``core.signals.Role``); recordings
contain it in the attributes of their variables. Without a declared role, ``E_source`` is a source,
and ``E_stored`` and every other ``E_...`` are sinks.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from bywire.core.signals import Role, signals_of
from bywire.simulation.run import Run
from bywire.simulation.run_table import change, one_of

if TYPE_CHECKING:
    import xarray as xr

_PREFIX = "energy_"
_ROLE = tuple(each.name for each in fields(Role))


@dataclass(frozen=True)
class Posting:
    """Energy of one source or sink.

    Parameters
    ----------
    name, label
        Variable, and its label.
    energy
        Energy in J, signed: negative for a source that absorbs energy, and for a loss that returns
        energy. For the rows of several runs, an array of shape (runs,), like all derived values.
    """

    name: str
    label: str
    energy: float


@dataclass(frozen=True)
class Ledger:
    """Sources and sinks of energy over a recording."""

    sources: tuple[Posting, ...]
    sinks: tuple[Posting, ...]

    @property
    def turnover(self) -> float:
        """Energy delivered by all sources, and by sinks that deliver energy [J]."""
        given: float = sum(_positive(posting.energy) for posting in self.sources)
        return given + sum(_positive(-posting.energy) for posting in self.sinks)

    @property
    def closing_error(self) -> float:
        """Energy of the sources minus energy of the sinks [J], which is the balance's error."""
        given = sum(posting.energy for posting in self.sources)
        return given - sum(posting.energy for posting in self.sinks)


def _positive(energy: float) -> float:
    return _plain(np.maximum(energy, 0.0))


def _plain(energy: Any) -> float:
    """Return the energy of one run as a float, and those of several runs as an array."""
    several: Any = energy
    return float(energy) if np.ndim(energy) == 0 else several


def role_attributes(role: Role | None) -> dict[str, str]:
    """Return a role as attributes of a variable; no attributes without a role."""
    if role is None:
        return {}
    values = {each.name: getattr(role, each.name) for each in fields(Role)}
    return {f"{_PREFIX}{name}": str(value) for name, value in values.items() if value}


@dataclass(frozen=True)
class Delivery:
    """Energy that a loss returned, although a loss cannot deliver energy.

    Parameters
    ----------
    name, label, book
        Variable, its label, and its balance, empty for the actuator's own balance.
    energy
        Maximum returned energy in J, >= 0. For the rows of several runs, an array of shape (runs,).
    turnover
        Energy transferred in the balance in J.
    """

    name: str
    label: str
    book: str
    energy: Any
    turnover: Any


def deliveries(recording: xr.Dataset, among: Collection[str] | None = None) -> list[Delivery]:
    """Return the energy that every loss of a recording returned, in all balances.

    Work, ``W_...``, is not a loss and may have either sign. Recordings of only both ends determine
    the total. ``among``: names of the losses to check (default: all).
    """
    roles = _roles(recording, _energies(recording))
    losses = {
        name: role
        for name, role in roles.items()
        if role.side == "sink"
        and role.returns != "any"
        and name.startswith("E_")
        and (among is None or name in among)
    }
    turnovers = {
        book: _ledger(recording, book, is_split=False).turnover
        for book in dict.fromkeys(role.book for role in losses.values())
    }
    returned = []
    for name, role in losses.items():
        values = recording.variables[name].values
        # A loss that may return energy temporarily counts only at the end.
        fallen = -values[..., -1:] if role.returns else np.maximum.accumulate(values, -1) - values
        most = _plain(np.max(fallen, axis=-1))
        returned.append(
            Delivery(name, role.label, role.book, _positive(most), turnovers[role.book])
        )
    return returned


def actuator_ledger(recording: xr.Dataset, is_split: bool = True) -> Ledger:
    """Return the energy balance of an actuator or rig, between the ends of a recording.

    ``recording``: recording with energies [J]. If there is no such balance, for example for a
    vehicle without actuators, the result is the first of the other balances. ``is_split``: whether
    to split sinks into moving and holding where declared, which needs all rows.
    """
    return _ledger(recording, _main_book(recording), is_split)


def further_ledgers(recording: xr.Dataset) -> dict[str, Ledger]:
    """Return the energy balances beyond the actuator's own, by name.

    A balance in which a source replaces one of the actuator's sources includes the actuator's
    energies. The additional energy of that source flows to a sink, such as the heat of the pads for
    a braked disc. Other balances are separate. A balance without any energy, whose part is switched
    off, is left out.
    """
    main = _main_book(recording)
    names = [name for name in _books(recording) if name not in ("", main)]
    books = {name: _ledger(recording, name) for name in names}
    return {
        name: each
        for name, each in books.items()
        if any(np.any(posting.energy) for posting in (*each.sources, *each.sinks))
    }


def _main_book(recording: xr.Dataset) -> str:
    """Return the name of the first balance: the actuator's, if it has a sink."""
    books = _books(recording, ("sink",))
    return "" if "" in books else next(iter(books), "")


def _books(
    recording: xr.Dataset, sides: tuple[str, ...] = ("source", "sink", "standstill")
) -> dict[str, None]:
    """Return the names of all balances with energies on some sides, in the recording's order."""
    roles = _roles(recording, _energies(recording)).values()
    return dict.fromkeys(role.book for role in roles if role.side in sides)


def ledger(recording: xr.Dataset, sources: Mapping[str, str], sinks: Mapping[str, str]) -> Ledger:
    """Return the energy balance of some variables.

    Parameters
    ----------
    recording
        Recording with energies [J]; the difference between end and start of each counts.
    sources, sinks
        Label by variable. Variables that the recording does not contain are left out. So are sinks
        whose parts, moving and holding, are both listed.
    """
    changes = _changes(recording) | _split(recording)
    given, taken = (
        [Posting(name, label, changes[name]) for name, label in wanted.items() if name in changes]
        for wanted in (sources, sinks)
    )
    names = {posting.name for posting in taken}
    parts = [p for p in taken if not {f"{p.name}_moving", f"{p.name}_holding"} <= names]
    return Ledger(tuple(given), tuple(parts))


def _ledger(recording: xr.Dataset, book: str, is_split: bool = True) -> Ledger:
    changes = _changes(recording)
    roles = _roles(recording, changes)
    widens = any(role.whole for role in roles.values() if role.book == book)
    books = ("", book) if widens else (book,)
    known = {name: role for name, role in roles.items() if role.book in books}
    sources = {name: role for name, role in known.items() if role.side == "source"}
    instead = {role.whole: name for name, role in sources.items() if role.whole in sources}
    given = [
        Posting(name, sources[name].label, changes[name])
        for name in (instead.get(each, each) for each in sources if each not in instead.values())
    ]
    taken = [
        Posting(role.rest, role.rest_label, changes[name] - changes[role.whole])
        for name, role in sources.items()
        if role.rest and role.whole in sources
    ]
    split = _split(recording) if is_split else {}
    for name, role in known.items():
        if role.side == "sink":
            kinds = [kind for kind in ("moving", "holding") if f"{name}_{kind}" in split]
            taken += [
                Posting(f"{name}_{kind}", f"{role.label}, {kind}", split[f"{name}_{kind}"])
                for kind in kinds
            ] or [Posting(name, role.label, changes[name])]
    return Ledger(_told_apart(given), _told_apart(taken))


def _told_apart(postings: Sequence[Posting]) -> tuple[Posting, ...]:
    """Return postings whose labels differ; equal labels are followed by the variable's name."""
    count = Counter(each.label for each in postings)
    return tuple(
        replace(each, label=f"{each.label} ({each.name})") if count[each.label] > 1 else each
        for each in postings
    )


def _roles(recording: xr.Dataset, names: Collection[str]) -> dict[str, Role]:
    """Return the role of every energy: the declared role, else the role that its name implies."""
    declared = {name: _role_of(recording.variables[name]) for name in names}
    roles = {name: role for name, role in declared.items() if role is not None}
    if "E_source" in names and not any(role.side == "source" for role in roles.values()):
        roles["E_source"] = Role("source", "source")
    for name in sorted(names, key=lambda name: name != "E_stored"):
        if name.startswith("E_") and name != "E_source" and name not in roles:
            label = str(recording.variables[name].attrs.get("long_name", name))
            is_store = name == "E_stored"
            roles[name] = Role("sink", "stored", returns="any") if is_store else Role("sink", label)
    return roles


def _role_of(variable: xr.Variable) -> Role | None:
    attributes = variable.attrs
    named = (name for name in _ROLE if _PREFIX + name in attributes)
    return _role(tuple((name, str(attributes[_PREFIX + name])) for name in named))


@cache
def _role(attributes: tuple[tuple[str, str], ...]) -> Role | None:
    values: dict[str, Any] = dict(attributes)
    return Role(**{**values, "split": bool(values.get("split"))}) if "side" in values else None


def _changes(recording: xr.Dataset) -> dict[str, float]:
    """Return the increase of every energy [J]."""
    changes = {}
    for name in _energies(recording):
        values = recording.variables[name].values
        changes[name] = _plain(values[..., -1] - values[..., 0])
    return changes


def _energies(recording: xr.Dataset) -> list[str]:
    """Return the names of all energies."""
    named = (str(key) for key in recording.data_vars if str(key).startswith(("E_", "W_")))
    # Variables, because arrays with coordinates would cost more than all balances.
    return [name for name in named if recording.variables[name].ndim == 1]


def _split(recording: xr.Dataset) -> dict[str, float]:
    """Return the energies of sinks that are split into moving and holding [J].

    Holding is the increase of an energy at standstill, assumed to be even within each recording
    interval.
    """
    every = {str(key): _role_of(recording.variables[key]) for key in recording.data_vars}
    still = next((name for name, role in every.items() if role and role.side == "standstill"), "")
    changes: dict[str, float] = {}
    for name in (name for name, role in every.items() if role and role.split and still):
        names = (name, still, "time")
        energy, stuck, time = (np.diff(recording.variables[each].values) for each in names)
        holding = np.sum(energy * np.clip(stuck / time, 0.0, 1.0), axis=-1)
        values = recording.variables[name].values
        whole = values[..., -1] - values[..., 0]
        changes[f"{name}_moving"] = _plain(whole - holding)
        changes[f"{name}_holding"] = _plain(holding)
    return changes


_OPEN = 1e-5  # of the turnover: maximum closing error, and maximum energy that a loss may return
_NOTHING = 1e-9  # J: rounding error of the stored energy while nothing moves


def energy_doubts(recording: xr.Dataset, runs: Sequence[Run] = ()) -> list[str]:
    """Return warnings on impossible energies in a recording.

    One warning concerns an energy balance whose closing error is larger than the step can explain,
    the other a loss that delivers energy. The scheme closes the balance to a few parts in 1e8,
    except for nonlinear elements. A loss increases in every substep. Both fail if extreme
    parameters make numbers cancel, or if an element's equations leave their range.

    ``runs``: the run of the recording, if known.
    """
    return energy_doubts_of_cases(recording, 1, runs)[0]


def energy_doubts_of_cases(
    recording: xr.Dataset, cases: int, runs: Sequence[Run] = ()
) -> list[list[str]]:
    """Return the `energy_doubts` of each of several runs, from the rows of all."""
    doubts: list[list[str]] = [[] for _ in range(cases)]
    for each in deliveries(recording, _losses(runs)):
        if not np.any(_is_delivered(each)):
            continue
        where = f" of the balance {each.book!r}" if each.book else ""
        energies, totals = (np.broadcast_to(e, cases) for e in (each.energy, each.turnover))
        is_wrong = np.broadcast_to(_is_delivered(each), cases)
        for k in np.flatnonzero(is_wrong).tolist():
            doubts[k].append(
                f"the loss {each.label!r}{where} ({each.name}) delivers {energies[k]:.3g} J of "
                f"{totals[k]:.3g} J transferred, which is impossible. Do not trust this run. Use a "
                "smaller step, and check for an extreme parameter"
            )
    if _are_surely_closed(recording):
        return doubts
    books = actuator_ledger(recording)
    error, turned = (np.broadcast_to(each, cases) for each in (books.closing_error, books.turnover))
    for k, (left, total) in enumerate(zip(error.tolist(), turned.tolist(), strict=True)):
        if abs(left) > _OPEN * total + _NOTHING:
            doubts[k].append(
                f"the energy balance has an error of {abs(left):.3g} J of "
                f"{total:.3g} J transferred. Do not trust this run. Use a smaller step, and check "
                "for an extreme parameter"
            )
    return doubts


def _losses(runs: Sequence[Run]) -> Collection[str] | None:
    """Return the losses that must increase in every substep; None for all.

    A contact's loss includes the energy of a change in its parameters (see
    `bywire.simulation.advance`).
    """
    return one_of(runs).model.Flow._fields if change(runs) else None


def _is_delivered(delivery: Delivery) -> Any:
    """Return whether a loss returned more than rounding explains, for each of several runs."""
    return np.greater(delivery.energy, _OPEN * delivery.turnover + _NOTHING)


def are_surely_sound(recording: xr.Dataset, runs: Sequence[Run] = ()) -> bool:
    """Return whether the ends of a recording, or of several runs, exclude `energy_doubts`."""
    given = deliveries(recording, _losses(runs))
    is_quiet = not any(np.any(_is_delivered(each)) for each in given)
    return is_quiet and _are_surely_closed(recording)


def _are_surely_closed(recording: xr.Dataset) -> bool:
    """Return whether the ends of a recording, or of several runs, exclude a closing error."""
    books = actuator_ledger(recording, is_split=False)
    if not (books.sources and books.sinks):
        return True
    # Splitting a sink cannot reduce the turnover, so a check without splits is sufficient.
    return bool(np.all(2.0 * np.abs(books.closing_error) <= _OPEN * books.turnover + _NOTHING))


def energy_signals(run: Run) -> tuple[str, ...]:
    """Return the outputs of a run's model that are part of an energy balance."""
    return tuple(
        name
        for name, signal in signals_of(run.model.Output).items()
        if name.startswith(("E_", "W_")) or signal.role is not None
    )


def energy_residual(recording: xr.Dataset) -> xr.DataArray:
    """Return the energy input minus the losses and the change of stored energy [J].

    The residual is zero except for the numerical error. It covers only the actuator's own balance.
    """
    losses = sum(
        values
        for name, values in recording.items()
        if str(name).startswith("E_")
        and name not in ("E_source", "E_stored")
        and "energy_book" not in values.attrs
    )
    balance = recording["E_source"] - losses - recording["E_stored"]
    residual: xr.DataArray = balance - float(balance.values[0])
    residual.attrs = {"units": "J", "long_name": "residual of the energy balance"}
    return residual
