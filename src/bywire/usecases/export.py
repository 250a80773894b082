"""Exports of a bench: C code of its ECU, functional mock-up unit, WebAssembly, web page."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bywire.core.errors import not_valid
from bywire.usecases.asks import BenchName, ExportFolder, LastBenchChanges, NeededCase
from bywire.usecases.declare import NOTHING, Ask, Command, Form, use_case

if TYPE_CHECKING:
    from bywire.api.exports import BenchPage, ControllerExport, ExportedFmu, ExportedWasm
    from bywire.core.typing import Progress

Precision = Annotated[str, Ask("Floating-point precision of the C code: double or single.")]
Vectors = Annotated[int, Ask("Number of test vectors per task.")]
IsChecked = Annotated[
    bool,
    Ask(
        "Run the C code on this machine and on emulated Cortex-M3, M4F and M7, in both "
        "precisions. Exits with status 1 if any bit differs."
    ),
]
Bus = Annotated[bool, Ask("Also write a CAN database (DBC) that describes the ECU's memory.")]
Prefix = Annotated[
    str,
    Ask(
        "Prefix of file and symbol names. With different prefixes, several ECUs can be linked "
        "into one program.",
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
    """Export the ECU as readable C99 code with parameters, test vectors and a test harness.

    Parameters
    ----------
    bench
        Bench, bench file, or name of an experiment. The ECU uses the bench's parameters and
        options, or those of the first case if there are several. The export ignores the bench's
        faults.
    out
        Folder, which bywire creates if it is missing. The export overwrites an earlier export
        there.
    overrides
        Changes to a bench file or experiment, in the same form as ``--set``.
    precision
        ``"double"``, bit-identical to Python, or ``"single"``.
    vectors
        Number of test vectors per task.
    check
        Whether to compile the C code in both precisions, run it on the test vectors, compare its
        results bit for bit, and measure it. bywire does this on this machine, and also on emulated
        Cortex-M3, M4F and M7 if arm-none-eabi-gcc and qemu-system-arm are installed.
    dbc
        Whether to write a CAN database (DBC) for the memory, with C code that fills the messages.
    name
        Prefix of file and symbol names, which must be a C identifier. Default: the model's name.
        ECUs with different prefixes can be linked into one program.

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


# --- A bench's model as a functional mock-up unit

Part = Annotated[
    str,
    Ask("Part to export: brake, plant or ecu.", shown_default="brake, or plant for model-exchange"),
]
UnitKind = Annotated[str, Ask("Kind of FMU: co-simulation, or model-exchange (plant only).")]
Version = Annotated[int, Ask("FMI version: 2 or 3.")]
Targets = Annotated[
    Sequence[str],
    Ask("Target platform, e.g. linux64 or win64. Repeatable.", name="target"),
]


@use_case(Command("export fmu", writes=""))
def export_fmu(
    bench: BenchName,
    out: ExportFolder,
    overrides: LastBenchChanges = NOTHING,
    *,
    part: Part = "",
    kind: UnitKind = "co-simulation",
    fmi: Version = 2,
    case: NeededCase = "",
    targets: Targets = (),
    progress: "Progress | None" = None,
) -> "ExportedFmu":
    """Export a functional mock-up unit (FMU) for co-simulation or model exchange.

    Parameters
    ----------
    bench
        A `Bench`, the path of a bench file, or the name of an experiment.
    out
        Folder for the file ``NAME_PART.fmu``. bywire overwrites an existing file.
    overrides
        Changes to a bench file or experiment, in the same form as ``--set``.
    part
        ``"brake"`` exports everything. ``"plant"`` has the ECU's outputs as inputs and the ECU's
        readings as outputs. ``"ecu"`` is the reverse. Default: ``"brake"``, or ``"plant"`` for
        model exchange.
    kind
        ``"co-simulation"`` is an FMU with the bench's own solver. ``"model-exchange"`` is the plant
        without a solver, with derivatives, event indicators and modes for the importing tool's
        solver.
    fmi
        FMI version: 2 for 2.0, or 3 for 3.0, where tasks become clocks and tables become arrays.
    case
        Run of the experiment to export. Optional if there is only one.
    targets
        Platforms for which to build binaries: ``linux64``, ``win64``, ``darwin64``,
        ``aarch64-linux``, ``aarch64-darwin``. Default: this machine's platform.
    progress
        Called with a label and the completed fraction, 0 to 1.

    Returns
    -------
    ExportedFmu
        The file and its contents. All values in it are in SI units.

    Raises
    ------
    InputError
        If the bench cannot be exported, or the file cannot be written.
    CompilerError
        If this machine has no compiler for a platform, or the compiler fails.
    """
    from bywire.api.exports import ExportedFmu, export_folder
    from bywire.api.run import bench_of
    from bywire.bench.step_choice import with_chosen_step
    from bywire.core.errors import ParameterError, quoted, unknown_name
    from bywire.core.typing import silent
    from bywire.export.exported import KINDS, PARTS, exported
    from bywire.export.fmu.archive import PLATFORMS, this_platform, unit_of, write_unit

    if kind not in KINDS:
        raise unknown_name("kind", kind, KINDS)
    part = part or ("plant" if kind == "model-exchange" else "brake")
    if part not in PARTS:
        raise unknown_name("part", part, PARTS)
    if kind == "model-exchange" and part != "plant":
        raise ParameterError(
            f"part = {part!r} is not valid: for model exchange it must be 'plant', because the ECU "
            "runs in ticks. Export the ECU separately for co-simulation",
            name="part",
            value=repr(part),
            valid="plant",
        )
    if fmi not in (2, 3):
        raise not_valid("fmi", quoted(fmi), "2 (version 2.0) or 3 (version 3.0)")
    systems = tuple(dict.fromkeys(targets)) or (this_platform(),)
    for each in systems:
        if each not in PLATFORMS:
            raise unknown_name("target", each, PLATFORMS)
    bench = with_chosen_step(bench_of(bench, overrides), progress=progress)
    unit = unit_of(exported(bench, case), part, fmi, kind)
    with export_folder(out) as folder:
        path = folder / f"{unit.identifier}.fmu"
        compilers = write_unit(unit, path, systems, progress or silent)
    return ExportedFmu(path, unit, systems, tuple(compilers))


# --- A bench's run as WebAssembly


@use_case(Command("export wasm", writes=""))
def export_wasm(
    bench: BenchName,
    out: ExportFolder,
    overrides: LastBenchChanges = NOTHING,
    *,
    case: NeededCase = "",
) -> "ExportedWasm":
    """Export a run as a WebAssembly function that maps parameters to a recording, with a loader.

    Parameters
    ----------
    bench
        A `Bench`, the path of a bench file, or the name of an experiment.
    out
        Folder for the files. bywire overwrites existing files.
    overrides
        Changes to a bench file or experiment, in the same form as ``--set``.
    case
        Run of the experiment to export. Optional if there is only one.

    Returns
    -------
    ExportedWasm
        The files: ``NAME.wasm``, ``NAME.json`` (parameters, signals and stimulus in SI units), and
        the loader ``bywire.mjs`` with its types.

    Raises
    ------
    InputError
        If the bench cannot be exported, or files cannot be written.
    CompilerError
        If the extra ``compiler`` is not installed.
    """
    import os

    from bywire.api.exports import ExportedWasm, export_folder
    from bywire.api.run import bench_of
    from bywire.bench.step_choice import with_chosen_step
    from bywire.core.scratch import scratch_folder
    from bywire.export.exported import exported, identifier_of
    from bywire.export.wasm.module import module_files

    bench = with_chosen_step(bench_of(bench, overrides))
    made = exported(bench, case)
    contents = module_files(made, identifier_of(bench.name or bench.experiment))
    with export_folder(out) as folder, scratch_folder(folder) as scratch:  # all, or none
        for name, content in contents.items():
            (scratch / name).write_bytes(content)
        paths = tuple(folder / name for name in contents)
        for path in paths:
            os.replace(scratch / path.name, path)
    return ExportedWasm(paths, made, len(next(iter(contents.values()))))


# --- A bench as one page that anyone can open

PageFile = Annotated[str | Path, Ask("HTML file to write (.html).", is_flag=True)]
Sliders = Annotated[
    Sequence[str],
    Ask(
        "Parameter to show at the top of the page. Repeatable.",
        completes="parameters",
    ),
]


@use_case(
    Command("page", writes=""),
    form=Form(
        "Live page", "Make the page", fields=("bench", "case"), is_listed=False, is_file=True
    ),
)
def page(
    bench: BenchName,
    out: PageFile,
    overrides: LastBenchChanges = NOTHING,
    *,
    vary: Sliders = (),
    case: NeededCase = "",
) -> "BenchPage":
    """Write a bench as one interactive HTML file whose curves update as you change parameters.

    Parameters
    ----------
    bench
        A `Bench`, the path of a bench file, or the name of an experiment.
    out
        HTML file of the page (.html). bywire overwrites an existing file.
    overrides
        Changes to a bench file or experiment, in the same form as ``--set``.
    vary
        Parameters at the top of the page. Default: those that the bench changes. If it changes
        none, those that its brake declares (`bywire.authoring.Sliders`).
    case
        Run of the experiment for the page to compute. Optional if there is only one.

    Returns
    -------
    BenchPage
        The file and its size.

    Raises
    ------
    InputError
        If the bench cannot be exported, the file cannot be written, or a name in ``vary`` is not
        a numeric parameter of the bench or has no effect.
    CompilerError
        If the extra ``compiler`` is not installed.
    """
    import gzip

    from bywire.api.exports import BenchPage
    from bywire.api.run import bench_of
    from bywire.bench.running import run
    from bywire.bench.step_choice import with_chosen_step
    from bywire.core.errors import ParameterError, unknown_name
    from bywire.core.parameters import leaf_fields
    from bywire.export.exported import exported, interface, start_source
    from bywire.report.drawing import write_bytes
    from bywire.report.live_page.content import page_text
    from bywire.report.time_traces import shown_panels

    if Path(out).suffix.lower() not in (".html", ".htm"):
        raise not_valid("out", repr(str(out)), "a file name that ends in .html")
    bench = with_chosen_step(bench_of(bench, overrides))
    made = exported(bench, case)
    _, reads = start_source(made)
    used = [each.name for each in interface(made, "brake", reads).of("parameter")]
    for name in vary:
        if name not in leaf_fields(type(bench.par)):
            raise unknown_name("parameter", name, used)
        if name not in used:
            raise ParameterError(
                f"{name} has no effect in this bench. Remove it from vary", name=name
            )
    result = run(bench)
    panels = shown_panels(result.recordings[made.case.label])
    content = page_text(made, panels, result, vary).encode()
    file = write_bytes(out, content)
    return BenchPage(file, made, len(content), len(gzip.compress(content, mtime=0)))
