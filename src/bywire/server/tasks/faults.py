"""A campaign of faults, which goes on fault by fault."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.core import option_texts as texts
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.common_fields import bench_changes, changes_of, names, path_of
from bywire.server.field import Field
from bywire.server.place import Place
from bywire.server.task import Task

if TYPE_CHECKING:
    from bywire.campaigns.plan import CampaignPlan


def _plan(asked: Mapping[str, Any], place: Place) -> CampaignPlan:
    from bywire.campaigns.campaign_file import read_campaign

    return read_campaign(path_of(asked["campaign"], place), changes_of(asked, place))


def _begun(asked: Mapping[str, Any], place: Place, folders: Sequence[Path]) -> Path | None:
    from bywire.campaigns.running import CampaignStore

    plan = _plan(asked, place)
    return next((each for each in folders if CampaignStore(each).holds(plan)), None)


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.run_faults import run_faults

    return run_faults(asked["campaign"], out, asked["set"], progress=progress)


TASK = Task(
    "faults",
    "Fault campaign",
    "Run, or go on",
    (
        Field(
            "campaign",
            "Campaign",
            "thing",
            texts.CAMPAIGN,
            names("campaigns"),
            lambda there: list(there.campaigns),
            is_required=True,
            fits=lambda asked, place: _plan({**asked, "set": {}}, place),
        ),
        bench_changes(_plan),
    ),
    _compute,
    subject="campaign",
    begun=_begun,
    summary="What every fault of a brake does in a maneuver, when it is seen, what is covered",
)
