"""Life of a brake: slow states over thousands of stops, and the end of life."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from bywire.api.run_sections import choice_data, choice_texts
from bywire.bench.kpis.kpi import Kpi
from bywire.core.arguments import whole_number
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.core.units import difference_unit
from bywire.life.life_file import CONDITION, CONDITIONS, WEAR, LifePlan
from bywire.life.projection import CONFIDENCE, Projection
from bywire.report.answer import Answer, FigureAt
from bywire.report.document import (
    Banner,
    Change,
    Details,
    Document,
    FigureBlock,
    Listing,
    Section,
    TableBlock,
    recording_file,
    spaced,
)
from bywire.report.subject import Subject, defaults_of, parameter_rows, value_changes
from bywire.report.tables import KpiRow, Table, amount_cell, kpi_table, parameter_table, text_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LIFE_FIGURES: Mapping[str, tuple[str, str]] = {"stops": ("1", "Number of stops until end of life.")}
"""unit and definition of the figures that requirements can limit, by name"""
_MOST = 100_000  # maximum number of stops to simulate individually
_PROJECTION = ("stops", "seed", "share", "tolerance", "longest")


@dataclass(frozen=True, repr=False)
class LifeResult(Answer):
    """Projected life of a brake.

    Parameters
    ----------
    projection
        Slow states and margins to the limits over stops [SI].
    checked
        Slow states of individually simulated stops, shape (stops + 1,) each. May be empty.
    """

    projection: Projection
    checked: Mapping[str, Array] = field(default_factory=dict)

    @property
    def key_figures(self) -> list[FigureAt]:
        """Number of stops until the end of life, with the half-width of its interval."""
        made = self.projection
        note = "" if made.ended_by else f"no limit is reached within {made.stops} stops"
        unit, definition = LIFE_FIGURES["stops"]
        return [FigureAt(Kpi("stops", float(made.stops), unit, definition, note, made.error))]

    @property
    def warnings(self) -> list[str]:
        """Warnings of the runs. Of those that differ only in numbers, the first."""
        kinds: dict[str, list[str]] = {}
        for text in self.projection.warnings:
            kinds.setdefault(re.sub(r"-?\d[\d.e+-]*", "#", text), []).append(text)
        return [
            texts[0] + (f" (and {len(texts) - 1} similar)" if len(texts) > 1 else "")
            for texts in kinds.values()
        ]

    @property
    def data(self) -> xr.Dataset:
        """Slow states and margins to the limits [SI] after each stop, dimension ``stop``."""
        life, made = self.projection.plan.life, self.projection
        told = {**life.states, **{f"left_{name}": each for name, each in life.limits.items()}}
        values = {**made.states, **{f"left_{name}": each for name, each in made.left.items()}}
        return xr.Dataset(
            {
                name: ("stop", values[name], {"units": each.unit, "long_name": each.label})
                for name, each in told.items()
            },
            coords={"stop": np.arange(made.stops + 1)},
        )

    def deviation(self, name: str) -> float:
        """Return the relative error of a state's projected change, from individual stops.

        The error is NaN without such stops, or if the state does not change.
        """
        if not self.checked:
            return math.nan
        truth = self.checked[name]
        change = float(truth[-1] - truth[0])
        made = float(self.projection.states[name][truth.size - 1] - truth[0])
        return made / change - 1.0 if change else math.nan

    def document(self) -> Document:
        """Return the number of stops until end of life, its cause, slow states and settings."""
        plan = self.projection.plan
        subject = Subject.of_bench(
            plan.bench,
            plan.name,
            plan.life.summary,
            [each.name for each in plan.varied],
            _wear_changes(plan),
        )
        kpis, states = TableBlock(kpi_table(self._rows())), TableBlock(self._states())
        warned = [Listing([f"Warning: {text}." for text in self.warnings])] if self.warnings else []
        wear = Details(
            "Parameters of wear",
            [
                TableBlock(parameter_table(parameter_rows(plan.wear, plan.life.values))),
                TableBlock(parameter_table(parameter_rows(plan.conditions))),
            ],
        )
        return Document(
            f"Life {plan.name}",
            subject.line,
            sections=lambda: [
                Section("Life", [*warned, kpis]),
                Section("Slow states", [states, FigureBlock(self._drawn, _CAPTION, "life")]),
                Section(
                    "Stops",
                    [Listing([*choice_texts(plan.bench), *self._population()]), wear],
                ),
                subject.provenance(),
            ],
            brief=[
                f"life {plan.name}: {plan.life.summary}",
                Listing([*choice_texts(plan.bench), *self._population()]),
                "",
                *spaced([kpis, states]),
            ],
            data=self._data(),
            banner=Banner(self._outcome()),
            attachments=[recording_file("life.nc", self.data)],
            record="life.json",
            changes=subject.changes,
        )

    def _outcome(self) -> str:
        made = self.projection
        if not made.ended_by:
            return f"no end of life within {made.stops} stops"
        half = math.ceil(made.error)
        about = f" +- {half}" if half else ""
        return f"{made.stops}{about} stops: {made.plan.life.limits[made.ended_by].label} is used up"

    def _rows(self) -> list[KpiRow]:
        made, life = self.projection, self.projection.plan.life
        runs = sum(len(which) for _, which in made.plan.known)
        end = (
            "ended by: " + life.limits[made.ended_by].label if made.ended_by else "no limit reached"
        )
        rows = [
            KpiRow("stops", float(made.stops), "1", f"Number of stops until end of life ({end})."),
            KpiRow(
                "interval",
                made.error,
                "1",
                f"Half-width of its {100 * CONFIDENCE:g} % interval, from a sample of "
                f"{made.plan.count} stop{'s' * (made.plan.count > 1)}.",
            ),
            KpiRow("runs", float(runs), "1", "Simulated stops."),
        ]
        for name, each in life.states.items():
            if not math.isnan(share := self.deviation(name)):
                rows.append(
                    KpiRow(
                        f"deviation_{name}",
                        100.0 * share,
                        "%",
                        f"Relative error of the {each.label}'s projected change, from "
                        f"{len(self.checked[name]) - 1} individually simulated stops.",
                    )
                )
        return rows

    def _states(self) -> Table:
        made = self.projection
        rows = []
        for name, each in made.plan.life.states.items():
            path = made.states[name]
            rate = (path[-1] - path[0]) / made.stops
            rows.append(
                (
                    name,
                    each.label,
                    amount_cell(path[0], each.unit),
                    amount_cell(path[-1], each.unit),
                    amount_cell(float(path.min()), each.unit),
                    amount_cell(float(path.max()), each.unit),
                    amount_cell(rate, difference_unit(each.unit)),
                )
            )
        return text_table(
            ("state", "meaning", "new", "at end", "least", "largest", "per stop"), rows
        )

    def _population(self) -> list[str]:
        plan = self.projection.plan
        if not plan.varied:
            return ["all stops are identical"]
        return [f"{each.name}: {each.distribution.text}" for each in plan.varied]

    def _drawn(self) -> Figure:
        from bywire.report.life_figure import Course, life_figure

        made, life = self.projection, self.projection.plan.life
        courses = [
            Course(each.label, each.unit, made.states[name])
            for name, each in life.states.items()
            if each.is_drawn and np.ptp(made.states[name]) > 0.0
        ] + [
            Course(each.label, each.unit, made.left[name], is_left=True)
            for name, each in life.limits.items()
        ]
        return life_figure(courses, [*(step.first for step in made.steps), made.stops])

    def _data(self) -> dict[str, Any]:
        made = self.projection
        return {
            "life": made.plan.life.name,
            "name": made.plan.name,
            "parameters": made.plan.bench.parameters,
            "stops": made.stops,
            "interval": made.error,
            "ended_by": made.ended_by,
            "states": {
                name: {
                    "unit": each.unit,
                    "label": each.label,
                    "new": float(made.states[name][0]),
                    "end": float(made.states[name][-1]),
                    "deviation": self.deviation(name),
                }
                for name, each in made.plan.life.states.items()
            },
            "left": {name: float(values[-1]) for name, values in made.left.items()},
            "steps": [{"first": each.first, "stops": each.count} for each in made.steps],
            "population": self._population(),
            **choice_data(made.plan.bench),
            "warnings": self.warnings,
        }


_CAPTION = (
    "Slow states and margins to the limits versus stops. Dots mark simulated stops. Life ends when "
    "the first margin reaches zero."
)


def _wear_changes(plan: LifePlan) -> tuple[Change, ...]:
    """Return a life file's settings for wear, stop conditions and projection."""
    life, wear = plan.life, plan.life.defaults()
    origins = {name: ", ".join(filter(None, (c.kind, c.where))) for name, c in life.values.items()}
    of = f"the life {life.name}"
    settings = {each.name: each.default for each in fields(LifePlan) if each.name in _PROJECTION}
    chosen = {name: getattr(plan, name) for name in settings}
    return (
        *value_changes(plan.wear, wear.flat(), of, WEAR, origins),
        *value_changes(plan.conditions, CONDITIONS.flat(), defaults_of("lives"), CONDITION),
        *(
            Change(f"projection.{name}", f"{chosen[name]:g}", f"{default:g}", defaults_of("lives"))
            for name, default in settings.items()
            if chosen[name] != default
        ),
    )


def require_checkable(check: int, plan: LifePlan) -> None:
    """Reject a number of individual stops that cannot check the projection.

    Raises
    ------
    ParameterError
        If the number is invalid, too large, or smaller than the population's sample.
    """
    whole_number("check", check, 0, _MOST)
    if 0 < check < plan.count:
        raise ParameterError(
            f"check = {check} is not valid: it must be 0 or >= {plan.count}, the number of "
            "stops in the sample that represents the population",
            name="check",
            value=f"{check}",
            valid=f"0 or >= {plan.count}",
        )
