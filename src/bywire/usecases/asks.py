"""Arguments that several use cases share."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from bywire.usecases.declare import Ask

if TYPE_CHECKING:
    from bywire.bench.bench import Bench

LoopName = Annotated[str, Ask("Loop (see 'bywire list loops').", "Loop", known=("loops",))]
ParameterSetName = Annotated[
    str, Ask("Parameter set, e.g. roberts2003.", "Parameter set", known=("parameter_sets",))
]
At = Annotated[str, Ask("Operating point, e.g. '20 bar'.", "Operating point")]
Changes = Annotated[
    Mapping[str, Any],
    Ask(
        "Change a parameter, e.g. motor.R_m=0.4ohm.",
        "Changes",
        name="set",
        metavar="KEY=VALUE",
        completes="changes",
    ),
]
Frequencies = Annotated[
    str, Ask("Frequencies, e.g. '1 Hz:150 Hz:20' or '1 Hz, 5 Hz'.", "Frequencies")
]
Side = Annotated[
    str,
    Ask(
        "Side of the kink at the operating point: above, below, or FILE:LINE=above.",
        "Side of kinks",
    ),
]

BenchName = Annotated[
    "Bench | str | Path",
    Ask(
        "Bench file (TOML) or experiment.",
        "Bench",
        metavar="BENCH",
        known=("experiments", "generic_experiments"),
        files=".toml",
        offered=("benches",),
    ),
]
BENCH_CHANGES = Ask(
    "Change the bench, e.g. motor.R_m=0.4ohm.",
    "Changes",
    name="set",
    metavar="KEY=VALUE",
    completes="changes",
)
BenchChanges = Annotated[Mapping[str, str], BENCH_CHANGES]
ErrorEstimate = Annotated[
    bool,
    Ask(
        "Rerun with other step sizes to estimate the numerical error.",
        "Estimate the error",
        name="error_estimate",
    ),
]
LastBenchChanges = Annotated[Mapping[str, str], replace(BENCH_CHANGES, is_last=True)]
NeededCase = Annotated[
    str, Ask("Run of the experiment. Required if the experiment has several runs.", "Run")
]
CaseName = Annotated[str, Ask("Run of the experiment. Default: the first.", "Run")]
OUT = Ask("Folder for recordings, figures and the report.", is_folder=True)
LastOutFolder = Annotated[str | Path | None, replace(OUT, is_last=True)]
ExportFolder = Annotated[str | Path, Ask("Folder for the exported files.", is_folder=True)]

Cases = Annotated[
    int | None,
    Ask(
        "Number of cases. Overrides the study file. A larger number extends the study. A smaller "
        "number drops cases that are not computed yet.",
        "Cases",
    ),
]
Workers = Annotated[
    int | None, Ask("Number of processes. Default: one per core for large studies.")
]
ClusterAddress = Annotated[
    str, Ask("Address of a Dask scheduler that runs the cases.", metavar="ADDRESS")
]
EngineName = Annotated[str, Ask("Simulation engine, e.g. cuda for a GPU.")]
StudyFolder = Annotated[str | Path, Ask("Study folder.", metavar="FOLDER")]


def require_study_folder(folder: Path, **others: Any) -> None:
    """Reject a file where a study folder is expected, before the command creates anything."""
    from bywire.studies.meant_study import require_no_file

    del others
    require_no_file(folder)


STUDY_FOLDER: dict[str, Any] = {
    "before": require_study_folder,
    "writes": "folder",
    "advice": "Check that you have write permission there",  # another folder has no chunks
}
"""settings for commands that write to a study folder"""

TestBench = Annotated[
    "Bench | str | Path",
    Ask(
        "Bench file (TOML) or experiment.",
        "Bench",
        known=("experiments", "generic_experiments"),
        offered=("benches",),
        is_flag=True,
    ),
]
MeaningFile = Annotated[
    str | Path | None,
    Ask(
        "TOML file that maps columns to signals.",
        "Column map",
        name="map",
        metavar="PATH",
        offered=("maps",),
    ),
]
Inputs = Annotated[
    Mapping[str, str],
    Ask(
        "Signals that drive the model, e.g. 'p_set=Demand [bar]'.",
        "Inputs",
        name="input",
        kind="pairs",
        metavar="STIMULUS=COLUMN",
    ),
]
Time = Annotated[
    str,
    Ask("Time column, e.g. 'Zeit [s]', or sample rate, e.g. '1 kHz'.", "Time", metavar="COLUMN"),
]
