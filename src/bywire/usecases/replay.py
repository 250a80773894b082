"""Replay of a measured demand, which compares the model's response with the measurement."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from bywire.usecases.asks import (
    BENCH_CHANGES,
    CaseName,
    ErrorEstimate,
    Inputs,
    MeaningFile,
    TestBench,
    Time,
)
from bywire.usecases.declare import NOTHING, Ask, Command, Form, use_case

if TYPE_CHECKING:
    import xarray as xr

    from bywire.api.replay import Replay
    from bywire.core.typing import Progress

MeasurementFile = Annotated[
    "str | Path | xr.Dataset", Ask("Measurement file.", "Measurement", kind="file")
]
ModelChanges = Annotated[Mapping[str, Any], BENCH_CHANGES]
Outputs = Annotated[
    Sequence[str] | Mapping[str, str],
    Ask(
        "Signal to compare, e.g. 'p_mc=Pressure [psi]'. Default: all.",
        "Outputs",
        name="output",
        kind="names",
        metavar="SIGNAL[=COLUMN]",
    ),
]
Tolerances = Annotated[
    Sequence[str],
    Ask(
        "Tolerance, e.g. 'nrmse <= 5 %' or 'p_mc.max_error <= 2 bar'.",
        "Tolerances",
        name="tolerance",
    ),
]
Segments = Annotated[
    str | Path,
    Ask(
        "Segments to evaluate separately: auto (steps and holds) or a TOML file.",
        "Evaluate steps and holds separately",
        is_text=True,
        ticked="auto",
    ),
]
Tracked = Annotated[
    Sequence[str], Ask("Drifting parameter to track, e.g. mu_B.", "Drifting parameters")
]


def _read(bench: Path, overrides: Mapping[str, Any]) -> None:
    from bywire.bench import bench_file

    bench_file.read(bench, overrides)


@use_case(
    Command("replay", status_1="if a tolerance is missed", first=("measurement", "bench", "map")),
    form=Form(
        "Replay a measurement",
        "Replay",
        fields=(
            "bench",
            "measurement",
            "input",
            "output",
            "tolerance",
            "map",
            "time",
            "case",
            "segments",
            "track",
            "set",
        ),
        is_listed=False,
    ),
    check=_read,
)
def replay(
    measurement: MeasurementFile,
    bench: TestBench,
    overrides: ModelChanges = NOTHING,
    *,
    mapping: MeaningFile = None,
    inputs: Inputs = NOTHING,
    outputs: Outputs = (),
    time: Time = "",
    case: CaseName = "",
    tolerances: Tolerances = (),
    segments: Segments = "",
    track: Tracked = (),
    progress: "Progress | None" = None,
    estimate_error: ErrorEstimate = True,
) -> "Replay":
    """Drive the model with a measured demand, and compare its response with the measurement.

    Parameters
    ----------
    measurement
        A file, or the result of `bywire.read_measurement`.
    bench, overrides
        A `Bench`, the path of a bench file, or an experiment's name, and changes to it in the same
        form as ``--set``.
    mapping
        File that maps columns of a measurement file to signals.
    inputs
        Stimulus of the model -> measured signal, or column such as ``"Demand [bar]"``. Default: all
        signals with matching names.
    outputs
        Signals to compare. Default: all measured signals that show how well the model fits. A
        mapping specifies the column of each signal, as in ``{"p_mc": "Pressure [psi]"}``. An empty
        column means the signal's own name.
    time
        Time column, such as ``"Zeit [s]"``, or a sample rate. Default: the one that the file
        declares.
    case
        Run of the experiment. Default: the first.
    tolerances
        Limits such as ``"nrmse <= 5 %"`` or ``"p_mc.max_error <= 2 bar"``.
    segments
        Segments to evaluate separately: ``"auto"`` for steps and holds, or a TOML file. Default:
        the whole record.
    track
        Drifting parameters to track, for example ``"mu_B"``.
    progress
        Called with a label and the completed fraction, 0 to 1.
    estimate_error
        Whether to rerun with half and twice the step size to estimate each figure's numerical
        error. If a figure is closer to its tolerance than this error, the tolerance is undecided.

    Returns
    -------
    Replay
        Measured and simulated signals in SI units, with figures for the differences between them.

    Raises
    ------
    InputError
        If an argument is invalid, or the measurement cannot be used.
    """
    from bywire.api.replay import Replay, columns_of_bench, driven_bench, stretches_of, units_of
    from bywire.core.signals import signals_of
    from bywire.core.typing import silent
    from bywire.data.named_columns import reject_swapped
    from bywire.identification import bench_replay, tracking
    from bywire.identification.bench_replay import case_of
    from bywire.identification.measured import measured, name_of
    from bywire.identification.replay_fit import judged, read_tolerances

    shown = silent if progress is None else progress
    driven = driven_bench(bench, overrides)
    limits = read_tolerances(tolerances)
    columns = {n: c for n, c in outputs.items() if c} if isinstance(outputs, Mapping) else {}
    model = case_of(driven, case).model
    reject_swapped("inputs", inputs, signals_of(model.Stimulus))
    reject_swapped("outputs", columns, signals_of(model.Output))
    units = units_of(model, inputs, outputs)
    named = columns_of_bench(inputs, columns, time, units)
    read = measured([measurement], mapping, gaps=True, named=named, progress=shown)
    shown("replay", 0.0)
    replayed = bench_replay.replay(
        driven,
        read.data,
        inputs or None,
        list(outputs) or None,
        case,
        estimate_error=estimate_error,
    )
    shown("replay", 1.0)
    stretches = stretches_of(segments, replayed.inputs, limits)
    fits = judged(replayed.outputs, stretches, replayed.others)
    tracks = [tracking.track(name, read.data, replayed.run.par) for name in track]
    return Replay(driven, name_of(measurement), replayed, fits, tuple(tracks), tuple(read.notes))
