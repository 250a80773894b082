"""Closed-form evidence with known verdicts: a brake force F = k x at a travel of 1 mm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Limit
from bywire.report.answer import Answer, FigureAt
from bywire.report.document import Banner, Document
from bywire.signoff.plan import Computed, Task
from bywire.signoff.signoff_file import Readers
from bywire.usecases.evidence.entry import read_figure_limit

TRAVEL = 1e-3  # m
COMPUTED: list[str] = []
"""titles of the tasks computed in this process"""


@dataclass(frozen=True)
class Spring(Answer):
    """Force at each stiffness [N/m], with a numerical error in N."""

    stiffness: tuple[float, ...]
    error: float

    @property
    def key_figures(self) -> list[FigureAt]:
        return [
            FigureAt(Kpi("force", k * TRAVEL, "N", "Brake force.", error=self.error), f"k = {k:g}")
            for k in self.stiffness
        ]

    def document(self) -> Document:
        return Document("Spring", "", sections=[], brief=[], data={}, banner=Banner("a spring"))


@dataclass(frozen=True)
class SpringTask(Task):
    name: str
    arguments: Mapping[str, Any]
    folder: Path

    @property
    def origin(self) -> Any:
        return read_spring, (self.name, self.arguments, self.folder)

    @property
    def title(self) -> str:
        return f"spring {self.name}"

    @property
    def identity(self) -> Mapping[str, Any]:
        return {"kind": "spring", **self.arguments}

    def limit(self, text: str) -> Limit:
        return read_figure_limit(text, {"force": "N"})

    def compute(self, folder: Path, progress: Any) -> Computed:
        COMPUTED.append(self.name)
        return Computed(Spring(tuple(self.arguments["k"]), self.arguments.get("error", 0.0)))


def read_spring(name: str, arguments: Mapping[str, Any], folder: Path) -> SpringTask:
    return SpringTask(name, arguments, folder)


READERS: Readers = {"spring": read_spring}
