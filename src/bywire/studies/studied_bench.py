"""Which bench a study tests, and what it changes of it, as its file says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class StudiedBench:
    """Where the bench of a study comes from.

    Parameters
    ----------
    bench
        The bench file, as the study file names it, or the experiment.
    changes
        What ``[set]`` and ``--set`` change of it, as texts by name.
    """

    bench: str
    changes: Mapping[str, str] = field(default_factory=dict)
