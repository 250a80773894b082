"""Export of a bench's model as a functional mock-up unit."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

from bywire.core.errors import not_valid
from bywire.usecases.asks import BenchName, ExportFolder, LastBenchChanges, NeededCase
from bywire.usecases.declare import NOTHING, Ask, Command, use_case

if TYPE_CHECKING:
    from bywire.api.exports import ExportedFmu
    from bywire.core.typing import Progress

Part = Annotated[
    str,
    Ask("Part to export: brake, plant or ecu.", shown_default="brake, or plant for model-exchange"),
]
UnitKind = Annotated[str, Ask("Kind of unit: co-simulation, or model-exchange (plant only).")]
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
        Folder for the file ``NAME_PART.fmu``. An existing file is overwritten.
    overrides
        Changes to a bench file or experiment, in the form of ``--set``.
    part
        ``"brake"`` exports everything. ``"plant"`` has the ECU's outputs as inputs and the ECU's
        readings as outputs. ``"ecu"`` is the reverse. Default: the brake, or the plant for model
        exchange.
    kind
        ``"co-simulation"`` is a unit with the bench's own solver. ``"model-exchange"`` is the plant
        for a client's solver, with derivatives, event indicators and modes.
    fmi
        FMI version: 2 for 2.0, or 3 for 3.0, in which tasks are clocks and tables are arrays.
    case
        Run of the experiment to export. Optional if there is only one.
    targets
        Platforms of the binaries: ``linux64``, ``win64``, ``darwin64``, ``aarch64-linux``,
        ``aarch64-darwin``. Default: the platform of this machine.
    progress
        Called with a label and the finished share, 0 to 1.

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
    unit = unit_of(exported(bench_of(bench, overrides), case), part, fmi, kind)
    with export_folder(out) as folder:
        path = folder / f"{unit.identifier}.fmu"
        compilers = write_unit(unit, path, systems, progress or silent)
    return ExportedFmu(path, unit, systems, tuple(compilers))
