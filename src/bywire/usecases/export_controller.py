"""The ECU of a bench as readable C99."""

from typing import TYPE_CHECKING, Annotated

from bywire.usecases.asks import BenchName, ExportFolder, LastBenchChanges
from bywire.usecases.declare import NOTHING, Ask, Command, use_case

if TYPE_CHECKING:
    from bywire.api.exports import ControllerExport

Precision = Annotated[str, Ask("Numbers of the C: double, or single.")]
Vectors = Annotated[int, Ask("Test vectors of each task.")]
IsChecked = Annotated[
    bool,
    Ask(
        "Run it here and on emulated Cortex-M3, M4F and M7, in both precisions; exit status 1 "
        "where a bit differs."
    ),
]
Bus = Annotated[bool, Ask("Also describe its memory for a CAN bus.")]
Prefix = Annotated[
    str,
    Ask(
        "Prefix of files and symbols, so that several ECUs link into one program.",
        shown_default="the model's name",
    ),
]


@use_case(Command("export controller", writes=""))
def export_controller(
    bench: BenchName,
    out: ExportFolder,
    overrides: LastBenchChanges = NOTHING,
    *,
    precision: Precision = "double",
    vectors: Vectors = 200,
    check: IsChecked = False,
    dbc: Bus = False,
    name: Prefix = "",
) -> "ControllerExport":
    """Write the ECU as readable C99 with parameters, test vectors and a harness.

    Parameters
    ----------
    bench
        Bench, bench file, or name of an experiment: its parameters and choices are those of the
        ECU; of several cases the first one's. Faults of the bench are left out.
    out
        Folder, made where it is missing; files of an earlier export in it are replaced.
    overrides
        Changes of a bench file or experiment, as ``--set`` takes them.
    precision
        ``"double"``, equal to Python in every bit, or ``"single"``.
    vectors
        Test vectors of each task.
    check
        Whether the C is compiled in both precisions, for this machine and, where
        arm-none-eabi-gcc and qemu-system-arm are installed, for Cortex-M3, M4F and M7; run there
        on the vectors, compared bit by bit, and measured.
    dbc
        Whether the memory is described as signals of a CAN bus, with the C that fills messages.
    name
        What files and symbols begin with, an identifier of C; the model's name by default. ECUs of
        different names link into one program.

    Returns
    -------
    ControllerExport
        Files, functions and parameters.

    Raises
    ------
    ParameterError
        When the name is no identifier of C.
    ModelError
        With file, line and operation of what cannot be translated.
    FileError
        When the folder cannot be written.
    CompilerError
        When a check finds no compiler, or one fails.
    """
    import os
    from dataclasses import replace

    from bywire.api.exports import ControllerExport, check_controller, export_folder
    from bywire.api.run import bench_of
    from bywire.core.arguments import whole_number
    from bywire.core.catalog import PARAMETER_SETS
    from bywire.core.errors import unknown_name
    from bywire.core.scratch import scratch_folder
    from bywire.export.controller.c_text import PRECISIONS, checked_name
    from bywire.export.controller.files import files
    from bywire.export.controller.program import program
    from bywire.export.controller.vectors import vectors as test_vectors
    from bywire.export.exported import cases_of

    if precision not in PRECISIONS:
        raise unknown_name("precision", precision, PRECISIONS)
    whole_number("vectors", vectors, 1, 100_000)
    if name:
        checked_name(name)
    bench = bench_of(bench, overrides)
    case = cases_of(replace(bench, faults=()))[0]
    made = program(case.model, case.par, precision, name)
    cited = PARAMETER_SETS.find(bench.parameters).values
    every = test_vectors(made, case.memory, vectors)
    texts = files(made, case.memory, cited, every, bus=dbc)
    with export_folder(out) as folder, scratch_folder(folder) as scratch:  # all, or none
        for name, text in texts.items():
            (scratch / name).write_text(text, encoding="utf-8")
        for name in texts:
            os.replace(scratch / name, folder / name)
    checked = check_controller(case, cited, vectors) if check else None
    return ControllerExport(folder, tuple(texts), made, vectors, bench, checked)
