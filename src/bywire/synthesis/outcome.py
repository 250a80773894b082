"""What a design gives: gains, figures, what binds, what excludes what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from bywire.synthesis.requirement import Requirement

Status = Literal["met", "infeasible", "interrupted"]
MISSED = -1e-3
"""slack below which a requirement counts as missed: share of the limit"""
ROOMY = 0.05
"""slack from which on a requirement does not bind any more"""


@dataclass(frozen=True)
class Binding:
    """A requirement that leaves no room.

    Parameters
    ----------
    requirement, case
        Which one, and for which model.
    value, slack
        What was reached, and its distance from the limit as a share of it.
    """

    requirement: Requirement
    case: str
    value: float
    slack: float


@dataclass(frozen=True)
class Conflict:
    """What one requirement allows of another.

    Parameters
    ----------
    wanted, kept
        The requirement that was pushed, while the other one held.
    best
        The best value of the wanted one.
    gains
        Where it was reached.
    """

    wanted: Requirement
    kept: Requirement
    best: float
    gains: Mapping[str, float]

    @property
    def excludes(self) -> bool:
        """Whether the two alone cannot both be met."""
        return self.wanted.slack(self.best) < MISSED


@dataclass(frozen=True)
class Design:
    """Gains and what they give.

    Parameters
    ----------
    gains
        By dotted name [SI].
    status
        ``"met"``, ``"infeasible"``, or ``"interrupted"`` with the best until then.
    nominal
        All figures of the nominal model.
    worst
        Figure -> worst value over all models, and the model's label.
    binding
        What leaves no room, the worst first.
    conflicts
        For infeasible requirements, what each binding one allows of the others.
    slack
        The worst normalized slack.
    evaluations
        Loops that were computed.
    kept
        What was kept besides the requirements, see `floors`.
    """

    gains: Mapping[str, float]
    status: Status
    nominal: Mapping[str, float]
    worst: Mapping[str, tuple[float, str]]
    binding: tuple[Binding, ...]
    conflicts: tuple[Conflict, ...]
    slack: float
    evaluations: int
    kept: tuple[Requirement, ...] = ()

    @property
    def binds(self) -> bool:
        """Whether what is worst off leaves no room worth having."""
        return self.slack < ROOMY
