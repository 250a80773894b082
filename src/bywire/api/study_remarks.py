"""What a study says beside its figures: warnings, notes, and why cases have no result."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from bywire.api.study_rare import rare_notes, search_notes, state_texts
from bywire.api.study_sensitivity import missing_indices
from bywire.api.study_tables import shown_figures
from bywire.core.units import shown
from bywire.studies.designs import WORST
from bywire.studies.findings import Findings
from bywire.studies.plan import CHUNK, StudyPlan
from bywire.studies.sensitivity import VarianceShares

_REASONS = 10  # that are named
_WIDE = 0.15  # reach of an interval of shares of the variance to either side, that tells little


def warned(findings: Findings, of_the_bench: list[str]) -> list[str]:
    """Return what runs warn of, what is undecided of rare failures, and cases without a result."""
    count = len(findings.cases)
    said = [f"{text} ({cases} of {count} cases)" for text, cases in findings.warnings.items()]
    said += of_the_bench if not said else []
    if failed := findings.failures:
        said.append(
            f"{len(failed)} of {count} cases have no result; they count as missing every "
            "requirement"
        )
    if findings.spreads:
        said += _undefined(findings)
    elif count and not failed:
        said.append("no key figure is defined in any case: look at the bench alone, bywire run")
    return said + (state_texts(findings) if findings.rare and count else [])


def _undefined(findings: Findings) -> list[str]:
    """Return which figures of requirements are not defined in cases that ran."""
    cases: dict[int, list[str]] = {}
    for each in findings.judgments:
        undefined = int(np.count_nonzero(~np.isfinite(findings.figure(each.demand.figure))))
        if lacking := undefined - len(findings.failures):
            cases.setdefault(lacking, []).append(each.demand.figure)
    return [
        f"{', '.join(names)}: not defined in {number} of {len(findings.cases)} cases, which count "
        "as missing what is required"
        for number, names in cases.items()
    ]


def unfinished(plan: StudyPlan, cases: int, resume: str) -> str:
    """Return what is still to be computed, and by which command."""
    if plan.sought is not None:
        return f"not all cases that it asks for are computed yet: {resume}"
    limit = f" (its file gives it {shown(plan.time, 's')} at a time)"
    return (
        f"{plan.total - cases} of {plan.total} cases are not computed yet"
        f"{limit if math.isfinite(plan.time) else ''}: {resume}"
    )


def noted(findings: Findings, damaged: int) -> list[str]:
    """Return what was rounded or repaired, and what intervals stand for."""
    repaired = ""
    if damaged:
        files = "1 damaged chunk is" if damaged == 1 else f"{damaged} damaged chunks are"
        repaired = f"{files} computed again"
    return [
        *filter(None, [repaired]),
        *_rounding(findings.plan),
        *_on_intervals(findings),
        *_on_choices(findings.plan),
    ]


def failure_texts(findings: Findings, named: Callable[[int], str]) -> list[str]:
    """Return why cases have no result, each reason once, with the first case that has it.

    Parameters
    ----------
    named
        ``named(row)``: the case with its values.
    """
    reasons = findings.reasons
    texts = []
    for text, rows in list(reasons.items())[:_REASONS]:
        count = f"{len(rows)} cases, " if len(rows) > 1 else ""
        texts.append(f"{text} ({count}case {named(rows[0])})")
    rest = len(reasons) - len(texts)
    return texts + ([f"and {rest} reasons more"] if rest else [])


def _rounding(plan: StudyPlan) -> list[str]:
    if plan.total == plan.cases or not (plan.is_sampled or plan.sensitivity is not None):
        return []
    what = "whole groups" if plan.sensitivity is not None else f"whole chunks of {CHUNK}"
    return [f"{plan.total} cases in place of {plan.cases}: they come in {what}"]


def _on_choices(plan: StudyPlan) -> list[str]:
    choices = [v.name for v in plan.varied if not v.unit]
    if not choices or not plan.is_sampled:
        return []
    return [
        f"{', '.join(choices)}: a choice has no rank correlation: its correlation ratio ranks it "
        "among the quantities, without a sign or an interval; 'sobol-indices' tells its share of "
        "the variance"
    ]


def _on_intervals(findings: Findings) -> list[str]:
    plan = findings.plan
    if plan.design == WORST:
        return search_notes(findings)
    if plan.sought is not None:
        return rare_notes(findings)
    if plan.sensitivity is not None:
        return [
            f"{plan.design}: cases share values, so that shares of them are no probabilities",
            *((missing_indices(findings) + _wide_shares(findings)) if len(findings.cases) else []),
        ]
    if not plan.is_sampled:
        return [f"{plan.design}: what may happen, and not how often"]
    if plan.design == "monte-carlo":
        return []
    return [
        f"{plan.design}: intervals are those of independent cases, which scatter more as a rule"
    ]


def _wide_shares(findings: Findings) -> list[str]:
    """Return which key figures have shares of the variance that are hardly known."""
    design = findings.plan.sensitivity
    assert design is not None
    wide = [
        name
        for name in shown_figures(findings)
        if any(
            isinstance(each, VarianceShares) and max(each.first.reach, each.total.reach) > _WIDE
            for each in findings.sensitivity(name).drivers
        )
    ]
    if not wide:
        return []
    return [
        f"{', '.join(wide)}: {design.base} groups do not tell shares within +-{_WIDE:g}; "
        "name more cases in the study file, and run it into another folder"
    ]
