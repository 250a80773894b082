"""Bench: a complete virtual test with its requirements, equivalent to a bench file."""

from __future__ import annotations

import math
import operator
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from bywire.bench.changes import settled, split_options
from bywire.bench.experiment import (
    Case,
    Cases,
    DefaultStep,
    Experiment,
    FaultyCase,
    as_run,
    check_seed,
    checked_error,
    checked_interval,
    checked_step,
    error_text,
    longest_choice,
    two_steps,
)
from bywire.bench.faults.fault_section import Injection, injections
from bywire.bench.faults.injected import checked_sections, with_faults
from bywire.bench.generic_experiment import experiment_of, usual_set
from bywire.bench.misplaced import refuse_misplaced
from bywire.bench.requirements import Limit, read_limits
from bywire.bench.stimulus import Stimulus, stimulus_of, stimulus_sections
from bywire.core.catalog import PARAMETER_SETS, outdated_values
from bywire.core.errors import (
    BywireError,
    InputError,
    ModelError,
    ParameterError,
    not_valid,
    place_of,
    quoted,
    unknown_name,
)
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet, choice_fields, choices_of, leaf_fields
from bywire.core.several import DifferError
from bywire.core.traced import Traced
from bywire.core.typing import Array
from bywire.core.units import shown
from bywire.core.values import parsed
from bywire.simulation.engine import engine_names, structure_of
from bywire.simulation.run import Run

_SHARE = 1e-3  # relative change that tests whether a value has an effect


@dataclass(frozen=True)
class StepChoice:
    """Step that bywire chose for a stated error.

    Parameters
    ----------
    stated
        Stated numerical error, as a fraction.
    step
        Chosen step [s].
    reached
        Largest estimated error of the deciding key figures, as a fraction.
    figure
        Name of the key figure with that error.
    benches
        Number of benches that decided: the bench itself, and cases of a study or a range.
    """

    stated: float
    step: float
    reached: float
    figure: str
    benches: int = 1


@dataclass(frozen=True)
class Bench:
    """Complete virtual test.

    Parameters
    ----------
    experiment
        Name of the experiment.
    parameters
        Name of a parameter set of the catalog. If empty, the main set of the experiment's brake;
        an experiment for any brake then uses the only set of the brakes loaded by path.
    overrides, options
        Changed parameters and options of the experiment, by dotted name: SI numbers, or texts
        with units such as ``"0.35 ohm"``. Durations below may also be such texts. A percentage
        changes a parameter relatively, ``{"seal.T_pr": "+50%"}``, and a pattern several,
        ``{"seal.*": "-10%"}``.
    stimulus
        ``{"kind": ..., **parameters}`` for experiments with a stimulus of your choice; a table may
        come from a file (see `bywire.bench.stimulus.with_nodes`). Experiments for any brake also
        accept such a mapping under the name of each additional signal of the model's Stimulus.
    step
        Substep [s]. NaN while `error` is stated and no step is chosen.
    record
        Recording interval [s]. None for the experiment's own interval.
    seed
        Seed of the sensor noise.
    requirements
        Limit by KPI name, such as ``{"overshoot": "<= 15 %"}``.
    name
        Name in reports.
    faults
        Faults and their times: tables like those of ``[[faults]]`` in a bench file (see
        ``docs/faults.md``).
    assembly
        Tested model of the parameters' brake, for experiments that allow a choice. Default: the
        parameter set's model.
    engine
        Engine of the runs: ``auto``, ``compiled``, ``virtual-machine``, ``cuda`` (a graphics
        processor), or the compiled C of the ECU in the loop, ``sil`` (double precision) or
        ``sil-single``.
    error
        Numerical error of the key figures, in place of a step: ``"0.1 %"``, or a fraction. bywire
        chooses the step (see ``docs/bench-files.md``).
    choice
        Chosen step for this error. A bench with another step or error has none.

    Raises
    ------
    InputError
        At construction, for names, values, files and steps that are not valid. The run itself
        raises errors of the simulation, and the error for too little memory.
    """

    experiment: str
    parameters: str = ""
    overrides: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    stimulus: Mapping[str, Any] = field(default_factory=dict)
    step: float = DefaultStep(20e-6)
    record: float | None = None
    seed: int = 0
    requirements: Mapping[str, str] = field(default_factory=dict)
    name: str = ""
    assembly: str = ""
    faults: Sequence[Mapping[str, Any]] = ()
    engine: str = "auto"
    error: float | str | None = None
    choice: StepChoice | None = None

    def __post_init__(self) -> None:
        for key in ("experiment", "parameters", "name", "assembly"):
            if not isinstance(getattr(self, key), str):
                raise not_valid(key, quoted(getattr(self, key)), "a string")
        for key in ("overrides", "options", "stimulus", "requirements"):
            object.__setattr__(self, key, dict(getattr(self, key)))  # a copy
        object.__setattr__(self, "faults", tuple(checked_sections(self.faults)))
        self._settle_step()
        object.__setattr__(self, "record", checked_interval(self.record))
        check_seed(self.seed)
        if self.engine not in engine_names():
            raise unknown_name("engine", self.engine, engine_names())
        object.__setattr__(self, "parameters", self.parameters or usual_set(self.experiment))
        known = PARAMETER_SETS.find(self.parameters)
        written = tuple(self.overrides)
        object.__setattr__(self, "overrides", settled(known.parameters(), self.overrides))
        if self.assembly == known.assembly:
            object.__setattr__(self, "assembly", "")
        chosen = self.definition
        object.__setattr__(self, "experiment", chosen.name)  # also for an earlier name
        if chosen.assembly != self.system:
            by_name = f"assembly = {self.assembly!r}"
            by_set = f"parameter set {known.name!r} is for a {known.assembly}"
            fit = [n for n, s in PARAMETER_SETS.all().items() if chosen.tests(s.assembly)]
            raise ParameterError(
                f"experiment {chosen.name!r} tests a {chosen.assembly}, but "
                f"{by_name if self.assembly else by_set}. Its parameter sets are {', '.join(fit)}",
                name="assembly" if self.assembly else "parameters",
                value=self.assembly or known.name,
                valid=chosen.assembly,
            )
        refuse_misplaced(chosen, self.parameters, self.overrides, self.options, self.requirements)
        self._check_stimulus(chosen)
        _ = self.limits  # rejects requirements that cannot be judged
        if chosen.preview is None:
            self._require_effects(written, self.cases(), chosen.cases)
        else:
            self._require_effects(written, self._made(chosen.preview), chosen.preview)

    def _settle_step(self) -> None:
        """Check step and error, of which a bench states one."""
        error, choice, step = checked_error(self.error), self.choice, self.step
        if choice is not None and (error != choice.stated or step != choice.step):
            # A new step replaces the stated error, and a new error needs another choice.
            error = error if error != choice.stated else None
            step = math.nan if error is not None else step
            choice = None
        if error is None and isinstance(step, float) and math.isnan(step):
            step = Bench.step  # the bench no longer states an error
        is_stated = not isinstance(step, DefaultStep) and step == step
        if error is not None and choice is None and is_stated:
            raise two_steps(shown(checked_step(step), "s"), error_text(error))
        object.__setattr__(self, "error", error)
        object.__setattr__(self, "choice", choice)
        is_open = error is not None and choice is None
        object.__setattr__(self, "step", math.nan if is_open else checked_step(step))

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields, from which a copy derives the rest."""
        return {name: self.__dict__[name] for name in type(self).__dataclass_fields__}

    def _check_stimulus(self, chosen: Experiment) -> None:
        """Reject a stimulus that the experiment does not accept."""
        further = [name for name, each in self.stimulus.items() if isinstance(each, Mapping)]
        if len(further) < len(self.stimulus) and chosen.driven_unit is None:
            raise ParameterError(
                f"experiment {chosen.name!r} has its own stimulus. Remove [stimulus], or use "
                "experiment 'open-loop'",
                name="stimulus",
            )
        known = {} if chosen.beside is None else chosen.beside(self.chosen_options)
        for name in further:
            if name not in known:
                raise unknown_name(f"additional stimulus of {chosen.name}", name, known)

    def _require_effects(self, names: Sequence[str], cases: Sequence[Case], make: Cases) -> None:
        """Reject changed parameters that would have no effect because a choice switches them off.

        ``names``: names without patterns; a pattern may match parameters that have no effect.
        """
        base = PARAMETER_SETS.find(self.parameters).parameters()
        for name in filter(self.overrides.__contains__, names):
            value, before = self.par.value(name), base.value(name)
            if value == before or isinstance(value, (str, bool)):
                continue
            switches = switches_of(name, cases)
            if switches and not self._is_used(name, before, cases, make):
                refuse_without_effect(name, value, switches, self.par)

    def _is_used(self, name: str, other: Any, cases: Sequence[Case], make: Cases) -> bool:
        """Test whether the experiment depends on a parameter by setting another value."""
        try:
            par, following = self.par.replace({name: other}), self.definition.following
            if following is not None and following(par) != following(self.par):
                return True
            others = self.cases_with(par, self.chosen_options, make)
            made = tuple(map(self._aligned, others))
        except InputError:
            return True
        return not are_alike(cases, made)

    def require_effect(self, name: str) -> None:
        """Reject a parameter to vary if a choice switches it off.

        Raises
        ------
        ParameterError
            With the choice that switches the parameter on.
        """
        if name not in self.par.leaves():
            return
        make = self.definition.preview or self.definition.cases
        cases, value = self._previewed, self.par.value(name)
        switches = switches_of(name, cases)
        moved = value + _SHARE * (abs(value) or 1.0)
        if switches and not self._is_used(name, moved, cases, make):
            refuse_without_effect(name, value, switches, self.par)

    @cached_property
    def limits(self) -> Mapping[str, Limit]:
        """Limits from the requirements, by KPI name."""
        return read_limits(self.requirements, self.definition.kpis_with(self.chosen_options))

    @cached_property
    def system(self) -> str:
        """Name of the tested assembly."""
        return self.assembly or PARAMETER_SETS.find(self.parameters).assembly

    @cached_property
    def definition(self) -> Experiment:
        """Experiment of this name."""
        return experiment_of(self.experiment, self.parameters, self.assembly, self.options)

    @cached_property
    def par(self) -> ParameterSet:
        """Validated parameters, including the overrides."""
        base = PARAMETER_SETS.find(self.parameters).parameters()
        listed = f"bywire list {self.parameters}"
        return base.replace(parsed(type(base), self.overrides, "parameter", listed))

    @cached_property
    def outdated(self) -> list[str]:
        """Derived values of the set that no longer match the values behind them."""
        cited = PARAMETER_SETS.find(self.parameters).values
        leaves = leaf_fields(type(self.par))
        texts = []
        for each in outdated_values(cited, self.par, self.overrides):
            unit = leaves[each.name].unit.symbol
            now = shown(each.now, unit)
            then = shown(each.formula, unit) if math.isfinite(each.formula) else "no finite value"
            texts.append(
                f"{each.name} = {now} does not match {', '.join(each.changed)}, which you changed: "
                f"its formula ({each.where}) now gives {then}. Change {each.name} too, or accept "
                "the mismatch"
            )
        return texts

    @cached_property
    def chosen_options(self) -> ParameterSet:
        """Validated options of the experiment."""
        chosen, following = self.definition, self._following or {}
        values = parsed(chosen.options, self.options, f"option of {chosen.name}")
        return chosen.defaults.replace({**following, **values})

    @cached_property
    def chosen_stimuli(self) -> Mapping[str, Stimulus]:
        """Validated stimuli by signal; the stimulus of a plain section has the name ""."""
        chosen, sections = self.definition, stimulus_sections(self.stimulus)
        units = {} if chosen.beside is None else dict(chosen.beside(self.chosen_options))
        if chosen.driven_unit is not None:
            units[""] = chosen.driven_unit(self.chosen_options)
        return {name: stimulus_of(each, units[name], name) for name, each in sections.items()}

    @property
    def chosen_stimulus(self) -> Stimulus | None:
        """Validated stimulus of a plain section; None without one."""
        return self.chosen_stimuli.get("")

    def summary(self, varied: Collection[str] = ()) -> str:
        """Return the experiment's summary with the options of this bench.

        ``varied``: names of quantities that have several values, including ``options.NAME``.
        """
        _, own = split_options(dict.fromkeys(varied))
        return self.definition.summary_with(self.chosen_options, own)

    def cases(self) -> tuple[Case, ...]:
        """Return the runs of the experiment, with the settling times of the simulation."""
        return self._cases

    @cached_property
    def _cases(self) -> tuple[Case, ...]:
        return self._made(self.definition.cases)

    def cases_with(self, par: Any, options: Any, make: Cases | None = None) -> tuple[Case, ...]:
        """Return the runs with other parameters and options."""
        has_several = self.definition.beside is not None
        stimuli = self.chosen_stimuli if has_several else self.chosen_stimulus
        cases = (make or self.definition.cases)(par, options, stimuli)
        return with_faults(cases, self.faults) if self.faults else cases

    def _made(self, make: Cases) -> tuple[Case, ...]:
        """Return the cases; reject overrides without effect and steps that do not divide."""
        cases = self.cases_with(self.par, self.chosen_options, make)
        for case in cases:
            _check_driven(case, self.definition)
        is_changed = any(case.par is not self.par for case in cases)
        for name in self.overrides if is_changed else ():
            wanted, given = self.par.value(name), [case.par.value(name) for case in cases]
            if given and all(value != wanted for value in given):
                raise ParameterError(
                    f"{name} = {wanted!r} would have no effect because experiment "
                    f"{self.experiment!r} sets it to {given[0]!r}. Leave {name} out",
                    name=name,
                    value=repr(wanted),
                    valid=repr(given[0]),
                )
        return tuple(map(self._aligned, cases))

    def _aligned(self, case: Case) -> Case:
        """Return a case aligned for its step, or for the longest one if none is chosen yet."""
        if math.isnan(self.step):
            return case.aligned(longest_choice(case.intervals(self.record)), self.record)
        return case.aligned(self.step, self.record)

    @cached_property
    def injections(self) -> tuple[Injection, ...]:
        """Faults of the runs, read for the first run."""
        if not self.faults:
            return ()
        has_several = self.definition.beside is not None
        stimuli = self.chosen_stimuli if has_several else self.chosen_stimulus
        case, *_ = self.definition.cases(self.par, self.chosen_options, stimuli)
        return injections(self.faults, case.model, case.par)

    def runs(self) -> dict[str, Run]:
        """Return the runs by label, for ensembles and sensitivities.

        Their time starts with the settling, ``Case.settle`` before the recording's zero.
        """
        return {
            case.label: as_run(case, self.step, seed=(self.seed, number))
            for number, case in enumerate(self.cases())
        }

    def varied(
        self, overrides: Mapping[str, Any], options: Mapping[str, Any], seed: int | None = None
    ) -> Bench:
        """Return this bench with other numbers and choices, faster than a new bench.

        Names and files are known to be valid; only the values are checked.

        Parameters
        ----------
        overrides, options
            Parameters, choices and numbers of the options by dotted name [SI].
        seed
            Seed of the sensor noise. Default: unchanged.

        Raises
        ------
        InputError
            For values out of range, or values with which the experiment cannot be set up.
        """
        made = object.__new__(type(self))
        known = made.__dict__
        known |= self._shared
        known["overrides"] = {**self.overrides, **overrides}
        known["options"] = {**self.options, **options}
        if any(isinstance(value, (str, bool)) for value in options.values()):
            known.pop("chosen_stimuli")  # a choice may determine the driven signal and its unit
        known["seed"] = self.seed if seed is None else seed
        known["par"] = par = self.par.replace(overrides)
        following = self.definition.following
        if not options and (following is None or following(par) == self._following):
            known["chosen_options"] = self.chosen_options
        known["_cases"] = made._made(self.definition.cases)
        return made

    def joined(self, columns: Mapping[str, Array]) -> Bench:
        """Return this bench with the numbers of several cases, only to set up its runs.

        Parameters
        ----------
        columns
            Value of each changed parameter in each case [SI], shape (cases,), by dotted name.

        Raises
        ------
        DifferError
            When a case is invalid, or when the cases must be set up separately.
        """
        made = object.__new__(type(self))
        known = made.__dict__
        known |= self._shared
        known["overrides"] = {**self.overrides, **columns}
        known["par"] = par = self.par.with_columns(columns)
        following = self.definition.following
        if following is not None and following(par) != self._following:
            raise DifferError("options depend on the parameters")
        known["chosen_options"] = self.chosen_options
        known["_cases"] = made._made(self.definition.cases)
        return made

    @cached_property
    def _shared(self) -> dict[str, Any]:
        """Properties that this bench shares with the benches that `varied` returns."""
        lasting = ("definition", "system", "chosen_stimuli")
        return {**self.__getstate__(), **{name: getattr(self, name) for name in lasting}}

    @cached_property
    def _following(self) -> Mapping[str, Any] | None:
        """Options that depend on the parameters."""
        following = self.definition.following
        return None if following is None else following(self.par)

    def with_overrides(self, overrides: Mapping[str, Any]) -> Bench:
        """Return this bench with additional changes; percentages refer to its current values."""
        changes = settled(self.par, overrides)
        matched = changes.keys() - overrides.keys()
        silent = {name for name in matched if switches_of(name, self._previewed)}
        kept = {name: value for name, value in changes.items() if name not in silent}
        return replace(self, overrides={**self.overrides, **(kept or changes)})

    def without_choice(self) -> Bench:
        """Return this bench without a step that bywire chose for its stated error."""
        return self if self.choice is None else replace(self, step=Bench.step, choice=None)

    @property
    def _previewed(self) -> tuple[Case, ...]:
        """Runs for checks, without computing the runs on which they depend."""
        preview = self.definition.preview
        return self.cases() if preview is None else self._made(preview)


def _check_driven(case: Case, experiment: Experiment) -> None:
    """Reject an experiment that drives a signal that is not in its model's Stimulus."""
    known = case.model.Stimulus._fields
    for name in case.stimulus(np.zeros(1)):
        if name not in known:
            error = unknown_name(f"stimulus of {case.model.name}", name, known)
            raise ModelError(
                f"{place_of(experiment.cases)}: experiment {experiment.name!r}: {error}",
                name=error.name,
                value=error.value,
                valid=error.valid,
            )


# --- Parameters without effect because a structural choice switches them off

_TIMES = 101  # number of times at which stimuli are compared
_KNOWN: dict[tuple[object, ...], frozenset[str] | None] = {}


@dataclass(frozen=True)
class Switch:
    """A choice that switches a parameter off.

    Parameters
    ----------
    name, value
        The choice and its value.
    others
        Values with which the parameter would have an effect.
    """

    name: str
    value: Any
    others: tuple[Any, ...]

    @property
    def hint(self) -> str:
        """Advice on how to switch the parameter on."""
        return f"set {self.name} = {' or '.join(map(repr, self.others))}"


def switches_of(name: str, cases: Sequence[Case]) -> list[Switch]:
    """Return the choices that switch a parameter off in all runs of an experiment.

    A choice switches the parameter off if the equations of no run read it, but would read it with
    another value of that choice. The choices are those in the parameter's group and in the groups
    above it. If the equations cannot be traced, the list is empty.

    Parameters
    ----------
    name
        Name of a number or table among the parameters.
    cases
        Runs of the experiment.
    """
    pairs = [(case.model, par) for case in cases for par in _parameters(case)]
    if not pairs or any(_is_read(name, model, par) for model, par in pairs):
        return []
    switches = []
    model, par = pairs[0]
    groups = name.split(".")[:-1]
    above = {".".join((*groups[:k], "")) for k in range(1, len(groups) + 1)}
    for choice in choice_fields(type(par)):
        if choice[: choice.rfind(".") + 1] not in above:
            continue
        value = par.value(choice)
        others = [other for other in choices_of(type(par), choice) if other != value]
        read = tuple(each for each in others if _is_read_with(name, model, par, choice, each))
        if read:
            switches.append(Switch(choice, value, read))
    return switches


def refuse_without_effect(
    name: str, value: Any, switches: Sequence[Switch], par: ParameterSet
) -> None:
    """Raise ParameterError for a parameter if any choices switch it off."""
    if not switches:
        return
    leaf = leaf_fields(type(par)).get(name)
    text = shown(value, leaf.unit.symbol) if leaf and isinstance(value, float) else repr(value)
    off = " and ".join(f"{each.name} = {each.value!r}" for each in switches)
    on = ", or ".join(each.hint for each in switches)
    raise ParameterError(
        f"{name} = {text} would have no effect because {off}. Either {on} too, or leave {name} out",
        name=name,
        value=text,
    )


def are_alike(cases: Sequence[Case], others: Sequence[Case]) -> bool:
    """Return whether runs have the same start, stimuli and times."""
    return len(cases) == len(others) and all(map(_is_alike, cases, others))


def _is_alike(case: Case, other: Case) -> bool:
    plans = [(c.duration, c.settle, c.keep, c.record) for c in (case, other)]
    if plans[0] != plans[1] or type(case.model) is not type(other.model):
        return False
    begun, also_begun = (np.array([*c.state, *c.memory], dtype=float) for c in (case, other))
    times = np.linspace(-case.settle, case.duration, _TIMES)
    driven, also = case.stimulus(times), other.stimulus(times)
    return (
        np.array_equal(begun, also_begun, equal_nan=True)
        and driven.keys() == also.keys()
        and all(np.array_equal(driven[n], also[n], equal_nan=True) for n in driven)
    )


def _parameters(case: Case) -> Iterator[ParameterSet]:
    """Yield the parameters of a run, and those after each change by its faults."""
    yield case.par
    if isinstance(case, FaultyCase):
        yield from (par for _, par in case.changes)


def _is_read_with(name: str, model: Model, par: ParameterSet, choice: str, value: Any) -> bool:
    try:
        return _is_read(name, model, par.replace({choice: value}), False)
    except BywireError:  # the other parameters contradict this value
        return False


def _is_read(name: str, model: Model, par: ParameterSet, unless_known: bool = True) -> bool:
    """Return whether equations read a parameter.

    ``unless_known``: result for equations that cannot be traced.
    """
    read = parameters_read(model, par)
    if read is None:
        return unless_known
    return name in read or any(each.startswith(f"{name}.") for each in read)


def parameters_read(model: Model, par: ParameterSet) -> frozenset[str] | None:
    """Return the names of the numbers that a model's equations and controllers read.

    Tables have one name per node, ``name.0``. None if the equations cannot be traced.
    """
    key = structure_of(model, par)
    if key not in _KNOWN:
        try:
            _KNOWN[key] = _traced(model, par)
        except (TypeError, ValueError, AttributeError, ArithmeticError, RecursionError):
            _KNOWN[key] = None  # they branch on a value, or pass it to untraceable code
    return _KNOWN[key]


def _traced(model: Any, par: ParameterSet) -> frozenset[str]:
    leaves = {name: Traced(None, name) for name in par.leaves()}
    here: Any = par.with_leaves(leaves)

    def numbers(names: Iterable[Any]) -> tuple[Traced, ...]:
        return tuple(Traced(None, None) for _ in names)

    x, xe, rate = (model.State._make(numbers(model.State._fields)) for _ in range(3))
    m, u, flow = (
        kind._make(numbers(kind._fields)) for kind in (model.Memory, model.Stimulus, model.Flow)
    )
    groups = model.compliance(here)
    contact = numbers(range(sum(map(len, groups))))
    reaction = numbers((*model.frictions, *model.limits, *model.stops))
    zeros = _Zeros()
    mass, balance = model.mass(xe, here), model.balance(x, xe, m, here, contact)
    results: tuple[Any, ...] = (
        # A state without any force stays at rest, so its mass has no effect.
        tuple(
            each
            for each, force, name in zip(mass, balance, model.State._fields, strict=True)
            if not zeros.has(force) or name in model.frictions
        ),
        balance,
        model.bounds(x, xe, m, here, contact),
        model.widths(x, xe, m, here, contact),
        groups,
        model.gap(x, xe, here),
        model.powers(x, xe, rate, m, here, contact, reaction),
        model.output(x, m, here, contact, reaction, flow),
        tuple(task.tick(x, m, u, here) for task in model.tasks(par)),
        tuple(task.period for task in model.tasks(here)),
    )
    return frozenset(_names_that_count(results, zeros)) & leaves.keys()


class _Zeros:
    """Numbers that are zero for any input; kernels also leave these out."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[bool, Any]] = {}  # kept alive: ids stay unique

    def has(self, value: Any) -> bool:
        """Return whether a number is zero."""
        if not isinstance(value, Traced):
            return isinstance(value, (int, float)) and value == 0
        if id(value) not in self._known:
            self._known[id(value)] = self._judged(value), value
        return self._known[id(value)][0]

    def _judged(self, value: Traced) -> bool:
        if value.operation is operator.mul:
            return any(map(self.has, value.inputs))
        if value.operation is operator.truediv:
            return self.has(value.inputs[0])
        sums = (operator.add, operator.sub, operator.neg)
        return value.operation in sums and all(map(self.has, value.inputs))


def _names_that_count(values: Any, zeros: _Zeros) -> Iterator[Any]:
    """Yield the names from which values are computed, without those of zeros."""
    waiting, seen = [values], set()
    while waiting:
        each = waiting.pop()
        if isinstance(each, Traced):
            if id(each) in seen or zeros.has(each):
                continue
            seen.add(id(each))
            if each.operation is None:
                yield each.inputs[0]
            waiting += each.inputs
        elif isinstance(each, (tuple, list)):
            waiting += each
