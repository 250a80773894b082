"""The cases of a study that are shown and run again: of each requirement the worst one.

In a study of rare failures, the most probable failing one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

from bywire.api.study_tables import figure_text
from bywire.bench import running
from bywire.bench.bench import Bench
from bywire.bench.bench_file import bench_text
from bywire.bench.running import Result
from bywire.report.document import Attachment, recording_file
from bywire.report.wording import amount
from bywire.studies.chunk import case_bench
from bywire.studies.findings import Findings, Judgment

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class ShownCases:
    """One case of each requirement.

    Parameters
    ----------
    findings
        What was found.
    nominal
        The bench itself.
    """

    findings: Findings
    nominal: Result

    @property
    def kind(self) -> str:
        """What each is called, in names of files too."""
        return "failing" if self.findings.rare else "worst"

    @property
    def title(self) -> str:
        """What they are called together."""
        return "Most probable failing cases" if self.findings.rare else "Worst cases"

    @cached_property
    def benches(self) -> Mapping[str, Bench]:
        """What runs each that has a result, by its key figure."""
        return {
            j.demand.figure: self._bench(j, row)
            for j in self.findings.judgments
            if (row := j.worst) is not None and row not in self.findings.failures
        }

    @cached_property
    def results(self) -> Mapping[str, Result]:
        """Each one, run again, by its key figure."""
        return {kpi: running.run(bench) for kpi, bench in self.benches.items()}

    def texts(self) -> list[str]:
        """Return each case in words."""
        return [
            self._text(each, each.worst)
            for each in self.findings.judgments
            if each.worst is not None
        ]

    def _text(self, judgment: Judgment, row: int) -> str:
        kpi = judgment.demand.figure
        if row in self.findings.failures:
            return f"{kpi}: case {self.named(row)}, which has no result"
        if not math.isfinite(self.findings.figure(kpi)[row]):
            (why,) = [each.note for each in self.results[kpi].kpis if each.name == kpi]
            return (
                f"{kpi} is not defined in case {self.named(row)}{why and f': {why}'}; "
                f"{self.kind}-{kpi}.toml runs it"
            )
        return (
            f"{kpi} = {self._figure(kpi, row)}{self._doubt(judgment, row)} in case "
            f"{self.named(row)}; {self.kind}-{kpi}.toml runs it"
        )

    def named(self, row: int) -> str:
        """Return a case by its row: number and values."""
        units = self.findings.plan.units
        values = ", ".join(
            f"{name} = {value if isinstance(value, str) else amount(value, units[name])}"
            for name, value in self.findings.values(row).items()
        )
        return f"{self.findings.number(row)} ({values})"

    def recordings(self) -> dict[str, dict[str, xr.Dataset]]:
        """Return the recordings of the bench itself and of the cases, by run."""
        each = {"the bench itself": self.nominal} | {
            f"{self.kind} {kpi}": result for kpi, result in self.results.items()
        }
        return {
            label: {name: r.recordings[label] for name, r in each.items() if label in r.recordings}
            for label in self.nominal.recordings
        }

    def attachments(self) -> list[Attachment]:
        """Return bench files and recordings."""
        labels = list(self.nominal.recordings)
        return [
            *(
                Attachment(f"{self.kind}-{kpi}.toml", partial(self._write_bench, bench))
                for kpi, bench in self.benches.items()
            ),
            *(
                Attachment(
                    f"{self.kind}-{kpi}{'' if len(labels) == 1 else '-' + label}.nc",
                    partial(self._write_recording, kpi, label),
                )
                for kpi in self.benches
                for label in labels
            ),
        ]

    def _bench(self, judgment: Judgment, row: int) -> Bench:
        plan, findings = self.findings.plan, self.findings
        made = case_bench(plan, findings.number(row), findings.values(row))
        return replace(made, name=f"{self.kind} {judgment.demand.figure}")

    def _doubt(self, judgment: Judgment, row: int) -> str:
        """Return that a case is too close to the limit to be told from one that meets it."""
        is_close = self.findings.is_close(judgment.demand)[row]
        return " (closer to the limit than its error)" if is_close else ""

    def _figure(self, name: str, row: int) -> str:
        return figure_text(self.findings, name, float(self.findings.figure(name)[row]))

    def _write_bench(self, bench: Bench, path: Path) -> Path:
        what = "Most probable failing" if self.findings.rare else "Worst"
        text = bench_text(bench, f"{what} case of study {self.findings.plan.name}")
        path.write_text(text, "utf-8")
        return path

    def _write_recording(self, kpi: str, label: str, path: Path) -> Path:
        return recording_file(path.name, self.results[kpi].recordings[label]).write(path)
