r"""Gains of a loop from requirements, for a set of models, with the largest worst slack.

.. math:: \max_{x, t} t \quad \text{with} \quad s_{jk}(x) \ge t

for every requirement j and model k: the maximum of the minimum slack, without the kinks of a plain
minimum. Of n drawn models, the worst floor((1 - P) n) do not count for a requirement with a
probability P, so that its slack over these models is a quantile. The optimizer uses sequential
quadratic programming from several starts, then a simplex search if it stopped at a kink of a
figure.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize
from scipy.stats import qmc

from bywire.analysis.loop_figures import LOOP_FIGURES
from bywire.bench.requirements import Limit
from bywire.core.errors import ParameterError
from bywire.core.interrupts import interrupt_handled
from bywire.core.typing import Array, Progress
from bywire.synthesis.bench_figures import BenchFigures
from bywire.synthesis.linear_case import LinearCase, read, room, slack, state_of, values_of
from bywire.synthesis.outcome import MISSED, Binding, Conflict, Design, Status

Report = Callable[[float], None]
"""``report(share)``: finished share of a stage, 0 to 1"""


def stage(progress: Progress | None, label: str) -> Report:
    """Return a function that reports the finished share of one stage, if progress is shown."""
    if progress is None:
        return lambda share: None
    return lambda share: progress(label, min(max(share, 0.0), 1.0))


def piece(report: Report, k: int, count: int) -> Report:
    """Return a function that reports the finished share of one of several pieces of a stage."""
    return lambda share: report((k + share) / count)


def suffixed(progress: Progress | None, text: str) -> Progress | None:
    """Return progress with a suffix in its labels."""
    if progress is None:
        return None
    return lambda label, share: progress(f"{label}, {text}", share)


# --- The optimizer

UNSTABLE = -12.0
"""slack of an unstable loop, before subtracting its growth"""
_LEAST, _LARGEST = -10.0, 3.0  # range of slacks that are treated as different
KEPT_MISSED = -1e3
"""below this slack, no point of a search meets the requirements to keep"""
_STEP = 1e-5  # of differences, as a fraction of a range
_SAMPLES, _STARTS = 64, 3
_ITERATIONS = 40
_SIMPLEX = 25  # evaluations per gain


@dataclass(frozen=True)
class Problem:
    """Design problem: parameters to choose, requirements, and models.

    Parameters
    ----------
    tunables
        Dotted name -> minimum and maximum value [SI]; the search uses a logarithmic scale if the
        minimum is above zero.
    requirements
        Constraints for every case. A requirement with a probability may be missed by some of the
        drawn models (see `spared`).
    cases
        The models, the nominal one first.
    """

    tunables: Mapping[str, tuple[float, float]]
    requirements: tuple[Limit, ...]
    cases: tuple[LinearCase, ...]
    _known: dict[tuple[bytes, int], tuple[Array, Array]] = field(default_factory=dict, repr=False)

    @property
    def evaluations(self) -> int:
        """Number of loops computed so far."""
        return len(self._known)

    def gains(self, z: Array) -> dict[str, float]:
        """Return gains by name for a point of the unit cube."""
        values = {}
        for share, (name, (low, high)) in zip(z, self.tunables.items(), strict=True):
            s = min(max(float(share), 0.0), 1.0)
            values[name] = low * (high / low) ** s if low > 0 else low + (high - low) * s
        return values

    def point(self, gains: Mapping[str, float]) -> Array:
        """Return the point of the unit cube for gains, or the nearest if they are outside."""
        shares = []
        for name, (low, high) in self.tunables.items():
            value = min(max(gains[name], low), high)
            share = math.log(value / low, high / low) if low > 0 else (value - low) / (high - low)
            shares.append(share)
        return np.array(shares)

    @cached_property
    def spared(self) -> Mapping[int, int]:
        """Number of drawn models that may miss a requirement, by its index, if it is above zero.

        Of n draws, this is floor((1 - P) n). A draw without a model misses every requirement.
        """
        draws = max((case.draws for case in self.cases), default=0)
        lacking = draws - sum(case.draws > 0 for case in self.cases)
        counts = {
            j: math.floor((1.0 - wanted.probability) * draws + 1e-9) - lacking
            for j, wanted in enumerate(self.requirements)
            if wanted.probability is not None
        }
        return {j: count for j, count in counts.items() if count > 0}

    def counted(
        self, slacks: ArrayLike, cases: Sequence[int], stable: Sequence[bool] | None = None
    ) -> Array:
        """Return slacks in which infinity replaces those that do not count.

        For each requirement, the worst drawn models do not count, up to the permitted number. An
        unstable model always counts.

        Parameters
        ----------
        slacks
            Shape (cases, requirements).
        cases
            Indices of the cases.
        stable
            Whether each case is stable. By default, this follows from slacks of `slacks`.
        """
        counted = np.array(slacks, dtype=float)
        drawn = np.array([k for k, case in enumerate(cases) if self.cases[case].draws], dtype=int)
        is_stable = counted.min(axis=1) >= _LEAST if stable is None else np.array(stable)
        for j, count in self.spared.items():
            worst = drawn[np.argsort(counted[drawn, j], kind="stable")[:count]]
            counted[worst[is_stable[worst]], j] = np.inf
        return counted

    def slacks(self, z: Array, cases: Sequence[int], *, plain: bool = False) -> Array:
        """Return the slack of every requirement for some cases, shape (cases, requirements).

        ``plain``: measures a bandwidth by its frequency (see `linear_case.room`).
        """
        return np.array([self._of(z, k)[int(plain)] for k in cases])

    def points_seen(self, cases: Sequence[int]) -> list[Array]:
        """Return all points that were computed for each of some cases."""
        keys = [{z for z, k in self._known if k == case} for case in cases]
        return [np.frombuffer(z) for z in sorted(set.intersection(*keys))]

    def _of(self, z: Array, k: int) -> tuple[Array, Array]:
        key = (np.round(z, 12).tobytes(), k)
        if key not in self._known:
            figures = self.cases[k].figures(self.gains(z))
            if figures.is_stable:
                both = [
                    [slack(figures, wanted) for wanted in self.requirements],
                    [room(figures, wanted) for wanted in self.requirements],
                ]
                slacks, rooms = np.clip(both, _LEAST, _LARGEST)
            else:
                worse = UNSTABLE - 10.0 * (figures.growth - 1.0)
                slacks = rooms = np.full(len(self.requirements), worse)
            self._known[key] = slacks, rooms
        return self._known[key]


@dataclass
class Search:
    """Search for the largest worst slack.

    Parameters
    ----------
    problem
        Design problem.
    cases
        Indices of the models to consider.
    wanted
        Requirements whose worst slack is maximized; all by default.
    kept
        Requirements that must be met at the same time.
    best, slack
        Best point so far and its worst slack, also after an interrupt.
    seen
        Slack and position of every visited point.
    plain
        Whether to measure a bandwidth by its frequency. If requirements cannot be met, the margin
        of the magnitude up to the limit does not show how far the frequency itself can go.
    """

    problem: Problem
    cases: Sequence[int]
    wanted: Sequence[int] | None = None
    kept: Sequence[int] = ()
    best: Array | None = None
    slack: float = -math.inf
    seen: list[tuple[float, Array]] = field(default_factory=list)
    plain: bool = False

    def recall(self) -> Array | None:
        """Return the best point of all searches over these cases."""
        for z in self.problem.points_seen(self.cases):
            self._judged(z)
        return self.best

    def run(self, starts: Sequence[Array], report: Report = lambda share: None) -> None:
        """Climb from each start, then from the best point with a simplex search, then again.

        Parameters
        ----------
        starts
            Points of the unit cube.
        report
            Called with the finished share, at every iteration.
        """
        parts = len(starts) + 2
        for k, start in enumerate(starts):
            self._climb(start, piece(report, k, parts))
        if self.best is None:
            report(1.0)
            return
        # A figure such as an overshoot has kinks: SQP stops there, a simplex search continues.
        n = self.best.size
        corners = np.vstack(
            [self.best, self.best + 0.04 * np.where(self.best < 0.5, 1, -1) * np.eye(n)]
        )
        options: Any = {"maxfev": _SIMPLEX * n, "initial_simplex": corners, "fatol": 1e-5}
        climb: Any = minimize  # its stubs distinguish the methods' starting points
        known, simplex = len(self.seen), piece(report, len(starts), parts)
        climb(
            lambda z: -self._judged(z),
            self.best,
            method="Nelder-Mead",
            bounds=[(0.0, 1.0)] * n,
            options=options,
            callback=lambda z: simplex((len(self.seen) - known) / (_SIMPLEX * n)),
        )
        self._climb(self.best, piece(report, len(starts) + 1, parts))
        report(1.0)

    def _chosen(self) -> list[int]:
        count = len(self.problem.requirements)
        return list(range(count)) if self.wanted is None else list(self.wanted)

    def _slacks(self, z: Array) -> Array:
        """Return the slacks that count, shape (cases, requirements).

        Slacks of a requirement that some models may miss are in descending order: which models
        these are may change between points, but each order statistic is continuous.
        """
        slacks = self.problem.slacks(np.clip(z, 0.0, 1.0), self.cases, plain=self.plain)
        if self.problem.spared:
            counted = self.problem.counted(slacks, self.cases)
            for j in self.problem.spared:
                slacks[:, j] = np.minimum(np.sort(counted[:, j])[::-1], _LARGEST)
        return slacks

    def _judged(self, z: Array) -> float:
        """Return the worst slack of the objectives, or the violation of a constraint."""
        slacks = self._slacks(z)
        value = float(slacks[:, self._chosen()].min())
        if self.kept:
            missing = float(slacks[:, list(self.kept)].min())
            if missing < -1e-6:
                value = KEPT_MISSED + missing
        self.seen.append((value, np.clip(z, 0.0, 1.0)))
        if value > self.slack:
            self.slack, self.best = self.seen[-1]
        return value

    def _climb(self, start: Array, report: Report) -> None:
        n, count = start.size, [0]

        def passed(_: Array) -> None:
            count[0] += 1
            report(count[0] / _ITERATIONS)

        def excess(v: Array) -> Array:
            self._judged(v[:n])
            slacks = self._slacks(v[:n])
            wanted = slacks[:, self._chosen()] - v[n]
            return np.concatenate([wanted.ravel(), slacks[:, list(self.kept)].ravel()])

        # Our own forward differences need one loop per gain for all requirements together.
        def slope(v: Array) -> Array:
            here, columns = excess(v), []
            for k in range(n):
                h = _STEP if v[k] < 0.5 else -_STEP
                moved = v.copy()
                moved[k] += h
                columns.append((excess(moved) - here) / h)
            rate = np.zeros(here.size)
            rate[: len(self.cases) * len(self._chosen())] = -1.0
            return np.column_stack([*columns, rate])

        # The slack is a separate variable (epigraph), because the minimum slack has kinks, but the
        # constraints have none.
        first = self._slacks(start)[:, self._chosen()].min()
        constraints: Any = [{"type": "ineq", "fun": excess, "jac": slope}]
        options: Any = {"maxiter": _ITERATIONS, "ftol": 1e-5}
        climb: Any = minimize
        climb(
            lambda v: -float(v[n]),
            np.append(start, max(first, UNSTABLE)),
            method="SLSQP",
            jac=lambda v: np.append(np.zeros(n), -1.0),
            bounds=[*[(0.0, 1.0)] * n, (None, None)],
            constraints=constraints,
            options=options,
            callback=passed,
        )
        report(1.0)


def starts_of(problem: Problem, given: Sequence[Array], seed: int) -> list[Array]:
    """Return start points: the given points, and the best of a seeded sample of the cube."""
    n = len(problem.tunables)
    sample = qmc.Sobol(n, rng=np.random.default_rng(seed)).random(_SAMPLES)
    worst = [float(problem.slacks(z, [0]).min()) for z in sample]
    order = np.argsort(worst)[::-1]
    return [*given, *(sample[k] for k in order[:_STARTS])]


# --- The design
# Without other constraints, a required bandwidth alone leads to the stability limit, and a phase
# margin alone to no integral action. The disk margin :math:`\alpha` guarantees (P.
# Seiler, A. Packard, P. Gahinet, "An Introduction to Disk Margins", IEEE Control Systems Magazine
# 40(5), 2020, section on disk-based gain and phase margins)
#
# .. math:: g_m \ge \frac{2 + \alpha}{2 - \alpha}, \quad
#     g_l \le \frac{2 - \alpha}{2 + \alpha}, \quad \varphi_m \ge 2 \arctan\frac{\alpha}{2}
#
# By this formula, smaller margins that the user requires lower it.

DISK = 0.5
"""minimum disk margin: gain by a factor of 1.67, phase by 28 degree"""
ERROR = 5.0
"""maximum steady-state error [%]"""
_WORSE = 1.5  # maximum factor by which constrained figures of the start may worsen
_TRACKS = 50.0  # error above which an output intentionally does not track the set point, %


def linear_floors(requirements: Sequence[Limit], error: float) -> tuple[Limit, ...]:
    """Return constraints for every model: a disk margin, and a residual error.

    Parameters
    ----------
    requirements
        The user's requirements. A required margin below the one that `DISK` guarantees lowers the
        constraint, and a requirement on the same figure replaces it.
    error
        The start's maximum steady-state error [%]; NaN for an unstable start. An error larger than
        `ERROR` may grow by half; a loop that does not track has no constraint.
    """
    texts = []
    named = {wanted.figure for wanted in requirements}
    if "disk_margin" not in named:
        disk = min([DISK, *(_implied(wanted) for wanted in requirements)])
        texts.append(f"disk_margin >= {disk:.3g}")
    if "steady_state_error" not in named and not error > _TRACKS:
        limit = ERROR if math.isnan(error) else max(ERROR, _WORSE * error)
        texts.append(f"steady_state_error <= {limit:.3g} %")
    return read(texts) if texts else ()


def bench_floors(
    requirements: Sequence[Limit],
    floors: Sequence[Limit],
    trials: Iterable[BenchFigures],
) -> tuple[Limit, ...]:
    """Return constraints for retuned gains: floors, and the linear design's settled step.

    Parameters
    ----------
    requirements
        The user's requirements.
    floors
        See `linear_floors`.
    trials
        Results of the linear design on the bench in every trial.
    """
    steps = [figures.step for figures in trials if figures.step]
    kept = list(floors)
    named = {wanted.figure for wanted in requirements}
    errors = [step["steady_state_error"] for step in steps]
    if errors and "steady_state_error" not in named:
        kept = [floor for floor in kept if floor.figure != "steady_state_error"]
        if all(error <= _TRACKS for error in errors):  # NaN is not
            kept += read([f"steady_state_error <= {max(ERROR, _WORSE * max(errors)):.3g} %"])
    times = [step["settling_time"] for step in steps]
    if times and "settling_time" not in named and all(0.0 < time < math.inf for time in times):
        kept += read([f"settling_time <= {_WORSE * max(times):.3g} s"])
    return tuple(kept)


def _implied(wanted: Limit) -> float:
    """Return the disk margin that guarantees a required margin; infinity for other figures.

    Return half of it for an upper limit of the margin.
    """
    if wanted.figure == "phase_margin":
        disk = 2.0 * math.tan(math.radians(0.5 * wanted.bound))
    elif wanted.figure == "gain_margin":
        disk = 2.0 * (wanted.bound - 1.0) / (wanted.bound + 1.0)
    elif wanted.figure == "lower_gain_margin":
        disk = 2.0 * (1.0 - wanted.bound) / (1.0 + wanted.bound)
    elif wanted.figure == "sensitivity_peak":  # |S - T| = |2 S - 1| <= 2 max|S| + 1
        return (1.0 if wanted.is_upper else 0.5) * 2.0 / (2.0 * wanted.bound + 1.0)
    else:
        return math.inf
    is_least = wanted.is_upper == (wanted.figure == "lower_gain_margin")
    return max(disk * (1.0 if is_least else 0.5), 1e-3)


# --- The designer

_FINE = 4000  # points of the grid for reported figures
_BINDS = 0.01  # slacks this close to the worst one bind
_ROUNDS, _PAIRED = 8, 3
_CONFIRMED, _ALIKE = 40, 1e-3  # number of points evaluated again, and their minimum distance
_CONFIRMED_FIGURES, _APART = 150, 1e-2  # likewise, in a search by figures
_HELD = -1e-3  # minimum slack of constrained figures, with rounding


def design(
    tunables: Mapping[str, tuple[float, float]],
    requirements: Sequence[Limit],
    cases: Sequence[LinearCase],
    start: Mapping[str, float],
    *,
    seed: int = 0,
    progress: Progress | None = None,
) -> Design:
    """Choose gains that meet requirements for every model with the largest slack.

    The search starts with the nominal model and adds the worst other models; all models are checked
    at the end. An interrupt ends the search, and the function returns the best gains so far. The
    constraints of `linear_floors` are also enforced.

    Parameters
    ----------
    tunables
        Dotted name -> minimum and maximum value [SI].
    requirements
        See `linear_case.read`.
    cases
        Models, the nominal one first.
    start
        Initial gains, in addition to a sample.
    seed
        Seed of that sample.
    progress
        Called with a label and the finished share.

    Raises
    ------
    ParameterError
        When no parameter can be tuned, or a bandwidth is above half the sampling frequency.
    """
    if not tunables:
        raise ParameterError(
            "all tunable parameters of the loop are fixed. Set fewer of them", name="parameters"
        )
    floors = linear_floors(requirements, largest_error(cases, start))
    problem = Problem(tunables, (*requirements, *floors), tuple(cases))
    _require_sampled(problem, start)
    first = problem.point(start)
    search, status = Search(problem, [0]), "met"
    conflicts: tuple[Conflict, ...] = ()
    try:
        _over_all(search, [first], seed, progress)
        if search.best is not None:
            search.best = _confirmed(search)
        if search.slack < MISSED:
            status = "infeasible"
            search = _by_figures(search, progress)
            conflicts = _conflicts(search, progress)
    except KeyboardInterrupt:
        interrupt_handled()
        status = status if status == "infeasible" else "interrupted"
    z = first if search.best is None else search.best
    outcome = _judged(problem, z, "interrupted" if status == "interrupted" else None, conflicts)
    return replace(outcome, kept=floors)


def largest_error(cases: Sequence[LinearCase], gains: Mapping[str, float]) -> float:
    """Return the maximum steady-state error over some models [%]; NaN if one is unstable."""
    every = [case.figures(gains) for case in cases]
    return max(
        (figures.steady_state_error if figures.is_stable else np.nan for figures in every),
        key=lambda error: np.inf if np.isnan(error) else error,
    )


def _require_sampled(problem: Problem, start: Mapping[str, float]) -> None:
    period = problem.cases[0].figures(start).closed.period
    for wanted in problem.requirements:
        if wanted.unit == "Hz" and not wanted.is_upper and wanted.bound >= 0.5 / period:
            raise ParameterError(
                f"requirement {str(wanted)!r} cannot be met because the loop's sample time is "
                f"{period * 1e3:g} ms. Use a limit < {0.5 / period:g} Hz",
                name=wanted.figure,
                value=wanted.text,
                valid=f"< {0.5 / period:g} Hz",
            )


def _over_all(
    search: Search, starts: Sequence[Array], seed: int, progress: Progress | None
) -> None:
    """Search over the nominal model, and add the worst other model until none is worse."""
    problem, everything = search.problem, range(len(search.problem.cases))
    begin = starts_of(problem, starts, seed)
    # A quantile has more local optima than a minimum, so each of its searches has several starts.
    again = begin if any(each.probability is not None for each in problem.requirements) else []
    for _ in range(_ROUNDS):
        count = len(search.cases)
        models = "" if count == 1 else f", {count} models"
        search.run(begin, stage(progress, f"linear design{models}"))
        if search.best is None:
            return
        every = problem.slacks(search.best, everything)
        counted = problem.counted(every, everything)
        slacks = counted.min(axis=1)
        worst = int(np.argmin(slacks))
        # Models that do not count are needed too: the search spares as many of its own models.
        missing = np.flatnonzero(np.isinf(counted[:, int(np.argmin(counted[worst]))])).tolist()
        added = [k for k in (*missing, worst) if k not in search.cases]
        if slacks[worst] >= search.slack - 1e-4 or not added:
            return
        begin = [search.best, *again]
        search.cases, search.slack, search.seen = [*search.cases, *added], -np.inf, []


def _by_figures(search: Search, progress: Progress | None) -> Search:
    """Return a search by the figures themselves, from the best visited point."""
    by_room = Search(search.problem, search.cases, plain=True)
    best = by_room.recall()
    if best is not None:
        by_room.run([best], stage(progress, "linear design, nearest to all limits"))
    return by_room


def _confirmed(search: Search) -> Array:
    """Return the best point on a finer grid of frequencies, for all models.

    A coarse grid may miss a narrow dip of the closed loop to -3 dB, and the best points are where
    figures jump.
    """
    problem = search.problem

    def fine_slack(z: Array) -> float:
        every = [case.figures(problem.gains(z), _FINE) for case in problem.cases]
        slacks = [
            [slack(figures, wanted) for wanted in problem.requirements]
            if figures.is_stable
            else [UNSTABLE] * len(problem.requirements)
            for figures in every
        ]
        stable = [figures.is_stable for figures in every]
        return float(problem.counted(slacks, range(len(every)), stable).min())

    best = _looked_anew(search, fine_slack, -np.inf, 1e-4, (_CONFIRMED, _ALIKE))
    return np.asarray(search.best if best is None else best)


def _confirmed_by_figures(search: Search, wanted: Limit, kept: Limit) -> Array | None:
    """Return the point with the best figure on a finer grid that meets another requirement.

    None if no visited point meets it.
    """
    problem = search.problem

    def fine_room(z: Array) -> float:
        every = [problem.cases[k].figures(problem.gains(z), _FINE) for k in search.cases]
        if not all(figures.is_stable for figures in every):
            return -np.inf
        rooms = [[room(figures, each) for each in problem.requirements] for figures in every]
        least = problem.counted(rooms, search.cases, [True] * len(every)).min(axis=0)
        if least[problem.requirements.index(kept)] < _HELD:
            return -np.inf
        return float(least[problem.requirements.index(wanted)])

    return _looked_anew(search, fine_room, KEPT_MISSED, 1e-3, (_CONFIRMED_FIGURES, _APART))


def _looked_anew(
    search: Search,
    judge: Callable[[Array], float],
    least: float,
    gain: float,
    limits: tuple[int, float],
) -> Array | None:
    """Return the best visited point by a finer evaluation, which starts with the best coarse ones.

    It ends when the coarse slack is not above ``least`` or cannot improve by ``gain``. The first of
    the limits is the maximum number of evaluated points, and the second their minimum distance.
    """
    most, apart = limits
    best, place = -np.inf, None
    judged: list[Array] = []
    for coarse, z in sorted(search.seen, key=lambda point: -point[0]):
        if coarse <= max(best + gain, least) or len(judged) >= most:
            break
        if any(float(np.max(np.abs(z - other))) < apart for other in judged):
            continue
        judged.append(z)
        fine = judge(z)
        if fine > best:
            best, place = fine, z
    return place


def _conflicts(search: Search, progress: Progress | None) -> tuple[Conflict, ...]:
    """Return the best value of each requirement that every binding requirement allows."""
    problem = search.problem
    if search.best is None:
        return ()
    slacks = problem.slacks(search.best, search.cases, plain=True)
    slacks = problem.counted(slacks, search.cases).min(axis=0)
    bound = [int(k) for k in np.argsort(slacks) if slacks[k] <= slacks.min() + 5 * _BINDS]
    conflicts = []
    report = stage(progress, "conflicting requirements")
    pairs = list(permutations(bound[:_PAIRED], 2))
    for k, (a, b) in enumerate(pairs):
        pushed = Search(problem, search.cases, wanted=[a], kept=[b], plain=True)
        seen = pushed.recall()
        start = search.best if seen is None else seen
        pushed.run([start], piece(report, k, len(pairs)))
        wanted, kept = problem.requirements[a], problem.requirements[b]
        best = _confirmed_by_figures(pushed, wanted, kept)
        if best is not None:
            gains = problem.gains(best)
            value = _extreme(problem, gains, wanted, search.cases)
            conflicts.append(Conflict(wanted, kept, value, gains))
    return tuple(conflicts)


def _extreme(
    problem: Problem, gains: Mapping[str, float], wanted: Limit, cases: Sequence[int]
) -> float:
    every = [problem.cases[k].figures(gains, _FINE) for k in cases]
    rooms = [[room(figures, each) for each in problem.requirements] for figures in every]
    counted = problem.counted(rooms, cases, [True] * len(every)) == np.array(rooms)
    values = [
        getattr(figures, wanted.figure)
        for figures, counts in zip(every, counted, strict=True)
        if counts[problem.requirements.index(wanted)]
    ]
    return float(min(values) if not wanted.is_upper else max(values))


def _judged(
    problem: Problem, z: Array, status: Status | None, conflicts: tuple[Conflict, ...]
) -> Design:
    """Return the design of a point, with all models computed again on the fine grid."""
    gains = problem.gains(z)
    every = {case.label: case.figures(gains, _FINE) for case in problem.cases}
    rows = {label: values_of(figures) for label, figures in every.items()}
    states = {label: state_of(figures) for label, figures in every.items()}
    rooms = np.array([[room(f, wanted) for wanted in problem.requirements] for f in every.values()])
    stable = [figures.is_stable for figures in every.values()]
    counts = problem.counted(rooms, range(len(rooms)), stable) == rooms
    bindings = [
        Binding(wanted, label, rows[label][wanted.figure], float(rooms[k, j]))
        for k, label in enumerate(rows)
        for j, wanted in enumerate(problem.requirements)
        if counts[k, j]
    ]
    bindings.sort(key=lambda binding: binding.slack)
    is_sound = set(states.values()) == {""}
    slack = bindings[0].slack if is_sound else -np.inf
    worst = {}
    for name, figure in LOOP_FIGURES.items():
        sign = -1.0 if figure.is_less_better else 1.0
        counted = [label for k, label in enumerate(rows) if counts[k, _limits(problem, name)].all()]
        label = min(counted, key=lambda case: _size(sign * rows[case][name]))
        worst[name] = (rows[label][name], label)
    missed = {
        str(wanted): int((rooms[:, j] < MISSED).sum())
        for j, wanted in enumerate(problem.requirements)
        if wanted.probability is not None
    }
    return Design(
        gains=gains,
        status=status or ("met" if slack >= MISSED else "infeasible"),
        nominal=next(iter(rows.values())),
        worst=worst,
        binding=tuple(b for b in bindings if b.slack <= bindings[0].slack + _BINDS),
        conflicts=conflicts,
        slack=float(slack),
        evaluations=problem.evaluations,
        unsound={label: state for label, state in states.items() if state},
        missed=missed,
    )


def _limits(problem: Problem, figure: str) -> list[int]:
    """Return the indices of requirements that limit a figure on its worse side."""
    is_upper = LOOP_FIGURES[figure].is_less_better
    return [
        j
        for j, each in enumerate(problem.requirements)
        if each.figure == figure and each.is_upper == is_upper
    ]


def _size(value: float) -> float:
    """Return the figure by which models are ranked; a model without the figure is the worst."""
    return -np.inf if np.isnan(value) else value
