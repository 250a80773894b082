"""Contracts of one function: its units, its results on every type of number, its derivatives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import casadi as ca
import numpy as np

from bywire.contracts.dimensioned import Dimensioned, fits
from bywire.contracts.elements import flat, numbers, signature_of
from bywire.contracts.evidence import Evidence, measured
from bywire.contracts.sampling import (
    Arguments,
    Sampler,
    call,
    carrying,
    combinations,
    described,
    evaluate,
    flattened,
    samples_of,
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
