"""Contract: what an element stores is what comes in less what it loses.

An element with ``energy`` also has ``power_in``; with a ``State`` it has ``mass`` and
``balance``; with inputs that its energy depends on it has ``input_rate``, a tuple of their
derivatives under their names; without ``power_loss`` it is lossless. An argument whose type
another function of the element returns (the contact forces) is computed by that function.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np
import pytest

from contracts.elements import (
    annotations,
    flat,
    functions,
    is_parameters,
    is_signals,
    label,
    merged,
    modules,
)
from contracts.sampling import Arguments, Case, call, combinations, flattened, symbolic

SAMPLES = 30
TOLERANCE = 1e-9  # the series of the fluid's flow energy is off by some 1e-10
ENERGETIC = ("energy", "power_in", "power_loss", "mass", "balance", "input_rate")
STORING = [m for m in modules() if "energy" in functions(m)]
LOSSY = [m for m in modules() if "power_loss" in functions(m)]


def check_energy(module: ModuleType) -> None:
    """Refuse an element that makes or hides energy."""
    own = {k: f for k, f in functions(module).items() if k in ENERGETIC}
    needed = {"power_in", *(("mass", "balance") if hasattr(module, "State") else ())}
    assert needed <= own.keys(), f"stores energy: needs {sorted(needed - own.keys())} too"
    arguments = merged(own.values())
    for choices in combinations(arguments):
        structure, matrix = Case(arguments, choices).matrix(SAMPLES)
        column, sample = symbolic(structure)
        sample = _consistent(module, arguments, sample)
        rates = _rates(module, own, arguments, sample)
        stored = call(own["energy"], sample)
        slopes = dict(
            zip(flattened(structure), ca.vertsplit(ca.gradient(stored, column)), strict=True)
        )
        terms = [slopes[name] * rate for name, rate in rates.items()]
        terms.append(-call(own["power_in"], sample))
        terms.append(call(own["power_loss"], sample) if "power_loss" in own else 0.0)
        signals = [k for k in slopes if not is_parameters(arguments[k.split(".")[0]])]
        unmoved = [slopes[k] for k in signals if k not in rates]
        compiled = ca.Function("E", [column], [ca.vertcat(*terms), ca.vertcat(0.0, *unmoved)])
        powers, hidden = (out.full() for out in compiled(matrix))
        assert not hidden.any(), f"the energy depends on inputs without input_rate, {choices}"
        off, scale = np.abs(powers.sum(axis=0)), np.abs(powers).sum(axis=0)
        assert scale.any(), f"no power ever flows, {choices}"
        assert np.all(off <= TOLERANCE * scale), f"d(energy)/dt is off by {off} W, {choices}"


def check_loss(module: ModuleType) -> None:
    """Refuse a loss that gives energy, unless its docstring calls it signed."""
    loss = functions(module)["power_loss"]
    claim = loss.__doc__ or ""
    assert (">= 0" in claim) != ("signed" in claim), "the docstring says '>= 0' or 'signed'"
    if "signed" in claim:
        return
    arguments, _ = annotations(loss)
    for choices in combinations(arguments):
        structure, matrix = Case(arguments, choices).matrix(SAMPLES * 4)
        column, sample = symbolic(structure)
        heat = call(loss, _consistent(module, arguments, sample))
        values = ca.Function("P", [column], [heat])(matrix).full()
        assert values.min() >= 0.0, f"power_loss falls to {values.min():g} W, {choices}"


def _consistent(module: ModuleType, known: dict[str, Any], sample: Arguments) -> Arguments:
    """Return the arguments with those computed that the element has a law for."""
    computed: Arguments = {}
    for law in (f for k, f in functions(module).items() if k not in ENERGETIC):
        takes, gives = annotations(law)
        free = is_signals(gives) and gives is not getattr(module, "State", None)
        for name in (k for k, note in known.items() if note is gives and free):
            if takes.keys() <= sample.keys() - {name}:
                computed[name] = call(law, sample)
    return sample | computed


def _rates(
    module: ModuleType, own: dict[str, Any], known: dict[str, Any], sample: Arguments
) -> dict[str, Any]:
    """Return the derivatives of all states and moving inputs, by the name of their argument."""
    rates: dict[str, Any] = {}
    place = {note: name for name, note in known.items() if is_signals(note)}
    if hasattr(module, "State"):
        pairs = zip(
            flat(call(own["balance"], sample)), flat(call(own["mass"], sample)), strict=True
        )
        for field, (top, bottom) in zip(module.State._fields, pairs, strict=True):
            rates[f"{place[module.State]}.{field}"] = top / bottom
    if "input_rate" in own:
        moving = call(own["input_rate"], sample)
        rates |= {f"{place[module.Input]}.{k}": v for k, v in moving._asdict().items()}
    return rates


@pytest.mark.parametrize("module", STORING, ids=label)
def test_stored_energy_is_what_came_in_less_the_loss(module: ModuleType) -> None:
    check_energy(module)


@pytest.mark.parametrize("module", LOSSY, ids=label)
def test_loss_never_gives_energy(module: ModuleType) -> None:
    check_loss(module)
