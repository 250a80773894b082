"""The bench: what is tested, how, and what is required of it. The same thing as a bench file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from bywire.bench.experiment import EXPERIMENTS, Case, Cases, Experiment, as_run
from bywire.bench.extent import check_seed, checked_interval, checked_step
from bywire.bench.requirements import check
from bywire.bench.stimuli.registry import STIMULI, Stimulus, create
from bywire.bench.stimulus_file import with_nodes
from bywire.bench.values import parsed
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.parameters import ParameterSet
from bywire.simulation.run import Run


@dataclass(frozen=True)
class Bench:
    """A virtual test, complete.

    Parameters
    ----------
    experiment
        Name of the experiment.
    parameters
        Name of a parameter set of the catalog.
    overrides, options
        Other parameters and options of the experiment, by dotted name: SI numbers, or texts with
        units such as ``"0.35 ohm"``. Durations below may be written so as well.
    stimulus
        ``{"kind": ..., **parameters}`` for experiments that take a stimulus; a table may come
        from a file, see ``stimulus_file``.
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

    Raises
    ------
    InputError
        At construction, for anything that does not fit: names, values, files, steps. What only
        a run or this machine's memory shows comes when it is run.
    """

    experiment: str
    parameters: str
    overrides: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    stimulus: Mapping[str, Any] = field(default_factory=dict)
    step: float = 20e-6
    record: float | None = None
    seed: int = 0
    requirements: Mapping[str, str] = field(default_factory=dict)
    name: str = ""

    def __post_init__(self) -> None:
        for key in ("experiment", "parameters", "name"):
            if not isinstance(getattr(self, key), str):
                raise ParameterError(f"{key} = {quoted(getattr(self, key))}: a text is wanted")
        for key in ("overrides", "options", "stimulus", "requirements"):
            object.__setattr__(self, key, dict(getattr(self, key)))  # ours alone from now on
        object.__setattr__(self, "step", checked_step(self.step))
        object.__setattr__(self, "record", checked_interval(self.record))
        check_seed(self.seed)
        chosen, found = EXPERIMENTS.find(self.experiment), PARAMETER_SETS.find(self.parameters)
        if chosen.assembly != found.assembly:
            raise ParameterError(
                f"experiment {chosen.name!r} tests a {chosen.assembly}, but parameter set "
                f"{found.name!r} is for a {found.assembly}"
            )
        if self.stimulus and chosen.driven_unit is None:
            raise ParameterError(
                f"experiment {chosen.name!r} brings its own stimulus: leave out [stimulus], or "
                "use experiment 'open-loop'"
            )
        self._check_names()
        check(self.requirements, chosen.kpis_with(self.chosen_options))
        self._made(chosen.preview or chosen.cases)

    def _check_names(self) -> None:
        """Refuse options that stand among the parameters, the likeliest mistake of all."""
        options = self.definition.defaults.flat().keys()
        parameters = PARAMETER_SETS.find(self.parameters).values.keys()
        for name in self.overrides:
            if name in options and name not in parameters:
                raise unknown_name("parameter", name, [f"options.{name}"])

    @property
    def definition(self) -> Experiment:
        """The experiment behind the name."""
        return EXPERIMENTS.find(self.experiment)

    @cached_property
    def par(self) -> ParameterSet:
        """Validated parameters, overrides applied."""
        base = PARAMETER_SETS.find(self.parameters).parameters()
        return base.replace(parsed(type(base), self.overrides, "parameter"))

    @cached_property
    def chosen_options(self) -> ParameterSet:
        """Validated options of the experiment."""
        chosen = self.definition
        following = {} if chosen.following is None else chosen.following(self.par)
        values = parsed(chosen.options, self.options, f"option of {chosen.name}")
        return chosen.defaults.replace({**following, **values})

    @cached_property
    def chosen_stimulus(self) -> Stimulus | None:
        """Validated stimulus; None where none is given."""
        driven_unit = self.definition.driven_unit
        if not self.stimulus or driven_unit is None:
            return None
        values = dict(self.stimulus)
        kind = values.pop("kind", None)
        if not isinstance(kind, str):
            raise ParameterError(f"[stimulus] needs a kind: {', '.join(sorted(STIMULI.all()))}")
        unit = driven_unit(self.chosen_options)
        return create(kind, with_nodes(values, unit) if kind == "table" else values, unit)

    def cases(self) -> tuple[Case, ...]:
        """Return the runs that the experiment consists of, with settling times as they are run."""
        return self._made(self.definition.cases)

    def _made(self, make: Cases) -> tuple[Case, ...]:
        """Return cases, or refuse overrides without effect and steps that do not divide."""
        found = make(self.par, self.chosen_options, self.chosen_stimulus)
        wanted, made = self.par.flat(), [case.par.flat() for case in found]
        for name in self.overrides:
            if made and all(values[name] != wanted[name] for values in made):
                raise ParameterError(
                    f"{name} = {wanted[name]!r} would have no effect: experiment "
                    f"{self.experiment!r} sets it to {made[0][name]!r}; leave it out"
                )
        return tuple(case.aligned(self.step, self.record) for case in found)

    def runs(self) -> dict[str, Run]:
        """Return the runs by label, for ensembles and sensitivities.

        Their time starts with the experiment's settling, ``Case.settle`` before its zero.
        """
        return {
            case.label: as_run(case, self.step, seed=(self.seed, number))
            for number, case in enumerate(self.cases())
        }

    def with_overrides(self, overrides: Mapping[str, Any]) -> Bench:
        """Return this bench with further parameters changed."""
        return replace(self, overrides={**self.overrides, **overrides})
