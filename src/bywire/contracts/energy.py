"""Contracts of an element: what it stores is what comes in less what it loses.

An element with ``energy`` also has ``power_in``; where the energy depends on a ``State`` it has
``mass`` and ``balance``; with inputs that its energy depends on it has ``input_rate``, a tuple of
their derivatives under their names; without ``power_loss`` it is lossless. An argument whose type
another function of the element returns (the contact forces) is computed by that function.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np

from bywire.contracts.dimensioned import fits
from bywire.contracts.elements import (
    flat,
    functions,
    is_parameters,
    is_signals,
    merged,
    numbers,
    signature_of,
)
from bywire.contracts.equations import SAMPLES, with_units
from bywire.contracts.evidence import Evidence, measured, place_of
from bywire.contracts.sampling import (
    Arguments,
    Sampler,
    call,
    combinations,
    described,
    flattened,
    samples_of,
    symbolic,
)

BALANCE = 1e-9
"""of the powers that flow; the series of the fluid's flow energy is off by some 1e-10"""
ENERGETIC = ("energy", "power_in", "power_loss", "mass", "balance", "input_rate")


def has_rates_of_its_states(module: ModuleType) -> Iterator[Evidence]:
    """Find whether balance over mass has the dimension of the derivative of the state."""
    mass, balance = (functions(module)[name] for name in ("mass", "balance"))
    arguments = merged((mass, balance))
    states = numbers("state", module.State)
    for choices in combinations(arguments):
        sample = with_units(Sampler(arguments, choices))
        rates = zip(flat(call(balance, sample)), flat(call(mass, sample)), strict=True)
        for (name, number), (top, bottom) in zip(states.items(), rates, strict=True):
            rate, unit = top / bottom, f"({number.unit})/s"
            yield Evidence(
                fits(rate, unit),
                f"rate of {name} is {rate}, wanted {unit}{described(choices)}",
                place=place_of(balance),
            )


def keeps_energy(module: ModuleType) -> Iterator[Evidence]:
    """Find whether an element makes or hides energy."""
    laws = {k: f for k, f in functions(module).items() if k in ENERGETIC}
    powers = [law for name, law in laws.items() if name in ("energy", "power_in", "power_loss")]
    moving = getattr(module, "State", None) in merged(powers).values()
    needed = {"power_in", *(("mass", "balance") if moving else ())}
    place = place_of(laws["energy"])
    if needed - laws.keys():
        missing = ", ".join(sorted(needed - laws.keys()))
        yield Evidence(False, f"it stores energy: it needs {missing} too", place=place)
        return
    arguments = merged(laws.values())
    is_alive = False
    for choices in combinations(arguments):
        structure, samples = samples_of(arguments, choices, SAMPLES)
        column, sample = symbolic(structure)
        sample = _consistent(module, arguments, sample)
        rates = _rates(module, laws, arguments, sample)
        stored = call(laws["energy"], sample)
        slopes = dict(
            zip(flattened(structure), ca.vertsplit(ca.gradient(stored, column)), strict=True)
        )
        terms = [slopes[name] * rate for name, rate in rates.items()]
        terms.append(-call(laws["power_in"], sample))
        terms.append(call(laws["power_loss"], sample) if "power_loss" in laws else 0.0)
        signals = [k for k in slopes if not is_parameters(arguments[k.split(".")[0]])]
        unmoved = [slopes[k] for k in signals if k not in rates]
        compiled = ca.Function("E", [column], [ca.vertcat(*terms), ca.vertcat(0.0, *unmoved)])
        powers, hidden = (out.full() for out in compiled(samples))
        if hidden.any():
            text = f"the energy depends on inputs without input_rate{described(choices)}"
            yield Evidence(False, text, place=place)
            return
        off, scale = np.abs(powers.sum(axis=0)), np.abs(powers).sum(axis=0)
        if not scale.any():  # the choices may switch it off
            continue
        is_alive = True
        shares = off / np.where(scale > 0, scale, 1.0)
        at = int(np.argmax(shares))
        share = float(shares[at])
        where = described(choices, structure, samples[:, at], share > BALANCE)
        text = f"d(energy)/dt is off by {share:.1e} of the powers{where}"
        yield measured(share, BALANCE, text, place)
    if not is_alive:
        yield Evidence(False, "no power ever flows", place=place)


def loses_what_it_says(module: ModuleType) -> Iterator[Evidence]:
    """Find whether a loss gives energy, unless its docstring calls it signed."""
    loss = functions(module)["power_loss"]
    claim, place = loss.__doc__ or "", place_of(loss)
    if (">= 0" in claim) == ("signed" in claim):
        text = "the docstring of power_loss must say '>= 0' or 'signed'"
        yield Evidence(False, text, place=place)
        return
    if "signed" in claim:
        return
    arguments, _ = signature_of(loss)
    for choices in combinations(arguments):
        structure, samples = samples_of(arguments, choices, SAMPLES * 4)
        column, sample = symbolic(structure)
        heat = call(loss, _consistent(module, arguments, sample))
        values = ca.Function("P", [column], [heat])(samples).full()
        at = int(np.argmin(values))
        least = float(values.flat[at])
        where = described(choices, structure, samples[:, at], not least >= 0.0)
        yield Evidence(least >= 0.0, f"power_loss falls to {least:g} W{where}", place=place)


def _consistent(module: ModuleType, known: dict[str, Any], sample: Arguments) -> Arguments:
    """Return the arguments with those computed that the element has a law for."""
    computed: Arguments = {}
    for law in (f for k, f in functions(module).items() if k not in ENERGETIC):
        takes, gives = signature_of(law)
        free = is_signals(gives) and gives is not getattr(module, "State", None)
        for name in (k for k, note in known.items() if note is gives and free):
            if takes.keys() <= sample.keys() - {name}:
                computed[name] = call(law, sample)
    return sample | computed


def _rates(
    module: ModuleType, laws: dict[str, Any], known: dict[str, Any], sample: Arguments
) -> dict[str, Any]:
    """Return the derivatives of all states and moving inputs, by the name of their argument."""
    rates: dict[str, Any] = {}
    place = {note: name for name, note in known.items() if is_signals(note)}
    if "balance" in laws and hasattr(module, "State"):
        pairs = zip(
            flat(call(laws["balance"], sample)), flat(call(laws["mass"], sample)), strict=True
        )
        for field, (top, bottom) in zip(module.State._fields, pairs, strict=True):
            rates[f"{place[module.State]}.{field}"] = top / bottom
    if "input_rate" in laws:
        moving = call(laws["input_rate"], sample)
        rates |= {f"{place[module.Input]}.{k}": v for k, v in moving._asdict().items()}
    return rates
