"""Gains of a current loop from steps of its demand, the rotor held: one method for every loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import xarray as xr

from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Array
from bywire.data.labeled import labeled
from bywire.identification.electrics.loop_records import (
    LoopOptions,
    identified_loop,
    noise_of_levels,
    require_steps,
    without_lead,
)
from bywire.identification.measured import split
from bywire.identification.method import Effort, Identified, Method
from bywire.identification.output_error import Trial, trial


@dataclass(frozen=True)
class CurrentLoop:
    """A current loop whose gains are sought.

    Parameters
    ----------
    model
        The model that holds the loop, and what it drives.
    demand, current
        What the record calls demand and measured current; the demand is the model's stimulus.
    computed
        The model's signal that the measured current is compared with.
    gains, winding
        Names of the parameters: the controller's, and resistance and inductance.
    held
        ``held(par, options)``: the parameters with the rotor held.
    rest
        ``rest(par)``: state and memory in which a record begins; all zero where None.
    """

    model: Model
    demand: str
    current: str
    computed: str
    gains: tuple[str, ...]
    winding: tuple[str, ...]
    held: Callable[[Any, Any], ParameterSet]
    rest: Callable[[Any], tuple[Any, Any]] | None = None

    def identify(
        self, data: xr.Dataset, par: ParameterSet, options: LoopOptions, effort: Effort
    ) -> Identified:
        """Return the gains, with the winding where the options ask for it.

        The loop is run over the measured demand, the rotor held, and fitted to the measured
        current.

        Parameters
        ----------
        data
            Demand and current [A], the rotor locked or stuck. One or several records.
        par
            Where the search begins.
        options, effort
            What is unknown; what the search may take.

        Raises
        ------
        ParameterError
            When the demand does not step, or nothing can be estimated.

        Notes
        -----
        From demand to current only k_p V/L, k_i V/L and R/L show: with all four unknown, the one
        that the data tells least keeps its value, and is named.
        """
        trials = [self._trial(record, par, options, label) for label, record in split(data).items()]
        return identified_loop(trials, par, options.names(self.gains, self.winding))

    def _trial(
        self, data: xr.Dataset, par: ParameterSet, options: LoopOptions, label: str
    ) -> Trial:
        require_steps(data, self.demand, self.current, label)
        i = data[self.current].values
        sigma = noise_of_levels(i, data[self.demand].values)
        held = self.held(par, options)
        state, memory = self.rest(held) if self.rest else (None, None)
        beside = trial(
            self.model,
            held,
            data.assign({self.computed: ("time", i)}),
            {self.demand: self.demand},
            {self.computed: sigma},
            state=state,
            memory=memory,
            label=label,
        )
        return without_lead(beside, data, options.lead)

    def record(self, time: Array, demand: Array, current: Array, label: str) -> xr.Dataset:
        """Return a record of demand and current [A]; ``label``: long name of the current."""
        signals = {
            self.demand: (demand, "A", "current demand"),
            self.current: (current, "A", label),
        }
        return labeled({"time": (time, "s", "time")}, signals)

    def method(self, **declared: Any) -> Method:
        """Return the method that identifies the loop; ``declared``: what only its brake knows."""
        return Method(
            signals={self.demand: "A", self.current: "A"},
            identify=self.identify,
            unknowns=self.gains,
            several=True,
            **declared,
        )
