"""Contracts of an element or a control law: equations, derivatives, energy."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np

from bywire.contracts import values
from bywire.contracts.dimensioned import Dimensioned, fits
from bywire.contracts.elements import (
    Element,
    flat,
    functions,
    is_parameters,
    is_signals,
    merged,
    numbers,
    parameter_classes,
    signature_of,
)
from bywire.contracts.evidence import Contract, Demand, Demands, Evidence, measured, place_of
from bywire.contracts.values import (
    Arguments,
    Sampler,
    call,
    carrying,
    combinations,
    described,
    evaluate,
    flattened,
    samples_of,
    symbolic,
    traced,
)
from bywire.core.typing import Array

Function = Callable[..., Any]

SAMPLES = 30
BACK_ENDS = 1e-12
"""by how much floats, arrays and symbols may differ, of the largest value"""
DIFFERENCE = 1e-6
"""step of the differences, of the nominal value"""
SLOPE = 1e-7
"""by how much a derivative may differ from them"""
PREFIX = 1e-12
"""by how much the factor of a unit to SI may differ from one"""


def with_units(sampler: Sampler) -> Arguments:
    """Return a sample whose numbers carry their units."""
    sample = sampler.sample()
    values = {k: Dimensioned(v, sampler.known(k).unit) for k, v in flattened(sample).items()}
    return carrying(sample, values)


def has_annotated_units(function: Function) -> Iterator[Evidence]:
    """Find whether results have the dimension that the annotation says, whatever the choices."""
    arguments, returns = signature_of(function)
    expected = numbers("result", returns)
    for choices in combinations(arguments):
        got = flat(call(function, with_units(Sampler(arguments, choices))))
        for (name, number), value in zip(expected.items(), got, strict=True):
            text = f"{name} is {value}, wanted {number.unit}{described(choices)}"
            yield Evidence(fits(value, number.unit), text)


def is_in_SI(function: Function) -> Iterator[Evidence]:
    """Find whether all units are SI: a prefix is a factor that nobody applies."""
    arguments, returns = signature_of(function)
    for argument, annotation in (*arguments.items(), ("result", returns)):
        for name, number in numbers(argument, annotation).items():
            factor = Dimensioned(1.0, number.unit).value
            yield measured(abs(factor - 1.0), PREFIX, f"{name} [{number.unit}] is {factor:g} of SI")


def has_agreeing_back_ends(function: Function) -> Iterator[Evidence]:
    """Find whether floats, NumPy arrays and CasADi symbols give one result."""
    arguments, _ = signature_of(function)
    for choices in combinations(arguments):
        structure, samples = samples_of(arguments, choices, SAMPLES)
        each = [evaluate(function, structure, numbers_in) for numbers_in in samples.T.tolist()]
        floats = np.array(each).T
        arrays = evaluate(function, structure, samples)
        column, results = traced(function, structure)
        symbols = ca.Function("f", [column], [results])(samples).full()
        # A difference of large terms is as good as the terms: the row's largest value is scale.
        scale = np.abs(floats).max(axis=1, keepdims=True)
        for name, other in (("arrays", arrays), ("symbols", symbols)):
            apart = np.abs(other - floats)
            off = _relative(apart, scale)
            at = int(np.argmax((apart / np.where(scale > 0, scale, 1)).max(axis=0)))
            where = described(choices, structure, samples[:, at], off > BACK_ENDS)
            yield measured(off, BACK_ENDS, f"{name} differ from floats by {off:.1e}{where}")


def has_its_slopes(function: Function) -> Iterator[Evidence]:
    """Find whether the symbolic Jacobian is the slope of the function, away from kinks."""
    arguments, _ = signature_of(function)
    for choices in combinations(arguments):
        sampler = Sampler(arguments, choices)
        structure, samples = samples_of(arguments, choices, SAMPLES)
        column, results = traced(function, structure)
        shape = (results.numel(), column.numel(), SAMPLES)
        compiled = ca.Function("J", [column], [ca.vec(ca.densify(ca.jacobian(results, column)))])
        exact = compiled(samples).full().reshape(shape, order="F")
        if not np.all(np.isfinite(exact)):
            at = int(np.argmax(~np.isfinite(exact).all(axis=(0, 1))))
            where = described(choices, structure, samples[:, at])
            yield Evidence(False, f"the Jacobian is not finite{where}")
            return
        largest = np.abs(evaluate(function, structure, samples)).max(axis=1)[:, None]
        names = list(flattened(structure))
        nominals = np.array([abs(sampler.known(name).nominal) for name in names])
        both = [
            _slopes(function, structure, samples, h * nominals)
            for h in (DIFFERENCE, DIFFERENCE / 2)
        ]
        for j, (name, nominal, wide, narrow) in enumerate(zip(names, nominals, *both, strict=True)):
            scale = largest / nominal + np.abs(exact[:, j])
            # Where the two differences disagree there is a kink or a jump between their ends.
            smooth = np.abs(wide - narrow) <= 1e-3 * scale
            if not np.all(smooth.mean(axis=1) > 0.5):
                yield Evidence(False, f"kinks everywhere along {name}{described(choices)}")
                return
            off = np.abs(narrow - exact[:, j]) / np.where(scale > 0, scale, 1)
            share = float(off[smooth].max())
            at = int(np.argmax(np.where(smooth, off, -1.0).max(axis=0)))
            where = described(choices, structure, samples[:, at], share > SLOPE)
            yield measured(share, SLOPE, f"slope along {name} is off by {share:.1e}{where}")


def _slopes(function: Function, structure: Arguments, matrix: Array, steps: Array) -> Array:
    """Return central differences along every row of the samples, shape (rows, results, samples)."""
    moves = np.kron(np.diag(steps), np.ones(matrix.shape[1]))
    many = np.tile(matrix, len(steps))
    difference = evaluate(function, structure, many + moves) - evaluate(
        function, structure, many - moves
    )
    along = difference.reshape(len(difference), len(steps), matrix.shape[1])
    return np.asarray(along.transpose(1, 0, 2) / (2.0 * steps[:, None, None]))


def _relative(off: Array, scale: Array) -> float:
    """Return the largest share; a difference where all values are zero is infinitely large."""
    wide = np.broadcast_to(scale, off.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(off == 0.0, 0.0, off / wide)
    return float(share.max())


# --- Energy: what an element stores is what comes in minus what it loses
# An element with ``energy`` also has ``power_in``; where the energy depends on a ``State`` it has
# ``mass`` and ``balance``; with inputs that its energy depends on it has ``input_rate``, a tuple
# of their derivatives under their names; without ``power_loss`` it is lossless. An argument whose
# type another function of the element returns (the contact forces) is computed by that function.

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


# --- All of them

OF_A_FUNCTION: dict[str, Contract] = {
    "units": has_annotated_units,
    "SI units": is_in_SI,
    "back ends": has_agreeing_back_ends,
    "derivatives": has_its_slopes,
}
"""what every public function has to keep"""

OF_A_CLASS: dict[str, Contract] = {
    "round trip": values.survives_json,
    "refusals": values.keeps_its_ranges,
}
"""what every class of parameters has to keep"""


def demands_on(element: Element) -> Demands:
    """Yield every contract that an element has to keep."""
    functions = element.functions
    for name, function in functions.items():
        for contract, test in OF_A_FUNCTION.items():
            yield Demand(contract, f"{element.name}.{name}", function, test)
    module = element.module
    if {"mass", "balance"} <= functions.keys():
        yield Demand("rates", element.name, module, has_rates_of_its_states)
    if "energy" in functions:
        yield Demand("energy balance", element.name, module, keeps_energy)
    if "power_loss" in functions:
        yield Demand("loss", element.name, module, loses_what_it_says)
    for cls in parameter_classes(module):
        for contract, test in OF_A_CLASS.items():
            yield Demand(contract, f"{element.name}.{cls.__name__}", cls, test)
