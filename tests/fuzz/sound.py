"""Generated benches that are admissible: they are to be carried through to the run."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from random import Random

from bywire.bench.bench import Bench, switches_of
from bywire.bench.experiment import EXPERIMENTS
from bywire.core.catalog import PARAMETER_SETS, parameters
from bywire.core.parameters import Leaf, leaf_fields
from bywire.core.units import convert

Entries = dict[str, str]
"""what a bench file says beside experiment and parameters: value by dotted key of ``--set``"""

_MOTORCYCLE = (
    "dardanelli2010",
    "dardanelli2010-retuned",
    "dardanelli2010-table1",
    "dardanelli2010-scheduled",
)
_WEDGE = ("roberts2003",)


@dataclass(frozen=True)
class Trial:
    """An experiment with options that make it quick."""

    experiment: str
    sets: tuple[str, ...]
    options: Mapping[str, str]
    driven: str = ""
    """unit of the stimulus that it takes"""


def _trial(name: str, sets: tuple[str, ...], driven: str = "", **options: str) -> Trial:
    return Trial(name, sets, {f"options.{key}": text for key, text in options.items()}, driven)


TRIALS = (
    _trial("hard-braking", _MOTORCYCLE, duration="40 ms", settle="10 ms"),
    _trial("current-step", _MOTORCYCLE),
    _trial("pressure-step", _MOTORCYCLE, duration="60 ms", settle="20 ms"),
    _trial("pressure-release", _MOTORCYCLE, duration="80 ms", settle="20 ms", t_ramp="20 ms"),
    _trial("friction-ramp", _MOTORCYCLE, i_max="0.1 A", slope="4 A/s"),
    _trial("seal-stribeck", _MOTORCYCLE),
    _trial("motor-open-loop", _MOTORCYCLE, "A", duration="60 ms", settle="10 ms", source="current"),
    _trial("motor-open-loop", _MOTORCYCLE, "V", duration="60 ms", settle="10 ms", source="voltage"),
    _trial("step", ("dardanelli2010",), input="p_set", duration="50 ms"),
    _trial(
        "moment-pulses",
        _WEDGE,
        t_hold="60 ms",
        t_low="20 ms",
        t_high="20 ms",
        pulses="1",
        settle="10 ms",
    ),
    _trial(
        "moment-ramp",
        _WEDGE,
        t_hold="60 ms",
        t_low="20 ms",
        t_ramp="20 ms",
        t_end="20 ms",
        settle="10 ms",
    ),
    _trial("moment-release", _WEDGE, settle="60 ms", duration="40 ms"),
    _trial("power-off-hold", _WEDGE, settle="60 ms", duration="40 ms"),
    _trial(
        "gap-adjusting", _WEDGE, applications="1", t_hold="60 ms", t_pause="20 ms", settle="10 ms"
    ),
    _trial("current-loop", _WEDGE, duration="4 ms"),
    _trial("run-down", _WEDGE, t_spin="20 ms", duration="40 ms"),
    _trial("step", _WEDGE, input="M_set", duration="50 ms"),
)

_UNITS = {
    "s": ("s", "ms", "us"),
    "m": ("m", "mm", "um"),
    "Pa": ("Pa", "bar", "kPa", "MPa"),
    "A": ("A", "mA"),
    "V": ("V", "mV"),
    "N*m": ("N*m", "N*mm"),
    "Hz": ("Hz", "kHz"),
    "N": ("N", "kN"),
    "kg": ("kg", "g"),
    "m**2": ("m**2", "mm**2"),
    "rad": ("rad", "mrad", "deg"),
    "ohm": ("ohm", "mohm"),
    "H": ("H", "mH", "uH"),
    "W": ("W", "kW"),
}


def text(rng: Random, value: float, symbol: str) -> str:
    """Return a quantity in one of its units."""
    unit = rng.choice(_UNITS.get(symbol, (symbol,)))
    number = f"{convert(value, symbol, unit):.{rng.choice((4, 9))}g}"
    return number if unit == "1" else f"{number} {unit}"


def _admits(leaf: Leaf, value: float) -> bool:
    above = value > leaf.low if leaf.low_open else value >= leaf.low
    below = value < leaf.high if leaf.high_open else value <= leaf.high
    return above and below


def _moved(rng: Random, leaf: Leaf, value: float) -> float:
    """Return another admissible value: near mostly, within a decade at times; or the value."""
    if leaf.name.rpartition(".")[2].startswith("T_") and leaf.unit.symbol == "s":
        return value * rng.choice((0.5, 1.0, 2.0))  # steps divide sample times
    far = rng.random() < 0.1
    moved = value * (10 ** rng.uniform(-1.0, 1.0) if far else rng.lognormvariate(0.0, 0.12))
    # A margin for the digits that are written.
    return moved if _admits(leaf, 0.999 * moved) and _admits(leaf, 1.001 * moved) else value


@cache
def switched_off(name: str) -> frozenset[str]:
    """Return the numbers of a set that its choices switch off: changing one is refused."""
    known = PARAMETER_SETS.find(name)
    for label, experiment in EXPERIMENTS.all().items():
        if experiment.assembly != known.assembly:
            continue
        if cases := Bench(label, name).cases():
            names = leaf_fields(type(known.parameters()))
            return frozenset(key for key in names if switches_of(key, cases))
    return frozenset()


def changes(rng: Random, name: str) -> Entries:
    """Return admissible changes of one to four parameters of a set."""
    par = parameters(name)
    leaves = leaf_fields(type(par))
    numbers = {
        key: v
        for key, v in par.flat().items()
        if isinstance(v, float) and v and key in leaves and key not in switched_off(name)
    }
    entries = {}
    for key in rng.sample(sorted(numbers), rng.randrange(1, 5)):
        if rng.random() < 0.1 and _admits(leaves[key], 1.2 * numbers[key]) and "T_" not in key:
            entries[key] = f"{rng.uniform(-15.0, 15.0):+.3g}%"
        else:
            moved = _moved(rng, leaves[key], numbers[key])
            entries[key] = text(rng, moved, leaves[key].unit.symbol)
    return entries


def _options(rng: Random, trial: Trial) -> Entries:
    """Return some further options of an experiment, near their defaults."""
    definition = EXPERIMENTS.all().get(trial.experiment)
    if definition is None or definition.defaults is None or rng.random() < 0.5:
        return {}
    leaves, entries = leaf_fields(definition.options), {}
    for key, value in definition.defaults.flat().items():
        is_free = f"options.{key}" not in trial.options and key in leaves
        if is_free and isinstance(value, float) and value and leaves[key].unit.symbol != "s":
            moved = _moved(rng, leaves[key], value)
            entries[f"options.{key}"] = text(rng, moved, leaves[key].unit.symbol)
    return entries


def stimulus(rng: Random, unit: str) -> Entries:
    """Return what drives a bench for some ten milliseconds."""

    def level() -> str:
        return text(rng, rng.uniform(-3.0, 3.0), unit)

    def size() -> str:
        return text(rng, rng.uniform(0.0, 3.0), unit)

    def time() -> str:
        return text(rng, rng.uniform(1e-3, 50e-3), "s")

    def frequency() -> str:
        return text(rng, 10 ** rng.uniform(0.0, 3.0), "Hz")

    def table() -> Entries:
        count = rng.randrange(2, 6)
        times = sorted(rng.sample(range(60), count))
        return {
            "times": ", ".join(f"{t} ms" for t in times),
            "values": ", ".join(level() for _ in range(count)),
            "between": rng.choice(("linear", "hold")),
        }

    kinds: dict[str, Callable[[], Entries]] = {
        "step": lambda: {"start": level(), "end": level(), "t_step": time()},
        "sine": lambda: {"mean": level(), "amplitude": size(), "f": frequency()},
        "chirp": lambda: {
            "mean": level(),
            "amplitude": size(),
            "f_start": frequency(),
            "f_end": frequency(),
            "t_sweep": time(),
            "sweep": rng.choice(("linear", "logarithmic")),
        },
        "multisine": lambda: {"mean": level(), "amplitude": size(), "f_base": "50 Hz", "n": "7"},
        "table": table,
    }
    kind = rng.choice(sorted(kinds))
    return {"stimulus.kind": kind} | {f"stimulus.{k}": v for k, v in kinds[kind]().items()}


def quick(rng: Random) -> tuple[Trial, str, Entries]:
    """Return an experiment that does not take long, a parameter set and what makes it quick."""
    trial = rng.choice(TRIALS)
    driving = stimulus(rng, trial.driven) if trial.driven else {}
    return trial, rng.choice(trial.sets), dict(trial.options) | driving


def bench(rng: Random) -> tuple[str, str, Entries]:
    """Return experiment, parameter set and the entries of an admissible bench."""
    trial, name, entries = quick(rng)
    entries |= changes(rng, name) | _options(rng, trial)
    if rng.random() < 0.3:
        entries["simulation.step"] = rng.choice(("10 us", "20 us", "50 us", "2e-5 s"))
    if rng.random() < 0.2:
        entries["simulation.record"] = rng.choice(("1 ms", "500 us", "2 ms"))
    if rng.random() < 0.1:
        entries["simulation.seed"] = str(rng.randrange(1000))
    known = EXPERIMENTS.all().get(trial.experiment)
    kpis = known.kpis if known and isinstance(known.kpis, Mapping) and not trial.driven else {}
    for kpi in rng.sample(sorted(kpis), min(len(kpis), rng.choice((0, 0, 1, 2)))):
        limit = rng.lognormvariate(0.0, 2.0)
        written = f"{limit:.4g} %" if kpis[kpi] == "%" else text(rng, limit, kpis[kpi])
        entries[f"requirements.{kpi}"] = f"{rng.choice(('<', '<=', '>', '>='))} {written}"
    return trial.experiment, name, entries


def as_toml(rng: Random, experiment: str, name: str, entries: Entries) -> str:
    """Return a bench file."""
    sections: dict[str, Entries] = {}
    known = ("options", "stimulus", "simulation", "requirements")
    for key, value in entries.items():
        section, _, rest = key.partition(".")
        section, rest = (section, rest) if section in known else ("set", key)
        sections.setdefault(section, {})[rest] = value
    lines = [f'experiment = "{experiment}"', f'parameters = "{name}"']
    for section, content in rng.sample(sorted(sections.items()), len(sections)):
        lines.append(f"[{section}]")
        for key, value in content.items():
            is_bare = rng.random() < 0.5 and key.replace("_", "").replace(".", "").isalnum()
            is_number = value.isdigit() and key in ("seed", "pulses", "n")
            shown = value if is_number else json.dumps(value)
            lines.append(f"{key if is_bare and key.isascii() else json.dumps(key)} = {shown}")
    return "\n".join(lines) + "\n"


def as_sets(entries: Entries) -> list[str]:
    """Return entries as a command takes them."""
    return [word for key, value in entries.items() for word in ("--set", f"{key}={value}")]
