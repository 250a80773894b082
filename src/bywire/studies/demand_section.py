"""The section ``[requirements]`` of a study file: limits, each with a probability as wanted."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from bywire.bench.bench import Bench
from bywire.bench.requirements import Limit, read_limit
from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.units import parse

_WITH = re.compile(r"(.*?)\s+with\b\s*(.*?)\s*", re.DOTALL)
_PERCENT = re.compile(r"[+-]?[\d.]+(?:[eE][+-]?\d+)?\s*%")
_SHARE = re.compile(r"0?\.\d+")
_EXAMPLE = "99 %"


def read_demands(bench: Bench, section: Mapping[str, Any]) -> Iterator[Limit]:
    """Yield what is required: by the study, and by its bench of what the study says nothing of.

    Raises
    ------
    InputError
        For key figures that there are not, and limits and probabilities that cannot be read.
    """
    units = bench.definition.kpis_with(bench.chosen_options)
    for kpi, text in {**bench.requirements, **section}.items():
        if kpi not in units:
            raise unknown_name("KPI in [requirements]", kpi, units)
        split = _WITH.fullmatch(text) if isinstance(text, str) else None
        limit = read_limit(kpi, split[1] if split else text, units[kpi])
        yield replace(limit, probability=_probability(kpi, text, split[2])) if split else limit


def _probability(kpi: str, text: str, given: str) -> float:
    """Return the probability that stands behind "with" in the text of a requirement."""
    if not _PERCENT.fullmatch(given):  # 0.9 may be a share, or 0.9 %
        example = f"{100.0 * float(given):.10g} %" if _SHARE.fullmatch(given) else _EXAMPLE
        raise ParameterError(
            f"requirement {kpi} = {quoted(text)}: behind 'with' stands {quoted(given)}, and a "
            f"probability in percent is wanted: write for instance 'with {example}'"
        )
    share = parse(given, "1", f"probability of requirement {kpi}")
    if not 0.0 < share < 1.0:
        raise ParameterError(
            f"requirement {kpi}: a probability of {given} is not admissible: it must lie between 0 "
            "and 100 %, as 'with 99.9 %'; leave it out where every case has to meet the limit"
        )
    return share
