"""Contract: a result has the dimension that its annotation says, whatever the choices."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest

from contracts.dimensioned import Dimensioned, fits
from contracts.elements import (
    all_functions,
    annotations,
    flat,
    functions,
    label,
    merged,
    modules,
    numbers,
)
from contracts.sampling import Arguments, Case, call, carrying, combinations, flattened

FUNCTIONS = all_functions()
DYNAMIC = [m for m in modules() if {"mass", "balance"} <= functions(m).keys()]


def with_units(case: Case) -> Arguments:
    """Return a sample whose numbers carry their units."""
    sample = case.sample()
    found = {k: Dimensioned(v, case.known(k).unit) for k, v in flattened(sample).items()}
    return carrying(sample, found)


def check_units(function: Callable[..., Any]) -> None:
    """Refuse a function whose result has another dimension than its annotation."""
    arguments, returns = annotations(function)
    expected = numbers("result", returns)
    for choices in combinations(arguments):
        got = flat(call(function, with_units(Case(arguments, choices))))
        for (name, number), value in zip(expected.items(), got, strict=True):
            assert fits(value, number.unit), f"{name} is {value}, not {number.unit}; {choices}"


def check_rate_units(module: ModuleType) -> None:
    """Refuse a balance over a mass that is no derivative of the state."""
    mass, balance = (functions(module)[name] for name in ("mass", "balance"))
    arguments = merged((mass, balance))
    states = numbers("state", module.State)
    for choices in combinations(arguments):
        sample = with_units(Case(arguments, choices))
        rates = zip(flat(call(balance, sample)), flat(call(mass, sample)), strict=True)
        for (name, number), (top, bottom) in zip(states.items(), rates, strict=True):
            rate = top / bottom
            assert fits(rate, f"({number.unit})/s"), f"rate of {name} is {rate}; {choices}"


def check_SI(function: Callable[..., Any]) -> None:
    """Refuse a function with a unit that is not SI: a prefix is a factor that nobody applies."""
    arguments, returns = annotations(function)
    for argument, annotation in (*arguments.items(), ("result", returns)):
        for name, number in numbers(argument, annotation).items():
            one = Dimensioned(1.0, number.unit).quantity.magnitude
            assert one == pytest.approx(1.0, rel=1e-12), f"{name} [{number.unit}] is not SI"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_result_has_the_annotated_dimension(name: str) -> None:
    check_units(FUNCTIONS[name])


@pytest.mark.parametrize("module", DYNAMIC, ids=label)
def test_balance_over_mass_is_the_rate_of_the_state(module: ModuleType) -> None:
    check_rate_units(module)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_units_inside_are_SI(name: str) -> None:
    check_SI(FUNCTIONS[name])
