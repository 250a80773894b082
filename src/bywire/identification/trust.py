"""Trust in a method: estimates from simulated experiments compared with the true values."""

from __future__ import annotations

import hashlib
import math
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from bywire.bench.computation import functions_digest
from bywire.bench.experiment import Case, as_run
from bywire.cases.runner import complete
from bywire.cases.store import PieceLines
from bywire.core.copies import processes_with_brakes
from bywire.core.errors import BywireError, ParameterError
from bywire.core.model import ASSEMBLIES
from bywire.core.parameters import ParameterSet
from bywire.core.signals import signals_of
from bywire.core.typing import Progress, silent
from bywire.data.labeled import labeled
from bywire.identification.confidence import MisfitWarning
from bywire.identification.method import Effort, Method
from bywire.identification.unknown import parameters_of, scattered
from bywire.simulation.run import simulate

_STEP = 20e-6


@dataclass(frozen=True)
class Sensor:
    """A sensor that reads a run.

    ``output``: output of the model; ``sigma``: standard deviation of white noise on every sample
    [unit of the output].
    """

    output: str
    sigma: float = 0.0


def sensed(case: Case, sensors: Mapping[str, Sensor], random: np.random.Generator) -> xr.Dataset:
    """Return a run's signals from time zero on, with noise.

    ``sensors``: signal -> its sensor; ``random``: generator of the noise.
    """
    run = as_run(case, _STEP)
    computed = simulate(run, tuple({s.output for s in sensors.values()}))
    known = signals_of(run.model.Output)
    settled = run.duration - case.duration
    kept = computed.time >= settled - 1e-9
    axis = pd.Index(np.round(computed.time[kept] - settled, 12), name="time")
    rows = {}
    for name, sensor in sensors.items():
        values = computed[sensor.output][kept] + random.normal(0.0, sensor.sigma, int(kept.sum()))
        signal = known[sensor.output]
        rows[name] = (values, signal.unit, signal.label)
    return labeled({"time": (axis, "s", "time")}, rows)


# --- Trust
# Each experiment has its own seed, and its search starts away from the truth. Over many of them,
# the mean estimate must match the truth within its scatter, and the 95 % intervals must contain it
# about 95 times in 100.

_TRIES = 20
_KILLED = "with an output folder, bywire saves each experiment, and the same command continues"


@dataclass(frozen=True)
class Outcome:
    """Outcome of one simulated experiment.

    Parameters
    ----------
    seed
        Seed of its noise and of its start.
    values, deviations, low, high
        By label: estimate, its standard deviation, and the 95 % interval, SI.
    units
        SI unit by label.
    failed_checks
        Names of the method's failed checks.
    kept
        Labels that the data did not determine.
    error
        Reason if nothing was identified; otherwise empty.
    """

    seed: int
    values: Mapping[str, float]
    deviations: Mapping[str, float]
    low: Mapping[str, float]
    high: Mapping[str, float]
    units: Mapping[str, str]
    failed_checks: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()
    error: str = ""


def displaced(par: ParameterSet, names: Sequence[str], spread: float, seed: int) -> ParameterSet:
    """Return parameters, some changed by up to ``spread``, so that a search has to move.

    Raises
    ------
    ParameterError
        When there is no valid set around this one.
    """
    unknowns = parameters_of(par, [n for n in names if n in par.leaves()])
    if not unknowns or spread == 0.0:
        return par
    for values in scattered(unknowns, _TRIES + 1, spread, seed)[1:]:
        try:
            return par.replace({u.name: float(v) for u, v in zip(unknowns, values, strict=True)})
        except ParameterError:
            continue
    raise ParameterError(
        f"spread = {100 * spread:g} % gives no valid parameters. Reduce it",
        name="spread",
        value=f"{100 * spread:g} %",
    )


def experiments(
    method: Method,
    par: Any,
    options: Any,
    seeds: Iterable[int],
    effort: Effort,
    *,
    processes: int | None = 1,
    store: Path | None = None,
    progress: Progress | None = None,
) -> tuple[Outcome, ...]:
    """Simulate and identify one experiment per seed; the arguments are those of ``trust``."""
    chosen = replace(effort, threads=1, store=None, progress=None)
    wanted = list(dict.fromkeys(seeds))
    key = _key(method, par, options, chosen)
    lines, told = PieceLines(store), progress or silent
    done = complete(
        wanted,
        {outcome.seed: outcome for of, outcome in lines.pieces(_outcome) if of == key},
        partial(experiment, method, par, options, chosen),
        keep=lambda _, outcome: lines.keep(key, asdict(outcome)),
        progress=lambda _, share: told("experiments", share),
        workers=processes,
        pool=partial(processes_with_brakes, advice=_KILLED),
    )
    return tuple(done[seed] for seed in wanted)


def experiment(method: Method, par: Any, options: Any, effort: Effort, seed: int) -> Outcome:
    """Simulate one experiment and identify it from a displaced start."""
    try:
        data = method.synthetic(par, options, seed)
        start = par if par is None else displaced(par, method.unknowns, effort.spread, seed)
        with warnings.catch_warnings():  # a check of the method counts it
            warnings.simplefilter("ignore", MisfitWarning)
            identified = method.identify(data, start, options, replace(effort, seed=seed))
    except BywireError as error:
        return Outcome(seed, {}, {}, {}, {}, {}, error=str(error))
    values: dict[str, float] = {}
    deviations, low, high = dict(values), dict(values), dict(values)
    units: dict[str, str] = {}
    for estimate in identified.estimates.values():
        values |= dict(zip(estimate.names, estimate.values.tolist(), strict=True))
        deviations |= dict(zip(estimate.names, estimate.deviations.tolist(), strict=True))
        units |= {u.label: u.unit for u in estimate.unknowns}
        ends = estimate.intervals()
        low |= dict(zip(estimate.names, ends[:, 0].tolist(), strict=True))
        high |= dict(zip(estimate.names, ends[:, 1].tolist(), strict=True))
    kept = tuple(k.unknown.label for e in identified.estimates.values() for k in e.kept)
    checks = tuple(check.name for check in identified.checks if not check.holds)
    return Outcome(seed, values, deviations, low, high, units, checks, kept)


def _key(method: Method, par: Any, options: Any, effort: Effort) -> str:
    values = "" if par is None else par.model_dump_json()
    model = ASSEMBLIES.find(method.assembly) if method.assembly else None
    name = f"{method.name}{method.key}"
    computed = functions_digest(
        (method.identify, method.synthetic, method.truth, model),
        "bywire.identification",
        with_equations=True,
    )
    text = f"{name} {values} {options.model_dump_json()} {effort.starts} {effort.spread} {computed}"
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _outcome(row: Mapping[str, Any]) -> Outcome:
    """Return the outcome from an entry in a file of finished experiments."""
    return Outcome(**{**row, **{name: tuple(row[name]) for name in ("failed_checks", "kept")}})


# --- Trust

_BIAS = 3.0  # standard errors of the mean
_COVERED = (0.90, 0.99)


@dataclass(frozen=True)
class Recovered:
    """Recovery of one unknown.

    Parameters
    ----------
    label, unit, truth
        Name, SI unit and true value.
    count
        Number of experiments that determined it.
    bias
        Mean estimate minus truth.
    bias_in_errors
        Bias over the standard error of the mean.
    coverage, coverage_range
        Share of 95 % intervals that contain the truth, and its own 95 % confidence interval
        (Clopper, Pearson 1934).
    scatter, claimed
        Standard deviation of the estimates, and the root mean square of those that they claim.
    """

    label: str
    unit: str
    truth: float
    count: int
    bias: float
    bias_in_errors: float
    coverage: float
    coverage_range: tuple[float, float]
    scatter: float
    claimed: float

    @property
    def holds(self) -> bool:
        """Whether |bias| < 3 standard errors and the coverage can be 90 to 99 %."""
        low, high = self.coverage_range
        return abs(self.bias_in_errors) < _BIAS and low <= _COVERED[1] and high >= _COVERED[0]


@dataclass(frozen=True)
class Trust:
    """Results of many simulated experiments on a method.

    Parameters
    ----------
    outcomes
        One per seed, in their order.
    recovered
        One per unknown.
    """

    outcomes: tuple[Outcome, ...]
    recovered: tuple[Recovered, ...]

    @property
    def failed(self) -> tuple[Outcome, ...]:
        """Experiments without an identification."""
        return tuple(o for o in self.outcomes if o.error)

    @property
    def holds(self) -> bool:
        """Whether every experiment recovers every unknown."""
        return bool(self.recovered) and not self.failed and all(r.holds for r in self.recovered)


def trust(
    method: Method,
    par: Any,
    options: Any,
    seeds: Iterable[int],
    effort: Effort | None = None,
    *,
    processes: int | None = 1,
    store: Path | None = None,
    progress: Progress | None = None,
) -> Trust:
    """Identify many simulated experiments.

    Parameters
    ----------
    method, par, options
        Method, true parameters, and options.
    seeds
        Seeds, one per experiment.
    effort
        Effort of each search; ``spread`` is also the offset of its first start. One start by
        default.
    processes
        Number of parallel experiments; None for all cores.
    store
        File that saves finished experiments; the same study continues from there.
    progress
        Callback with a label and the finished share.

    Raises
    ------
    KeyboardInterrupt
        When interrupted; finished experiments are in the store.
    """
    outcomes = experiments(
        method,
        par,
        options,
        seeds,
        effort or Effort(starts=1),
        processes=processes,
        store=store,
        progress=progress,
    )
    return Trust(outcomes, tuple(_recovered(method, par, options, outcomes)))


def put_in(method: Method, par: Any, options: Any) -> dict[str, float]:
    """Return the true values of a method's simulated measurements, SI, by label.

    Parameters
    ----------
    method
        Method with the simulation ``method.synthetic``.
    par, options
        Its parameters, None for a method of any assembly, and its options.

    Raises
    ------
    ParameterError
        When the simulation has no true values of the method's estimates.
    """
    truth: dict[str, float] = {} if par is None else par.leaves()
    return truth if method.truth is None else {**truth, **method.truth(par, options)}


def _recovered(
    method: Method, par: Any, options: Any, outcomes: Sequence[Outcome]
) -> Iterator[Recovered]:
    from scipy import stats

    truth = put_in(method, par, options)
    for label in dict.fromkeys(label for o in outcomes for label in o.values if label in truth):
        telling = [o for o in outcomes if label in o.values]
        values = np.array([o.values[label] for o in telling])
        claimed = math.sqrt(float(np.mean([o.deviations[label] ** 2 for o in telling])))
        inside = sum(o.low[label] <= truth[label] <= o.high[label] for o in telling)
        scatter = float(values.std(ddof=1)) if len(telling) > 1 else math.nan
        error = (scatter if len(telling) > 1 else claimed) / math.sqrt(len(telling))
        bias = float(values.mean() - truth[label])
        ends = stats.binomtest(inside, len(telling)).proportion_ci(0.95)
        yield Recovered(
            label,
            telling[0].units[label],
            float(truth[label]),
            len(telling),
            bias,
            bias / error if error > 0.0 else math.copysign(math.inf, bias) if bias else 0.0,
            inside / len(telling),
            (float(ends.low), float(ends.high)),
            scatter,
            claimed,
        )
