"""Text of the live page: kernel, scripts and styles inside, and a strict policy.

The page contains everything that a browser runs or styles, with its digest in the policy. Data are
JSON in which no tag can begin.
"""

from __future__ import annotations

import base64
import hashlib
import json
import math
import zlib
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from html import escape
from importlib.resources import files
from string import Template
from typing import TYPE_CHECKING, Any

import numpy as np

from bywire.analysis.loop import LOOPS
from bywire.analysis.margins import MARGINS
from bywire.bench.bench import Bench
from bywire.bench.bench_file import bench_text
from bywire.bench.experiment import Case
from bywire.bench.kpis.families import FAMILIES, FamilyJudge
from bywire.bench.running import Result
from bywire.bench.stated import StatedLevel, StatedRange, stated_figures, stated_for
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import BywireError, InputError
from bywire.core.quantities import BY_SIZE, display_unit
from bywire.core.typing import Array
from bywire.core.units import convert, parse
from bywire.core.version import __version__
from bywire.export.exported import Exported
from bywire.export.loop_source import LoopSource, loop_source
from bywire.export.wasm.module import module_files
from bywire.report.inline_script import admitted, bare
from bywire.report.live_page.sliders import first_sliders
from bywire.report.panels import Panel, Trace
from bywire.report.stated_levels import stated_figure
from bywire.report.subject import bench_changes, parameter_rows
from bywire.report.terminal import change_texts
from bywire.report.wording import amount, unit_text
from bywire.simulation.c_runtime import SCALAR

if TYPE_CHECKING:
    import xarray as xr

_SHARE = 1e-3  # relative change of a value that reveals its effects
_TIMES = 101  # number of times at which stimuli are compared
_SAME = 1e-12  # maximum difference of equal states, relative to each


@dataclass(frozen=True)
class Dependence:
    """Dependencies on parameters.

    Parameters
    ----------
    driving
        Parameters that change the stimulus, the duration, or the times of recording; those that
        change the initial state in a way that the page cannot compute; those that the experiment
        itself sets; and nodes of tables, which are only meaningful together.
    judging
        Parameters that change options for key figures.
    """

    driving: frozenset[str]
    judging: frozenset[str]


def dependence(bench: Bench, number: int, names: Collection[str]) -> Dependence:
    """Return the dependencies on a bench's parameters in one of its runs.

    Each parameter changes by a thousandth, up or else down. A parameter that allows neither is
    treated as driving.
    """
    case, values = _case(bench, number), bench.par.leaves()
    driving, judging = set(), set()
    for name in names:
        if name not in values:  # a node, in the form of exports: p_table[1]
            driving.add(name)
            continue
        moved, other = _moved(bench, number, name, values[name])
        is_taken = other is not None and other.par.value(name) == moved.par.value(name)
        if other is None or not (is_taken and _is_driven_alike(bench, case, other)):
            driving.add(name)
        if moved.chosen_options != bench.chosen_options:
            judging.add(name)
    return Dependence(frozenset(driving), frozenset(judging))


def _is_driven_alike(bench: Bench, case: Case, other: Case) -> bool:
    """Return whether a page's run with other parameters has the bench's stimulus and start."""
    plans = [(c.duration, c.settle, c.keep, c.record) for c in (case, other)]
    is_driven = plans[0] == plans[1] and np.array_equal(_rows(case), _rows(other))
    return is_driven and _begins_alike(bench, case, other)


def _case(bench: Bench, number: int) -> Case:
    """Return a run with its stimulus, or with its preview's if the stimulus needs earlier runs."""
    made = bench.cases_with(bench.par, bench.chosen_options, bench.definition.preview)[number]
    return made.aligned(bench.step, bench.record)


def _begins_alike(bench: Bench, case: Case, other: Case) -> bool:
    """Return whether a run with other parameters has the page's initial state."""
    if bench.definition.preview is not None:
        return True  # earlier runs determine the start; the page notes that it keeps its own
    begun = (case.state, case.memory) if case.start is None else case.start(other.par)
    pairs = zip(begun, (other.state, other.memory), strict=True)
    return all(np.allclose(a, b, rtol=_SAME, atol=0.0, equal_nan=True) for a, b in pairs)


def _moved(bench: Bench, number: int, name: str, value: float) -> tuple[Bench, Case | None]:
    """Return the bench with a changed parameter, and its run; None if no change is valid."""
    step = _SHARE * (abs(value) or 1.0)
    for other in (value + step, value - step):
        with suppress(BywireError):
            moved = bench.with_overrides({name: other})
            return moved, _case(moved, number)
    return bench, None


def _rows(case: Case) -> Array:
    """Return the stimulus over the run, with zeros for omitted signals."""
    times = np.linspace(-case.settle, case.duration, _TIMES)
    given = case.stimulus(times)
    names: Sequence[str] = case.model.Stimulus._fields
    return np.array([given.get(name, np.zeros(_TIMES)) for name in names], dtype=float)


# --- Loops shown next to the run: those that the bench's experiment proves


def loops_of(made: Exported) -> list[LoopSource]:
    """Return the loops of a bench in C, without those whose operating point cannot be updated."""
    par = made.run.par
    shown = [
        loop
        for loop in LOOPS.all().values()
        if loop.proof == made.bench.experiment and loop.is_in(made.bench.definition.assembly)
    ]
    sources = [loop_source(loop, par) for loop in shown]
    return [source for source in sources if source is not None]


_MARGIN_UNITS = {"1": ("", 1.0), "s": ("ms", 1e3)}  # unit and factor, if not the default


def told(source: LoopSource) -> dict[str, Any]:
    """Return the data of a loop for the page."""
    loop = source.loop
    is_state = loop.cut in source.states
    names = source.states if is_state else source.memory
    point = f"{loop.at.name} {amount(loop.at.default, loop.at.unit)}"
    return {
        "name": loop.name,
        "summary": loop.summary,
        "point": point,
        "cutName": loop.cut,
        "entry": source.entry,
        "size": source.size,
        "contacts": source.contacts,
        "states": len(source.states),
        "held": len(source.memory),
        "every": list(source.every),
        "frame": source.frame,
        "from": loop.band[0],
        "isAnalog": loop.analog,
        "margins": [
            [name, figure.heading, *_MARGIN_UNITS.get(figure.unit, (figure.unit, 1.0))]
            for name, figure in MARGINS.items()
            if name != "bandwidth"  # needs the closed loop
        ],
        "cut": {"isState": is_state, "at": names.index(loop.cut)},
    }


# --- The page

_SCRIPTS = ("values.js", "controls.js", "curves.js", "bode.js", "bench.js")
_WORKER = ("unpack.js", "figures.js", "loops.js", "margins.js", "worker.js")
_NAME = "run"  # of the module, inside the page
_MARGIN_UNITS = {"1": ("", 1.0), "s": ("ms", 1e3)}  # unit and factor, if not the default
# SI unit, exponents of kg, m, s, A, K, rad, and common spellings of it
_UNITS = (
    ("1", (0, 0, 0, 0, 0, 0), "%"),
    ("m", (0, 1, 0, 0, 0, 0), "m km dm cm mm um µm nm inch"),
    ("s", (0, 0, 1, 0, 0, 0), "s ms us µs min h"),
    ("A", (0, 0, 0, 1, 0, 0), "A kA mA uA µA"),
    ("V", (1, 2, -3, -1, 0, 0), "V kV mV uV µV"),
    ("ohm", (1, 2, -3, -2, 0, 0), "ohm Ohm Ω mohm mΩ uohm µΩ kohm kΩ Mohm MΩ"),
    ("W", (1, 2, -3, 0, 0, 0), "W kW mW MW"),
    ("J", (1, 2, -2, 0, 0, 0), "J kJ mJ MJ"),
    ("N", (1, 1, -2, 0, 0, 0), "N kN mN MN"),
    ("N*m", (1, 2, -2, 0, 0, 0), "Nm kNm mNm"),
    ("Pa", (1, -1, -2, 0, 0, 0), "Pa hPa kPa MPa GPa bar mbar psi"),
    ("kg", (1, 0, 0, 0, 0, 0), "kg g mg"),
    ("delta_degC", (0, 0, 0, 0, 1, 0), "K mK"),
    ("Hz", (0, 0, -1, 0, 0, 0), "Hz kHz MHz mHz"),
    ("rad", (0, 0, 0, 0, 0, 1), "rad mrad deg ° rev"),
    ("rad/s", (0, 0, -1, 0, 0, 1), "rpm"),
    ("m**3", (0, 3, 0, 0, 0, 0), "l L ml mL"),
    ("H", (1, 2, -2, -2, 0, 0), "H mH uH µH"),
    ("V*s", (1, 2, -2, -1, 0, 0), "Wb"),
    ("A*s", (0, 0, 1, 1, 0, 0), "C"),
)
"""units whose products a field accepts, if `bywire.core.units` reads them"""
_SIZES = {
    "deg": math.pi / 180,
    "°": math.pi / 180,
    "rev": 2 * math.pi,
    "rpm": math.pi / 30,
    "psi": 6894.757293168361,
}
"""sizes to the last digit; a quantity that is read has 15"""
_SHIFTED = {
    **dict.fromkeys(("degC", "°C"), (1.0, 273.15)),
    **dict.fromkeys(("degF", "°F"), (5 / 9, 459.67 * 5 / 9)),
}
"""temperatures in K: size and zero"""


def page_text(
    made: Exported,
    panels: Sequence[tuple[Panel, Sequence[Trace]]],
    result: Result,
    chosen: Sequence[str],
) -> str:
    """Return the page of a run.

    Parameters
    ----------
    made
        The exported run.
    panels
        Panels over time, with the traces of the recording.
    result
        Result of the bench itself: labels and units of signals, definitions of key figures.
    chosen
        Parameters at the top. If empty, the bench's own choice.

    Raises
    ------
    CompilerError
        Without the extra ``compiler``.
    """
    name = made.bench.name or made.bench.experiment
    families = _settings(made) or ()
    judging = [each for name in families if (each := FAMILIES.find(name).loops) is not None]
    further = {each.entry: each.c_text for each in judging}
    loops = loops_of(made)
    further |= {loop.entry: f"{SCALAR}\n{loop.text}" for loop in loops}
    module = module_files(made, _NAME, further)
    data = _data(made, json.loads(module[f"{_NAME}.json"]), panels, result, chosen)
    data["loops"] = [told(loop) for loop in loops]
    digest = hashlib.sha256(module[f"{_NAME}.wasm"] + json.dumps(data).encode()).hexdigest()[:16]
    data["digest"] = digest
    data["description"]["name"] = "".join(c if c.isalnum() else "_" for c in name)
    loader = module["bywire.mjs"].decode().replace("export async function", "async function")
    blocks = {"bench": data, "loader": bare(loader), "worker": "\n".join(map(_script, _WORKER))}
    style = _text("uplot/uPlot.min.css") + _text("live.css")
    library = f"/* {_text('uplot/LICENSE').strip()} */\n{_text('uplot/uPlot.iife.min.js')}"
    script = '"use strict";\n' + "\n".join(map(_script, _SCRIPTS))
    policy = (
        f"default-src 'none'; script-src {admitted(library)} {admitted(script)} "
        "'wasm-unsafe-eval'; "
        f"style-src {admitted(style)}; worker-src blob:; base-uri 'none'; form-action 'none'"
    )
    # The kernel comes first. Between texts, it would make a compressed page 1.5 kB larger.
    return Template(_text("page.html")).substitute(
        kernel=_block("kernel", _packed(module[f"{_NAME}.wasm"])),
        policy=policy,
        title=escape(name),
        summary=escape(_summary(made)),
        changes=_changes(made.bench),
        style=style,
        library=library,
        script=script,
        footer=escape(_footer(made)),
        data="\n".join(_block(key, value) for key, value in blocks.items()),
    )


def _data(
    made: Exported,
    description: dict[str, Any],
    panels: Sequence[tuple[Panel, Sequence[Trace]]],
    result: Result,
    chosen: Sequence[str],
) -> dict[str, Any]:
    bench, recording = made.bench, result.recordings[made.case.label]
    cited = PARAMETER_SETS.find(bench.parameters).values
    origins = {row.name: row for row in parameter_rows(bench.par, cited)}
    read = [each["name"] for each in description["parameters"] if each["used"]]
    follow = dependence(bench, made.number, read)
    used, kept = set[str](), ("name", "unit", "start")  # fixed where nobody changes it
    for k, each in enumerate(description["parameters"]):
        if not each["used"] or each["name"] in follow.driving:
            description["parameters"][k] = {"used": False} | {key: each[key] for key in kept}
            continue
        used.add(each["name"])
        each |= {**_shown(each["unit"]), "kind": "", "where": ""}
        each["shownUnit"] = unit_text(display_unit(each["unit"]))
        each |= _read_as(each["unit"])
        if row := origins.get(each["name"]):
            each |= {"kind": row.kind, "where": row.where}
    chosen = chosen or first_sliders(bench, [name for name in read if name in used])
    return {
        "description": description,
        "panels": _panels(panels, recording, used, stated_for(bench)),
        "chosen": [name for name in chosen if name in used],
        "keep": made.case.keep,
        "text": bench_text(bench),
        "judged": _judged(made, result, sorted(follow.judging & used)),
        "held": sorted(follow.driving),
        "units": _known_units(),
    }


def _settings(made: Exported) -> Mapping[str, Any] | None:
    """Return the settings of the families of key figures on the page; None if it has none."""
    definition = made.bench.definition
    if not isinstance(definition.judge, FamilyJudge) or definition.finish is not None:
        return None
    if definition.judge.levels is not None or definition.judge.further is not None:
        # a page has no Python to compute them
        return None
    settings = definition.judge.settings(made.bench.chosen_options)
    is_whole = all(FAMILIES.find(name).loops is not None for name in settings)
    return settings if is_whole else None


def _family(name: str, setting: Any, recording: xr.Dataset) -> dict[str, Any]:
    """Return how the page calls the C of a family."""
    family = FAMILIES.find(name).loops
    assert family is not None
    _, level = family.signals_of(recording, setting)
    return {
        "name": name,
        "entry": family.entry,
        "figures": list(family.measures),
        "signals": [getattr(setting, field) for field in family.signals],
        "setting": np.nan_to_num(family.packed(setting)).tolist(),
        "room": family.room,
        "reasons": [
            {"text": text.replace("{{level}}", level), "open": is_open}
            for text, is_open in family.reasons
        ],
    }


def _judged(made: Exported, result: Result, followed: Sequence[str]) -> dict[str, Any] | None:
    """Return the data with which the page judges its run; None if it cannot."""
    bench, settings = made.bench, _settings(made)
    if settings is None:
        return None
    recording = result.recordings[made.case.label]
    limits = {
        name: {"compare": limit.compare, "bound": limit.bound}
        for name, limit in bench.limits.items()
    }
    units = {kpi.name: kpi.unit for kpi in result.kpis}
    stated = {
        name: {"text": stated_figure(each, units[name]), "where": each.where}
        for name, each in stated_figures(bench).items()
        if name in units
    }
    figures = [
        {
            "name": kpi.name,
            "unit": unit_text(display_unit(kpi.unit)),
            **_shown(kpi.unit),
            "sizes": [
                (least, convert(1.0, kpi.unit, unit), unit_text(unit))
                for least, unit in BY_SIZE.get(kpi.unit, ())
            ],
            "definition": kpi.definition,
            "text": bench.requirements.get(kpi.name, ""),
            "limit": limits.get(kpi.name),
            "stated": stated.get(kpi.name),
        }
        for kpi in result.kpis
    ]
    return {
        "families": [_family(name, each, recording) for name, each in settings.items()],
        "figures": figures,
        "followed": list(followed),
    }


def _panels(
    panels: Sequence[tuple[Panel, Sequence[Trace]]],
    recording: xr.Dataset,
    used: set[str],
    stated: Sequence[StatedLevel | StatedRange],
) -> list[dict[str, Any]]:
    """Return the panels, with stated values of a signal in the first panel that shows it."""
    shown, left = [], list(stated)
    for panel, traces in panels:
        names = {trace.variable for trace in traces}
        here = [each for each in left if each.signal in names]
        left = [each for each in left if each not in here]
        levels = [
            {
                "label": f"stated: {each.label}",
                "low": each.low,
                "high": each.high,
                "levels": each.levels,
            }
            for each in here
        ]
        shown.append({**_panel(panel, traces, recording, used), "stated": levels})
    return shown


def _panel(
    panel: Panel, traces: Sequence[Trace], recording: xr.Dataset, used: set[str]
) -> dict[str, Any]:
    unit = str(recording[traces[0].variable].attrs.get("units", "1"))
    return {
        "quantity": panel.quantity,
        "unit": unit_text(display_unit(unit)),
        **_shown(unit),
        "height": panel.height,
        "levels": list(panel.levels),
        "saturation": panel.saturation,
        "limit": panel.limit if panel.limit in used else None,
        "traces": [
            {
                "name": trace.variable,
                "role": trace.role.value,
                "label": str(recording[trace.variable].attrs.get("long_name", trace.variable)),
            }
            for trace in traces
        ],
    }


def _shown(symbol: str) -> Mapping[str, float]:
    """Return factor and offset from an SI unit to its display unit."""
    unit = display_unit(symbol)
    offset = float(convert(0.0, symbol, unit))
    return {"factor": float(convert(1.0, symbol, unit)) - offset, "offset": offset}


@cache
def _known_units() -> list[tuple[str, float, tuple[int, ...]]]:
    """Return the units that a field accepts, also in products: name, size, exponents."""
    return [
        (name, _SIZES.get(name, size), powers)
        for symbol, powers, names in _UNITS
        for name in names.split()
        for size in [_value(f"1 {name}", symbol)]
        if size is not None
    ]


@cache
def _read_as(symbol: str) -> dict[str, Any]:
    """Return the special rules for a field's unit: temperatures, and whether radians matter."""
    shifted = {
        unit: scale
        for unit, scale in _SHIFTED.items()
        if symbol == "K" and _value(f"0 {unit}", symbol) is not None
    }
    known = "" if symbol == "1" else f"*{symbol.replace('delta_degC', 'K')}"
    is_turning = _value(f"1 rad{known}", symbol) is None
    return ({"shifted": shifted} if shifted else {}) | ({"turns": True} if is_turning else {})


def _value(text: str, symbol: str) -> float | None:
    """Return a quantity in SI; None if it does not have this unit."""
    try:
        return parse(text, symbol, "a unit")
    except InputError:
        return None


def _summary(made: Exported) -> str:
    label = f", run {made.case.label}" if len(made.bench.cases()) > 1 else ""
    return f"{made.bench.summary()}{label}; parameters {made.bench.parameters}"


def _changes(bench: Bench) -> str:
    """Return the paragraphs on the changes of the bench itself."""
    texts = change_texts(bench_changes(bench))
    return "".join(f'<p class="summary">{escape(_capital(text))}.</p>\n' for text in texts)


def _capital(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}"


def _footer(made: Exported) -> str:
    cited = PARAMETER_SETS.find(made.bench.parameters)
    noise = any(name.startswith("noise_") for name in made.run.model.Stimulus._fields)
    begins = made.bench.definition.preview is not None
    return (
        f"bywire {__version__}. This page runs the bench's own kernel with a step of "
        f"{1e6 * made.schedule.step:g} us{', without sensor noise' if noise else ''}. "
        f"{'Every run starts as the unchanged bench does. ' if begins else ''}"
        f"Parameters: {cited.source}. Curves by uPlot (MIT license, in the page)."
    )


def _block(key: str, value: Any) -> str:
    text = json.dumps(value, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return f'<script type="application/json" id="{key}">{text}</script>'


def _script(name: str) -> str:
    return bare(_text(name))


def _packed(module: bytes) -> str:
    """Return a module as compressed text, because servers cannot compress base 64 well."""
    return base64.b64encode(zlib.compress(module, 9)).decode()


def _text(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")
