"""What a user asks to be identified on a bench, as texts, and methods that take it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import xarray as xr

from bywire.bench.bench import Bench
from bywire.core.errors import unknown_name
from bywire.core.parameters import ParameterSet
from bywire.core.registry import Kind, instances
from bywire.identification.method import METHODS, Method


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
