"""The bench: what is tested, how, and what is required of it. The same thing as a bench file."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from bywire.bench.changes import OPTION, settled, split_options
from bywire.bench.effects import are_alike, refuse_without_effect, switches_of
from bywire.bench.experiment import (
    Case,
    Cases,
    Experiment,
    as_run,
    check_seed,
    checked_interval,
    checked_step,
)
from bywire.bench.faults.fault_section import Injection, injections
from bywire.bench.faults.injected import checked_sections, with_faults
from bywire.bench.generic_experiment import experiment_of, usual_set
from bywire.bench.requirements import Limit, read_limits
from bywire.bench.stimulus import Stimulus, stimulus_of, stimulus_sections
from bywire.core.catalog import PARAMETER_SETS, outdated_values
from bywire.core.errors import (
    InputError,
    ModelError,
    ParameterError,
    place_of,
    quoted,
    unknown_name,
)
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.units import shown
from bywire.core.values import parsed
from bywire.simulation.engine import engine_names
from bywire.simulation.run import Run

_SHARE = 1e-3  # of a value, by which it is moved to see what follows it


@dataclass(frozen=True)
class Bench:
    """A virtual test, complete.

    Parameters
    ----------
    experiment
        Name of the experiment.
    parameters
        Name of a parameter set of the catalog. Where it is empty, the main set of the experiment's
        brake; an experiment of any brake takes the only set of the brakes loaded by path.
    overrides, options
        Other parameters and options of the experiment, by dotted name: SI numbers, or texts with
        units such as ``"0.35 ohm"``. Durations below may be written so as well. Parameters may also
        be changed by a share, ``{"seal.T_pr": "+50%"}``, and several by ``{"seal.*": "-10%"}``.
    stimulus
        ``{"kind": ..., **parameters}`` for experiments that take a stimulus; a table may come
        from a file, see ``stimulus_sections``. Experiments of any brake also take such a mapping
        under the name of each further signal of the model's Stimulus.
    step
        Substep [s].
    record
        Recording interval [s]; None for the experiment's own.
    seed
        Seed of the sensors' noise.
    requirements
        KPI name -> limit, such as ``{"overshoot": "<= 15 %"}``.
    name
        What reports call it.
    faults
        What fails, and when: tables as those of ``[[faults]]`` in a bench file, see
        ``docs/faults.md``.
    assembly
        Which model of the parameters' brake is tested, where an experiment of any brake leaves
        the choice; that of the parameter set where empty.
    engine
        What computes its runs: ``auto``, ``compiled``, ``virtual-machine``, a graphics processor,
        ``cuda``, or the compiled C of the ECU in the loop, ``sil`` (double precision) or
        ``sil-single``.

    Raises
    ------
    InputError
        At construction, for anything that does not fit: names, values, files, steps. What only
        a run or this machine's memory shows comes when it is run.
    """

    experiment: str
    parameters: str = ""
    overrides: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    stimulus: Mapping[str, Any] = field(default_factory=dict)
    step: float = 20e-6
    record: float | None = None
    seed: int = 0
    requirements: Mapping[str, str] = field(default_factory=dict)
    name: str = ""
    assembly: str = ""
    faults: Sequence[Mapping[str, Any]] = ()
    engine: str = "auto"

    def __post_init__(self) -> None:
        for key in ("experiment", "parameters", "name", "assembly"):
            if not isinstance(getattr(self, key), str):
                raise ParameterError(f"{key} = {quoted(getattr(self, key))}: a text is wanted")
        for key in ("overrides", "options", "stimulus", "requirements"):
            object.__setattr__(self, key, dict(getattr(self, key)))  # ours alone from now on
        object.__setattr__(self, "faults", tuple(checked_sections(self.faults)))
        object.__setattr__(self, "step", checked_step(self.step))
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
        object.__setattr__(self, "experiment", chosen.name)  # not an earlier name of it
        if chosen.assembly != self.system:
            raise ParameterError(
                f"experiment {chosen.name!r} tests a {chosen.assembly}, but "
                + (
                    f"assembly = {self.assembly!r}"
                    if self.assembly
                    else f"parameter set {known.name!r} is for a {known.assembly}"
                )
            )
        self._check_stimulus(chosen)
        self._check_names()
        _ = self.limits  # read now, so that what cannot be judged is refused
        if chosen.preview is None:
            self._require_effects(written, self.cases(), chosen.cases)
        else:
            self._require_effects(written, self._made(chosen.preview), chosen.preview)

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy is made of: not what follows from it."""
        return {name: self.__dict__[name] for name in type(self).__dataclass_fields__}

    def _check_stimulus(self, chosen: Experiment) -> None:
        """Refuse a stimulus that the experiment does not take."""
        further = [name for name, each in self.stimulus.items() if isinstance(each, Mapping)]
        if len(further) < len(self.stimulus) and chosen.driven_unit is None:
            raise ParameterError(
                f"experiment {chosen.name!r} brings its own stimulus: leave out [stimulus], or "
                "use experiment 'open-loop'"
            )
        known = {} if chosen.beside is None else chosen.beside(self.chosen_options)
        for name in further:
            if name not in known:
                raise unknown_name(f"stimulus beside {chosen.name}", name, known)

    def _require_effects(self, names: Sequence[str], cases: Sequence[Case], make: Cases) -> None:
        """Refuse parameters that a choice switches off: they would be listed and do nothing.

        ``names``: those that are written out; a pattern may match some that have no effect.
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
        """Return whether the experiment asks for a parameter: with another value, it is another."""
        try:
            par, following = self.par.replace({name: other}), self.definition.following
            if following is not None and following(par) != following(self.par):
                return True
            others = self.cases_with(par, self.chosen_options, make)
            made = tuple(case.aligned(self.step, self.record) for case in others)
        except InputError:
            return True
        return not are_alike(cases, made)

    def require_effect(self, name: str) -> None:
        """Refuse a parameter that is to vary and that a choice switches off.

        Raises
        ------
        ParameterError
            With what switches it on.
        """
        if name not in self.par.leaves():
            return
        make = self.definition.preview or self.definition.cases
        cases, value = self._previewed, self.par.value(name)
        switches = switches_of(name, cases)
        moved = value + _SHARE * (abs(value) or 1.0)
        if switches and not self._is_used(name, moved, cases, make):
            refuse_without_effect(name, value, switches, self.par)

    def _check_names(self) -> None:
        """Refuse options that stand among the parameters, the likeliest mistake of all."""
        options = self.definition.defaults.flat().keys()
        parameters = PARAMETER_SETS.find(self.parameters).values.keys()
        for name in self.overrides:
            if name in options and name not in parameters:
                raise unknown_name("parameter", name, [f"{OPTION}{name}"])

    @cached_property
    def limits(self) -> Mapping[str, Limit]:
        """The requirements as they are judged, by KPI name."""
        return read_limits(self.requirements, self.definition.kpis_with(self.chosen_options))

    @cached_property
    def system(self) -> str:
        """Name of the assembly that is tested."""
        return self.assembly or PARAMETER_SETS.find(self.parameters).assembly

    @cached_property
    def definition(self) -> Experiment:
        """The experiment behind the name."""
        return experiment_of(self.experiment, self.parameters, self.assembly, self.options)

    @cached_property
    def par(self) -> ParameterSet:
        """Validated parameters, overrides applied."""
        base = PARAMETER_SETS.find(self.parameters).parameters()
        return base.replace(parsed(type(base), self.overrides, "parameter"))

    @cached_property
    def outdated(self) -> list[str]:
        """Which derived values of the set no longer match what they were derived from."""
        cited = PARAMETER_SETS.find(self.parameters).values
        leaves = leaf_fields(type(self.par))
        texts = []
        for each in outdated_values(cited, self.par, self.overrides):
            unit = leaves[each.name].unit.symbol
            now = shown(each.now, unit)
            then = shown(each.formula, unit) if math.isfinite(each.formula) else "no finite value"
            texts.append(
                f"{each.name} = {now} is derived ({each.where}) from {', '.join(each.changed)}, "
                f"which was changed, and no longer matches: its formula gives {then}, so set it "
                "too or leave it on purpose"
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
        """Validated stimuli by the names of their signals; that of a plain section under ""."""
        chosen, sections = self.definition, stimulus_sections(self.stimulus)
        units = {} if chosen.beside is None else dict(chosen.beside(self.chosen_options))
        if chosen.driven_unit is not None:
            units[""] = chosen.driven_unit(self.chosen_options)
        return {name: stimulus_of(each, units[name], name) for name, each in sections.items()}

    @property
    def chosen_stimulus(self) -> Stimulus | None:
        """Validated stimulus of a plain section; None where none is given."""
        return self.chosen_stimuli.get("")

    def summary(self, varied: Collection[str] = ()) -> str:
        """Return what its experiment does in one line, with the options that it has.

        ``varied``: quantities that take several values, ``options.NAME`` among them.
        """
        _, own = split_options(dict.fromkeys(varied))
        return self.definition.summary_with(self.chosen_options, own)

    def cases(self) -> tuple[Case, ...]:
        """Return the runs that the experiment consists of, with settling times as they are run."""
        return self._cases

    @cached_property
    def _cases(self) -> tuple[Case, ...]:
        return self._made(self.definition.cases)

    def cases_with(self, par: Any, options: Any, make: Cases | None = None) -> tuple[Case, ...]:
        """Return the runs as they would be with other parameters and options."""
        has_several = self.definition.beside is not None
        stimuli = self.chosen_stimuli if has_several else self.chosen_stimulus
        cases = (make or self.definition.cases)(par, options, stimuli)
        return with_faults(cases, self.faults) if self.faults else cases

    def _made(self, make: Cases) -> tuple[Case, ...]:
        """Return cases, or refuse overrides without effect and steps that do not divide."""
        cases = self.cases_with(self.par, self.chosen_options, make)
        for case in cases:
            _check_driven(case, self.definition)
        is_changed = any(case.par is not self.par for case in cases)
        for name in self.overrides if is_changed else ():
            wanted, given = self.par.value(name), [case.par.value(name) for case in cases]
            if given and all(value != wanted for value in given):
                raise ParameterError(
                    f"{name} = {wanted!r} would have no effect: experiment "
                    f"{self.experiment!r} sets it to {given[0]!r}; leave it out"
                )
        return tuple(case.aligned(self.step, self.record) for case in cases)

    @cached_property
    def injections(self) -> tuple[Injection, ...]:
        """What fails in the runs: the faults, read for the first of them."""
        if not self.faults:
            return ()
        has_several = self.definition.beside is not None
        stimuli = self.chosen_stimuli if has_several else self.chosen_stimulus
        case, *_ = self.definition.cases(self.par, self.chosen_options, stimuli)
        return injections(self.faults, case.model, case.par)

    def runs(self) -> dict[str, Run]:
        """Return the runs by label, for ensembles and sensitivities.

        Their time starts with the experiment's settling, ``Case.settle`` before its zero.
        """
        return {
            case.label: as_run(case, self.step, seed=(self.seed, number))
            for number, case in enumerate(self.cases())
        }

    def varied(
        self, overrides: Mapping[str, Any], options: Mapping[str, Any], seed: int | None = None
    ) -> Bench:
        """Return this bench with other numbers and choices, quicker than a new one is made.

        What its names and files are is known to fit; the values are checked as ever.

        Parameters
        ----------
        overrides, options
            Parameters, choices and numbers of the options by dotted name [SI].
        seed
            Seed of the sensors' noise; as it is by default.

        Raises
        ------
        InputError
            For values out of range, or with which the experiment cannot be set up.
        """
        made = object.__new__(type(self))
        known = made.__dict__
        known |= self._shared
        known["overrides"] = {**self.overrides, **overrides}
        known["options"] = {**self.options, **options}
        if any(isinstance(value, (str, bool)) for value in options.values()):
            known.pop("chosen_stimuli")  # a choice may say what is driven, and in which unit
        known["seed"] = self.seed if seed is None else seed
        known["par"] = par = self.par.replace(overrides)
        following = self.definition.following
        if not options and (following is None or following(par) == self._following):
            known["chosen_options"] = self.chosen_options
        known["_cases"] = made._made(self.definition.cases)
        return made

    @cached_property
    def _shared(self) -> dict[str, Any]:
        """What a bench has in common with those that it is varied to."""
        lasting = ("definition", "system", "chosen_stimuli")
        return {**self.__getstate__(), **{name: getattr(self, name) for name in lasting}}

    @cached_property
    def _following(self) -> Mapping[str, Any] | None:
        """The options that follow the parameters."""
        following = self.definition.following
        return None if following is None else following(self.par)

    def with_overrides(self, overrides: Mapping[str, Any]) -> Bench:
        """Return this bench with further parameters changed; shares are of what it has."""
        changes = settled(self.par, overrides)
        matched = changes.keys() - overrides.keys()
        silent = {name for name in matched if switches_of(name, self._previewed)}
        kept = {name: value for name, value in changes.items() if name not in silent}
        return replace(self, overrides={**self.overrides, **(kept or changes)})

    @property
    def _previewed(self) -> tuple[Case, ...]:
        """The runs, without what has to run before them."""
        preview = self.definition.preview
        return self.cases() if preview is None else self._made(preview)


def _check_driven(case: Case, experiment: Experiment) -> None:
    """Refuse an experiment that drives what its model has no stimulus for."""
    known = case.model.Stimulus._fields
    for name in case.stimulus(np.zeros(1)):
        if name not in known:
            error = unknown_name(f"stimulus of {case.model.name}", name, known)
            raise ModelError(
                f"{place_of(experiment.cases)}: experiment {experiment.name!r}: {error}"
            )
