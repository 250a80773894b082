"""A campaign, run: what is missing is computed, fault by fault, and kept as it comes."""

from __future__ import annotations

from bywire.bench.running import Progress
from bywire.campaigns.findings import CampaignFindings, finding
from bywire.campaigns.judging import judge_fault, judge_healthy
from bywire.campaigns.plan import CampaignPlan
from bywire.campaigns.simulating import healthy_traces
from bywire.campaigns.store import CampaignStore


def complete(plan: CampaignPlan, store: CampaignStore, progress: Progress) -> CampaignFindings:
    """Return what a campaign finds, computed as far as its folder does not hold it.

    Parameters
    ----------
    progress
        Called with the fault's name and the finished share, 0 to 1.

    Raises
    ------
    InputError
        When a fault cannot be put in, or the folder is another campaign's.
    RunError
        When a run fails.
    KeyboardInterrupt
        When interrupted; finished faults stay.
    """
    store.open(plan)
    progress("healthy runs", 0.0)
    healthy = judge_healthy(plan, healthy_traces(plan))
    findings = []
    for number, failing in enumerate(plan.faults):
        progress(failing.name, number / len(plan.faults))
        outcome = store.kept(number)
        if outcome is None:
            outcome = judge_fault(plan, failing, number, healthy)
            store.keep(number, outcome)
        findings.append(finding(failing, outcome))
    progress("judged", 1.0)
    return CampaignFindings(plan, healthy, tuple(findings))
