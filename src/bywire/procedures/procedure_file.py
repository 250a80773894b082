"""Reader of procedure files, which returns a plan of stops. It never executes any file content.

A condition or limit may contain names of numbers in braces, ``"{v_test}"``. Each number has a
source or is missing. bywire does not run stops whose conditions need a missing number.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import Field

from bywire.bench import bench_file
from bywire.bench.bench import Bench
from bywire.bench.changes import OPTION
from bywire.bench.computation import bench_identity, functions_digest
from bywire.bench.experiment import EXPERIMENTS
from bywire.bench.kpis.kpi import Figures
from bywire.core.errors import InputError, ParameterError, not_valid, quoted, unknown_name
from bywire.core.parameters import leaf_fields
from bywire.core.section import Hint, Name, Section, Table
from bywire.core.units import parse, shown
from bywire.core.values import written
from bywire.data.toml_file import PROCEDURE, entry_lines, read_toml, require_kind
from bywire.procedures.formula import SpeedLimit, read_speed_limit
from bywire.procedures.motion import SPEED, Motion

_QUOTED = Hint("write it in quotation marks, with its unit")
_Quoted = Annotated[str, _QUOTED]
_QuotedOrNone = Annotated[str | None, _QUOTED]
_BRACES = re.compile(r"\{(\w+)\}")
_OF_MAXIMUM = re.compile(r"([^%]*%)\s*of\s+v_max\s*")
NUMBERS, MAXIMUM = "numbers.", "v_max"
"""prefix of the names of numbers, and name of the maximum speed, in changes of a procedure"""
_SET = "set."
_MOST = 200  # stops under the same conditions
_LONGEST = 86400.0  # interval between stops [s]


class NumberSection(Section):
    """A section ``[numbers.NAME]``: a number with its source, or one that is missing."""

    value: _QuotedOrNone = None
    source: Annotated[str | None, Hint("write the document and the paragraph")] = None
    missing: Annotated[str | None, Hint("write where the source states the number")] = None


class StopSection(Section):
    """A section ``[[stops]]``: conditions and limits of one or more stops."""

    name: Annotated[Name, Hint("write a name that is not blank")]
    source: str = ""
    speed: Annotated[Any, Field()] = None
    until: _QuotedOrNone = None
    count: Annotated[Any, Field()] = 1
    interval: _QuotedOrNone = None
    cooling_speed: _QuotedOrNone = None
    T_brake: _QuotedOrNone = None
    deceleration: _QuotedOrNone = None
    adjust: Literal["first", "every"] = "first"
    judged: bool = True
    set: Table
    limits: Table


class ProcedureFile(Section):
    """A procedure file."""

    procedure: Annotated[Name, Hint('write the title: procedure = "..."')]
    source: str = ""
    experiment: Annotated[str, Hint("write experiment = \"...\" (see 'bywire list experiments')")]
    parameters: str = ""
    v_max: _Quoted
    demand: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    set: Table
    numbers: Annotated[Mapping[str, NumberSection], Field(default_factory=dict)]
    stops: tuple[StopSection, ...] = ()


@dataclass(frozen=True)
class Number:
    """A number of a procedure.

    Parameters
    ----------
    name
        Its name.
    value
        Text with unit; empty if the number is missing.
    source
        Document and paragraph, or the place of a missing number.
    """

    name: str
    value: str
    source: str


@dataclass(frozen=True)
class StopPlan:
    """One or more stops under the same conditions.

    Parameters
    ----------
    name, source
        Name of the stops, and their paragraph in the source.
    bench
        The stop with cold brakes; None if a number is missing.
    motion
        Signals of the vehicle.
    v_0, until
        Initial speed, and speed at which the brakes open [m/s]; 0 for a stop to standstill.
    count
        Number of stops.
    interval
        Time from the beginning of a stop to the beginning of the next [s]; None if each stop begins
        with the same temperatures.
    cooling_speed
        Speed between the stops [m/s].
    T_brake
        Disc temperature before the first stop [K], or before each stop without an interval. None
        for the temperature that remains after the interval, or the air temperature.
    deceleration
        Mean fully developed deceleration to which the demand is adjusted [m/s^2]; None for the
        demand of the bench.
    adjusts_every
        Whether every stop adjusts the demand, instead of only the first.
    limits
        Limits of key figures.
    changes
        The user's changes to these stops.
    lacking
        Names of the missing numbers without which the stops cannot run.
    unknown
        Text of each limit that needs a missing number, and this number's name.
    """

    name: str
    source: str
    bench: Bench | None = None
    motion: Motion | None = None
    v_0: float = 0.0
    until: float = 0.0
    count: int = 1
    interval: float | None = None
    cooling_speed: float = 0.0
    T_brake: float | None = None
    deceleration: float | None = None
    adjusts_every: bool = False
    limits: tuple[SpeedLimit, ...] = ()
    changes: tuple[tuple[str, str], ...] = ()
    lacking: tuple[str, ...] = ()
    unknown: tuple[tuple[str, str, str], ...] = ()

    @property
    def identity(self) -> dict[str, Any]:
        """Everything that affects its key figures and verdicts, except earlier stops."""
        conditions = (
            "name",
            "v_0",
            "until",
            "count",
            "interval",
            "cooling_speed",
            "T_brake",
            "deceleration",
            "adjusts_every",
            "lacking",
            "unknown",
        )
        return {
            "bench": None if self.bench is None else bench_identity(self.bench),
            "limits": [[each.figure, each.text] for each in self.limits],
            **{name: getattr(self, name) for name in conditions},
        }

    @property
    def follows(self) -> bool:
        """Whether the first stop begins with the heat of the previous stops."""
        return self.interval is not None and self.T_brake is None


@dataclass(frozen=True)
class ProcedurePlan:
    """Content of a procedure file.

    Parameters
    ----------
    name, title, source
        Name in reports, title and source of the procedure.
    bench
        The vehicle's stop with the changes that all stops share.
    v_max
        Maximum speed of the vehicle [m/s].
    demand
        Options that bywire scales to reach a deceleration. The report lists them.
    stops
        The stops in their order.
    numbers
        Numbers with their sources.
    missing
        What the procedure leaves out.
    """

    name: str
    title: str
    source: str
    bench: Bench
    v_max: float
    demand: tuple[str, ...]
    stops: tuple[StopPlan, ...]
    numbers: tuple[Number, ...] = ()
    missing: tuple[str, ...] = ()

    @property
    def units(self) -> dict[str, str]:
        """Unit of every key figure of its stops by name."""
        units = dict(self.demand_figures.units)
        for each in self.stops:
            if each.bench is not None and each.motion is not None:
                units |= each.bench.definition.kpis_with(each.bench.chosen_options)
                units |= each.motion.units
        return units

    @property
    def identity(self) -> dict[str, Any]:
        """Everything that affects its key figures and verdicts."""
        return {
            "computed": functions_digest((), "bywire.procedures"),
            "stops": [each.identity for each in self.stops],
            "demand": list(self.demand),
        }

    @property
    def demand_figures(self) -> Figures:
        """Key figures of the demand: the maximum value of each of its options."""
        leaves = leaf_fields(self.bench.definition.options)
        declared: dict[str, Any] = {
            f"demand_{name}": (leaves[name].unit.symbol, f"Demand of the stop, options.{name}.")
            for name in self.demand
        }
        return Figures(**declared)


def read_procedure(
    source: str | Path, overrides: Mapping[str, str] = MappingProxyType({})
) -> ProcedurePlan:
    """Read a procedure file.

    Parameters
    ----------
    source
        TOML file (see ``docs/procedures.md``).
    overrides
        Changes to the vehicle's stops in the same form as ``--set``, including ``v_max`` and
        ``numbers.NAME``.

    Raises
    ------
    FileError
        If the file cannot be read or is not valid TOML.
    InputError
        For any invalid entry. The message begins with the file's name.
    """
    file = Path(source)
    content = read_toml(file, "procedure file")
    lines = entry_lines(file).get("stops", [])
    try:
        require_kind(content, PROCEDURE, file)
        read = ProcedureFile.read(content, "a procedure file")
        return _plan(read, file.stem, overrides, lines)
    except InputError as error:
        raise error.reworded(f"{file}: {error}") from None


def _plan(
    file: ProcedureFile, name: str, overrides: Mapping[str, str], lines: Sequence[int]
) -> ProcedurePlan:
    numbers = _numbers(file.numbers, overrides)
    known = {each.name: each.value for each in numbers}
    v_max = _positive(overrides.get(MAXIMUM, file.v_max), "m/s", MAXIMUM, 50.0)
    settings = {"parameters": file.parameters} if file.parameters else {}
    settings |= _texts(file.set, "[set]")
    of_bench = {
        key: value
        for key, value in overrides.items()
        if key != MAXIMUM and not key.startswith(NUMBERS)
    }
    _require_free(settings | of_bench)
    shared, lacking = _filled(settings | of_bench, known)
    if lacking:
        where = ", ".join(f"{NUMBERS}{each}" for each in lacking)
        raise ParameterError(
            f"[set] needs a value for {where}. Set it with --set, or write the value in [set]",
            name="set",
            valid=where,
        )
    if not bench_file.names_experiment(file.experiment):
        raise unknown_name("experiment", file.experiment, EXPERIMENTS.all())
    bench = bench_file.read(file.experiment, shared)
    options = leaf_fields(bench.definition.options)
    if SPEED not in options or options[SPEED].unit.symbol != "m/s":
        raise ParameterError(
            f"experiment {bench.experiment!r} has no option {SPEED}, which sets the speed of a "
            "stop. Use an experiment that stops a vehicle",
            name="experiment",
            value=bench.experiment,
            valid=f"an experiment with the option {SPEED}",
        )
    for each in file.demand:
        if each not in options:
            raise unknown_name(f"option of {bench.experiment} in demand", each, options)
    if not file.stops:
        raise ParameterError("a procedure needs at least one [[stops]]", name="stops")
    reader = _Reader(file, shared, known, v_max, bench)
    stops: list[StopPlan] = []
    for k, section in enumerate(file.stops):
        line = f" (line {lines[k]})" if k < len(lines) else ""
        stops.append(reader.stop(section, stops, line))
    if any(each.T_brake is not None or each.interval is not None for each in stops):
        stops = reader.warmed(stops)
    return ProcedurePlan(
        name,
        file.procedure,
        file.source,
        bench,
        v_max,
        file.demand,
        tuple(stops),
        numbers,
        file.missing,
    )


def _numbers(
    sections: Mapping[str, NumberSection], overrides: Mapping[str, str]
) -> tuple[Number, ...]:
    for key in overrides:
        if key.startswith(NUMBERS) and key.removeprefix(NUMBERS) not in sections:
            raise unknown_name("number of the procedure", key.removeprefix(NUMBERS), sections)
    return tuple(
        _number(name, section, overrides.get(f"{NUMBERS}{name}"))
        for name, section in sections.items()
    )


def _number(name: str, section: NumberSection, override: str | None) -> Number:
    where = f"[{NUMBERS}{name}]"
    if (section.value is None) == (section.missing is None):
        raise ParameterError(
            f"{where} needs either value and source, or missing", name=where, valid="value, missing"
        )
    if override is not None:
        return Number(name, override, "set by the user")
    if section.missing is not None:
        return Number(name, "", section.missing)
    if not (section.source or "").strip():
        raise ParameterError(
            f"{where} has a value without a source. Add source with the document and the paragraph",
            name=f"{where} source",
        )
    return Number(name, section.value or "", section.source or "")


def _texts(changes: Mapping[str, Any], where: str) -> dict[str, str]:
    flat = bench_file.flattened(changes)
    for key, value in flat.items():
        if not isinstance(value, str):
            raise not_valid(f"{where} {key}", quoted(value), "a string with its unit")
    return flat


def _require_free(changes: Mapping[str, str]) -> None:
    """Reject a change of the initial speed, which the stops determine."""
    if f"{OPTION}{SPEED}" in changes:
        raise ParameterError(
            f"{OPTION}{SPEED} would have no effect, because the speed of each stop determines it. "
            "Change speed instead",
            name=f"{OPTION}{SPEED}",
        )


def _filled(
    texts: Mapping[str, str], known: Mapping[str, str]
) -> tuple[dict[str, str], tuple[str, ...]]:
    """Return texts with numbers in place of their names, and the names of missing numbers."""
    lacking: dict[str, None] = {}

    def fill(match: re.Match[str]) -> str:
        name = match[1]
        if name not in known:
            raise unknown_name("number of the procedure", name, known)
        if not known[name]:
            lacking[name] = None
        return known[name]

    return {key: _BRACES.sub(fill, text) for key, text in texts.items()}, tuple(lacking)


def _positive(text: str, symbol: str, name: str, nominal: float) -> float:
    value = float(written(text, symbol, name, nominal))
    if not value > 0.0:
        raise not_valid(name, quoted(text), f"> 0 {symbol}")
    return value


def _count(value: Any) -> int:
    is_whole = not isinstance(value, bool) and re.fullmatch(r"\d{1,3}", str(value))
    if not is_whole or not 1 <= int(value) <= _MOST:
        raise not_valid("count", quoted(value), f"a whole number from 1 to {_MOST}")
    return int(value)


_UNITS = {
    "interval": ("s", 30.0),
    "cooling_speed": ("m/s", 20.0),
    "T_brake": ("K", 350.0),
    "deceleration": ("m/s**2", 3.0),
}


@dataclass(frozen=True)
class _Reader:
    """Reader of the stops of a file."""

    file: ProcedureFile
    shared: Mapping[str, str]
    known: Mapping[str, str]
    v_max: float
    bench: Bench

    def stop(self, section: StopSection, before: Sequence[StopPlan], line: str) -> StopPlan:
        """Return the plan of a section's stops; ``line``: its line in errors."""
        where = f"[[stops]] {quoted(section.name)}{line}"
        if section.name in {each.name for each in before}:
            raise ParameterError(
                f"{where} occurs twice. Use a different name for each entry of [[stops]]",
                name="stops",
                value=section.name,
            )
        if section.judged and not section.limits:
            raise ParameterError(
                f"{where} has no limit. Add limits, or add judged = false if the stop only heats "
                "the brakes",
                name=f"{where} limits",
                valid="limits, or judged = false",
            )
        try:
            return self._stop(section, where, before)
        except InputError as error:
            raise error.reworded(f"{where} {error}") from None

    def _stop(self, section: StopSection, where: str, before: Sequence[StopPlan]) -> StopPlan:
        speeds = self._speeds(section.speed)
        given = {
            key: str(getattr(section, key))
            for key in ("count", "until", *_UNITS)
            if getattr(section, key) is not None
        }
        changes = _texts(section.set, "set")
        _require_free(changes)
        texts = {
            **{f"speed{k}": text for k, text in enumerate(speeds)},
            **given,
            **{f"{_SET}{key}": text for key, text in changes.items()},
        }
        filled, lacking = _filled(texts, self.known)
        if lacking:
            stated = bench_file.flattened(section.limits)
            unknown = tuple((key, str(text), ", ".join(lacking)) for key, text in stated.items())
            follows = section.interval is not None and section.T_brake is None
            return StopPlan(
                section.name,
                section.source,
                interval=0.0 if follows else None,
                lacking=lacking,
                unknown=unknown,
                count=1 if "{" in given["count"] else _count(section.count),
            )
        values = {
            key: _positive(filled[key], symbol, key, nominal)
            for key, (symbol, nominal) in _UNITS.items()
            if key in filled
        }
        if values.get("interval", 0.0) > _LONGEST:
            raise not_valid(
                "interval", quoted(filled["interval"]), f"<= {shown(_LONGEST, 's', 'h')}"
            )
        if "cooling_speed" in values:
            self._require_reached("cooling_speed", filled["cooling_speed"], values["cooling_speed"])
        v_0 = min(self._speed(filled[f"speed{k}"]) for k in range(len(speeds)))
        own = {k.removeprefix(_SET): v for k, v in filled.items() if k.startswith(_SET)}
        bench = bench_file.read(self.bench.experiment, {**self.shared, **own})
        bench = bench_with_speed(bench, v_0)
        motion = Motion.of(bench, v_0)
        limits, gaps = self._limits(section, bench, motion, v_0, before)
        if "deceleration" in values and not self.file.demand:
            raise ParameterError(
                "deceleration needs demand options. Add demand = [...] to the file, with the "
                "options that bywire scales to reach the deceleration",
                name="demand",
            )
        if not motion.brakes and values.keys() & {"T_brake", "interval"}:
            key = next(key for key in ("T_brake", "interval") if key in values)
            raise ParameterError(
                f"{key} would have no effect because the brakes of {bench.system} do not warm up "
                f"in this model. Remove {key}",
                name=key,
            )
        return StopPlan(
            section.name,
            section.source,
            bench,
            motion,
            v_0,
            self._share(filled["until"], "until") * v_0 if "until" in filled else 0.0,
            _count(section.count if isinstance(section.count, int) else filled["count"]),
            values.get("interval"),
            values.get("cooling_speed", v_0),
            values.get("T_brake"),
            values.get("deceleration"),
            section.adjust == "every",
            limits,
            tuple(own.items()),
            unknown=gaps,
        )

    @staticmethod
    def _speeds(value: Any) -> list[str]:
        speeds = [value] if isinstance(value, str) else value
        valid = 'a speed such as "60 km/h", or a list of speeds, of which the lowest applies'
        if value is None:
            raise ParameterError(f"speed is missing. Add {valid}", name="speed", valid=valid)
        is_list = isinstance(speeds, list | tuple) and speeds
        if not is_list or not all(isinstance(each, str) for each in speeds):
            raise not_valid("speed", quoted(value), valid)
        return list(speeds)

    def _speed(self, text: str) -> float:
        """Return a speed [m/s], which may be a fraction of the maximum speed."""
        match = _OF_MAXIMUM.fullmatch(text)
        v = (
            self._share(match[1], "speed") * self.v_max
            if match
            else _positive(text, "m/s", "speed", 20.0)
        )
        self._require_reached("speed", text, v)
        return v

    def _require_reached(self, key: str, text: str, v: float) -> None:
        if v > self.v_max:
            most = f"<= v_max = {shown(self.v_max, 'm/s', 'km/h')}"
            raise not_valid(key, quoted(text), most, "the maximum speed of the vehicle")

    @staticmethod
    def _share(text: str, name: str) -> float:
        share = parse(text, "1", name) if text.strip().endswith("%") else -1.0
        if not 0.0 < share <= 1.0:
            raise not_valid(name, quoted(text), "a percentage > 0 % and <= 100 %")
        return share

    def _limits(
        self,
        section: StopSection,
        bench: Bench,
        motion: Motion,
        v_0: float,
        before: Sequence[StopPlan],
    ) -> tuple[tuple[SpeedLimit, ...], tuple[tuple[str, str, str], ...]]:
        """Return the limits of a stop, and those that need a missing number."""
        units = {**bench.definition.kpis_with(bench.chosen_options), **motion.units}
        read, gaps = [], []
        for figure, given in section.limits.items():
            if figure not in units:
                raise unknown_name("key figure in limits", figure, units)
            for text in given if isinstance(given, list | tuple) else (given,):
                if not isinstance(text, str):
                    raise not_valid(f"limits {figure}", quoted(text), "a limit in quotation marks")
                filled, lacking = _filled({"": text}, self.known)
                if lacking:
                    gaps.append((figure, text, ", ".join(lacking)))
                    continue
                limit = read_speed_limit(figure, filled[""], units[figure], "limits")
                if limit.at is not None:
                    limit.at(v_0)  # rejects a formula without a value
                elif limit.of not in (names := [each.name for each in before]):
                    raise unknown_name(f"earlier stop in limits {figure}", limit.of, names)
                read.append(limit)
        return tuple(read), tuple(gaps)

    def warmed(self, stops: Sequence[StopPlan]) -> list[StopPlan]:
        """Return the stops with brakes that warm up."""
        return [
            each
            if each.bench is None or each.motion is None
            else replace(
                each,
                bench=replace(each.bench, overrides={**each.bench.overrides, **each.motion.warm()}),
            )
            for each in stops
        ]


def bench_with_speed(bench: Bench, v_0: float) -> Bench:
    """Return a bench that starts at a speed [m/s]."""
    return replace(bench, options={**bench.options, SPEED: v_0})
