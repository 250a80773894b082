"""Execution of a campaign: runs, stored results of each fault, and coverage."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np

from bywire.bench.running import Progress
from bywire.campaigns.judging import FACTORS, Healthy, healthy_traces, judge_fault, judge_healthy
from bywire.campaigns.plan import CampaignPlan, Failing
from bywire.cases.runner import complete
from bywire.cases.store import PieceFolder, json_object
from bywire.core.callers import option
from bywire.core.typing import Array
from bywire.studies.statistics import Share, share

CONFIDENCE = 0.95
_AT = FACTORS.index(1.0)
_SAME = 1e-9  # s: tolerance for times of rows
Class = Literal["covered", "too late", "undetected", "harmless, seen", "latent"]


@dataclass(frozen=True)
class FaultFinding:
    """Outcomes of all runs with a fault.

    Parameters
    ----------
    failing
        The fault.
    reached
        Time from onset until each criterion is violated [s], by name. NaN if it is not violated.
    detected
        Time from onset until each residual detects it [s], by name; shape (factors, cases).
    extremes
        By signal: minimum, maximum and final deviation from the fault-free run.
    reacted
        Times of violation with the reaction, by criterion, for runs in which it was possible.
    answered
        Indices of these runs.
    delay
        Delay from detection to the reaction [s]; 0 without reaction.
    doubts
        Warnings from the solver in these runs.
    """

    failing: Failing
    reached: Mapping[str, Array]
    detected: Mapping[str, Array]
    extremes: Mapping[str, Sequence[Array]]
    reacted: Mapping[str, Array]
    answered: Sequence[int] = ()
    delay: float = 0.0
    doubts: Sequence[str] = ()

    @property
    def cases(self) -> int:
        """Number of runs."""
        return len(next(iter(self.reached.values())))

    @cached_property
    def violated(self) -> Array:
        """Time until the first violation of a criterion [s]; NaN if none; shape (cases,)."""
        return _first([*self.reached.values()])

    @cached_property
    def seen(self) -> Array:
        """Time until the first residual detects it [s], NaN without detection; shape (cases,)."""
        never = np.full(self.cases, math.nan)
        return _first([never, *(each[_AT] for each in self.detected.values())])

    @property
    def dangerous(self) -> int:
        """Number of runs that violate a criterion."""
        return int(np.sum(~np.isnan(self.violated)))

    @property
    def tolerance(self) -> float:
        """Fault tolerant time, from the worst run [s]; NaN without violation."""
        return float(np.nanmin(self.violated)) if self.dangerous else math.nan

    @property
    def in_time(self) -> int:
        """Number of dangerous runs with detection and reaction within the tolerant time."""
        there = ~np.isnan(self.violated)
        if not self.dangerous:
            return 0
        return int(np.sum(self.seen[there] + self.delay < self.tolerance))

    @property
    def criteria(self) -> dict[str, int]:
        """Number of runs that violate each criterion, for violated criteria."""
        counts = {name: int(np.sum(~np.isnan(times))) for name, times in self.reached.items()}
        return {name: count for name, count in counts.items() if count}

    @cached_property
    def only_with_reaction(self) -> dict[str, int]:
        """Number of runs that violate each criterion only because of the reaction."""
        counts = {
            name: int(np.sum(np.isnan(self._unanswered(name)) & ~np.isnan(times)))
            for name, times in self.reacted.items()
        }
        return {name: count for name, count in counts.items() if count}

    @cached_property
    def sooner_with_reaction(self) -> dict[str, int]:
        """Number of runs that violate each criterion anyway, but sooner with the reaction."""
        counts = {
            name: int(np.sum(times < self._unanswered(name) - _SAME))
            for name, times in self.reacted.items()
        }
        return {name: count for name, count in counts.items() if count}

    @cached_property
    def prevented_by_reaction(self) -> dict[str, int]:
        """Number of runs that violate each criterion only without the reaction."""
        counts = {
            name: int(np.sum(~np.isnan(self._unanswered(name)) & np.isnan(times)))
            for name, times in self.reacted.items()
        }
        return {name: count for name, count in counts.items() if count}

    @property
    def is_relieved(self) -> bool:
        """Whether the reaction prevents every violation in dangerous runs."""
        dangerous = set(np.flatnonzero(~np.isnan(self.violated)).tolist())
        if not dangerous or not dangerous <= set(self.answered):
            return False
        return all(np.isnan(times).all() for times in self.reacted.values())

    def _unanswered(self, criterion: str) -> Array:
        """Return the time of violation without the reaction, for runs with a reaction [s]."""
        return np.asarray(self.reached[criterion])[list(self.answered)]

    @property
    def first_seen_by(self) -> str:
        """Residual that detects the fault first in most runs; empty without detection."""
        names = [*self.detected]
        times = np.array([self.detected[name][_AT] for name in names])
        if not times.size:
            return ""
        ranked = np.where(np.isnan(times), np.inf, times)
        firsts = [
            names[k]
            for k, least in zip(ranked.argmin(0), ranked.min(0), strict=True)
            if np.isfinite(least)
        ]
        return Counter(firsts).most_common(1)[0][0] if firsts else ""

    @property
    def kind(self) -> Class:
        """Class of the fault, from its worst run."""
        if self.dangerous:
            if self.in_time == self.dangerous:
                return "covered"
            missed = np.isnan(self.seen[~np.isnan(self.violated)])
            return "undetected" if missed.any() else "too late"
        return "latent" if np.isnan(self.seen).any() else "harmless, seen"

    def severity(self, plan: CampaignPlan) -> str:
        """Return the worst severity of the violated criteria, by alphabetical order."""
        return max((c.severity for c in plan.criteria if c.name in self.criteria), default="")


@dataclass(frozen=True)
class CampaignFindings:
    """Findings of a campaign so far."""

    plan: CampaignPlan
    healthy: Healthy
    faults: tuple[FaultFinding, ...]

    @property
    def is_weighted(self) -> bool:
        """Whether failure rates weight the faults."""
        return bool(self.plan.rates)

    @property
    def coverage(self) -> float:
        """Fraction of dangerous runs detected in time, weighted by rates; NaN if there are none."""
        rows = [(self.plan.rate(f.failing) / f.cases, f.in_time, f.dangerous) for f in self.faults]
        total = sum(weight * dangerous for weight, _, dangerous in rows)
        return sum(weight * seen for weight, seen, _ in rows) / total if total else math.nan

    @property
    def coverage_of_cases(self) -> Share:
        """Unweighted fraction of dangerous runs detected in time, with its interval."""
        seen = sum(each.in_time for each in self.faults)
        return share(seen, sum(each.dangerous for each in self.faults), CONFIDENCE)

    @property
    def false_alarms(self) -> Share:
        """Fraction of fault-free runs, not used for tuning, in which a residual raises an alarm."""
        plan = self.plan
        return share(self.healthy.any_alarm, plan.healthy - plan.tuning, CONFIDENCE)

    @property
    def doubts(self) -> tuple[str, ...]:
        """Warnings from the solver, with the number of faults that caused them."""
        counts = Counter(text for each in self.faults for text in dict.fromkeys(each.doubts))
        return (
            *(f"fault-free runs: {text}" for text in self.healthy.traces.doubts),
            *(f"runs with {n} of the faults: {text}" for text, n in counts.items()),
        )

    def kinds(self) -> Counter[Class]:
        """Return the number of faults in each class."""
        return Counter(each.kind for each in self.faults)

    def harm_of_reaction(self) -> tuple[str, ...]:
        """Return the harmful effects of the reaction, one sentence each."""
        if self.plan.reaction is None:
            return ()
        groups = {
            "harmless, seen": [each for each in self.faults if each.kind == "harmless, seen"],
            "latent": [each for each in self.faults if each.kind == "latent"],
            "dangerous": [each for each in self.faults if each.dangerous],
        }
        caused = _harm({k: [f.only_with_reaction for f in each] for k, each in groups.items()})
        sooner = _harm({k: [f.sooner_with_reaction for f in each] for k, each in groups.items()})
        named = f"the reaction, {self.plan.reaction.failing.name},"
        worse = f"{named} is harmful: it alone causes {'; '.join(caused)}"
        return (
            *([worse] if caused else []),
            *([f"{named} hastens {'; '.join(sooner)}"] if sooner else []),
        )

    def benefit_of_reaction(self) -> str:
        """Return the violations that the reaction prevents, and the number of harmless faults."""
        dangerous = [each for each in self.faults if each.dangerous]
        prevented = _harm({"dangerous": [each.prevented_by_reaction for each in dangerous]})
        relieved = sum(each.is_relieved for each in dangerous)
        return (
            f"the reaction prevents {'; '.join(prevented) or 'nothing'}, and makes {relieved} of "
            f"{len(dangerous)} dangerous faults harmless"
        )

    def curve(self, residual: str) -> list[tuple[float, int, float, int]]:
        """Return threshold factor, false alarms, median delay [s] and number of detected runs.

        Rows are by factor, and count the dangerous runs of all faults.
        """
        rows = []
        for k, factor in enumerate(FACTORS):
            times = [each.detected[residual][k][~np.isnan(each.violated)] for each in self.faults]
            seen = np.concatenate(times) if times else np.empty(0)
            seen = seen[~np.isnan(seen)]
            median = float(np.median(seen)) if seen.size else math.nan
            rows.append((factor, self.healthy.alarms[residual][k], median, int(seen.size)))
        return rows


def finding(plan: CampaignPlan, number: int, outcome: Mapping[str, Any]) -> FaultFinding:
    """Return the finding of a fault's outcome; ``number``: the fault's index in the plan."""
    reacted = outcome.get("reacted", {}).get("reached", {})
    return FaultFinding(
        plan.faults[number],
        {name: _numbers(times) for name, times in outcome["reached"].items()},
        {name: _numbers(times) for name, times in outcome["detected"].items()},
        {name: [_numbers(each) for each in sides] for name, sides in outcome["extremes"].items()},
        {name: _numbers(times) for name, times in reacted.items()},
        outcome.get("reacted", {}).get("cases", ()),
        0.0 if plan.reaction is None else plan.reaction.delay,
        tuple(map(str, outcome.get("doubts", ()))),
    )


def _harm(groups: Mapping[str, Sequence[Mapping[str, int]]]) -> list[str]:
    """Return the affected criteria and the number of affected faults in each group.

    If several groups are affected by the same criteria, their sum comes first.
    """
    affected = {
        kind: worse
        for kind, each in groups.items()
        if (worse := [counts for counts in each if counts])
    }
    criteria = {
        kind: ", ".join(dict.fromkeys(name for counts in worse for name in counts))
        for kind, worse in affected.items()
    }
    shares = {kind: f"{len(each)} of {len(groups[kind])} {kind}" for kind, each in affected.items()}
    if len(shares) > 1 and len(set(criteria.values())) == 1:
        count, total = sum(map(len, affected.values())), sum(map(len, groups.values()))
        same = next(iter(criteria.values()))
        return [f"{same} in {count} of {total} faults ({'; '.join(shares.values())})"]
    return [f"{criteria[kind]} in {text} faults" for kind, text in shares.items()]


def _numbers(values: Any) -> Array:
    return np.array(values, dtype=np.float64)


def _first(columns: Sequence[Array]) -> Array:
    times = np.array(columns)
    ranked = np.where(np.isnan(times), np.inf, times).min(axis=0)
    return np.where(np.isfinite(ranked), ranked, np.nan)


# --- Running


@dataclass(frozen=True)
class CampaignStore(PieceFolder):
    """Folder of the outcomes of a campaign.

    Parameters
    ----------
    folder
        The campaign's folder.
    """

    NOUN = "campaign"
    KIND = "campaign of faults"
    COMMAND = "bywire faults"
    RECORD = "campaign.json"
    PIECES = "faults"
    FILE = "{:04d}.json"
    SAID: ClassVar[Mapping[str, type]] = {"digest": str, "campaign": dict}

    @property
    def elsewhere(self) -> str:
        """Advice if the folder contains another campaign."""
        return f"Choose another folder with {option('out')}, or remove this folder"

    def kept(self, plan: CampaignPlan) -> dict[int, dict[str, Any]]:
        """Return the stored outcomes of faults by number, without damaged outcomes."""
        outcomes = {}
        for number in self.finished() & {*range(len(plan.faults))}:
            try:
                outcomes[number] = json_object(self.path(number).read_bytes())
                finding(plan, number, outcomes[number])
            except (OSError, ValueError, KeyError, TypeError, AttributeError):
                outcomes.pop(number, None)
        return outcomes

    def keep(self, number: int, outcome: dict[str, Any]) -> None:
        """Store the outcome of a fault.

        Raises
        ------
        FileError
            If the folder is not writable.
        """
        text = json.dumps(outcome) + "\n"
        self.keep_file(number, lambda fresh: fresh.write_text(text, encoding="utf-8"))


# --- The run


def run_campaign(
    plan: CampaignPlan, store: CampaignStore | None, progress: Progress
) -> CampaignFindings:
    """Run a campaign, except for faults whose outcomes are in its folder.

    Parameters
    ----------
    plan, store
        Campaign and its folder, or None to store nothing.
    progress
        Called with the fault's name and the finished share, 0 to 1.

    Raises
    ------
    InputError
        If a fault cannot be injected, or the folder belongs to another campaign.
    RunError
        If a run fails.
    KeyboardInterrupt
        If interrupted. Finished faults remain.
    """
    if store is not None:
        store.begin(plan, {"name": plan.name})
    progress("fault-free runs", 0.0)
    healthy = judge_healthy(plan, healthy_traces(plan))
    # Each fault uses only a few lanes, so several faults in parallel use the cores better.
    outcomes = complete(
        range(len(plan.faults)),
        {} if store is None else store.kept(plan),
        lambda number: judge_fault(plan, plan.faults[number], healthy),
        keep=(lambda *_: None) if store is None else store.keep,
        progress=lambda number, share: progress(plan.faults[number].name, share),
    )
    progress("judged", 1.0)
    findings = (finding(plan, k, outcomes[k]) for k in range(len(plan.faults)))
    return CampaignFindings(plan, healthy, tuple(findings))
