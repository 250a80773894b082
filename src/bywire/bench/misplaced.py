"""Names in the wrong section of a bench: the error states the kind of name and the remedy."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from bywire.bench.changes import OPTION, share_of
from bywire.bench.experiment import EXPERIMENTS, Experiment
from bywire.bench.requirements import limit_like
from bywire.core.callers import option
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import UnknownNameError, quoted
from bywire.core.model import ASSEMBLIES
from bywire.core.signals import signals_of

_PARAMETER, _KPI, _SIMULATION = "", "requirements.", "simulation."
_KINDS = {_PARAMETER: "parameter", OPTION: "option", _KPI: "KPI in [requirements]"}
_SETTINGS = ("step", "error", "record", "seed", "engine")


def refuse_misplaced(
    experiment: Experiment,
    parameters: str,
    overrides: Mapping[str, Any],
    options: Mapping[str, Any],
    requirements: Mapping[str, Any],
) -> None:
    """Reject a name that belongs in another section.

    Parameters
    ----------
    experiment, parameters
        The bench's experiment, and its parameter set.
    overrides, options, requirements
        The bench's sections.

    Raises
    ------
    UnknownNameError
        If a name belongs elsewhere, with its kind and the remedy. Unknown names are not rejected.
    """
    kpis = experiment.kpis_with(experiment.defaults)
    sections: dict[str, tuple[str, Collection[str]]] = {
        _PARAMETER: ("a parameter", PARAMETER_SETS.find(parameters).parameters().flat()),
        OPTION: (f"an option of {experiment.name}", experiment.defaults.flat()),
        _KPI: (f"a key figure of {experiment.name}", kpis),
        _SIMULATION: ("a setting of the simulation", _SETTINGS),
    }
    written = {_PARAMETER: overrides, OPTION: options, _KPI: requirements}
    for section, values in written.items():
        for name, value in values.items():
            if name in sections[section][1]:
                continue
            right = next((each for each, (_, known) in sections.items() if name in known), None)
            if right == _KPI:
                limit = str(value) if str(value)[:1] in ("<", ">") else limit_like(kpis[name])
                advice = f"To limit it, type {option('overrides', {_KPI + name: limit})}"
            elif right is not None:
                text = "VALUE" if right and share_of(value) is not None else str(value)
                advice = f"Type {option('overrides', {right + name: text})}"
            elif section == _PARAMETER:
                _refuse_other(name, experiment)
                continue
            else:
                continue
            raise _error(section, name, sections[right][0], advice)


def _refuse_other(name: str, experiment: Experiment) -> None:
    """Reject a known name that is not valid in any section of a bench."""
    for what, advice in _others(name, experiment):
        raise _error(_PARAMETER, name, what, advice)


def _others(name: str, experiment: Experiment) -> Iterator[tuple[str, str]]:
    if PARAMETER_SETS.get(name) is not None:
        yield "a parameter set", f"Type {option('overrides', {'parameters': name})}"
    if EXPERIMENTS.get(name) is not None:
        yield "an experiment", f"Type {option('overrides', {'experiment': name})}"
    model = ASSEMBLIES.find(experiment.assembly)()
    if name in {*signals_of(model.Stimulus), *signals_of(model.Output)}:
        yield (
            f"a signal of {experiment.assembly}",
            f"'bywire list {experiment.name}' lists what you can change",
        )


def _error(section: str, name: str, what: str, advice: str) -> UnknownNameError:
    return UnknownNameError(
        f"unknown {_KINDS[section]} {quoted(name)}: it is {what}. {advice}",
        name=_KINDS[section],
        value=name,
    )
