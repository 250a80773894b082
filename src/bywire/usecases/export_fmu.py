"""A bench's model as a functional mock-up unit."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

from bywire.usecases.asks import BenchName, ExportFolder, LastBenchChanges, NeededCase
from bywire.usecases.declare import NOTHING, Ask, Command, use_case

if TYPE_CHECKING:
    from bywire.api.exports import ExportedFmu
    from bywire.core.typing import Progress

Part = Annotated[str, Ask("brake, plant or ecu.", shown_default="brake; plant for model-exchange")]
UnitKind = Annotated[str, Ask("co-simulation, or model-exchange of the plant.")]
Version = Annotated[int, Ask("Version of the interface: 2 or 3.")]
Targets = Annotated[
    Sequence[str],
    Ask("System, e.g. linux64 or win64; may be given several times.", name="target"),
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
    """Write a functional mock-up unit for co-simulation, or model exchange.

    Parameters
    ----------
    bench
        A `Bench`, the path of a bench file, or the name of an experiment.
    out
        Folder in which the file ``NAME_PART.fmu`` is written; one that is there is replaced.
    overrides
        Changes of a bench file or experiment, as ``--set`` takes them.
    part
        ``"brake"``: all; ``"plant"``: what the ECU holds are inputs, its readings outputs;
        ``"ecu"``: the reverse. The brake by default; the plant where that is exchanged.
    kind
        ``"co-simulation"``: it steps by itself, as the bench does; ``"model-exchange"``: the plant
        for a client's solver, with derivatives, event indicators and modes.
    fmi
        Version of the interface: 2 for 2.0, 3 for 3.0 (tasks are clocks, tables arrays).
    case
        Which run of the experiment is exported; may be left out where there is but one.
    targets
        Systems that binaries are made for: ``linux64``, ``win64``, ``darwin64``,
        ``aarch64-linux``, ``aarch64-darwin``; this system by default.
    progress
        Called with a label and the finished share, 0 to 1.

    Returns
    -------
    ExportedFmu
        The file, and what it holds; all values in it are SI.

    Raises
    ------
    InputError
        When the bench cannot be exported, or the file cannot be written.
    CompilerError
        When there is no compiler for a system, or it fails.
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
            f"part = {part!r}: model exchange is for the plant, the ECU works in ticks; export "
            "that for co-simulation beside it"
        )
    if fmi not in (2, 3):
        raise ParameterError(f"fmi = {quoted(fmi)}: FMUs of version 2 (2.0) and 3 (3.0) are made")
    systems = tuple(dict.fromkeys(targets)) or (this_platform(),)
    for each in systems:
        if each not in PLATFORMS:
            raise unknown_name("target", each, PLATFORMS)
    unit = unit_of(exported(bench_of(bench, overrides), case), part, fmi, kind)
    with export_folder(out) as folder:
        path = folder / f"{unit.identifier}.fmu"
        compilers = write_unit(unit, path, systems, progress or silent)
    return ExportedFmu(path, unit, systems, tuple(compilers))
