"""Control loops and plants of a brake: operating points, excitation, and cuts."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from bywire.analysis.linear.corners import taking
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import Friction
from bywire.analysis.linear.sampled_loops import (
    analog_gain,
    closed_again,
    closed_loop,
    cut_open,
    open_loop,
    sampled_models,
)
from bywire.core.arguments import checked
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.registry import Kind, instances
from bywire.core.typing import Array, Complex
from bywire.simulation.run import Run

_ROUNDING = 1e-12  # of a limit: maximum deviation of a clipped demand


@dataclass(frozen=True)
class Saturation:
    """Limit that a model does not record as a mode.

    Parameters
    ----------
    name
        Name of the fraction of time at the limit, for example ``"sat_current"``.
    signals
        Limited outputs; the limit is reached if one of them is at it.
    limits
        Dotted names of the parameters that limit the magnitude; the smallest one counts.
    """

    name: str
    signals: tuple[str, ...]
    limits: tuple[str, ...]

    def share(self, values: Array, matrix: Array, names: Sequence[str]) -> Array:
        """Return the fraction of time at the limit, shape (cases,).

        Parameters
        ----------
        values
            The signals, shape (cases, rows, signals).
        matrix, names
            Parameter vectors, shape (parameters, cases), and the names of their rows.
        """
        limit = matrix[[names.index(name) for name in self.limits]].min(axis=0)
        at = np.abs(values) >= (1.0 - _ROUNDING) * limit[:, None, None]
        return np.asarray(at.any(axis=2).mean(axis=1))


# --- Gain schedules: regions of the operating quantity with their gains


@dataclass(frozen=True)
class LoopSchedule:
    """Gains that depend on the operating point, region by region.

    Parameters
    ----------
    changes
        Parameters that switch the schedule on.
    borders
        Parameters at which regions meet, ascending.
    regions
        Name of each region -> parameters that a design may choose there: dotted name -> minimum
        and maximum value [SI]; by ascending operating point.
    main
        Region whose gains also apply without a schedule; it is designed first.
    points
        Usual operating points for the design of regions [SI].
    """

    changes: Mapping[str, Any]
    borders: tuple[str, ...]
    regions: Mapping[str, Mapping[str, tuple[float, float]]]
    main: str
    points: tuple[float, ...]

    def is_on(self, par: ParameterSet) -> bool:
        """Return whether the parameters switch the schedule on."""
        values = par.flat()
        return all(values[name] == value for name, value in self.changes.items())

    def region(self, par: ParameterSet, value: float) -> str:
        """Return the region of an operating point; a boundary belongs to the region above it."""
        leaves = par.leaves()
        return tuple(self.regions)[bisect_right([leaves[name] for name in self.borders], value)]


# --- Loops


@dataclass(frozen=True)
class Point:
    """Operating point, ready to run and to linearize.

    Parameters
    ----------
    model, par
        The system; the parameters close this loop, but no outer loop.
    state, memory, stimulus
        Equilibrium without dry friction.
    step
        Substep [s] required by its fastest motions.
    """

    model: Model
    par: ParameterSet
    state: NamedTuple
    memory: NamedTuple
    stimulus: NamedTuple
    step: float = 20e-6

    def run(self, step: float | None = None) -> Run:
        """Return a run that rests at the point, by default with the point's own substep [s]."""
        row = [float(value) for value in self.stimulus]
        return Run(
            self.model,
            self.par,
            self.state,
            self.memory,
            lambda t: np.repeat([row], t.size, axis=0),
            1.0,
            step or self.step,
            1e-3,
        )


@checked
@dataclass(frozen=True)
class Quantity:
    """Quantity that defines an operating point.

    Parameters
    ----------
    name, unit
        Name and SI unit, for example ``"pressure"`` in ``"Pa"``.
    default
        Usual value.
    """

    name: str
    unit: str
    default: float

    def refused(self, value: float, why: object) -> ParameterError:
        """Return the error for a value that is not an operating point."""
        return ParameterError(
            f"{self.name} = {value:g} {self.unit} is not a valid operating point: {why}",
            name=self.name,
            value=f"{value:g} {self.unit}",
        )

    def require_positive(self, value: float, remark: str = "") -> None:
        """Reject a value that is not positive; ``remark``: end of the error message."""
        if not value > 0.0:
            raise self.refused(value, f"it must be > 0 {self.unit}{remark}")


@checked
@dataclass(frozen=True)
class Loop:
    """Control loop of a brake.

    Parameters
    ----------
    name
        Name on the command line.
    assembly
        Assembly that contains it.
    summary
        One line for listings.
    at
        Quantity that defines its operating point.
    inputs
        Signals of the stimulus that are excited together; the first determines the unit.
    output
        Responding signal.
    cut
        Signal at which the loop is cut open for margins: a state that its controller reads, or a
        value that it writes.
    point
        ``point(par, value) -> Point``.
    causes
        Nonlinearities: name -> parameters that switch it off.
    band
        Usual frequency range [Hz].
    amplitudes
        Usual amplitudes, SI; the first one is small.
    whole
        ``whole(par)``: other frequencies [Hz] of which a window must contain whole periods.
    tunables
        Parameters that a design may choose: dotted name -> minimum and maximum value [SI] to try.
    realizable
        ``realizable(par)``: by dotted name, ranges [SI] that replace those of ``tunables`` because
        a controller with these sample times can implement only them as designed; both ends are
        equal for a required value. A design observes them unless the user disables this.
    sustained
        Parameters that allow long excitation, for example a disc that does not slow down; a
        design's trial with sines applies them.
    proof
        Experiment that tests the loop in the whole brake.
    laws
        ``laws(par, value, frequencies [Hz])``: the controller's responses at an operating point to
        its set point and to a decrease of the output, including sensor and filters, of shape (n,)
        each; None for more complex loops.
    schedule
        Its gain schedule, if there is one.
    saturations
        Limits for which a frequency response reports the fraction of time, if the model records no
        mode of that name.
    single
        Whether a single linear controller connects set point and output to the plant. The loop
        gain then follows from a measured closed-loop response, see ``large_signal``.
    analog
        Whether its controller is analog. ``cut`` is then a state within the plant, and the loop
        gain is a continuous model.
    locked
        States that its linear models hold, such as those of a clamped shaft.
    side
        Side of its linear models if the operating point is on the kink of an operation (see
        `corners.read_sides`); if empty, such a point raises an error.
    variants
        Names of further assemblies that contain it, for example the same brake with another motor.
        ``point`` returns the assembly that fits its parameters.
    """

    name: str
    assembly: str
    summary: str
    at: Quantity
    inputs: tuple[str, ...]
    output: str
    cut: str
    point: Callable[[ParameterSet, float], Point]
    causes: Mapping[str, Mapping[str, Any]]
    band: tuple[float, float]
    amplitudes: tuple[float, ...]
    whole: Callable[[ParameterSet], Sequence[float]] = field(default=lambda _: ())
    tunables: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    realizable: Callable[[ParameterSet], Mapping[str, tuple[float, float]]] = field(
        default=lambda _: {}
    )
    sustained: Mapping[str, Any] = field(default_factory=dict)
    proof: str = ""
    laws: Callable[[ParameterSet, float, Array], tuple[Complex, Complex]] | None = None
    schedule: LoopSchedule | None = None
    saturations: tuple[Saturation, ...] = ()
    single: bool = True
    analog: bool = False
    locked: tuple[str, ...] = ()
    side: str = ""
    variants: tuple[str, ...] = ()

    def is_in(self, assembly: str) -> bool:
        """Return whether an assembly contains the loop."""
        return assembly == self.assembly or assembly in self.variants

    def require_number(self, par: ParameterSet, name: str) -> None:
        """Reject a name that is neither the operating quantity nor a parameter.

        Raises
        ------
        UnknownNameError
            With the nearest known names.
        """
        if name != self.at.name and name not in par.leaves():
            raise unknown_name("parameter", name, [self.at.name, *par.leaves()])

    def varied(
        self, par: ParameterSet, value: float, name: str, values: Sequence[float]
    ) -> list[tuple[ParameterSet, float]]:
        """Return parameters and operating point for each value of a parameter, or of the point.

        Parameters
        ----------
        par, value
            Parameters and operating point to keep.
        name
            Dotted name of a parameter, or name of the operating quantity.
        values
            Its values [SI].

        Raises
        ------
        UnknownNameError
            When the name is unknown.
        """
        self.require_number(par, name)
        if name == self.at.name:
            return [(par, at) for at in values]
        return [(par.replace({name: number}), value) for number in values]

    def smooth(self, par: ParameterSet, leave: str = "") -> ParameterSet:
        """Return parameters with all causes of nonlinearity switched off, except one."""
        changes: dict[str, Any] = {}
        for cause, off in self.causes.items():
            if cause != leave:
                changes |= off
        return par.replace(changes)

    def closed(self, par: ParameterSet, value: float, step: float = 0.0) -> LinearModel:
        """Return the exact linear model from the input to the output at an operating point.

        With a step [s], it is the model of the simulation's midpoint rule (see ``stepped``).
        """
        p = self.point(self.smooth(par), value)
        with taking(self.side):
            model = closed_loop(
                p.model,
                p.par,
                p.state,
                p.memory,
                inputs=self.inputs,
                outputs=(self.output,),
                stimulus=p.stimulus,
                locked=self.locked,
                step=step,
            )
        return model.together(self.inputs)

    def gain(self, par: ParameterSet, value: float) -> LinearModel:
        """Return the exact loop gain at an operating point."""
        p = self.point(self.smooth(par), value)
        with taking(self.side):
            if self.analog:
                return analog_gain(
                    p.model, p.par, p.state, p.memory, cut=self.cut, locked=self.locked
                )
            return open_loop(
                p.model,
                p.par,
                p.state,
                p.memory,
                cut=self.cut,
                stimulus=p.stimulus,
                locked=self.locked,
            )

    def gain_and_closed(self, par: ParameterSet, value: float) -> tuple[LinearModel, LinearModel]:
        """Return `gain` and `closed` at an operating point, from one model of its plant."""
        if self.analog:
            return self.gain(par, value), self.closed(par, value)
        p = self.point(self.smooth(par), value)
        with taking(self.side):
            closed, gain = sampled_models(
                p.model,
                p.par,
                (p.state, p.memory, p.stimulus),
                lambda system: (
                    closed_again(p.model, system, self.inputs).together(self.inputs),
                    cut_open(p.model, system, self.cut),
                ),
                inputs=self.inputs,
                outputs=(self.output,),
                locked=self.locked,
            )
        return gain, closed


LOOPS = Kind("loop", ("loops",), instances(Loop), declared="a Loop")
"""every control loop"""


# --- Plants


@dataclass(frozen=True)
class PlantPoint:
    """Operating point of a plant, with the treatment of dry friction.

    Parameters
    ----------
    quantity, value
        Quantity that defines the operating point, and its value [SI].
    friction
        As in `bywire.analysis.linear.linearize.linearize`.
    speed
        Motor speed [rad/s], positive toward clamping; nonzero for sliding friction only.
    """

    quantity: Quantity
    value: float
    friction: Friction = "removed"
    speed: float = 0.0

    @contextmanager
    def named(self, unless: Quantity) -> Iterator[None]:
        """Add the value to errors in this context, except for the quantity ``unless``."""
        try:
            yield
        except ParameterError as error:
            if self.quantity is unless:
                raise
            raise self.quantity.refused(self.value, error) from None


@dataclass(frozen=True)
class Plant:
    """Plant of a brake, without its controllers.

    Parameters
    ----------
    name
        Name on the command line.
    assembly
        Assembly that contains it.
    summary
        One line for listings.
    at
        Quantities that may define its operating point; the first one is the default.
    model
        ``model(par, point) -> LinearModel``.
    band
        Usual upper end of the frequency range [Hz].
    whole
        The model that this one simplifies, with the same inputs and outputs; None for the exact
        model.
    side
        As in `bywire.analysis.loop.Loop`.
    """

    name: str
    assembly: str
    summary: str
    at: tuple[Quantity, ...]
    model: Callable[[ParameterSet, PlantPoint], LinearModel]
    band: float
    whole: Callable[[ParameterSet, PlantPoint], LinearModel] | None = None
    side: str = ""

    def linear(self, par: ParameterSet, point: PlantPoint) -> LinearModel:
        """Return `model` on the plant's side of kinks."""
        with taking(self.side):
            return self.model(par, point)

    def exact(self, par: ParameterSet, point: PlantPoint) -> LinearModel | None:
        """Return the model that this one simplifies, likewise; None for the exact model."""
        with taking(self.side):
            return None if self.whole is None else self.whole(par, point)

    @property
    def usual(self) -> PlantPoint:
        """Default operating point."""
        return PlantPoint(self.at[0], self.at[0].default)


PLANTS = Kind("plant", ("plants",), instances(Plant), declared="a Plant")
"""every plant, and every simplified model of a plant"""
