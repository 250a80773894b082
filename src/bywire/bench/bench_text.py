"""A bench as the text of a bench file: what `bywire.bench.bench_file` reads, written."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bywire.bench.bench import Bench
from bywire.bench.faults.course import Course
from bywire.bench.stimuli.registry import STIMULI
from bywire.bench.stimulus_sections import stimulus_sections
from bywire.core.parameters import ParameterSet, leaf_fields

PATHS = ("trace", "trace_map", "file")
"""keys of options and stimuli that name files: written down, they must hold from any folder"""


def bench_text(bench: Bench, comment: str = "") -> str:
    """Return a bench as TOML.

    Parameters
    ----------
    bench
        What is written; numbers get their SI units, texts stay as they were typed.
    comment
        First lines.

    Examples
    --------
    >>> print(bench_text(Bench("hard-braking", "dardanelli2010", overrides={"motor.R_m": 0.4})))
    experiment = "hard-braking"
    parameters = "dardanelli2010"
    <BLANKLINE>
    [set]
    "motor.R_m" = "0.4 ohm"
    <BLANKLINE>
    """
    definition = bench.definition
    simulation: dict[str, Any] = {"step": bench.step} if bench.step != Bench.step else {}
    simulation |= {} if bench.record is None else {"record": bench.record}
    simulation |= {"seed": bench.seed} if bench.seed else {}
    simulation |= {} if bench.engine == "auto" else {"engine": bench.engine}
    sections: dict[str, tuple[Mapping[str, Any], Mapping[str, str]]] = {
        "options": (bench.options, _units(definition.options)),
        **_stimulus(bench),
        "set": (bench.overrides, _units(type(bench.par))),
        "simulation": (simulation, {"step": "s", "record": "s"}),
        "requirements": (bench.requirements, {}),
    }
    lines = [f"# {line}" for line in comment.splitlines()]
    lines += [f'experiment = "{bench.experiment}"', f'parameters = "{bench.parameters}"']
    lines += [f'assembly = "{bench.assembly}"'] if bench.assembly else []
    for name, (values, units) in sections.items():
        if values:
            lines += ["", f"[{name}]"]
            lines += [f"{_key(k)} = {_text(k, v, units.get(k, '1'))}" for k, v in values.items()]
    for section, fault in zip(bench.faults, bench.injections, strict=True):
        units = _units(Course) | {"value": fault.mode.unit or "1"}
        lines += ["", "[[faults]]"]
        lines += [
            f"{_key(k)} = {_text(k, v, units.get(k, '1'))}"
            for k, v in section.items()
            if k != "set"
        ]
        changed = section.get("set", {})
        of_parameters = _units(type(bench.par))
        lines += [
            f'set."{k}" = {_text(k, v, of_parameters.get(k, "1"))}' for k, v in changed.items()
        ]
    return "\n".join(lines) + "\n"


def _stimulus(bench: Bench) -> dict[str, tuple[Mapping[str, Any], Mapping[str, str]]]:
    """Return the sections of the stimulus by title, each with the units of its values."""
    definition, options = bench.definition, bench.chosen_options
    levels = {} if definition.beside is None else dict(definition.beside(options))
    if definition.driven_unit is not None:
        levels[""] = definition.driven_unit(options)
    stimuli: dict[str, tuple[Mapping[str, Any], Mapping[str, str]]] = {}
    for name, section in stimulus_sections(bench.stimulus).items():
        cls = STIMULI.find(str(section["kind"])).parameter_class
        units = _units(cls, levels[name])
        stimuli[f"stimulus.{name}" if name else "stimulus"] = (section, units)
    return stimuli


def _units(cls: type[ParameterSet], level: str = "") -> dict[str, str]:
    return {n: leaf.unit.symbol.replace("level", level) for n, leaf in leaf_fields(cls).items()}


def _key(name: str) -> str:
    return f'"{name}"' if "." in name else name


def _text(name: str, value: Any, symbol: str) -> str:
    if isinstance(value, (str, Path)):
        path = name in PATHS and str(value)
        return json.dumps(str(Path(path).resolve()) if path else str(value), ensure_ascii=False)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Sequence):
        return f"[{', '.join(_text(name, node, symbol) for node in value)}]"
    number = value if isinstance(value, int) else float(value)  # all digits: it runs the same
    return json.dumps(f"{number} {symbol}") if symbol != "1" else f"{number}"
