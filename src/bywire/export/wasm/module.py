"""The files of an exported run: module, description, loader, types."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from bywire.core.child_process import run_program
from bywire.core.errors import CompilerError
from bywire.core.scratch import process_folder, scratch_folder
from bywire.core.signals import Signal, ranges_of, signals_of
from bywire.export.exported import Exported, start_nodes
from bywire.export.interface import Interface, finite_range, interface, parameter_variables
from bywire.export.wasm.formulas import run_formulas, with_section
from bywire.simulation.c_runtime import SCALAR
from bywire.simulation.compiler import KERNEL_MATH, TIMEOUT, bundled_compiler
from bywire.simulation.emit_rare import CUT
from bywire.simulation.run import sampled_stimulus

HERE = Path(__file__).parent
_LOADER = ("formulas.mjs", "loader.mjs")
_FLAGS = (
    "-target",
    "wasm32-freestanding",
    "-mbulk-memory",
    "-Os",
    "-std=c11",
    "-nostdlib",
    "-fno-builtin",
    "-fno-slp-vectorize",
    "-fno-unroll-loops",
    *KERNEL_MATH,
    "-Wl,--no-entry",
    "-Wl,--import-table",
    "-s",
)


def module_files(
    made: Exported, name: str, further: Mapping[str, str] = MappingProxyType({})
) -> dict[str, bytes]:
    """Return the files of an exported run by their names.

    ``further``: C that goes into the module, by the name of the function that it exports.

    Raises
    ------
    CompilerError
        Without the extra ``compiler``, or when it fails.
    """
    start = start_nodes(made)
    faces = interface(made, "brake", start.reads if start else frozenset())
    description = json.dumps(_description(made, name, start is not None, faces), indent=1)
    return {
        f"{name}.wasm": _module(made, further),
        f"{name}.json": description.encode(),
        "bywire.mjs": b"".join((HERE / each).read_bytes() for each in _LOADER),
        "bywire.d.mts": (HERE / "loader.d.ts").read_bytes(),
    }


def _module(made: Exported, further: Mapping[str, str]) -> bytes:
    """Return the module: what is the same for every bench in code, its formulas as a table."""
    formulas = run_formulas(made)
    headers = {"runtime.h": SCALAR, "layout.h": formulas.header, "cut.h": CUT}
    return with_section(_compiled(headers, further), "formulas", formulas.table)


def _compiled(headers: Mapping[str, str], further: Mapping[str, str]) -> bytes:
    """Return what is compiled of a module."""
    compiler = bundled_compiler()
    if compiler is None:
        raise CompilerError(
            "WebAssembly is compiled by the extra bywire[compiler], which is not installed: "
            "pip install 'bywire[compiler]'"
        )
    with scratch_folder(process_folder()) as folder:
        for name in ("math.h", "string.h", "page.c"):
            (folder / name).write_bytes((HERE / name).read_bytes())
        for name, text in headers.items():
            (folder / name).write_text(text, encoding="utf-8")
        sources = [folder / "page.c"]
        for entry, text in further.items():
            sources.append(folder / f"{entry}.c")
            sources[-1].write_text(text, encoding="utf-8")
        made = folder / "module.wasm"
        exported = [f"-Wl,--export={entry}" for entry in further]
        command = [*compiler, *_FLAGS, *exported, f"-I{folder}", *map(str, sources)]
        try:
            done = run_program([*command, "-o", str(made)], TIMEOUT)
        except subprocess.TimeoutExpired:
            raise CompilerError(f"the compiler took longer than {TIMEOUT:g} s") from None
        if done.returncode != 0:
            message = "\n".join(done.stderr.splitlines()[:6]) or "without a message"
            raise CompilerError(f"the compiler refused the kernel for WebAssembly:\n{message}")
        return made.read_bytes()


def _description(
    made: Exported, name: str, begins_anywhere: bool, faces: Interface
) -> dict[str, Any]:
    """Return what the loader, and who uses it, must know of a run."""
    schedule, par = made.schedule, made.run.par
    count = made.program.sizes.parameters  # all: the loader fills the kernel's whole vector
    used = {each.name for each in faces.of("parameter")}
    parameters = []
    for each in parameter_variables(made, frozenset(range(count)), frozenset()):
        low, high = (None, None) if each.leaf is None else finite_range(each.leaf)
        parameters.append(
            {
                "name": each.name,
                "unit": each.unit,
                "start": each.start,
                "low": low,
                "high": high,
                "range": "" if each.leaf is None else each.leaf.range_text,
                "meaning": each.label,
                "used": each.name in used,
            }
        )
    return {
        "name": name,
        "model": made.run.model.name,
        "duration": made.run.duration,
        "settle": made.case.settle,
        "step": schedule.step,
        "frame": schedule.frame,
        "recordFrames": schedule.record_frames,
        "stimulusFrames": schedule.stimulus_frames,
        "stateLength": made.layout.total,
        "unsettledAt": made.layout.start["counters"],
        "beginsAtRest": begins_anywhere,
        "choices": {k: v for k, v in par.choices().items() if isinstance(v, (str, int))},
        "parameters": parameters,
        "stimulus": _stimuli(made),
        "signals": [_signal(k, s) for k, s in made.program.outputs.items()],
    }


def _stimuli(made: Exported) -> list[dict[str, Any]]:
    """Return what drives the bench, as steps: values that hold from their times on, no noise."""
    rows = sampled_stimulus(made.run, made.schedule)
    times = made.schedule.stimulus_times
    ranges = ranges_of(made.run.model.Stimulus)
    told: list[dict[str, Any]] = []
    for k, (name, signal) in enumerate(signals_of(made.run.model.Stimulus).items()):
        values = np.zeros(len(rows)) if name.startswith("noise_") else rows[:, k]
        changes = np.flatnonzero(np.diff(values, prepend=0.0))
        steps = [[float(times[at]), float(values[at])] for at in changes]
        ends = zip(("low", "high"), ranges.get(name, ()), strict=False)
        known = {end: value for end, value in ends if np.isfinite(value)}
        told.append({**_signal(name, signal), **known, "steps": steps})
    return told


def _signal(name: str, signal: Signal) -> dict[str, str]:
    return {"name": name, "unit": signal.unit, "label": signal.label}
