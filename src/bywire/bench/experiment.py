"""An experiment: its runs of a brake, and the judgment of their recordings."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from functools import lru_cache
from string import Formatter
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from bywire.bench.kpis import hysteresis, sine_sweep, step_response, tracking
from bywire.bench.kpis.kpi import Kpi
from bywire.core import units
from bywire.core.arguments import checked
from bywire.core.callers import option
from bywire.core.errors import ModelError, StepError, not_valid, quoted
from bywire.core.machine import machine_memory as _memory
from bywire.core.model import Model
from bywire.core.parameters import Leaf, ParameterSet, leaf_fields
from bywire.core.quantities import BY_SIZE, Unit, display_unit
from bywire.core.registry import Kind, instances
from bywire.core.units import convert, shown, unit_text
from bywire.simulation.advance import Change
from bywire.simulation.noise import Noise, put_noise
from bywire.simulation.run import Run
from bywire.simulation.schedule import longest_step, plan

if TYPE_CHECKING:
    import xarray as xr

# --- Summaries: one line on an experiment, with the values of its options


class Summary(str):
    """Experiment's summary, with its template.

    Parameters
    ----------
    text
        The line.
    template
        The same line with names of options in braces.
    """

    template: str

    def __new__(cls, text: str, template: str) -> Self:
        """Return the line with its template."""
        made = super().__new__(cls, text)
        made.template = template
        return made

    def __getnewargs__(self) -> tuple[str, str]:  # type: ignore[override]
        """Return the arguments of `__new__`, for copies."""
        return str(self), self.template


def summary_of(template: str, options: ParameterSet, varied: Collection[str] = ()) -> Summary:
    """Return a summary in which the values of options replace their names.

    Parameters
    ----------
    template
        Line with names of options in braces. A unit may follow a colon:
        ``"stop from {v_0:km/h} on {surface}"``. For a table of values, the line shows both ends.
    options
        The options.
    varied
        Names of options that take several values; the line marks them.

    Raises
    ------
    ModelError
        For names in braces that are not options, and for unmatched braces.
    """
    known, pieces = options.flat(), []
    try:
        for text, name, unit, _ in Formatter().parse(template):
            pieces.append(text)
            if name is not None:
                value = _value_text(known[name], _symbol(options, name), unit or "")
                pieces.append(f"{value} (varied)" if name in varied else value)
    except (KeyError, TypeError, ValueError) as error:
        raise ModelError(
            f"summary {quoted(template)}: braces must contain names of options ({error})",
            name="summary",
            value=template,
        ) from None
    return Summary("".join(pieces), template)


def _symbol(options: ParameterSet, name: str) -> str:
    """Return the SI unit of an option; that of a pure number for a choice."""
    leaf = leaf_fields(type(options)).get(name)
    return "1" if leaf is None else leaf.unit.symbol


def _value_text(value: Any, symbol: str, unit: str) -> str:
    """Return a value as part of a sentence: with its unit, or in words for a choice."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return value.replace("-", " ")
    several = value if isinstance(value, tuple) else (value,)
    largest = max(abs(float(each)) for each in several)
    if not unit and 0.0 < convert(largest, symbol, display_unit(symbol)) < 1e-3:
        unit = BY_SIZE.get(symbol, ((0.0, ""),))[0][1]  # 1 Pa, not 1e-05 bar
    unit = unit or display_unit(symbol)
    ends = dict.fromkeys((min(several), max(several)))  # 2 to 100 Hz
    numbers = " to ".join(f"{convert(float(each), symbol, unit):.6g}" for each in ends)
    return f"{numbers} {unit_text(unit)}".rstrip()


# --- Experiments

Recordings = Mapping[str, "xr.Dataset"]
_LENGTHENED = 100.0  # maximum settling until all sample times coincide, relative to the run


@dataclass(frozen=True)
class Case:
    """One run of an experiment.

    Parameters
    ----------
    label
        Name of the run within its experiment, for example ``"with-dither"``.
    model, par
        The system and its parameters, drive mode included.
    state, memory
        Initial values.
    stimulus
        ``stimulus(t) -> dict``: signals of the model's Stimulus at the times t [s] of the
        recording's axis, each of shape (len(t),); missing signals are zero.
    duration
        Duration of the recording after time zero [s].
    settle
        Time before zero in which the run settles [s], for example into a periodic orbit.
    keep
        Part of the settling time that the recording keeps [s].
    record
        Recording interval [s].
    start
        ``start(par) -> (state, memory)``: initial values for other parameters of this structure.
        It uses only ``core.ops``, so that exported models also begin at rest with changed
        parameters. None if there is no such function.
    """

    label: str
    model: Model
    par: ParameterSet
    state: Any
    memory: Any
    stimulus: Callable[[NDArray[np.float64]], Mapping[str, NDArray[np.float64]]]
    duration: float
    settle: float = 0.0
    keep: float = 0.0
    record: float = 1e-3
    start: Callable[[Any], tuple[Any, Any]] | None = None

    def aligned(self, step: float, interval: float | None = None) -> Case:
        """Return the case with a settling time after which all ticks and a row coincide at zero.

        The settling time is rounded up to a common multiple of the sample times and the recording
        interval. An event at zero then falls on a tick and on a recorded row.

        Parameters
        ----------
        step
            Substep [s].
        interval
            Recording interval [s]. None for the case's own interval.

        Raises
        ------
        StepError
            When the step does not divide a sample time or the recording interval, the common
            multiple is much longer than the run, or no step is chosen yet (NaN).
        """
        if math.isnan(step):
            raise without_step("this command does not choose a step")
        record = self.record if interval is None else interval
        periods = tuple((task.name, task.period) for task in self.model.tasks(self.par))
        settle = _settling(self.settle, self.duration, periods, step, record)
        is_aligned = settle == self.settle and record == self.record
        return self if is_aligned else replace(self, settle=settle, record=record)

    def intervals(self, interval: float | None = None) -> tuple[float, ...]:
        """Return all intervals [s] that a step must divide; ``interval``: as in `aligned`."""
        record = self.record if interval is None else interval
        return (*(task.period for task in self.model.tasks(self.par)), record)


@lru_cache(maxsize=256)  # the cases of a study share it
def _settling(
    settle: float,
    duration: float,
    periods: tuple[tuple[str, float], ...],
    step: float,
    record: float,
) -> float:
    """Return a settling time after which all ticks and a row coincide at zero (`Case.aligned`)."""
    schedule = plan(settle + duration, step, dict(periods), record)
    common = math.lcm(schedule.record_frames, *schedule.task_frames) * schedule.frame
    settled = float(f"{math.ceil(settle / common - 1e-9) * common:.12g}")
    if settled > _LENGTHENED * (settle + duration):
        raise StepError(
            f"a run of {settle + duration:g} s would need to settle for {settled:g} s, until all "
            "sample times and recording intervals coincide. Choose shorter sample times that are "
            f"multiples of each other ({', '.join(f'{name} {T:g} s' for name, T in periods)})",
            name="settle",
            value=f"{settled:g} s",
            valid=f"<= {_LENGTHENED * (settle + duration):g} s",
        )
    return settled


@dataclass(frozen=True)
class FaultyCase(Case):
    """One run of an experiment with faults.

    Parameters
    ----------
    changes
        Times [s] on the recording's axis, in order, each with the parameters from then on.
    corrupted
        ``corrupted(t) -> dict``: signals of the model's taps, which are part of its Stimulus.
    """

    changes: tuple[tuple[float, ParameterSet], ...] = ()
    corrupted: Callable[[NDArray[np.float64]], Mapping[str, NDArray[np.float64]]] = lambda _: {}


Cases = Callable[[Any, Any, Any], tuple[Case, ...]]
"""``cases(par, options, stimulus)``"""


@dataclass(frozen=True)
class Experiment:
    """A named virtual test.

    Parameters
    ----------
    name
        Name in bench files and on the command line.
    assembly
        Name of the tested assembly.
    summary
        One line for listings and below the titles of reports. `summary_with` replaces names of
        options in braces by their values, in the unit after a colon: ``"stop from {v_0:km/h}"``.
    options
        Class of its options, each with unit and range.
    defaults
        Options as in the source.
    cases
        ``cases(par, options, stimulus)``: the runs of the experiment; none for a static
        characteristic. ``stimulus`` is the bench file's `Stimulus`, or None. For an experiment with
        ``beside``, it maps names of signals to stimuli; the plain section has an empty name.
    judge
        ``judge(recordings, options)``: the experiment's KPIs.
    kpis
        Unit of each KPI by name, to check requirements before any run.
    figures
        Kinds of figures that show the experiment, by their names in the report layer.
    finish
        ``finish(recording, options)``: returns a recording with derived signals added.
    step
        ``step(options)``: setting of the step response, for KPIs and figures.
    loop, followed, sweep
        Corresponding settings of a hysteresis loop, a signal that follows another, and sines.
    static
        ``static(par, options)``: recordings of a static characteristic, which needs no run.
    driven_unit
        ``driven_unit(options)``: SI unit of the signal that a ``[stimulus]`` section drives; None
        if the experiment has its own stimulus.
    beside
        ``beside(options)``: SI unit of every stimulus that a section ``[stimulus.NAME]`` may
        drive, by its name; such an experiment records its stimuli. None if the experiment itself
        drives all signals.
    following
        ``following(par)``: defaults of options that depend on the parameters.
    preview
        ``cases`` with any start, for checks, if ``cases`` itself must compute runs first.
    without
        ``without(options)``: key figures that the options leave out.
    begins_at
        Recorded signal by the option that sets its initial value, for replays.
    compared
        Label of the ordinate by signal, for overlaid traces of several runs.
    named
        ``named(options)``: unit of every key figure by name, if a table among the options
        determines the key figures; ``kpis`` then contains the units for the default options.
    variants
        Names of further assemblies that the experiment also tests, for example the same brake with
        another motor. ``cases`` starts the assembly that fits its parameters.
    formerly
        Earlier name, which now belongs to an experiment for any brake. Bench files with that name
        still work if their options distinguish the two experiments.
    """

    name: str
    assembly: str
    summary: str
    options: type[ParameterSet]
    defaults: ParameterSet
    cases: Cases
    judge: Callable[[Recordings, Any], tuple[Kpi, ...]]
    kpis: Mapping[str, str]
    figures: tuple[str, ...]
    finish: Callable[[xr.Dataset, Any], xr.Dataset] | None = None
    step: Callable[[Any], step_response.Setting] | None = None
    loop: Callable[[Any], hysteresis.Setting] | None = None
    followed: Callable[[Any], tracking.Setting] | None = None
    sweep: Callable[[Any], sine_sweep.Setting] | None = None
    static: Callable[[Any, Any], dict[str, xr.Dataset]] | None = None
    driven_unit: Callable[[Any], str] | None = None
    beside: Callable[[Any], Mapping[str, str]] | None = None
    following: Callable[[Any], Mapping[str, Any]] | None = None
    preview: Cases | None = None
    without: Callable[[Any], tuple[str, ...]] | None = None
    named: Callable[[Any], Mapping[str, str]] | None = None
    begins_at: Mapping[str, str] = field(default_factory=dict)
    compared: Mapping[str, str] = field(default_factory=dict)
    formerly: str = ""
    variants: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        template = getattr(self.summary, "template", self.summary)
        object.__setattr__(self, "summary", summary_of(template, self.defaults))

    def tests(self, assembly: str) -> bool:
        """Return whether the experiment tests an assembly."""
        return assembly == self.assembly or assembly in self.variants

    def of(self, assembly: str) -> Experiment:
        """Return the experiment with one of its variants as the tested assembly."""
        return self if assembly == self.assembly else replace(self, assembly=assembly)

    def summary_with(self, options: Any, varied: Collection[str] = ()) -> str:
        """Return the summary with values of options; ``varied``: options with several values."""
        assert isinstance(self.summary, Summary)
        return summary_of(self.summary.template, options, varied)

    def kpis_with(self, options: Any) -> dict[str, str]:
        """Return the unit of every key figure by name, without those that the options leave out."""
        left_out = () if self.without is None else self.without(options)
        kpis = self.kpis if self.named is None else self.named(options)
        return {name: unit for name, unit in kpis.items() if name not in left_out}


@dataclass(frozen=True)
class _Driven:
    """Stimulus of a case's run, with noise from a seed."""

    case: Case
    seed: tuple[int, ...]

    def __call__(self, t: NDArray[np.float64]) -> NDArray[np.float64]:
        rows, noise = np.zeros((t.size, len(self.case.model.Stimulus._fields))), self.noise
        self.put_into(rows, t)
        for child, column in enumerate(noise.columns):
            put_noise(rows[:, column], noise.seed, child)
        return rows

    @property
    def noise(self) -> Noise:
        """Noise that `put_into` leaves out."""
        fields = self.case.model.Stimulus._fields
        return Noise(self.seed, tuple(k for k, n in enumerate(fields) if n.startswith("noise_")))

    def put_into(self, rows: NDArray[np.float64], t: NDArray[np.float64]) -> None:
        """Write the stimulus without noise into rows of zeros; see `bywire.simulation.run`."""
        given = driven_at(self.case, t - self.case.settle)
        for k, name in enumerate(self.case.model.Stimulus._fields):
            if name in given and not name.startswith("noise_"):
                rows[:, k] = given[name]


@checked
def as_run(
    case: Case, step: float, interval: float | None = None, seed: tuple[int, ...] = (0,)
) -> Run:
    """Return the engine's description of a case.

    The run begins at -settle on the recording's axis, with the settling time rounded up by
    `Case.aligned`. Signals of the stimulus named ``noise_*`` are standard normal. Each has its own
    generator, so a longer run begins with the same samples.
    """
    begun = case.aligned(step, interval)
    return Run(
        model=begun.model,
        par=begun.par,
        state=begun.state,
        memory=begun.memory,
        stimulus=_Driven(begun, seed),
        duration=begun.settle + begun.duration,
        step=step,
        record=begun.record,
        changes=changes_of(begun, begun.settle),
    )


def driven_at(case: Case, t: NDArray[np.float64]) -> Mapping[str, NDArray[np.float64]]:
    """Return the signals that a case drives at times of its recording [s], with faults."""
    given = case.stimulus(t)
    return {**given, **case.corrupted(t)} if isinstance(case, FaultyCase) else given


def changes_of(case: Case, zero: float) -> tuple[Change, ...]:
    """Return the changes of a case's run; ``zero``: time of the run at the recording's zero."""
    changes = case.changes if isinstance(case, FaultyCase) else ()
    return tuple(Change(zero + t, par) for t, par in changes)


def fixed(**levels: float) -> Callable[[NDArray[np.float64]], Mapping[str, NDArray[np.float64]]]:
    """Return a stimulus with constant levels [SI]."""
    return lambda t: {name: np.full(t.shape, value) for name, value in levels.items()}


EXPERIMENTS = Kind("experiment", ("experiments",), instances(Experiment))
"""every experiment for a single brake; `GENERIC_EXPERIMENTS` contains those for any brake"""


# --- Steps, seeds and memory, checked before a run

SHORTEST_STEP = 1e-9
"""shortest substep [s]: below it, a single tick of an ECU would take seconds to compute"""
LARGEST_ERROR = 0.1
"""largest numerical error that a bench may state"""
SMALLEST_ERROR = 1e-6
"""smallest numerical error that a bench may state"""
FINEST = 1e-6
"""shortest substep [s] that bywire chooses; a run with it takes 20 times as long as usual"""
LARGEST_SEED = 2**63 - 1
"""maximum seed that a recording's file can store"""

_COPIES = 3  # of the recorded rows in memory, while they become a dataset and a file
_GIGA = 1e9


class DefaultStep(float):
    """Substep [s] that nobody stated."""


def checked_step(value: Any) -> float:
    """Return a substep [s], or raise a StepError."""
    if isinstance(value, DefaultStep):
        return value
    return _checked_time("simulation.step", value, SHORTEST_STEP, False, "usually 20 us")


def checked_error(value: Any) -> float | None:
    """Return a numerical error as a fraction, None if none is stated, or raise a StepError."""
    if value is None:
        return None
    text = value if isinstance(value, str) else getattr(value, "text", "")
    error = units.Written(units.parse(value, "%", "simulation.error", 0.1), text)
    if SMALLEST_ERROR <= error <= LARGEST_ERROR:
        return error
    written = quoted(text) if text else f"{error:g}"
    valid = f">= {error_text(SMALLEST_ERROR)} and <= {error_text(LARGEST_ERROR)}"
    raise not_valid("simulation.error", written, valid, 'for example, "0.1 %"', StepError)


def longest_choice(intervals: Collection[float]) -> float:
    """Return twice the longest step [s] that bywire may choose.

    Parameters
    ----------
    intervals
        All sample times and recording intervals [s], which steps and their doubles divide.

    Raises
    ------
    StepError
        When the intervals permit only steps below `FINEST`.
    """
    longest = longest_step(intervals)
    if longest >= 2.0 * FINEST:
        return longest
    texts = ", ".join(shown(each, "s", digits=9) for each in sorted(set(intervals)))
    raise StepError(
        f"simulation.error is not possible with the sample times and recording intervals {texts}, "
        f"because bywire does not choose steps below {shown(FINEST, 's', 'us')}. Choose multiples "
        f"of each other, or type {option('overrides', {'simulation.step': '20us'})}",
        name="simulation.error",
        valid="simulation.step",
    )


def two_steps(step: str, error: str) -> StepError:
    """Return the error for a bench that states a step and a numerical error."""
    return StepError(
        f"simulation.step = {step} and simulation.error = {error} exclude each other, because "
        "the error determines the step. Remove one of them",
        name="simulation.error",
        value=error,
        valid="simulation.step or simulation.error",
    )


def without_step(reason: str) -> StepError:
    """Return the error for a stated numerical error for which no step is chosen."""
    return StepError(
        f"simulation.error is not possible here, because {reason}. Type "
        f"{option('overrides', {'simulation.step': '20us'})}",
        name="simulation.error",
        valid="simulation.step",
    )


def error_text(error: float) -> str:
    """Return a numerical error in percent.

    Examples
    --------
    >>> error_text(0.001)
    '0.1 %'
    """
    return f"{100.0 * error:.10g} %"


def checked_interval(value: Any) -> float | None:
    """Return a recording interval [s], None for the experiment's own, or raise a StepError."""
    if value is None:
        return None
    return _checked_time("simulation.record", value, 0.0, True, "usually 1 ms")


def _checked_time(name: str, value: Any, low: float, low_open: bool, advice: str) -> float:
    """Return a time [s] that remembers its text, which errors of the schedule use."""
    text = value if isinstance(value, str) else getattr(value, "text", "")
    time = units.Written(units.parse(value, "s", name), text)
    leaf = Leaf(name, Unit("s"), low, math.inf, low_open, high_open=True)
    if leaf.admits(time):
        return time
    written, valid = leaf.outside_text(time, text)
    raise not_valid(name, written, valid, advice, StepError)


def check_seed(value: Any) -> None:
    """Raise a ParameterError unless the value is a seed."""
    whole = isinstance(value, int) and not isinstance(value, bool)
    if not whole or not 0 <= value <= LARGEST_SEED:
        limits = f"a whole number, >= 0 and <= {LARGEST_SEED}"
        raise not_valid("simulation.seed", quoted(value), limits)


def check_extent(case: Case, run: Run) -> None:
    """Reject a run that records nothing, or more than fits into this machine's memory.

    ``case``: the run as the experiment describes it; ``run``: the same run for the engine.

    Raises
    ------
    StepError
        When steps do not divide each other, or with the memory that the run would need.
    """
    if not run.record <= case.duration:
        raise StepError(
            f"a recording of {shown(case.duration, 's')} cannot have rows every "
            f"{shown(run.record, 's')}. Lengthen the run, or record more often (simulation.record)",
            name="simulation.record",
            value=shown(run.record, "s"),
            valid=f"<= {shown(case.duration, 's')}",
        )
    check_memory(run, len(run.model.Output._fields))


def check_recordings(runs: Sequence[Run], held: float) -> None:
    """Reject runs that together need more memory than this machine has.

    ``held``: bytes of other recordings in memory.

    Raises
    ------
    StepError
        With the memory that they would need.
    """
    each = [8 * run.schedule().rows * len(run.model.Output._fields) for run in runs]
    needed, memory = held + sum(each) + (_COPIES - 1) * max(each, default=0), _memory()
    if needed > memory:
        longest = max(runs, key=lambda run: run.schedule().rows)
        raise StepError(
            f"{len(runs)} runs of up to {longest.duration:g} s, recorded every "
            f"{longest.record:g} s, together need about {needed / _GIGA:.3g} GB of memory, but "
            f"this machine has {memory / _GIGA:.3g} GB. Shorten the runs, or record less often "
            "(simulation.record)",
            name="simulation.record",
            value=f"{longest.record:g} s",
        )


def check_memory(run: Run, signals: int) -> None:
    """Reject a run whose rows do not fit into the memory of this machine.

    ``signals``: number of recorded signals.

    Raises
    ------
    StepError
        When steps do not divide each other, or with the memory that the run would need.
    """
    schedule = run.schedule()
    numbers = schedule.rows * signals * _COPIES
    numbers += schedule.stimulus_rows * len(run.model.Stimulus._fields)
    needed, memory = 8 * numbers, _memory()  # integers, because a float cannot represent every size
    if needed > memory:
        raise StepError(
            f"a run of {run.duration:g} s, recorded every {run.record:g} s, needs about "
            f"{Decimal(needed) / 10**9:.3g} GB of memory, but this machine has "
            f"{memory / _GIGA:.3g} GB. Shorten the run, or record less often (simulation.record)",
            name="simulation.record",
            value=f"{run.record:g} s",
        )
