"""An FMU: description, binaries, sources, documentation and a reference run in one archive."""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from uuid import UUID
from xml.etree.ElementTree import Element, indent, tostring

import numpy as np

from bywire.core.scratch import replacing, scratch_folder
from bywire.core.version import __version__
from bywire.export.exported import Exported
from bywire.export.fmu.binaries import PLATFORMS, compiled
from bywire.export.fmu.description2 import description_2
from bywire.export.fmu.description3 import build_description, description_3
from bywire.export.fmu.documentation import documentation
from bywire.export.fmu.exchange_equations import Equations
from bywire.export.fmu.exchange_interface import exchange_interface
from bywire.export.initial_values import start_source
from bywire.export.interface import Interface, Kind, Part, identifier_of, interface
from bywire.export.model_header import model_header
from bywire.simulation.run import sampled_stimulus, simulate

HERE = Path(__file__).parent
KERNEL = "kernel.c"
_DATE = (1980, 1, 1, 0, 0, 0)  # of every file in the archive: the same FMU has the same bytes
Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Unit:
    """An FMU before it is written.

    Parameters
    ----------
    made
        The run that it is of.
    faces
        Its variables.
    version
        Of the interface: 2 or 3.
    functions
        File of the interface's functions.
    identifier
        Name of its binaries.
    token
        What tells it from others.
    begins_anywhere
        Whether it begins at rest with changed parameters too.
    files
        Texts of its sources by name.
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
        compiled_files = (KERNEL, self.functions)
        if self.version == 2:
            return description_2(*arguments, compiled_files)
        return description_3(*arguments)


def unit_of(made: Exported, part: Part, version: int, kind: Kind = "co-simulation") -> Unit:
    """Return the FMU of a part of an exported run; by model exchange that of its plant."""
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
        KERNEL: kernel,
        "model.h": model_header(made, faces, start, token, modes),
        **written,
    }
    identifier = f"{identifier_of(name)}_{part}" + "_exchange" * (kind == "model-exchange")
    return Unit(made, faces, version, functions, identifier, token, bool(start), files)


def write_unit(unit: Unit, path: Path, targets: Sequence[str], progress: Progress) -> list[str]:
    """Write an FMU, whole or not at all, and return the compilers of its binaries.

    Raises
    ------
    CompilerError
        When a binary cannot be made.
    OSError
        When the file cannot be written.
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
                built = build_description(unit.identifier, (KERNEL, unit.functions))
                _add(archive, "sources/buildDescription.xml", _xml(built))
            for number, target in enumerate(targets):
                progress(f"compiling for {target}", number / (len(targets) + 1))
                system = PLATFORMS[target]
                library = scratch / f"{unit.identifier}{system.suffix}"
                labels.append(compiled(scratch, KERNEL, unit.functions, target, library))
                folder = system.folder_2 if unit.version == 2 else system.folder_3
                _add(archive, f"binaries/{folder}/{library.name}", library.read_bytes())
            progress("reference run", len(targets) / (len(targets) + 1))
            page = documentation(unit.made, unit.faces, unit.begins_anywhere, unit.version)
            _add(archive, "documentation/index.html", page.encode())
            _add(archive, "documentation/reference.csv", reference(unit.made))
    return labels


def reference(made: Exported) -> bytes:
    """Return the bench's own run as CSV: time, stimulus, and signals after the ticks, SI."""
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
    return (HERE / name).read_text(encoding="utf-8")


def _xml(root: Element) -> bytes:
    indent(root)
    body: bytes = tostring(root, "utf-8", xml_declaration=True)
    return body


def _add(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    entry = zipfile.ZipInfo(name, _DATE)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = 0o644 << 16
    archive.writestr(entry, content)
