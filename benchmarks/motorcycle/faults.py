"""Fault campaigns: cases per minute, including key figures, with all kernels built."""

from __future__ import annotations

import time

from benchmarks.result import Result, at_least
from benchmarks.suite import Part
from bywire.campaigns.campaign_file import read_campaign
from bywire.campaigns.running import run_campaign
from bywire.core.typing import silent

_GOAL = 1000.0  # cases per minute


def faults() -> list[Result]:
    """Measure the second run of the motorcycle brake's campaign, including fault-free runs."""
    plan = read_campaign("motorcycle")
    for _ in range(2):
        started = time.perf_counter()
        run_campaign(plan, None, silent)
        seconds = time.perf_counter() - started
    note = f"{plan.total} runs with a fault and {plan.healthy} fault-free runs, all evaluated"
    rate = 60.0 * plan.total / seconds
    return [at_least("faults.cases_per_minute", rate, _GOAL, "1/min", note)]


PART = Part("faults", faults)
