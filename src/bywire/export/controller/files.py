"""All files of an ECU in C, by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bywire.core.provenance import Cited
from bywire.export.controller import render
from bywire.export.controller.a2l import a2l
from bywire.export.controller.can import can_header, can_source, dbc
from bywire.export.controller.harness import harness, makefile, vector_header
from bywire.export.controller.instance import instance_header, instance_source
from bywire.export.controller.parameter_file import parameter_file
from bywire.export.controller.program import Program
from bywire.export.controller.readme import readme
from bywire.export.controller.vectors import Vectors


def files(
    program: Program,
    memory: Any,
    cited: Mapping[str, Cited],
    every: Sequence[Vectors],
    *,
    bus: bool = False,
) -> dict[str, str]:
    """Return the text of every file.

    Parameters
    ----------
    memory
        With which the bench begins.
    cited
        Values of the parameter set with their provenance.
    every
        Test vectors of the tasks.
    bus
        Whether measurements are described for a CAN bus, too.
    """
    name = program.name
    made = {
        f"{name}_ecu.h": render.header(program),
        f"{name}_ops.h": render.operations(program),
        f"{name}_ecu.c": render.source(program),
        f"{name}_parameters.c": parameter_file(program, memory, cited),
    }
    if render.has_io(program):
        made[f"{name}_io.h"] = render.io_header(program)
        made[f"{name}_io.c"] = render.io_source(program)
    made[f"{name}_instance.h"] = instance_header(program)
    made[f"{name}_instance.c"] = instance_source(program)
    made[f"{name}_test_vectors.h"] = vector_header(program, every)
    made[f"{name}_harness.c"] = harness(program, every)
    made["Makefile"] = makefile(program, render.has_io(program))
    made[f"{name}.a2l"] = a2l(program)
    if bus:
        made[f"{name}.dbc"] = dbc(program)
        made[f"{name}_can.h"] = can_header(program)
        made[f"{name}_can.c"] = can_source(program)
    made["README.txt"] = readme(program, sorted([*made, "README.txt"]), len(every[0].given))
    return made
