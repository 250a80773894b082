"""Export of a bench's ECU as readable C99."""

from typing import TYPE_CHECKING, Annotated

from bywire.usecases.asks import BenchName, ExportFolder, LastBenchChanges
from bywire.usecases.declare import NOTHING, Ask, Command, use_case

if TYPE_CHECKING:
    from bywire.api.exports import ControllerExport

Precision = Annotated[str, Ask("Floating-point precision of the C code: double or single.")]
Vectors = Annotated[int, Ask("Number of test vectors per task.")]
IsChecked = Annotated[
    bool,
    Ask(
        "Run the C code on this machine and on emulated Cortex-M3, M4F and M7, in both "
        "precisions. Exits with status 1 if a bit differs."
    ),
]
Bus = Annotated[bool, Ask("Also write a description of the ECU's memory for a CAN bus (DBC).")]
Prefix = Annotated[
    str,
    Ask(
        "Prefix of file and symbol names. Different prefixes let several ECUs link into one "
        "program.",
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
    """Export the ECU as readable C99 with parameters, test vectors and a test harness.

    Parameters
    ----------
    bench
        Bench, bench file, or name of an experiment. The ECU uses the bench's parameters and
        options, or those of the first case if there are several. The export ignores the bench's
        faults.
    out
        Folder, created if missing. The export overwrites the files of an earlier export there.
    overrides
        Changes to a bench file or experiment, in the form of ``--set``.
    precision
        ``"double"``, bit-identical to Python, or ``"single"``.
    vectors
        Number of test vectors per task.
        check
        Whether to compile the C code in both precisions, run it on the vectors, compare it bit for
        bit, and measure it. bywire does this on this machine, and also on Cortex-M3, M4F and M7 if
        arm-none-eabi-gcc and qemu-system-arm are installed.
    dbc
        Whether to describe the memory as signals of a CAN bus, with C code that fills the messages.
    name
        Prefix of file and symbol names, a C identifier. Default: the model's name. ECUs with
        different prefixes link into one program.

    Returns
    -------
    ControllerExport
        Files, functions and parameters.

    Raises
    ------
    ParameterError
        If the name is not a valid C identifier.
    ModelError
        If bywire cannot translate an operation, with its file and line.
    FileError
        If the folder is not writable.
    CompilerError
        If a check finds no compiler, or a compiler fails.
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
