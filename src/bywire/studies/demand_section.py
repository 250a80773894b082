"""The section ``[requirements]`` of a study file: limits, each with a probability as wanted."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from bywire.bench.bench import Bench
from bywire.bench.requirements import limit_of
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.units import parse
from bywire.studies.plan import Demand

_WITH = re.compile(r"(.*\S)\s+with\s+(\S.*%)\s*", re.DOTALL)


def read_demands(bench: Bench, section: Mapping[str, Any]) -> Iterator[Demand]:
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
        limit, probability = (split[1], _probability(kpi, split[2])) if split else (text, None)
        limit_of(kpi, limit, units[kpi])
        yield Demand(kpi, limit, probability)


def _probability(kpi: str, text: str) -> float:
    share = parse(text, "1", f"probability of requirement {kpi}")
    if not 0.0 < share < 1.0:
        raise ParameterError(
            f"requirement {kpi}: a probability of {text} is not admissible: it must lie between 0 "
            "and 100 %, as 'with 99.9 %'; leave it out where every case has to meet the limit"
        )
    return share
