"""What a study found, for JSON: requirements and key figures, as far as it is computed."""

from __future__ import annotations

from typing import Any

from bywire.api.study_rare import rare_data
from bywire.api.study_sensitivity import drivers_data
from bywire.studies.findings import Findings, Judgment
from bywire.studies.statistics import Spread


def findings_data(findings: Findings) -> dict[str, Any]:
    """Return design, cases, requirements and key figures; values in the figures' units."""
    plan = findings.plan
    count = len(findings.cases)
    return {
        "design": plan.design,
        "seed": plan.seed,
        "cases": count,
        "of": plan.total * (len(plan.judged_demands) if plan.sought else 1),
        "confidence": plan.confidence,
        "failed": len(findings.failures),
        "reasons": [
            {"why": why, "cases": len(rows), "first": findings.number(rows[0])}
            for why, rows in findings.reasons.items()
        ],
        "requirements": [
            _judgment_data(findings, each) for each in (findings.judgments if count else ())
        ],
        "kpis": {
            each.name: {
                "unit": each.unit,
                "nominal": each.nominal,
                "least": each.least,
                "largest": each.largest,
                "undefined": each.undefined,
                **(_spread_data(each) if plan.is_sampled else {}),
                **drivers_data(findings, each.name),
            }
            for each in findings.spreads
        },
    }


def _judgment_data(findings: Findings, judgment: Judgment) -> dict[str, Any]:
    """Return a requirement; of cases that were not drawn, without a probability."""
    demand, share = judgment.demand, judgment.share
    probability = {"probability": share.value, "low": share.low, "high": share.high}
    rare = {}
    if judgment.failure is not None:
        (of,) = [each for each in findings.rare if each.demand == demand]
        rare = rare_data(judgment.failure, of)
    return rare | {
        "kpi": demand.figure,
        "limit": demand.text,
        "wanted": demand.probability,
        "outcome": judgment.outcome,
        "met": share.count,
        **(probability if findings.plan.is_sampled else {}),
        "undecided_cases": judgment.undecided,
        "worst_case": None if judgment.worst is None else findings.number(judgment.worst),
    }


def _spread_data(spread: Spread) -> dict[str, Any]:
    """Return mean and quantiles of drawn cases."""
    return {
        "mean": spread.mean,
        "sd": spread.sd,
        "quantiles": [
            {"probability": q.probability, "value": q.value, "low": q.low, "high": q.high}
            for q in spread.quantiles
        ],
    }
