"""Fault campaign that can continue after an interrupt."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bywire.usecases.asks import BenchChanges, LastOutFolder
from bywire.usecases.declare import NOTHING, Ask, Form, use_case

if TYPE_CHECKING:
    from bywire.api.run_faults import FaultCampaign
    from bywire.campaigns.plan import CampaignPlan
    from bywire.core.typing import Progress

CampaignName = Annotated[
    str | Path,
    Ask(
        "Campaign file (TOML) or a campaign's name, e.g. motorcycle.",
        "Campaign",
        known=("campaigns",),
        files=".toml",
        offered=("campaigns",),
        is_text=True,
    ),
]


def _read(campaign: str | Path, overrides: Mapping[str, str]) -> "CampaignPlan":
    from bywire.campaigns.campaign_file import read_campaign

    return read_campaign(campaign, overrides)


def _holds(folder: Path, plan: "CampaignPlan") -> bool:
    from bywire.campaigns.running import CampaignStore

    return CampaignStore(folder).holds(plan)


@use_case(
    "faults",
    form=Form("Fault campaign", "Run or continue", "campaign"),
    check=_read,
    holds=_holds,
)
def run_faults(
    campaign: CampaignName,
    out: LastOutFolder = None,
    overrides: BenchChanges = NOTHING,
    *,
    progress: "Progress | None" = None,
) -> "FaultCampaign":
    """Simulate every fault during a maneuver, and report effects, detection and coverage.

    Parameters
    ----------
    campaign
        Campaign file (see ``docs/faults.md``), or the name of a campaign that comes with a brake.
    out
        Folder for the outcomes, so that the same call continues after an interrupt. By default,
        bywire saves nothing.
    overrides
        Changes to the bench, as strings with units.
    progress
        Called with a label and the completed fraction, 0 to 1.

    Returns
    -------
    FaultCampaign
        Effect, class, fault-tolerant time [s] and detection time [s] of each fault, the diagnostic
        coverage, and false alarms.

    Raises
    ------
    InputError
        If the campaign is invalid, or the folder contains another campaign.
    RunError
        If a run fails.
    KeyboardInterrupt
        If interrupted. Finished faults stay in the folder.
    """
    from bywire.api.run_faults import FaultCampaign
    from bywire.bench import running
    from bywire.campaigns.running import CampaignStore, run_campaign
    from bywire.core.typing import silent

    plan = _read(campaign, overrides).with_step(progress)
    store = None if out is None else CampaignStore(Path(out))
    try:
        findings = run_campaign(plan, store, progress or silent)
    except KeyboardInterrupt:
        if store is None:
            raise
        kept = len(store.kept(plan))
        raise KeyboardInterrupt(
            f"{kept} of {len(plan.faults)} faults are saved. Rerun the command to continue"
        ) from None
    nominal = running.run(plan.bench, estimate_error=False)
    return FaultCampaign(findings, None if store is None else store.folder, nominal)
