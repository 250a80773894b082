"""Results of a bench: recordings, key figures, verdicts, energy balances."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.api.run_sections import (
    choice_data,
    energy,
    how_it_was_made,
    outcome,
    remarks,
    schematic_section,
    source_says,
)
from bywire.bench import bench_file, running
from bywire.bench.bench import Bench
from bywire.bench.energy_ledger import Ledger, actuator_ledger, further_ledgers
from bywire.bench.faults.fault_section import from_text
from bywire.bench.requirements import Limit, Verdict
from bywire.bench.result_folder import kpi_record, verdict_record
from bywire.bench.running import Result
from bywire.bench.stated import stated_figures
from bywire.bench.step_choice import exceeded, with_chosen_step
from bywire.core.arguments import require_kinds
from bywire.core.errors import ParameterError
from bywire.core.typing import Progress
from bywire.report.animation.scene import SCENES
from bywire.report.answer import Answer, FigureAt, Outcome, outcome_of
from bywire.report.document import (
    Attachment,
    Banner,
    Block,
    Details,
    Document,
    FigureBlock,
    Listing,
    Paragraph,
    Section,
    TableBlock,
    recording_file,
)
from bywire.report.stated_levels import stated_figure
from bywire.report.subject import bench_changes, origins_text
from bywire.report.tables import KpiRow, kpi_table
from bywire.report.wording import amount, beside_limit, error_text, measured_amount

if TYPE_CHECKING:
    from bywire.report.bench_figures import Shown


def require_scene(bench: Bench, over: str = "") -> None:
    """Reject benches without an animation.

    Raises
    ------
    ParameterError
        If the bench's assembly declares no animation, or a range of values is run.
    """
    assembly, known = bench.definition.assembly, SCENES.all()
    if assembly not in known:
        raise ParameterError(
            f"{bench.experiment}: {assembly} has no animation (available for {', '.join(known)}). "
            "Remove animate, or declare a SceneKind in the brake's module 'animations'",
            name="animate",
            value=assembly,
            valid=", ".join(known),
        )
    if over:
        raise ParameterError(
            "an animation shows a single run, not a range. Remove animate or over",
            name="animate",
            value=over,
        )


def _playable(result: Result) -> list[str]:
    """Return the labels of runs that an animation can show."""
    place = SCENES.find(result.bench.definition.assembly).place
    return [label for label, run in result.recorded.items() if place in run]


def animations(result: Result) -> list[Attachment]:
    """Return an animation page for each run of a result, as files for its folder."""
    from bywire.report.animation.scene import scene_page
    from bywire.report.drawing import write_bytes

    labels, draw = _playable(result), SCENES.find(result.bench.definition.assembly).draw
    several = len(labels) > 1
    title = result.bench.name or result.bench.experiment

    def page(label: str) -> Attachment:
        def write(path: Path) -> Path:
            heading = f"{title}, {label}" if several else title
            text = scene_page(draw(result.recordings[label]), heading, _SAID)
            return write_bytes(path, text.encode())

        return Attachment(f"animation-{label}.html" if several else "animation.html", write)

    return [page(label) for label in labels]


_SAID = (
    "Sliding tires leave marks on the road. Locked wheels leave black marks. Arrows show braking "
    "forces. An arrow of 1 m equals the weight."
)


# --- The result

_NAMED = 3  # requirements that are not met, in the banner
_SCATTERED = (
    'Errors marked "up to" belong to key figures that do not converge. Between runs with twice, '
    "once and half the step size, their differences do not shrink as a second-order scheme "
    "requires, so their errors are unknown. The value is a 95 % bound from the scatter of the "
    "key figure over all steps."
)


@dataclass(frozen=True)
class BenchResult(Result, Answer):
    """Result of a bench, with recordings as xarray and key figures with their verdicts.

    ``animated`` states whether the folder gets an animation page for each run.
    """

    animated: bool = False

    @property
    def holds(self) -> bool:
        """Whether every requirement is met, and none is undecided."""
        return self.status not in ("failed", "undecided")

    @property
    def key_figures(self) -> list[FigureAt]:
        """The key figures of the bench."""
        return [FigureAt(kpi) for kpi in self.kpis]

    @property
    def own_limits(self) -> list[Limit]:
        """Limits of the bench's requirements."""
        return list(self.bench.limits.values())

    @property
    def outcome(self) -> Outcome:
        """Verdict on the bench's requirements; ``not shown`` without any."""
        return outcome_of([verdict.outcome for verdict in self.verdicts])

    @property
    def warnings(self) -> list[str]:
        """Warnings about the bench and its runs."""
        return [*self.bench.outdated, *super().warnings, *filter(None, [exceeded(self)])]

    @property
    def rows(self) -> list[KpiRow]:
        """The key figures with their requirements."""
        verdicts, stated = {v.kpi: v for v in self.verdicts}, stated_figures(self.bench)
        return [
            KpiRow(
                kpi.name,
                kpi.value,
                kpi.unit,
                f"{kpi.definition} ({kpi.note})" if kpi.note else kpi.definition,
                verdicts[kpi.name].limit if kpi.name in verdicts else "",
                verdicts[kpi.name].outcome if kpi.name in verdicts else "",
                kpi.bound,
                stated_figure(stated[kpi.name], kpi.unit) if kpi.name in stated else "",
                stated[kpi.name].where if kpi.name in stated else "",
                kpi.converges,
            )
            for kpi in self.kpis
        ]

    def interact(self, *parameters: str, figure: str = "") -> Any:
        """Return sliders for a notebook. Each change reruns the bench and redraws the result.

        The notebook shows no numerical errors of key figures, because these need additional runs.

        Parameters
        ----------
        *parameters
            Parameters by dotted name, such as ``"motor.R_m"``. For a positive value, the slider
            ranges from a quarter of the value to four times the value, within the parameter's valid
            range.
        figure
            Name of the figure (see `plot`). Default: the first figure.

        Returns
        -------
        ipywidgets.VBox
            Sliders, figure and key figures for display in a notebook.

        Raises
        ------
        FileError
            If ipywidgets is not installed (extra ``notebook``).
        UnknownNameError
            If a parameter or the figure is unknown.
        ParameterError
            If no parameter is specified, or a parameter has no range around its value.
        """
        from bywire.api.notebook import sliders

        require_kinds(BenchResult.interact, (self, *parameters), {"figure": figure})
        if not parameters:
            raise ParameterError(
                "interact needs at least one parameter, such as 'motor.R_m'", name="parameters"
            )

        def run(changes: Mapping[str, float]) -> BenchResult:
            changed = self.bench.with_overrides(changes)
            return run_once(changed, None, "auto", estimate_error=False, animated=False)

        return sliders(self, self.bench.par, parameters, figure, run)

    def ledgers(self) -> dict[str, Ledger]:
        """Return the energy balances of every run from time zero on, by label."""
        ledgers = {}
        for label, recording in self.recorded.items():
            if "E_stored" not in recording or recording["E_stored"].dims != ("time",):
                continue
            after = recording.sel(time=slice(-1e-9, None))
            if after.sizes["time"] < 2:
                continue
            ledgers[label] = actuator_ledger(after)
            further = further_ledgers(after)
            ledgers |= {f"{label}, {book}": books for book, books in further.items()}
        return ledgers

    def document(self) -> Document:
        """Return verdict, changes, figures, key figures, energy, and settings."""
        bench = self.bench
        table = TableBlock(kpi_table(self.rows))
        said = [*remarks(self), *self._unplayed()]
        notes: list[Block] = [Paragraph(f"Warning: {text}.") for text in self.warnings]
        notes += [Listing(said)] if said else []
        return Document(
            bench.name or bench.experiment,
            f"simulation of {bench.system}: {bench.summary()}; parameter set {bench.parameters}",
            sections=lambda: [
                outcome(self, self.rows, notes),
                Section("Figures", [*self._figures(), *source_says(self)]),
                Section("Key figures", [table, *self._scatter()]),
                *energy(self.ledgers()),
                *schematic_section(self.bench),
                how_it_was_made(self, self._step_errors()),
            ],
            brief=[
                *([Listing(said)] if said else []),
                *([table] if self.kpis else []),
                *self._undefined(),
                Paragraph(f"{origins_text(bench.parameters)}."),
                Details("", self._scatter()),
            ],
            data={**self._data(), "remarks": said},
            banner=self._banner(),
            attachments=[
                recording_file(f"{label}.nc", recording)
                for label, recording in self.recorded.items()
            ]
            + self._animations(),
            record="result.json",
            remarks=[_remark(v) for v in self.verdicts if not v.met],
            is_paged=self.status != "interrupted",
            changes=bench_changes(bench),
        )

    def _undefined(self) -> list[Listing]:
        """Return the reasons why key figures are not defined, each reason once."""
        named: dict[str, list[str]] = {}
        for kpi in self.kpis:
            if not math.isfinite(kpi.value) and kpi.note:
                named.setdefault(kpi.note, []).append(kpi.name)
        texts = [f"{', '.join(names)}: {note}" for note, names in named.items()]
        return [Listing(texts, "Not defined:")] if texts else []

    def _scatter(self) -> list[Paragraph]:
        """Return an explanation of figures that do not converge, if there are any."""
        if all(kpi.converges for kpi in self.kpis):
            return []
        return [Paragraph(_SCATTERED)]

    def _animations(self) -> list[Attachment]:
        if not self.animated or self.status == "interrupted":
            return []
        return animations(self)

    def _unplayed(self) -> list[str]:
        """Return a remark if an animation was requested but no recording allows one."""
        if not self.animated or self._animations():
            return []
        return ["no animation: no recording of this experiment contains the vehicle's position"]

    def _figures(self) -> list[FigureBlock]:
        if self.status == "interrupted":
            return []
        from bywire.report.bench_figures import bench_figures

        shown: list[Shown] = bench_figures(self)
        return [FigureBlock(each.figure, each.caption, each.name) for each in shown]

    def _step_errors(self) -> dict[str, dict[str, dict[str, Any]]]:
        """Return the numerical error of every signal, by run and name."""
        return {
            label: {
                str(name): {
                    "rms": signal.attrs["step_error_rms"],
                    "max": signal.attrs["step_error_max"],
                    "unit": signal.attrs.get("units", "1"),
                }
                for name, signal in recording.items()
                if "step_error_rms" in signal.attrs
            }
            for label, recording in self.recorded.items()
        }

    def _banner(self) -> Banner:
        if not self.verdicts:
            missing = sum(math.isnan(kpi.value) for kpi in self.kpis)
            return Banner(
                "done, no requirements"
                + (f"; {missing} of {len(self.kpis)} key figures not defined" if missing else "")
            )
        met = sum(v.met for v in self.verdicts)
        text = f"{met} of {len(self.verdicts)} requirements met"
        if open_ := sum(not v.is_decided for v in self.verdicts):
            text += f", {open_} undecided"
        if names := list(dict.fromkeys(v.kpi for v in self.verdicts if not v.met)):
            more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
            text += f"; not met: {', '.join(names[:_NAMED])}{more}"
        return Banner(text, "good" if self.status == "passed" else "bad")

    def _data(self) -> dict[str, Any]:
        return {
            "bench": self.bench.name or self.bench.experiment,
            "status": self.status,
            "kpis": {kpi.name: kpi_record(kpi) for kpi in self.kpis},
            "requirements": [verdict_record(verdict) for verdict in self.verdicts],
            "energy": {
                label: {
                    "unit": "J",
                    "sources": {posting.name: posting.energy for posting in books.sources},
                    "sinks": {posting.name: posting.energy for posting in books.sinks},
                    "closing_error": books.closing_error,
                }
                for label, books in self.ledgers().items()
            },
            "step_errors": self._step_errors(),
            **choice_data(self.bench),
            "warnings": self.warnings,
        }


def run_once(
    bench: Bench, progress: Progress | None, engine: str, estimate_error: bool, animated: bool
) -> BenchResult:
    """Return the result of a bench (see `bywire.run`)."""
    bench = with_chosen_step(bench, progress=progress, engine=engine)
    result = running.run(bench, progress, engine, estimate_error)
    return BenchResult(
        **{each.name: getattr(result, each.name) for each in fields(result)}, animated=animated
    )


def bench_of(bench: Bench | str | Path, overrides: Mapping[str, str]) -> Bench:
    """Return the bench of a file or an experiment, with changes in the form of ``--set``.

    Raises
    ------
    InputError
        If the bench cannot be read, or a change is invalid.
    """
    if not isinstance(bench, Bench):
        return bench_file.read(bench, overrides)
    return bench.with_overrides(overrides).without_choice() if overrides else bench


def faulty(bench: Bench, faults: Sequence[str]) -> Bench:
    """Return a bench with additional faults, in the form of ``--fault``.

    Raises
    ------
    InputError
        If a string is not a valid fault.
    """
    if not faults:
        return bench
    return replace(bench.without_choice(), faults=(*bench.faults, *map(from_text, faults)))


def _remark(verdict: Verdict) -> str:
    """Return a remark about a requirement that is missed or undecided."""
    limit = f", limit {verdict.limit}"
    value, error, unit = beside_limit(verdict.value, verdict.error, verdict.unit, verdict.limit)
    if not verdict.is_decided and math.isfinite(verdict.error):
        return (
            f"requirement undecided: {verdict.kpi} is {measured_amount(value, unit, error)}, "
            f"with a numerical error of {error_text(value, unit, error)}{limit}. Use a smaller step"
        )
    if not verdict.is_decided and not math.isinf(verdict.error):
        return f"requirement undecided: {verdict.kpi} is not defined{limit} ({verdict.note})"
    if not verdict.is_decided:
        return (
            f"requirement undecided: {verdict.kpi} is defined with only one of the two step "
            f"sizes{limit}. Use a smaller step"
        )
    return f"requirement not met: {verdict.kpi} is {amount(value, unit)}{limit}" + (
        f" ({verdict.note})" if verdict.note else ""
    )
