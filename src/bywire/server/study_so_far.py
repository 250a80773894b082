"""What a study shows so far, as estimates and bars: told between chunks, long before a report."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from bywire.api.study_tables import figure_text, percent
from bywire.studies.findings import Findings

_BINS = 30
_MOST = 4  # figures of a study without requirements


def so_far(findings: Findings) -> list[dict[str, Any]]:
    """Return what the cases of a study say of each requirement, else of its first key figures.

    Shares of cases that were sought for say nothing, and none are told.

    Parameters
    ----------
    findings
        Of the cases that are there.

    Returns
    -------
    list of dict
        Of each its ``text``, the ``counts`` of its histogram, and the ``ends`` of that with units.
    """
    if not findings.plan.is_sampled or not len(findings.cases):
        return []
    return [
        {"text": text, **_bars(findings, name)}
        for name, text in (_judged(findings) if findings.judgments else _spread(findings))
    ]


def _judged(findings: Findings) -> Iterator[tuple[str, str]]:
    confidence = f"{100.0 * findings.plan.confidence:g} %"
    for each in findings.judgments:
        share = each.share
        low, high = percent(share.low, share), percent(share.high, share)
        yield (
            each.demand.figure,
            (
                f"{each.demand}: {share.count} of {share.cases} cases, probability "
                f"{percent(share.value, share)} ({confidence} interval: {low} to {high})"
            ),
        )


def _spread(findings: Findings) -> Iterator[tuple[str, str]]:
    for each in findings.spreads[:_MOST]:
        mean = figure_text(findings, each.name, each.mean)
        sd = figure_text(findings, each.name, each.sd, is_difference=True)
        yield each.name, f"{each.name}: mean {mean}, standard deviation {sd}"


def _bars(findings: Findings, name: str) -> dict[str, Any]:
    values = findings.figure(name)
    known = values[np.isfinite(values)]
    if not known.size:
        return {"counts": [], "ends": []}
    counts, edges = np.histogram(known, _BINS)
    ends = [figure_text(findings, name, float(edges[k])) for k in (0, -1)]
    return {"counts": counts.tolist(), "ends": ends}
