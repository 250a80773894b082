"""An FMU: description, binaries, sources, documentation and a reference run in one archive.

The compiler may assume finite numbers in the kernel. This option would delete the checks of a
client's values, so kernel and checks are compiled separately.
"""

from __future__ import annotations

import hashlib
import io
import platform
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from uuid import UUID
from xml.etree.ElementTree import Element, indent, tostring

import numpy as np

from bywire.core.child_process import run_program
from bywire.core.errors import CompilerError, unknown_name
from bywire.core.scratch import replacing, scratch_folder
from bywire.core.units import shown
from bywire.core.version import __version__
from bywire.export.exported import (
    Exported,
    Interface,
    Kind,
    Part,
    identifier_of,
    interface,
    model_header,
    start_source,
)
from bywire.export.fmu.description import build_description, description_2, description_3
from bywire.export.fmu.model_exchange import Equations, exchange_interface
from bywire.simulation.compiler import (
    KERNEL_MATH,
    PLAIN,
    TIMEOUT,
    Compiler,
    bundled_compiler,
    find_compiler,
)
from bywire.simulation.run import sampled_stimulus, simulate

_LANGUAGE = ("-std=c11", "-fvisibility=hidden")


@dataclass(frozen=True)
class Platform:
    """A platform for binaries.

    Parameters
    ----------
    folder_2, folder_3
        Folders of its binaries in an FMU of version 2.0 and of 3.0.
    suffix
        File extension.
    triple
        Name of the platform for the compiler of the extra ``compiler``.
    """

    folder_2: str
    folder_3: str
    suffix: str
    triple: str


PLATFORMS: Mapping[str, Platform] = {
    "linux64": Platform("linux64", "x86_64-linux", ".so", "x86_64-linux-gnu.2.17"),
    "win64": Platform("win64", "x86_64-windows", ".dll", "x86_64-windows-gnu"),
    "darwin64": Platform("darwin64", "x86_64-darwin", ".dylib", "x86_64-macos"),
    "aarch64-linux": Platform("aarch64-linux", "aarch64-linux", ".so", "aarch64-linux-gnu.2.17"),
    "aarch64-darwin": Platform("aarch64-darwin", "aarch64-darwin", ".dylib", "aarch64-macos"),
}


def this_platform() -> str:
    """Return the name of this platform in ``PLATFORMS``."""
    is_arm = platform.machine().lower() in ("aarch64", "arm64")
    if sys.platform == "win32":
        return "win64"
    if sys.platform == "darwin":
        return "aarch64-darwin" if is_arm else "darwin64"
    return "aarch64-linux" if is_arm else "linux64"


def compiled(sources: Path, kernel: str, functions: str, target: str, library: Path) -> str:
    """Compile the sources of an FMU to a shared library.

    Parameters
    ----------
    sources
        Folder of the sources.
    kernel, functions
        File of the kernel, and file of the interface's functions.
    target
        Name of the platform, one of ``PLATFORMS``.
    library
        Path of the library.

    Returns
    -------
    str
        Label of the compiler.

    Raises
    ------
    UnknownNameError
        For another platform.
    CompilerError
        If there is no compiler for the platform, or the compiler fails.
    """
    if target not in PLATFORMS:
        raise unknown_name("target", target, PLATFORMS)
    compiler, cross = _compiler_for(target)
    sources, library = sources.absolute(), library.absolute()
    position = () if target == "win64" else ("-fPIC",)
    objects = []
    for name, flags in ((kernel, (*KERNEL_MATH, *compiler.flags(PLAIN))), (functions, ("-O2",))):
        made = library.parent / f"{name}.o"
        given = [flag for flag in flags if not (cross and flag.startswith("-mtune"))]
        call = [*_LANGUAGE, *position, *given, "-c", str(sources / name), "-o", str(made)]
        _call(compiler, cross, call)
        objects.append(str(made))
    _call(compiler, cross, ["-shared", "-s", *objects, "-o", str(library), *_libraries(target)])
    for each in objects:
        Path(each).unlink()
    return compiler.label


def _libraries(target: str) -> list[str]:
    return [] if target == "win64" else ["-lm"]


def _compiler_for(target: str) -> tuple[Compiler, tuple[str, ...]]:
    """Return a compiler, and its arguments for the platform."""
    if target == this_platform():
        compiler = find_compiler()
        if compiler is None:
            raise CompilerError(
                "an FMU contains a compiled model, but this machine has no C compiler. Install "
                "one, "
                "or the extra bywire[compiler] (in your clone: pip install -e '.[compiler]')",
                name="compiler",
                valid="bywire[compiler]",
            )
        return compiler, ()
    command = bundled_compiler()
    if command is None:
        raise CompilerError(
            f"target {target}: this system's compiler supports only {this_platform()}. Install the "
            "extra bywire[compiler], which supports all platforms "
            "(in your clone: pip install -e '.[compiler]')",
            name="target",
            value=target,
            valid=this_platform(),
        )
    return Compiler(command, "clang of the extra compiler"), ("-target", PLATFORMS[target].triple)


def _call(compiler: Compiler, cross: tuple[str, ...], arguments: list[str]) -> None:
    command = [*compiler.command, *cross, *arguments]
    try:
        done = run_program(command, TIMEOUT)
    except subprocess.TimeoutExpired:
        raise CompilerError(
            f"{compiler.label} exceeded its limit of {TIMEOUT:g} s for an FMU"
        ) from None
    except OSError as error:
        raise CompilerError(f"{compiler.label} did not start ({error.strerror or error})") from None
    if done.returncode != 0:
        message = "\n".join(done.stderr.splitlines()[:6]) or "(no message)"
        raise CompilerError(f"{compiler.label} rejected the sources of an FMU:\n{message}")


# --- The archive

_HERE = Path(__file__).parent
_KERNEL = "kernel.c"
_DATE = (1980, 1, 1, 0, 0, 0)  # of every file, so that equal FMUs are byte-identical
Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Unit:
    """An FMU before it is written.

    Parameters
    ----------
    made
        The exported run.
    faces
        Variables of the run.
    version
        Version of the interface, 2 or 3.
    functions
        File of the interface's functions.
    identifier
        Name of the binaries.
    token
        Unique identifier.
    begins_anywhere
        Whether the run begins at rest with changed parameters, too.
    files
        Contents of the source files by name.
    """

    made: Exported
    faces: Interface
    version: int
    functions: str
    identifier: str
    token: str
    begins_anywhere: bool
    files: Mapping[str, str]

    def description(self) -> Element:
        """Return the model description."""
        bench = self.made.bench
        head = {
            "modelName": f"{bench.name or bench.experiment}, {self.faces.part}",
            "description": f"{self.made.run.model.name} of the bench "
            f"{bench.name or bench.experiment}: {bench.summary()}",
            "generationTool": f"bywire {__version__}",
        }
        arguments = (self.made, self.faces, self.identifier, self.token, head)
        compiled_files = (_KERNEL, self.functions)
        if self.version == 2:
            return description_2(*arguments, compiled_files)
        return description_3(*arguments)


def unit_of(made: Exported, part: Part, version: int, kind: Kind = "co-simulation") -> Unit:
    """Return the FMU of a part of an exported run; for model exchange, the FMU of the plant."""
    start, reads = start_source(made)
    modes: dict[str, object] = {}
    if kind == "model-exchange":
        equations = Equations(made)
        faces, modes = exchange_interface(equations, reads), equations.counts
        kernel, run, functions = equations.source(), "exchange.h", f"exchange{version}.c"
    else:
        faces = interface(made, part, reads)
        kernel, run, functions = made.kernel, "stepping.h", f"fmu{version}.c"
    written = {name: _own(name) for name in ("values.h", run, f"fmi{version}.h", functions)}
    digest = hashlib.sha256()
    for each in (kernel, repr(faces), start, repr(made.schedule), *written.values()):
        digest.update(each.encode())
    token = f"{{{UUID(bytes=digest.digest()[:16])}}}"
    name = made.bench.name or made.bench.experiment
    files = {
        _KERNEL: kernel,
        "model.h": model_header(made, faces, start, token, modes),
        **written,
    }
    identifier = f"{identifier_of(name)}_{part}" + "_exchange" * (kind == "model-exchange")
    return Unit(made, faces, version, functions, identifier, token, bool(start), files)


def write_unit(unit: Unit, path: Path, targets: Sequence[str], progress: Progress) -> list[str]:
    """Write a complete FMU or nothing, and return the compilers of its binaries.

    Raises
    ------
    CompilerError
        If a binary cannot be compiled.
    OSError
        If the file cannot be written.
    """
    labels = []
    with replacing(path) as fresh, scratch_folder(fresh.parent) as scratch:
        for name, text in unit.files.items():
            (scratch / name).write_text(text, encoding="utf-8")
        with zipfile.ZipFile(fresh, "w", zipfile.ZIP_DEFLATED) as archive:
            _add(archive, "modelDescription.xml", _xml(unit.description()))
            for name, text in unit.files.items():
                _add(archive, f"sources/{name}", text.encode())
            if unit.version == 3:
                built = build_description(unit.identifier, (_KERNEL, unit.functions))
                _add(archive, "sources/buildDescription.xml", _xml(built))
            for number, target in enumerate(targets):
                progress(f"compiling for {target}", number / (len(targets) + 1))
                system = PLATFORMS[target]
                library = scratch / f"{unit.identifier}{system.suffix}"
                labels.append(compiled(scratch, _KERNEL, unit.functions, target, library))
                folder = system.folder_2 if unit.version == 2 else system.folder_3
                _add(archive, f"binaries/{folder}/{library.name}", library.read_bytes())
            progress("reference run", len(targets) / (len(targets) + 1))
            page = documentation(unit.made, unit.faces, unit.begins_anywhere, unit.version)
            _add(archive, "documentation/index.html", page.encode())
            _add(archive, "documentation/reference.csv", reference(unit.made))
    return labels


def reference(made: Exported) -> bytes:
    """Return the bench's own run as CSV: time, stimulus, and signals after the ticks (SI)."""
    trajectory = simulate(made.run)
    schedule = made.schedule
    stimulus = sampled_stimulus(made.run, schedule)
    rows = np.rint(trajectory.time / (schedule.stimulus_frames * schedule.frame)).astype(int)
    given = stimulus[np.minimum(rows, len(stimulus) - 1)]
    names = ["time", *made.run.model.Stimulus._fields, *trajectory.names]
    table = np.column_stack([trajectory.time, given, trajectory.values])
    text = io.StringIO()
    np.savetxt(text, table, "%.17g", ",", header=",".join(names), comments="")
    return text.getvalue().encode()


def _own(name: str) -> str:
    return (_HERE / name).read_text(encoding="utf-8")


def _xml(root: Element) -> bytes:
    indent(root)
    body: bytes = tostring(root, "utf-8", xml_declaration=True)
    return body


def _add(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    entry = zipfile.ZipInfo(name, _DATE)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = 0o644 << 16
    archive.writestr(entry, content)


# --- Documentation page inside an FMU: content, stepping, inputs and outputs

_STEPS = {
    2: "A step first runs the ECU's ticks that are due at its beginning, with the current inputs, "
    "and then the substeps. Between steps, a client reads the state just before the ticks that are "
    "due at that time (left limits), and the ECU's memory after its last tick.",
    3: "Without event mode, a step first runs the ECU's ticks that are due at its beginning, with "
    "the current inputs, and then the substeps. Between steps, a client reads the state just "
    "before the ticks that are due at that time. With event mode, ticks run in events, when their "
    "clocks tick. The results after an event are those that a bench records.",
}
_EXCHANGED = (
    "A client's solver integrates the states. Bodies with dry friction stick or slide, states "
    "with limits are free or at a limit, stop operators follow their motion or slip, and contacts "
    "are closed or open. These modes (mode.*) change only in event mode, when an event indicator "
    "has changed sign or an input has changed. The ECU's outputs are inputs of this FMU. Set them "
    "in event mode. This FMU omits energies and other integrals."
)


def documentation(made: Exported, faces: Interface, begins_anywhere: bool, version: int) -> str:
    """Return the documentation as a self-contained HTML page."""
    bench, par, schedule = made.bench, made.run.par, made.schedule
    title = escape(f"{bench.name or bench.experiment}: {faces.part}")
    begins = (
        "With changed parameters, the run begins at rest, too."
        if begins_anywhere
        else "The initial state is the equilibrium for the exported parameters. With other "
        "parameters, the brake starts away from its equilibrium and settles."
    )
    tasks = ", ".join(
        f"{task.name} every {shown(task.period, 's')}" for task in made.run.model.tasks(par)
    )
    is_exchanged = faces.kind == "model-exchange"
    facts = [
        ("Model", made.run.model.name),
        ("Experiment", f"{bench.experiment}, run {made.case.label!r}: {bench.summary()}"),
        ("Parameter set", bench.parameters),
        ("Time 0", f"{shown(made.case.settle, 's')} before time zero of the bench's recording"),
        *(
            ()
            if is_exchanged
            else (
                ("Internal step", f"{shown(schedule.step, 's')}, fixed"),
                (
                    "Communication step",
                    f"integer multiples of {shown(schedule.frame, 's')}; the FMU rejects others",
                ),
                ("Tasks", tasks),
            )
        ),
        ("Structure", ", ".join(f"{k} = {v}" for k, v in par.choices().items())),
    ]
    texts = [
        _EXCHANGED if is_exchanged else _STEPS[version],
        f"{begins} The FMU rejects values that are NaN or out of range, and keeps the previous "
        "values. Sensor noise is an input. Set it to a standard normal number for each tick, or to "
        "zero.",
        "The file reference.csv, next to this page, contains the bench's own run: time, stimulus, "
        "and every recorded signal after the ticks, in SI units. This FMU does not warn you if the "
        "model leaves its range of validity.",
    ]
    rows = [
        (
            v.name,
            v.causality,
            v.unit,
            "" if v.start is None else f"{v.start:.6g}",
            "" if v.leaf is None else v.leaf.range_in(v.leaf.unit.symbol),
            v.label,
        )
        for v in faces.variables
        if v.causality != "local" or is_exchanged
    ]
    heading = ("name", "role", "unit", "start", "range", "meaning")
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<style>body {{ font: 15px sans-serif; margin: 2em auto; max-width: 70em }}
td, th {{ text-align: left; padding: 0.1em 1em 0.1em 0; vertical-align: top }}</style></head>
<body><h1>{title}</h1>
<p>Generated by bywire {escape(__version__)}. All values are in SI units.</p>
<table>{_rows(facts)}</table>
{"".join(f"<p>{escape(each)}</p>" for each in texts)}
<h2>Variables</h2>
<table><tr>{"".join(f"<th>{each}</th>" for each in heading)}</tr>{_rows(rows)}</table>
</body></html>
"""


def _rows(rows: Iterable[tuple[str, ...]]) -> str:
    return "\n".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows
    )
