"""The campaign of a brake, as it declares one: what a campaign file says, in Python."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from bywire.core.registry import Kind, instances


@dataclass(frozen=True)
class DeclaredCampaign:
    """A campaign that comes with a brake.

    Parameters
    ----------
    name
        What the command line calls it.
    summary
        One line for listings.
    content
        What a campaign file holds; its ``bench`` names an experiment.
    """

    name: str
    summary: str
    content: Mapping[str, Any]


CAMPAIGNS = Kind("campaign", ("campaigns",), instances(DeclaredCampaign))
"""the campaigns of every brake"""
