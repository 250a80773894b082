"""All contracts of a model and of its parameter sets."""

from __future__ import annotations

from collections.abc import Iterator

from bywire.bench.faults.modes import modes_of
from bywire.contracts.evidence import Contract, Evidence
from bywire.contracts.finding import Demand, Demands
from bywire.contracts.model_units import has_its_units
from bywire.contracts.rest import hides_no_friction, rests_exactly
from bywire.contracts.run_derivatives import has_its_derivatives
from bywire.contracts.run_energy import closes_its_energy
from bywire.contracts.small_signal import is_its_linear_model, is_linear_beside_its_corners
from bywire.contracts.stepping import (
    has_agreeing_engines,
    has_agreeing_lanes,
    is_of_second_order,
)
from bywire.contracts.trial import Trial
from bywire.contracts.values import set_keeps_its_ranges, set_survives_json
from bywire.core.parameters import ParameterSet

OF_A_SET: dict[str, Contract] = {
    "round trip": set_survives_json,
    "refusals": set_keeps_its_ranges,
}
"""what every parameter set has to keep"""


def has_faults_of_what_is_there(trial: Trial) -> Iterator[Evidence]:
    """Find whether what may fail in a model names signals, tasks and parameters that it has."""
    start = trial.start
    modes = modes_of(start.model, start.par)
    yield Evidence(True, f"{len(modes)} ways to fail name what is there")
    for mode in modes.values():
        if mode.changes is not None and not mode.lacks(start.par):
            for name in mode.changes(start.par, mode.value):
                try:
                    start.par.value(name)
                except (AttributeError, LookupError, ValueError):
                    text = f"the fault {mode.name} changes {name}, which is no parameter here"
                    yield Evidence(False, text)


OF_A_MODEL: dict[str, Contract] = {
    "units": has_its_units,
    "order of the step": is_of_second_order,
    "exact rest": rests_exactly,
    "hidden friction": hides_no_friction,
    "energy of a run": closes_its_energy,
    "engines": has_agreeing_engines,
    "lanes": has_agreeing_lanes,
    "linear model": is_its_linear_model,
    "linear model on corners": is_linear_beside_its_corners,
    "derivatives of a run": has_its_derivatives,
    "faults": has_faults_of_what_is_there,
}
"""what every model has to keep, where it starts with a parameter set"""


def demands_on_set(name: str, par: ParameterSet) -> Demands:
    """Yield every contract that a parameter set has to keep."""
    for contract, test in OF_A_SET.items():
        yield Demand(contract, name, par, test)


OF_ITS_NUMBERS = ("exact rest", "hidden friction", "energy of a run")
"""which of these hang on the numbers of a parameter set"""


def demands_on_model(name: str, trial: Trial, of_numbers: bool = False) -> Demands:
    """Yield every contract that a model has to keep, or those alone that hang on its numbers."""
    for contract, test in OF_A_MODEL.items():
        if not of_numbers or contract in OF_ITS_NUMBERS:
            yield Demand(contract, name, trial, test, trial.place())
