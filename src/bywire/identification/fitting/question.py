"""What a user asks to be identified on a bench, as texts and options, and methods that take it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import xarray as xr
from pydantic import Field

from bywire.bench.bench import Bench
from bywire.core.arguments import checked
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Factor, Unit
from bywire.core.registry import Kind, instances
from bywire.identification.least_squares import Loss
from bywire.identification.method import METHODS, Method
from bywire.identification.output_error import Between

Texts = Mapping[str, str] | Iterable[str]
"""what is said of each name; or the names alone"""

BETWEEN = re.compile(r"\s*(?:\+-|\+/-|±)\s*")
"""what stands between a value, or a column, and its standard deviation"""

_NUMBER = re.compile(r"[-+]?\.?\d")  # how a noise begins

Share = Annotated[float, Unit("1", 0.01), Field(ge=0, le=1, allow_inf_nan=False)]


@checked
@dataclass(frozen=True)
class Question:
    """What a method of any bench is asked: what is measured there, and what is unknown.

    Texts have units as on the command line.

    Parameters
    ----------
    bench
        A `Bench`, the path of a bench file, or an experiment's name.
    inputs
        Stimulus of the model -> measured signal, or column such as ``"Demand [bar]"``; by default
        all of the same name.
    outputs
        Output of the model -> standard deviation of its noise, such as ``"0.02 bar"``, its column,
        such as ``"Pressure [psi]"``, or both, ``"Pressure [psi] +- 0.02 bar"``. Empty, or the names
        alone, for a column of that name and the record's own noise.
    unknowns
        Parameter, ``stimulus.NAME`` or ``offset.SIGNAL`` -> range such as ``"0.1..1 ohm"``; empty,
        or the names alone, for none.
    priors
        What is known of an unknown: ``"0.35 +- 0.02 ohm"``.
    states
        States whose initial values are unknown, in every record its own.
    case
        Run of the experiment; the first one by default.
    holdout
        A measurement that is not fitted: validation.
    loss
        How large residuals count: ``linear``, ``soft_l1``, ``huber`` or ``cauchy``; the method's
        own choice by default.
    """

    bench: Bench | str | Path | None = None
    inputs: Mapping[str, str] = field(default_factory=dict)
    outputs: Texts = field(default_factory=dict)
    unknowns: Texts = field(default_factory=dict)
    priors: Mapping[str, str] = field(default_factory=dict)
    states: Sequence[str] = ()
    case: str = ""
    holdout: str | Path | xr.Dataset | None = None
    loss: str = ""

    @property
    def noise(self) -> dict[str, str]:
        """Noise of each measured output as it is written; empty for the record's own."""
        return {name: _column_and_noise(text)[1] for name, text in _texts_of(self.outputs).items()}

    @property
    def columns(self) -> dict[str, str]:
        """Column of each output whose column is named, as it is written."""
        texts = {name: _column_and_noise(text)[0] for name, text in _texts_of(self.outputs).items()}
        return {name: column for name, column in texts.items() if column}

    @property
    def ranges(self) -> dict[str, str]:
        """Range of each unknown as it is written; empty for none."""
        return _texts_of(self.unknowns)

    @property
    def key(self) -> str:
        """What tells experiments made for this from those made for anything else."""
        return f"{self.inputs} {self.noise} {self.ranges} {self.priors} {self.states} {self.case}"

    @property
    def given(self) -> tuple[str, ...]:
        """Names of what was given."""
        options = {
            "bench": self.bench is not None,
            "inputs": self.inputs,
            "outputs": self.outputs,
            "unknowns": self.unknowns,
            "priors": self.priors,
            "states": self.states,
            "case": self.case,
            "holdout": self.holdout is not None,
            "loss": self.loss,
        }
        return tuple(name for name, value in options.items() if value)


def _texts_of(names: Texts) -> dict[str, str]:
    """Return what is said of each name, nothing where there are names alone."""
    if isinstance(names, Mapping):
        return dict(names)
    return dict.fromkeys([names] if isinstance(names, str) else names, "")


def _column_and_noise(text: str) -> tuple[str, str]:
    """Return the column and the noise that a text names; both may be empty.

    What begins with a digit and has no unit in brackets is a noise.

    Examples
    --------
    >>> _column_and_noise("0.02 bar"), _column_and_noise("Druck [psi] +- 0.02 bar")
    (('', '0.02 bar'), ('Druck [psi]', '0.02 bar'))
    >>> _column_and_noise("2nd sensor [bar]")
    ('2nd sensor [bar]', '')
    """
    text = text.strip()
    *before, last = BETWEEN.split(text)
    if before and _NUMBER.match(last):
        return " +- ".join(before).strip(), last.strip()
    is_noise = _NUMBER.match(text) and not text.endswith(("]", ")"))
    return ("", text) if is_noise else (text, "")


@dataclass(frozen=True)
class BenchMethod:
    """A named method for any bench.

    Parameters
    ----------
    name
        What the command line calls it.
    summary
        One line for listings.
    options, defaults, simulated
        As of the methods that it makes.
    on
        ``on(bench, question) -> Method``: the method for what is asked of a bench.
    """

    name: str
    summary: str
    options: type[ParameterSet]
    defaults: ParameterSet
    simulated: tuple[str, ...]
    on: Callable[[Bench, Question], Method]


BENCH_METHODS = Kind(
    "method", ("methods",), instances(BenchMethod), "bywire.identification.methods"
)
"""the methods that are made for a bench"""


def find_method(name: str) -> Method:
    """Return one method that needs no bench.

    Raises
    ------
    UnknownNameError
        With the nearest known names, those of methods for a bench among them.
    """
    if name not in METHODS.all():
        raise METHODS.unknown(name, BENCH_METHODS)
    return METHODS.all()[name]


class Options(ParameterSet):
    """How large residuals count, and what is asked of the result."""

    loss: Loss
    """how large residuals count: beyond the noise a robust loss grows slower than the square"""
    between: Between
    """what inputs do between samples: held as a controller's demand is, or joined by straight lines
    as something smooth is that acts on the model faster than it was measured"""
    most_residual: Factor
    """residual over noise above which the model does not explain the record"""
    most_outliers: Share
    """residuals beyond four times the noise, of all, that a robust loss may set aside"""
    least_vaf: Share
    """variance of the held-out record that is to be accounted for, signal by signal"""
    noise: Share
    """synthetic: standard deviation of an output's noise, of its range, where none is given"""
