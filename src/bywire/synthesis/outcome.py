"""Results of the design of a loop or gain schedule, with probabilities of the requirements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from bywire.bench.requirements import Limit
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.typing import Progress, silent
from bywire.synthesis.linear_case import LinearCase, room, share_left, values_of

Status = Literal["met", "infeasible", "interrupted"]
MISSED = -1e-3
"""slack below which a requirement is treated as missed, as a fraction of the limit"""
ROOMY = 0.05
"""slack above which a requirement is not binding"""


@dataclass(frozen=True)
class Binding:
    """A binding requirement.

    Parameters
    ----------
    requirement, case
        The requirement, and the label of the model.
    value, slack
        Achieved value, and its distance from the limit as a fraction of the limit.
    """

    requirement: Limit
    case: str
    value: float
    slack: float


@dataclass(frozen=True)
class Conflict:
    """Best value of one requirement that another allows.

    Parameters
    ----------
    wanted, kept
        The optimized requirement, and the requirement that was met at the same time.
    best
        The best value of the optimized requirement.
    gains
        Gains with this value.
    """

    wanted: Limit
    kept: Limit
    best: float
    gains: Mapping[str, float]

    @property
    def excludes(self) -> bool:
        """Whether the two requirements alone cannot both be met."""
        return share_left(self.wanted, self.best) < MISSED


@dataclass(frozen=True)
class Design:
    """Designed gains and their figures.

    Parameters
    ----------
    gains
        By dotted name [SI].
    status
        ``"met"``, ``"infeasible"``, or ``"interrupted"`` with the best gains until then.
    nominal
        All figures of the nominal model.
    worst
        Figure -> worst value over all models, and the model's label. The drawn models that may miss
        a requirement with a probability do not count for its figure.
    binding
        Binding requirements, the worst first.
    conflicts
        For infeasible requirements, the best values of the others that each binding requirement
        allows.
    slack
        The worst normalized slack.
    evaluations
        Number of computed loops.
    kept
        Constraints that were also enforced; see `designer.linear_floors`.
    unsound
        Models without figures, by label: unstable, or without a loop.
    missed
        Number of models that miss each requirement with a probability, by its text.
    """

    gains: Mapping[str, float]
    status: Status
    nominal: Mapping[str, float]
    worst: Mapping[str, tuple[float, str]]
    binding: tuple[Binding, ...]
    conflicts: tuple[Conflict, ...]
    slack: float
    evaluations: int
    kept: tuple[Limit, ...] = ()
    unsound: Mapping[str, str] = field(default_factory=dict)
    missed: Mapping[str, int] = field(default_factory=dict)

    @property
    def binds(self) -> bool:
        """Whether the worst requirement has almost no slack."""
        return self.slack < ROOMY


def bench_text(
    title: str,
    experiment: str,
    parameters: str,
    changes: Mapping[str, str],
    par: ParameterSet,
    gains: Mapping[str, float],
) -> str:
    """Return the text of a bench file with the gains in its section ``[set]``.

    Parameters
    ----------
    title
        Comment at the top.
    experiment
        Experiment of the bench. If empty, the text contains only the section.
    parameters, changes
        Name of the parameter set, and the user's changes to it, as texts.
    par
        Any parameters of that class, for the units.
    gains
        By dotted name [SI].
    """
    leaves = leaf_fields(type(par))
    lines = [f"# {title}"]
    if experiment:
        lines += [f'experiment = "{experiment}"', f'parameters = "{parameters}"']
    lines += ["", "[set]"]
    lines += [f"{name} = {_quoted(text)}" for name, text in changes.items() if name not in gains]
    for name, value in gains.items():
        unit = leaves[name].unit.symbol
        lines.append(f"{name} = {_quoted(f'{value:.9g}' + ('' if unit == '1' else f' {unit}'))}")
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


@dataclass(frozen=True)
class Across:
    """The scheduled loop with its gains frozen at an operating point.

    Parameters
    ----------
    label, at, region
        Label of the model, its operating point [SI], and its region.
    figures
        All figures of the linear model.
    slack
        Slack of the worst requirement there; negative infinity if unstable.
    """

    label: str
    at: float
    region: str
    figures: Mapping[str, float]
    slack: float


@dataclass(frozen=True)
class ScheduleDesign:
    """Designed gain schedule and its figures.

    Parameters
    ----------
    regions
        Design of each region with free gains, by ascending operating point; each uses only its own
        models.
    points
        Operating points [SI] for which each region was designed.
    gains
        Gains of all regions together, by dotted name [SI].
    nominal
        All figures of the nominal model.
    cases
        Models of the scheduled loop: the nominal one, and those of all points and ranges.
    across
        The scheduled loop from the lowest to the highest point and across the boundaries.
    """

    regions: Mapping[str, Design]
    points: Mapping[str, tuple[float, ...]]
    gains: Mapping[str, float]
    nominal: Mapping[str, float]
    cases: tuple[LinearCase, ...]
    across: tuple[Across, ...]

    @property
    def worst(self) -> Across:
        """Worst point of the scheduled loop."""
        return min(self.across, key=lambda point: point.slack)

    @property
    def status(self) -> Status:
        """Whether every region, and the loop between them, meets the requirements."""
        statuses = [design.status for design in self.regions.values()]
        if "interrupted" in statuses:
            return "interrupted"
        return "met" if {*statuses} == {"met"} and self.worst.slack >= MISSED else "infeasible"


# --- Probabilities over random models, for which the gains were not designed


@dataclass(frozen=True)
class Judged:
    """Statistics of requirements over random models.

    Parameters
    ----------
    models
        Number of models; a model that does not exist, or is unstable, meets no requirement.
    unstable
        Number of models that are unstable with the gains, or do not exist.
    met
        Number of models that meet each requirement, in the order of the requirements.
    all_met
        Number of models that meet all requirements.
    worst
        Worst value of each requirement's figure over the stable models; NaN if there are none.
    """

    models: int
    unstable: int
    met: tuple[int, ...]
    all_met: int
    worst: tuple[float, ...]


def judged_over(
    cases: Sequence[LinearCase | None],
    requirements: Sequence[Limit],
    gains: Mapping[str, float],
    progress: Progress = silent,
) -> Judged:
    """Return the number of models that meet requirements with given gains.

    Parameters
    ----------
    cases
        Models; None for a model that does not exist.
    requirements
        See `linear_case.read`.
    gains
        By dotted name [SI].
    progress
        Called with a label and the finished share.
    """
    rooms = np.full((len(cases), len(requirements)), -np.inf)
    values = np.full(rooms.shape, np.nan)
    for k, case in enumerate(cases):
        figures = None if case is None else case.figures(gains)
        if figures is not None and figures.is_stable:
            rooms[k] = [room(figures, each) for each in requirements]
            known = values_of(figures)
            values[k] = [known[each.figure] for each in requirements]
        progress("random models", (k + 1) / len(cases))
    met = rooms >= MISSED
    lowest = np.where(np.isneginf(rooms), np.inf, rooms).argmin(axis=0)
    worst = tuple(float(values[row, r]) for r, row in enumerate(lowest))
    return Judged(
        len(cases),
        int(np.isneginf(rooms).all(axis=1).sum()),
        tuple(met.sum(axis=0).tolist()),
        int(met.all(axis=1).sum()),
        worst,
    )
