"""Motion and heat of a vehicle in recordings of its stops, from the parts of its model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis import vehicle_stop
from bywire.bench.kpis.kpi import Figures, Kpi, Undefined
from bywire.core.errors import ParameterError
from bywire.core.parts import Part
from bywire.core.signals import signals_of
from bywire.core.typing import Array
from bywire.plant import disc_heat, ground_support

SPEED = "v_0"
"""option of a stop experiment for the initial speed"""
_FIELDS = disc_heat.State._fields
_WARM = "lumped"

FIGURES = Figures(
    stopping_distance=("m", "Distance from the demand to the first standstill."),
    stopping_time=("s", "Time from the demand to the first standstill."),
    mfdd=(
        "m/s**2",
        "Mean fully developed deceleration: average over distance, from 0.8 to 0.1 of the initial "
        "speed.",
    ),
    time_to_lift=("s", "Time from the demand until the rear wheel leaves the ground."),
    disc_before=("K", "Temperature of the hottest disc at the start of the stop."),
    disc_after=("K", "Temperature of the hottest disc at the end of the stop."),
)
"""key figures of every stop of a procedure, in addition to those of its experiment"""
_NO_LIFT = "the rear wheel stays on the ground"


@dataclass(frozen=True)
class Motion:
    """Signals of a vehicle's motion, and its brakes that warm up.

    Parameters
    ----------
    label
        Label of the run.
    v, x
        Names of the vehicle's speed and position.
    support
        Name of the force below the rear wheel; empty if the model has none.
    brakes
        Parts that warm up, by name.
    """

    label: str
    v: str
    x: str
    support: str
    brakes: Mapping[str, Part[Any, Any, Any, Any]]

    @classmethod
    def of(cls, bench: Bench, v_0: float) -> Motion:
        """Return the motion of a bench whose stop starts at a speed [m/s].

        The vehicle's body is the part that moves at this speed.

        Raises
        ------
        ParameterError
            When the experiment makes several runs, or nothing moves at the initial speed.
        """
        cases = bench.cases()
        if len(cases) != 1:
            raise ParameterError(
                f"experiment {bench.experiment!r} makes {len(cases)} runs, but a procedure needs "
                "an experiment with a single stop",
                name="experiment",
                value=bench.experiment,
                valid="an experiment with one stop",
            )
        (case,) = cases
        parts: Mapping[str, Part[Any, Any, Any, Any]] = getattr(case.model, "parts", {})
        for part in parts.values():
            named = _moving(part, case, v_0)
            if named is not None:
                break
        else:
            raise ParameterError(
                f"no part of {bench.system} moves at options.{SPEED} at the start of experiment "
                f"{bench.experiment!r}. Use an experiment that stops a vehicle",
                name="experiment",
                value=bench.experiment,
                valid="an experiment that stops a vehicle",
            )
        supports = [name for p in parts.values() for name in _support(p)]
        return cls(
            case.label,
            *named,
            supports[0] if supports else "",
            {name: part for name, part in parts.items() if part.element is disc_heat},
        )

    def laws(self, par: Any) -> dict[str, disc_heat.Parameters]:
        """Return the parameters of the brakes that warm up, by part."""
        return {name: part.parameters(par) for name, part in self.brakes.items()}

    def warm(self) -> dict[str, str]:
        """Return the choices with which the brakes warm up."""
        return {f"{part.path}.law": _WARM for part in self.brakes.values()}

    def temperatures(self, rows: Any) -> dict[str, dict[str, Array]]:
        """Return the temperatures in a recording [K], by part and state."""
        return {
            name: {each: rows[part.state_name(each)].values for each in _FIELDS}
            for name, part in self.brakes.items()
        }

    def kpis(self, recordings: Recordings) -> tuple[Kpi, ...]:
        """Return the key figures of a stop."""
        run = recordings[self.label]
        t, v, x = (run[name].values.tolist() for name in ("time", self.v, self.x))
        stop = vehicle_stop.stop(t, v)
        values: dict[str, Any] = {}
        for name, measure, further in (
            ("stopping_distance", vehicle_stop.stopping_distance, (x,)),
            ("stopping_time", vehicle_stop.stopping_time, ()),
            ("mfdd", vehicle_stop.mean_deceleration, (x,)),
        ):
            values[name] = (
                stop if isinstance(stop, Undefined) else measure.__wrapped__(stop, *further)
            )
        if self.support:
            values["time_to_lift"] = _lift(run, self.support, stop)
        if self.brakes:
            values |= self._discs(run, stop)
        return FIGURES(**values)

    def _discs(self, run: xr.Dataset, stop: Any) -> dict[str, float | Undefined]:
        if isinstance(stop, Undefined):
            return dict.fromkeys(("disc_before", "disc_after"), stop)
        every = [each["T_disc"] for each in self.temperatures(run).values()]
        hottest = np.max(every, axis=0)
        return {
            "disc_before": float(hottest[stop.begin]),
            "disc_after": float(hottest[stop.until - 1]),
        }

    @property
    def units(self) -> dict[str, str]:
        """Unit of every key figure by name."""
        without = set() if self.support else {"time_to_lift"}
        without |= set() if self.brakes else {"disc_before", "disc_after"}
        return {name: unit for name, unit in FIGURES.units.items() if name not in without}


def _moving(part: Part[Any, Any, Any, Any], case: Case, v_0: float) -> tuple[str, str] | None:
    """Return the names of a part's speed and position, if it moves at the initial speed."""
    if not part.has("State"):
        return None
    signals = signals_of(part.element.State)
    speeds = [name for name, each in signals.items() if each.unit == "m/s"]
    places = [name for name, each in signals.items() if each.unit == "m"]
    moving = [n for n in speeds if getattr(case.state, part.state_name(n)) == v_0]
    if not moving or not places:
        return None
    return part.state_name(moving[0]), part.state_name(places[0])


def _support(part: Part[Any, Any, Any, Any]) -> list[str]:
    return list(part.outputs()) if part.element is ground_support else []


def _lift(run: xr.Dataset, support: str, stop: Any) -> float | tuple[float, str] | Undefined:
    """Return the time until the rear wheel leaves the ground [s]."""
    if isinstance(stop, Undefined):
        return stop
    off = np.flatnonzero(run[support].values[stop.begin : stop.until] <= 0.0)
    return stop.t[stop.begin + int(off[0])] if off.size else (np.nan, _NO_LIFT)


# --- Stops that start with warm brakes


@dataclass(frozen=True)
class StopBench(Bench):
    """Bench of a stop whose brakes start at given temperatures.

    Parameters
    ----------
    heat
        Temperatures of the brakes by part; brakes that are missing start as in the experiment.
    motion
        Signals of the vehicle. None for the experiment's key figures alone.
    """

    heat: Mapping[str, disc_heat.State] | None = None
    motion: Motion | None = None

    @classmethod
    def of(cls, bench: Bench, **more: Any) -> StopBench:
        """Return a bench with temperatures and motion."""
        given = {each.name: getattr(bench, each.name) for each in fields(Bench)}
        return cls(**{**given, **more})

    @cached_property
    def definition(self) -> Experiment:
        """Experiment of this name, with the key figures of a procedure."""
        experiment, motion = super().definition, self.motion
        if motion is None:
            return experiment

        def judge(recordings: Recordings, options: Any) -> tuple[Kpi, ...]:
            own = {kpi.name: kpi for kpi in experiment.judge(recordings, options)}
            return tuple({**own, **{kpi.name: kpi for kpi in motion.kpis(recordings)}}.values())

        return replace(experiment, judge=judge)

    def cases_with(self, par: Any, options: Any, make: Any = None) -> tuple[Case, ...]:
        """Return the runs with other parameters and options, and with warm brakes."""
        cases = super().cases_with(par, options, make)
        if not self.heat or self.motion is None:
            return cases
        changes = {
            part.state_name(name): T
            for key, part in self.motion.brakes.items()
            if key in self.heat
            for name, T in self.heat[key]._asdict().items()
        }
        return tuple(_warmed(case, changes) for case in cases)


def _warmed(case: Case, changes: Mapping[str, float]) -> Case:
    start = case.start

    def begin(par: Any) -> tuple[Any, Any]:
        assert start is not None
        state, memory = start(par)
        return state._replace(**changes), memory

    return replace(
        case, state=case.state._replace(**changes), start=None if start is None else begin
    )
