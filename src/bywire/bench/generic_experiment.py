"""Experiments for any brake, defined by the names of its signals.

A `GenericExperiment` is bound to a model. Its levels then have the units of the signals in its
options. The result is an `Experiment`, like those for one brake.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from types import MappingProxyType
from typing import Annotated, Any

from pydantic import Field, create_model
from pydantic.fields import FieldInfo

from bywire.bench.experiment import EXPERIMENTS, Case, Experiment
from bywire.bench.kpis import effort, occupation
from bywire.bench.kpis.families import FamilyJudge, recorded, units_of
from bywire.bench.stimulus import Stimulus
from bywire.core.callers import option
from bywire.core.catalog import PARAMETER_SETS, main_set, sets_of_loaded
from bywire.core.errors import ModelError, ParameterError, not_valid, quoted, unknown_name
from bywire.core.model import ASSEMBLIES, Model
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.quantities import Unit
from bywire.core.registry import Kind, instances, pick
from bywire.core.signals import Signal, signals_of, without_noise, zeros
from bywire.core.typing import Array

Course = Callable[[Array], Array]

InputLevel = Annotated[float, Unit("input"), Field(allow_inf_nan=False)]

_TOTALS = {"effort": effort.Setting(), "occupation": occupation.Setting()}


@dataclass(frozen=True)
class TestedModel:
    """Model to which a generic experiment is bound, with its signals.

    Parameters
    ----------
    generic
        The experiment, unbound.
    model
        Model under test.
    names
        Signal by the option that specifies it.
    units
        SI unit of each signal, by option.
    options, defaults
        Class of the options with these units, and its default values.
    """

    generic: GenericExperiment
    model: Model
    names: Mapping[str, str]
    units: Mapping[str, str]
    options: type[ParameterSet]
    defaults: ParameterSet

    @property
    def input(self) -> str:
        """Name of the driven stimulus."""
        return self.names["input"]

    @property
    def output(self) -> str:
        """Name of the recorded signal that responds."""
        return self.names["output"]

    @property
    def is_set_point(self) -> bool:
        """Whether the input has the output's unit, so that it is a set point of the output."""
        return self.units["input"] == self.units["output"]

    def experiment(
        self,
        course: Callable[[Any, Mapping[str, Stimulus]], Course],
        judged: Mapping[str, Callable[[Any], Any]],
        *figures: str,
        duration: Callable[[Any], float] = lambda options: float(options.duration),
        resolved: Mapping[str, str] = MappingProxyType({}),
        **more: Any,
    ) -> Experiment:
        """Return an experiment with one run that starts at rest.

        Parameters
        ----------
        course
            ``course(options, stimuli)``: function of times [s] that returns the input [SI].
        judged
            Families of key figures with ``setting(options)``; effort and occupation follow them.
        figures
            Kinds of figures in addition to time traces and energy balance.
        duration
            ``duration(options)`` of the run [s].
        resolved
            SI units of the placeholders of the families, except ``level``, the output's unit.
        more
            Additional fields of the `Experiment`.
        """
        stimuli = _known(self.model, "stimulus")
        others = {name: signal.unit for name, signal in stimuli.items() if name != self.input}

        def cases(par: Any, options: Any, given: Mapping[str, Stimulus]) -> tuple[Case, ...]:
            driven = course(options, given)

            def stimulus(t: Array) -> dict[str, Array]:
                further = {name: each.sample(t) for name, each in given.items() if name}
                return {**further, self.input: driven(t)}

            case = Case(
                "run",
                self.model,
                par,
                *at_rest(self.model, par),
                stimulus,
                duration(options),
                settle=options.settle,
                record=options.record,
                start=partial(at_rest, self.model),
            )
            return (case,)

        def settings(options: Any) -> dict[str, Any]:
            return {**{family: of(options) for family, of in judged.items()}, **_TOTALS}

        units = units_of(*judged, resolved={"level": self.units["output"], **resolved})
        return Experiment(
            name=self.generic.name,
            assembly=self.model.name,
            summary=self.generic.summary,
            options=self.options,
            defaults=self.defaults,
            cases=cases,
            judge=FamilyJudge(settings, left_out=units_of(*_TOTALS).keys() - self.totals().keys()),
            kpis={**units, **self.totals()},
            figures=self.figures(*figures),
            beside=lambda _: others,
            **more,
        )

    def totals(self) -> dict[str, str]:
        """Return units of the key figures of effort and occupation whose signals are recorded."""
        signals = self.model.Output._fields
        return {
            name: unit
            for family, setting in _TOTALS.items()
            for name, unit in recorded(family, setting, signals).items()
        }

    def figures(self, *kinds: str) -> tuple[str, ...]:
        """Return kinds of figures, with the energy balance if the model records energies."""
        has_energy = any(name.startswith(("E_", "W_")) for name in self.model.Output._fields)
        return (*kinds, "time-traces", *(("energy-balance",) if has_energy else ()))


@dataclass(frozen=True)
class GenericExperiment:
    """Virtual test of any model.

    Parameters
    ----------
    name
        Name in bench files and on the command line, different from all experiments of a brake.
    summary
        One line for listings.
    options
        Class of its options. The unit ``input`` represents the unit of the signal in the option
        ``input``, and other options work the same way.
    signals
        Kind of signal by option: a ``stimulus``, a ``recording``, either of them (``input or
        recording``), a ``friction`` or a ``state``. The default of ``input or recording`` and
        ``state`` is the signal of the first option.
    defaults
        Default options. A level is a multiple of its signal's nominal magnitude.
    build
        ``build(tested)``: the experiment for a model. Its cases receive the stimuli by name.
    """

    name: str
    summary: str
    options: type[ParameterSet]
    signals: Mapping[str, str]
    defaults: Mapping[str, Any]
    build: Callable[[TestedModel], Experiment]

    def bound(self, model: Model, given: Mapping[str, Any]) -> Experiment:
        """Return the experiment of a model.

        Parameters
        ----------
        given
            The user's options, by name.

        Raises
        ------
        UnknownNameError
            When an option is a signal that the model does not have.
        ParameterError
            When an option without a default signal is missing.
        """
        known: dict[str, tuple[str, Signal]] = {}
        for key, place in self.signals.items():
            known[key] = _signal(model, self.name, key, place, given.get(key), known)
        places = tuple((key, s.unit, s.nominal) for key, (_, s) in known.items())
        options = with_units(self.options, places)
        names = {key: name for key, (name, _) in known.items()}
        defaults = {**self._levels(options), **names}
        for key, info in options.model_fields.items():
            if info.is_required() and key not in defaults:
                raise ModelError(
                    f"the experiment {self.name!r} declares no default for its option {key!r}. Add "
                    "one to its defaults, or to the field of its class",
                    name=key,
                )
        units = {key: signal.unit for key, (_, signal) in known.items()}
        return self.build(TestedModel(self, model, names, units, options, options.create(defaults)))

    def _levels(self, options: type[ParameterSet]) -> dict[str, Any]:
        """Return the defaults, with levels in SI."""
        templates, leaves = leaf_fields(self.options), leaf_fields(options)
        levels = dict(self.defaults)
        for name, leaf in leaves.items():
            if name in levels and leaf.unit != templates[name].unit:
                size, value = leaf.unit.nominal, levels[name]
                several = isinstance(value, tuple)
                levels[name] = tuple(size * v for v in value) if several else size * value
        return levels


GENERIC_EXPERIMENTS = Kind(
    "experiment", ("generic_experiments",), instances(GenericExperiment), "bywire.bench.experiments"
)
"""every experiment for any brake"""


@cache
def with_units(
    template: type[ParameterSet], places: tuple[tuple[str, str, float], ...]
) -> type[ParameterSet]:
    """Return a class of options whose levels have the units of their signals.

    Parameters
    ----------
    template
        Class of options in which the names of options represent units.
    places
        Option for a signal; SI unit and nominal magnitude of that signal.
    """
    fields: dict[str, Any] = {}
    for name, info in template.model_fields.items():
        notes = [_placed(note, places) for note in info.metadata]
        if notes != info.metadata:
            fields[name] = (Annotated[(info.annotation, *notes)], _required(info))
    return create_model(
        template.__name__, __base__=template, __module__=template.__module__, **fields
    )


def _required(info: FieldInfo) -> Any:
    return ... if info.is_required() else info.default


def _placed(note: Any, places: Sequence[tuple[str, str, float]]) -> Any:
    for place, unit, nominal in places if isinstance(note, Unit) else ():
        symbol = re.sub(rf"\b{place}\b", unit, note.symbol)
        if symbol != note.symbol:
            return Unit(symbol, nominal)
    return note


def _signal(
    model: Model,
    experiment: str,
    key: str,
    place: str,
    wanted: Any,
    chosen: Mapping[str, tuple[str, Signal]],
) -> tuple[str, Signal]:
    """Return the signal in an option, or the default signal."""
    known = _known(model, place)
    if wanted is not None and not isinstance(wanted, str):
        raise not_valid(f"options.{key}", quoted(wanted), f"a {place} of {model.name}")
    if wanted:
        if wanted not in known:
            raise unknown_name(f"{place} of {model.name} in options.{key}", wanted, known)
        return wanted, known[wanted]
    if place in ("state", "input or recording"):
        return next(iter(chosen.values()))
    if not known:
        raise ParameterError(
            f"experiment {experiment!r} needs a {place}, but {model.name} has none",
            name=f"options.{key}",
        )
    if place == "recording":
        driven, signal = chosen["input"]
        alike = [n for n, each in known.items() if each.unit == signal.unit and n != driven]
        name = next(iter((*alike, *known)))
    elif len(known) == 1 or place == "friction":
        name = next(iter(known))
    else:
        valid = ", ".join(known)
        typed = option("overrides", {f"options.{key}": next(iter(known))})
        raise ParameterError(
            f"options.{key} is missing: the {place} of {model.name} that experiment "
            f"{experiment!r} drives. For example, type {typed}. Valid names are {valid}",
            name=f"options.{key}",
            valid=valid,
        )
    return name, known[name]


def _known(model: Model, place: str) -> dict[str, Signal]:
    """Return the signals of a model that are valid in an option."""
    states = signals_of(model.State)
    stimuli, outputs = signals_of(model.Stimulus), signals_of(model.Output)
    driven = {name: stimuli[name] for name in without_noise(stimuli)}
    return {
        "friction": {name: states[name] for name in model.frictions},
        "state": states,
        "stimulus": driven,
        "recording": outputs,
        "input or recording": {**driven, **outputs},
    }[place]


def at_rest(model: Model, par: Any) -> tuple[Any, Any]:
    """Return state and memory of a model at rest without any stimulus.

    They are the result of the model's ``rest(par)``, or zeros if the model has no such function.

    Raises
    ------
    ModelError
        When the result is not a State and a Memory.
    """
    rest = getattr(model, "rest", None)
    if rest is None:
        return zeros(model.State), zeros(model.Memory)
    start = rest(par)
    if not (isinstance(start, tuple) and len(start) == 2):
        raise ModelError(
            f"{model.name}: rest(par) must return (State, Memory), got {quoted(start)}",
            name="rest",
            value=quoted(start),
            valid="(State, Memory)",
        )
    return start


# --- Experiments by name, for one brake or for any


def experiment_of(
    name: str, parameters: str, assembly: str = "", options: Mapping[str, Any] | None = None
) -> Experiment:
    """Return the experiment with a name for a parameter set.

    Parameters
    ----------
    name
        Name of the experiment.
    parameters
        Name of the parameter set.
    assembly
        Model of the set's brake. Default: the set's model.
    options
        The user's options, which may be names of signals.

    Raises
    ------
    InputError
        When there is no such experiment, when the model does not have a signal in its options, and
        when an earlier name of a brake's experiment is ambiguous.
    """
    cited = PARAMETER_SETS.find(parameters)
    system = assembly or cited.assembly
    likely = EXPERIMENTS.guess(name)
    if likely is not None and likely.tests(system):
        return likely.of(system)
    brake = PARAMETER_SETS.owner(parameters)
    its_own = EXPERIMENTS.own(brake, name)
    if its_own is not None and its_own.tests(system):
        return its_own.of(system)
    known = GENERIC_EXPERIMENTS.all()
    if name in known:
        former = _former(name, brake, system, options or {}, known[name])
        if former is not None:
            return former
        models = ASSEMBLIES.of(brake)
        return known[name].bound(pick(models, system, "assembly")(), options or {})
    every = EXPERIMENTS.all()
    if name not in every:
        raise unknown_name("experiment", name, {*every, *known}, first=EXPERIMENTS.of(brake))
    return every[name]


def former_names(name: str) -> dict[str, str]:
    """Return the experiments that formerly had a name, each with its assembly."""
    every = EXPERIMENTS.all().values()
    return {each.name: each.assembly for each in every if each.formerly == name}


def _former(
    name: str, brake: str, system: str, options: Mapping[str, Any], generic: GenericExperiment
) -> Experiment | None:
    """Return a brake's experiment that formerly had this name, if the options fit it.

    Raises
    ------
    ParameterError
        When the options fit both experiments.
    """
    each = (e for e in EXPERIMENTS.of(brake).values() if e.formerly == name)
    former = next((e for e in each if e.assembly == system), None)
    if former is None:
        return None
    given = set(options)
    own, others = set(former.options.model_fields), set(generic.options.model_fields)
    if given & (others - own):
        return None
    if given & (own - others):
        return former
    example = next(iter(generic.signals))
    raise ParameterError(
        f"experiment {name!r} works with any brake, and the experiment of the {system} is now "
        f"called {former.name!r}. Use {former.name}, or specify the signal for {name}, for example "
        f"{option('overrides', {f'options.{example}': 'NAME'})}",
        name="experiment",
        value=name,
        valid=former.name,
    )


def usual_set(name: str) -> str:
    """Return the default parameter set of an experiment.

    It is the main set of the experiment's brake. For an experiment for any brake, it is the only
    set of the brakes loaded by path.

    Raises
    ------
    UnknownNameError
        When the experiment is unknown.
    ParameterError
        For an experiment for any brake if there are several sets.
    """
    definition, sets = EXPERIMENTS.get(name), sets_of_loaded()
    if len(sets) == 1 and name in GENERIC_EXPERIMENTS.all():
        return sets[0]
    if definition is not None:
        return main_set(definition.assembly, beside=type(definition.defaults))
    if name not in GENERIC_EXPERIMENTS.all():
        raise EXPERIMENTS.unknown(name, GENERIC_EXPERIMENTS)
    known = ", ".join(sets or PARAMETER_SETS.all())
    former = "".join(
        f". The experiment of the {assembly} is now called {now!r}"
        for now, assembly in former_names(name).items()
    )
    raise ParameterError(
        f"experiment {name!r} works with any brake. Specify a parameter set with "
        f"{option('overrides', {'parameters': 'NAME'})} ({known}){former}",
        name="parameters",
        valid=known,
    )
