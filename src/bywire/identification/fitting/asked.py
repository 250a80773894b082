"""What a user asks to be identified on a bench, as texts and options, and methods that take it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated

import xarray as xr
from pydantic import Field

from bywire.bench.bench import Bench
from bywire.core.errors import unknown_name
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Factor, Unit
from bywire.core.registry import Kind, instances
from bywire.identification.least_squares import Loss
from bywire.identification.method import METHODS, Method
from bywire.identification.replaying.measured_run import Between

Share = Annotated[float, Unit("1", 0.01), Field(ge=0, le=1, allow_inf_nan=False)]


@dataclass(frozen=True)
class Asked:
    """What is measured and what is unknown; texts with units as on the command line.

    Parameters
    ----------
    inputs
        Stimulus of the model -> measured signal; by default all of the same name.
    outputs
        Output of the model, measured under the same name -> standard deviation of its noise, or
        empty for the record's own.
    unknowns
        Parameter, ``stimulus.NAME`` or ``offset.SIGNAL`` -> range ``LOW..HIGH``, or empty.
    priors
        Of these unknowns -> ``MEAN +- DEVIATION``.
    states
        States whose initial values are unknown, in every record its own.
    case
        Label of the experiment's run; the first one by default.
    holdout
        A record that is not fitted, to try the result on.
    """

    inputs: Mapping[str, str] = field(default_factory=dict)
    outputs: Mapping[str, str] = field(default_factory=dict)
    unknowns: Mapping[str, str] = field(default_factory=dict)
    priors: Mapping[str, str] = field(default_factory=dict)
    states: tuple[str, ...] = ()
    case: str = ""
    holdout: xr.Dataset | None = None

    @property
    def key(self) -> str:
        """What tells experiments made for this from those made for anything else."""
        return str(replace(self, holdout=None))  # what is held out shapes no experiment


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
        ``on(bench, asked) -> Method``: the method for what is asked of a bench.
    """

    name: str
    summary: str
    options: type[ParameterSet]
    defaults: ParameterSet
    simulated: tuple[str, ...]
    on: Callable[[Bench, Asked], Method]


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
        raise unknown_name("method", name, (*METHODS.all(), *BENCH_METHODS.all()))
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
