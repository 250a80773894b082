"""Exact linear models of closed loops and plants: poles, responses, root loci, dither."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from bywire.analysis.crossings import bandwidth
from bywire.analysis.linear.corners import read_sides
from bywire.analysis.linear.linear_model import LinearModel, rates
from bywire.analysis.linear.linearize import Friction
from bywire.analysis.locus import Locus, locus, locus_of
from bywire.analysis.loop import LOOPS, PLANTS, Plant, PlantPoint, Quantity
from bywire.analysis.loop_figures import LoopFigures
from bywire.analysis.margins import NO_LOOP
from bywire.analysis.periodic import PeriodicModel, dithered_loop
from bywire.analysis.reduction import Reduced, ReductionError, reduction_error
from bywire.api import linear_texts as texts
from bywire.api.loop_case import LoopCase, loop_case, range_of
from bywire.api.parameter_choice import parameters_for
from bywire.bench.step_error import NO_ESTIMATE, OTHER_STEPS, of_difference
from bywire.core.callers import option
from bywire.core.catalog import main_set, parameters
from bywire.core.errors import ParameterError, UnitError, unknown_name
from bywire.core.parameters import ParameterSet
from bywire.core.values import number
from bywire.report.answer import Answer
from bywire.report.document import (
    Attachment,
    Banner,
    Block,
    Document,
    FigureBlock,
    Flat,
    Listing,
    Paragraph,
    Section,
)
from bywire.report.subject import Subject
from bywire.report.wording import amount, unit_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MADE = "Exact linear model of the plant, with sources in place of controllers."


@dataclass(frozen=True)
class PlantCase:
    """Plant with the requested parameters and operating point.

    Parameters
    ----------
    plant
        Plant to linearize.
        name, par
        Name of the parameter set, and its values in use.
    point
        Operating point, with the friction state there.
    """

    plant: Plant
    name: str
    par: ParameterSet
    point: PlantPoint

    @property
    def point_text(self) -> str:
        """Operating point and friction state as text."""
        point = self.point
        moving = f" at {point.speed:g} rad/s" if point.speed else ""
        value = amount(point.value, point.quantity.unit)
        return f"{point.quantity.name} = {value}, friction {point.friction}{moving}"

    @property
    def subject(self) -> Subject:
        """Plant and operating point for the report."""
        plant = self.plant
        return Subject(plant.name, plant.summary, self.name, self.par, self.point_text)


@dataclass(frozen=True)
class LinearizedPlant(Answer):
    """Linear model of a plant.

    Parameters
    ----------
    case
        Plant, its parameters and its operating point.
    model
        Model from inputs to outputs. ``model.state_space()`` returns a python-control system.
    reduced
        Reduced model, or None if it was not requested.
    """

    case: PlantCase
    model: LinearModel
    reduced: Reduced | None = None

    @property
    def notes(self) -> list[str]:
        """Notes on the side of a kink that the linear model uses."""
        return texts.corner_notes([self.model.corners])

    @cached_property
    def exact(self) -> LinearModel | None:
        """The exact model if ``model`` is simplified, otherwise None."""
        return self.case.plant.exact(self.case.par, self.case.point)

    @cached_property
    def error(self) -> ReductionError | None:
        """Error relative to the exact model, or None if the model is exact."""
        if self.exact is None:
            return None
        return reduction_error(self.exact, self.model, self.case.plant.band)

    def document(self) -> Document:
        """Return poles and responses, including those of the exact and the reduced model."""
        case, model = self.case, self.model
        head = (
            f"plant {case.plant.name} of {case.name} at {case.point_text}: {len(model.states)} "
            f"states, from {', '.join(model.inputs)} to {', '.join(model.outputs)}"
        )
        return Document(
            f"Linear model of {case.plant.name}",
            case.subject.line,
            sections=self._sections,
            brief=[head, *texts.poles_block(model), *self._notes(), *self._brief_reduced()],
            data=self._data(),
            attachments=[texts.json_file(f"{case.plant.name}-linear-model.json", self._data())],
            changes=case.subject.changes,
        )

    def _brief_reduced(self) -> list[str | Flat]:
        if self.reduced is None:
            return []
        return [texts.reduced_line(self.reduced), *texts.poles_block(self.reduced.model)]

    def _notes(self) -> list[str]:
        """Return a note on stuck friction, or on the error relative to the full plant."""
        if not self.model.effective():
            return ["friction holds the plant at rest, so the inputs do not move any output"]
        if self.error is None:
            return []
        return [f"relative to the full plant: {texts.error_line(self.error)}"]

    def _sections(self) -> list[Section]:
        case, notes = self.case, self._notes()
        models = {case.plant.name: self.model}
        if self.exact is not None:
            models = {"exact": self.exact, **models}
        if self.reduced is not None:
            models[f"reduced to {len(self.reduced.model.states)} states"] = self.reduced.model
            notes.append(texts.reduced_line(self.reduced))
        poles: list[Block] = [Listing(notes)] if notes else []
        for label, model in models.items():
            poles += texts.poles_block(model, f"Poles of {label}, slowest first.")
        from bywire.report.response_figures import plant_figures

        figures: list[Block] = [
            FigureBlock(figure, f"Frequency response of {name}.", f"{case.plant.name}-{name}")
            for name, figure in plant_figures(models, case.plant.band)
        ]
        return [
            Section("Poles", poles),
            Section("Figures", figures or [Paragraph("No output responds to the first input.")]),
            case.subject.provenance(_MADE),
        ]

    def _data(self) -> dict[str, Any]:
        point = self.case.point
        shown: dict[str, Any] = {
            "plant": self.case.plant.name,
            "parameters": self.case.name,
            "operating_point": {point.quantity.name: point.value, "unit": point.quantity.unit},
            "friction": point.friction,
            "speed": point.speed,
            **texts.matrices(self.model),
            "stable": self.model.is_stable,
        }
        if self.error is not None:
            shown["error"] = texts.error_object(self.error)
        if self.reduced is not None:
            shown["reduced"] = texts.reduced_object(self.reduced)
        return shown


@dataclass(frozen=True)
class PlantLocus(Answer):
    """Poles of a plant over a range of a parameter or of its operating point."""

    case: PlantCase
    locus: Locus

    def document(self) -> Document:
        """Return the stability limits and the root locus."""
        case, point = self.case, self.case.point
        name = case.plant.name
        listing = Listing(texts.locus_lines(self.locus))
        value = amount(point.value, point.quantity.unit)
        head = (
            f"plant {name} of {case.name} at {point.quantity.name} = {value}, over "
            f"{self.locus.name}:"
        )
        data = {"plant": name, "parameters": case.name, "locus": texts.locus_object(self.locus)}
        figure = FigureBlock(
            partial(_draw_locus, self.locus), f"Poles versus {self.locus.name}.", f"{name}-locus"
        )
        return Document(
            f"Root locus of {name}",
            case.subject.line,
            sections=lambda: [
                Section(f"Stability over {self.locus.name}", [listing]),
                Section("Figures", [figure]),
                case.subject.provenance(_MADE),
            ],
            brief=[head, listing],
            data=data,
            attachments=[texts.json_file(f"{name}-locus.json", data)],
            changes=case.subject.changes,
        )


def _linearized_plant(case: PlantCase, reduce: str) -> LinearizedPlant:
    model = case.plant.linear(case.par, case.point)
    reduced = texts.reduced(model, reduce, case.plant.band) if reduce else None
    return LinearizedPlant(case, model, reduced)


def _plant_locus(case: PlantCase, range_: str) -> PlantLocus:
    quantity = case.point.quantity
    over, unit, values = locus_range(case, range_)

    def model(value: float) -> LinearModel:
        if over == quantity.name:
            return case.plant.linear(case.par, replace(case.point, value=value))
        return case.plant.linear(case.par.replace({over: value}), case.point)

    return PlantLocus(case, locus_of(model, over, unit, sorted(values)))


def _plant_case(
    name: str,
    parameters: str,
    at: str,
    overrides: Mapping[str, Any],
    friction: str,
    speed: str,
    side: str = "",
) -> PlantCase:
    """Find a plant, and read its parameters and operating point.

    Parameters
    ----------
    name
        Name of the plant.
    parameters
        Parameter set. If empty, the main set of the plant's brake.
    at
        Operating point, whose unit selects the quantity. If empty, the plant's nominal point.
    overrides
        Parameters by dotted name, with units.
    friction, speed
        State of dry friction, and motor speed. If empty, friction is removed and the motors are at
        rest.
    side
        See `loop_case`.

    Raises
    ------
    InputError
        If a name is unknown, a value is out of range, or the parameter set is for another brake.
    """
    read_sides(side)
    plant = replace(PLANTS.find(name), side=side)
    chosen_set, par = parameters_for(
        f"plant {plant.name!r}", (plant.assembly,), parameters, overrides
    )
    quantity, value = _operating_point(plant, at)
    kind, omega = _friction(friction, speed)
    return PlantCase(plant, chosen_set, par, PlantPoint(quantity, value, kind, omega))


def _operating_point(plant: Plant, at: str) -> tuple[Quantity, float]:
    if not at:
        return plant.at[0], plant.at[0].default
    for quantity in plant.at:
        try:
            return quantity, number(at, quantity.unit, quantity.name)
        except UnitError:
            continue
    known = ", ".join(f"{quantity.name} in {quantity.unit}" for quantity in plant.at)
    raise UnitError(
        f"{option('at')} {at!r} is not valid: for {plant.name} it must be {known}",
        name=option("at"),
        value=repr(at),
        valid=known,
    )


def _friction(friction: str, speed: str) -> tuple[Friction, float]:
    kinds: tuple[Friction, ...] = get_args(Friction)
    kind = next((each for each in kinds if each == (friction or "removed")), None)
    if kind is None:
        raise unknown_name("kind of friction", friction, kinds)
    omega = number(speed, "rad/s", option("speed")) if speed else 0.0
    if kind == "sliding" and omega == 0.0:
        raise ParameterError(
            f"{option('friction', 'sliding')} needs a motor speed, because friction at rest has "
            f"no derivative. Add {option('speed')}, for example '5 rad/s', positive toward "
            "clamping",
            name=option("speed"),
        )
    if kind != "sliding" and omega != 0.0:
        raise ParameterError(
            f"{option('speed')} {speed} has no effect, because only sliding friction depends on "
            f"speed. Add {option('friction', 'sliding')}, or remove {option('speed')}",
            name=option("speed"),
            value=speed,
            valid=option("friction", "sliding"),
        )
    return kind, omega


def _draw_locus(locus: Locus) -> Figure:
    from bywire.report.poles import root_locus

    return root_locus(locus, math.nan)


# --- Closed loops

_LOWEST = 1e-2  # lower end of the search for the bandwidth, Hz
_NYQUIST = 0.998  # times half the sampling frequency
_POINTS = 600
_DEPTH = 80.0  # shown range of the closed loop's gain, dB


@dataclass(frozen=True)
class LinearizedLoop(Answer):
    """Linear model of a closed loop.

    Parameters
    ----------
    case
        Loop, its parameters and its operating point.
    model
        Sampled model from input to output. ``model.state_space()`` returns a python-control system.
    locus
        Poles over a range, or None if they were not requested.
    reduced
        Reduced model, or None if it was not requested.
        dithered
    Loop linearized about its motion under dither, or None if it was not requested.
    dithered_error
        Maximum relative numerical error of its gains for small sines. Infinite if the motion is not
        periodic in half steps.
    """

    case: LoopCase
    model: LinearModel
    locus: Locus | None = None
    reduced: Reduced | None = None
    dithered: PeriodicModel | None = None
    dithered_error: float = math.nan

    @property
    def notes(self) -> list[str]:
        """Notes on the side of a kink that the linear model uses."""
        return texts.corner_notes([self.model.corners])

    @cached_property
    def state(self) -> str:
        """``"stable"``, ``"unstable"``, or a text which states that there is no loop."""
        gain, closed = self.case.loop.gain_and_closed(self.case.par, self.case.value)
        if not LoopFigures(gain, closed).has_loop:
            return NO_LOOP
        return "stable" if self.model.is_stable else "unstable"

    def document(self) -> Document:
        """Return poles, responses, root locus, reduced model and motion under dither."""
        loop, model = self.case.loop, self.model
        poles = texts.poles_block(model, "Poles, slowest first.")
        stable = "UNSTABLE" if self.state == "unstable" else self.state
        head = (
            f"closed loop {loop.name} of {self.case.name} at {self.case.point}: {stable}, sampled "
            f"every {model.period * 1e3:g} ms"
        )
        over = [] if self.locus is None else [self._locus_listing(self.locus)]
        return Document(
            f"Linear model of closed loop {loop.name}",
            self.case.subject.line,
            sections=lambda: [
                Section("Poles", [*poles, *self._dithered_blocks(), *over]),
                Section("Figures", self._figures()),
                self.case.subject.provenance(
                    f"Exact linear model, sampled every {model.period * 1e3:g} ms. It includes "
                    "plant, "
                    "filters and controllers, but not dry friction."
                ),
            ],
            brief=[head, *poles, *over, *self._brief_reduced(), *self._brief_dithered()],
            data=self._data(),
            banner=Banner(self.state, "good" if self.state == "stable" else "bad"),
            attachments=self._attachments(),
            changes=self.case.subject.changes,
        )

    def _locus_listing(self, locus: Locus) -> Listing:
        return Listing(texts.locus_lines(locus), f"over {locus.name}:")

    def _brief_reduced(self) -> list[str | Flat]:
        if self.reduced is None:
            return []
        return [texts.reduced_line(self.reduced), *texts.poles_block(self.reduced.model)]

    def _brief_dithered(self) -> list[str | Flat]:
        if self.dithered is None:
            return []
        gains = texts.small_gains_line(self.dithered, self.case.loop.band, self.dithered_error)
        poles = texts.poles_block(self.dithered.averaged)
        return [texts.dithered_line(self.dithered), *poles, gains]

    def _dithered_blocks(self) -> list[Block]:
        if self.dithered is None:
            return []
        caption = "Poles with friction and dither, averaged over a dither period, slowest first."
        poles = texts.poles_block(self.dithered.averaged, caption)
        return [Paragraph(texts.dithered_line(self.dithered)), *poles]

    def _figures(self) -> list[FigureBlock]:
        name, model, width = self.case.loop.name, self.model, _closed_bandwidth(self.model)
        blocks = [
            FigureBlock(
                partial(_poles, model, width),
                "Poles of the closed loop as rates, one of each pair. Rays have equal damping "
                "ratio, "
                "and circles have equal frequency. The unstable half is shaded. f_s is the "
                "sampling "
                "frequency.",
                f"{name}-poles",
            ),
            FigureBlock(
                partial(_response, model, width, self.dithered),
                "Frequency response of the closed loop, down to 80 dB below its peak gain.",
                f"{name}-closed-loop",
            ),
        ]
        if self.locus is not None:
            caption = f"Poles of the closed loop versus {self.locus.name}."
            draw = partial(self._draw_locus, self.locus)
            blocks.append(FigureBlock(draw, caption, f"{name}-locus"))
        return blocks

    def _draw_locus(self, locus: Locus) -> Figure:
        from bywire.report.poles import root_locus

        case = self.case
        ends = (float(locus.values[0]), float(locus.values[-1]))
        cases = case.loop.varied(case.par, case.value, locus.name, ends)
        models = [self.model, *(case.loop.closed(*each) for each in cases)]
        widths = [_closed_bandwidth(model) for model in models if model.is_stable]
        return root_locus(locus, max(widths, default=math.nan))

    def _attachments(self) -> list[Attachment]:
        name = self.case.loop.name
        files = [texts.json_file(f"{name}-linear-model.json", self._model_data())]
        if self.dithered is not None:
            content = texts.dithered_object(self.dithered)
            files.append(texts.json_file(f"{name}-dithered-model.json", content))
        return files

    def _model_data(self) -> dict[str, Any]:
        shown = texts.matrices(self.model)
        transfers = shown.pop("transfer_functions")
        return {
            **self.case.heading,
            **shown,
            "rates": texts.pairs(rates(self.model)),
            "stable": self.model.is_stable,
            "has_loop": self.state != NO_LOOP,
            "transfer_functions": transfers,
        }

    def _data(self) -> dict[str, Any]:
        shown = self._model_data()
        if self.locus is not None:
            shown["locus"] = texts.locus_object(self.locus)
        if self.reduced is not None:
            shown["reduced"] = texts.reduced_object(self.reduced)
        if self.dithered is not None:
            shown["dithered"] = texts.dithered_object(self.dithered)
            shown["dithered"]["gain_step_error"] = self.dithered_error
        return shown


def _closed_bandwidth(model: LinearModel) -> float:
    """Return the -3 dB bandwidth of a closed loop [Hz], NaN if the loop is unstable."""
    if not model.is_stable:
        return math.nan
    return bandwidth(lambda f: model.response(f)[:, 0, 0], (_LOWEST, _NYQUIST * model.nyquist))


def _poles(model: LinearModel, width: float) -> Figure:
    from bywire.report.poles import pole_map

    return pole_map(rates(model), model.period, width)


def _response(model: LinearModel, width: float, dithered: PeriodicModel | None) -> Figure:
    from bywire.report.response_figures import Response, bode

    low = 0.01 * width if math.isfinite(width) else 1e-4 / model.period
    f = np.geomspace(low, _NYQUIST * model.nyquist, _POINTS)
    (taken,), (given,) = model.input_units, model.output_units
    unit = "1" if taken == given else f"{unit_text(given) or '1'}/{unit_text(taken) or '1'}"
    label = "closed loop" if dithered is None else "without friction"
    lines = [Response(label, f, model.response(f)[:, 0, 0])]
    if dithered is not None:
        lines.append(Response("with friction and dither", f, dithered.response(f)))
    marks = {f"bandwidth {width:.3g} Hz": width} if math.isfinite(width) else {}
    return bode(lines, gain_unit=unit, marks=marks, depth=_DEPTH)


# --- Linear models of loops and plants


def linearized(
    case: LoopCase | PlantCase, locus: str, reduce: str, dither: bool
) -> LinearizedLoop | LinearizedPlant | PlantLocus:
    """Linearize a loop or a plant, or compute a plant's poles over a range.

    For ``locus``, ``reduce`` and ``dither``, see `bywire.linearize`.
    """
    if isinstance(case, LoopCase):
        return _linearized_loop(case, locus, reduce, dither)
    if dither:
        raise ParameterError(
            f"{option('dither', True)} applies only to loops. Remove it, or choose a loop",
            name=option("dither", True),
        )
    if locus and reduce:
        raise ParameterError(
            f"{option('reduce')} and {option('locus')} cannot be combined. Use only one of them",
            name=option("reduce"),
            value=reduce,
        )
    return _plant_locus(case, locus) if locus else _linearized_plant(case, reduce)


def _linearized_loop(case: LoopCase, locus: str, reduce: str, dither: bool) -> LinearizedLoop:
    model = case.loop.closed(case.par, case.value)
    dithered = _dithered(case) if dither else None
    return LinearizedLoop(
        case,
        model,
        _followed(case, locus) if locus else None,
        texts.reduced(model, reduce, case.loop.band[1]) if reduce else None,
        dithered,
        math.nan if dithered is None else _gain_error(case, dithered),
    )


def linear_case(
    name: str,
    parameters: str,
    at: str,
    overrides: Mapping[str, Any],
    friction: str,
    speed: str,
    side: str = "",
) -> LoopCase | PlantCase:
    """Find the loop or plant to linearize, and read its parameters and operating point.

    Parameters
    ----------
    name, parameters, at, overrides, friction, speed, side
        See `bywire.linearize`.

    Raises
    ------
    InputError
        See `bywire.linearize`.
    """
    if name in PLANTS.all():
        return _plant_case(name, parameters, at, overrides, friction, speed, side)
    if name not in LOOPS.all():
        raise LOOPS.unknown(name, PLANTS)
    for argument, text in (("friction", friction), ("speed", speed)):
        if text:
            raise ParameterError(
                f"{option(argument)} {text} applies only to plants ({', '.join(PLANTS.all())}), "
                "because bywire linearizes loops without dry friction. Remove it",
                name=option(argument),
                value=text,
            )
    return loop_case(name, parameters, at, overrides, side)


def locus_range(case: LoopCase | PlantCase, range_: str) -> tuple[str, str, list[float]]:
    """Return name, unit and values of a root locus range.

    Raises
    ------
    InputError
        If the range is invalid.
    """
    quantity = case.point.quantity if isinstance(case, PlantCase) else case.loop.at
    return range_of(range_, quantity, case.par, "locus")


def _followed(case: LoopCase, range_: str) -> Locus:
    name, unit, values = locus_range(case, range_)
    return locus(case.loop, case.par, case.value, name, unit, sorted(values))


def _dithered(case: LoopCase) -> PeriodicModel:
    if not case.loop.whole(case.par):
        raise ParameterError(
            f"{option('dither', True)}: loop {case.loop.name!r} of {case.name} has no dither. "
            "Choose "
            f"a loop with dither ({_dithered_loops()}), and switch it on in the ECU's parameters",
            name=option("dither", True),
            valid=_dithered_loops(),
        )
    return dithered_loop(case.loop, case.par, case.value)


def _gain_error(case: LoopCase, model: PeriodicModel) -> float:
    """Return the relative numerical error of gains for small sines, from half steps."""
    share, frequencies = OTHER_STEPS[0], texts.small_sines(model, case.loop.band)
    try:
        finer = dithered_loop(case.loop, case.par, case.value, share * model.run.step)
    except NO_ESTIMATE:
        return math.inf
    gains, others = (np.abs(each.response(frequencies)) for each in (model, finer))
    return of_difference(share) * float(np.max(np.abs(others / gains - 1.0)))


def _dithered_loops() -> str:
    known = LOOPS.all().values()
    return ", ".join(each.name for each in known if each.whole(parameters(main_set(each.assembly))))
