"""Export of a bench's run as WebAssembly."""

from typing import TYPE_CHECKING

from bywire.usecases.asks import BenchName, ExportFolder, LastBenchChanges, NeededCase
from bywire.usecases.declare import NOTHING, Command, use_case

if TYPE_CHECKING:
    from bywire.api.exports import ExportedWasm


@use_case(Command("export wasm", writes=""))
def export_wasm(
    bench: BenchName,
    out: ExportFolder,
    overrides: LastBenchChanges = NOTHING,
    *,
    case: NeededCase = "",
) -> "ExportedWasm":
    """Export a run as a WebAssembly function from parameters to a recording, with a loader.

    Parameters
    ----------
    bench
        A `Bench`, the path of a bench file, or the name of an experiment.
    out
        Folder for the files. Existing files are overwritten.
    overrides
        Changes to a bench file or experiment, in the form of ``--set``.
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
    from bywire.core.scratch import scratch_folder
    from bywire.export.exported import exported, identifier_of
    from bywire.export.wasm.module import module_files

    bench = bench_of(bench, overrides)
    made = exported(bench, case)
    contents = module_files(made, identifier_of(bench.name or bench.experiment))
    with export_folder(out) as folder, scratch_folder(folder) as scratch:  # all, or none
        for name, content in contents.items():
            (scratch / name).write_bytes(content)
        paths = tuple(folder / name for name in contents)
        for path in paths:
            os.replace(scratch / path.name, path)
    return ExportedWasm(paths, made, len(next(iter(contents.values()))))
