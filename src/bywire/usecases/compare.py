"""Benches beside each other: result folders as they lie, all else run now."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bywire.usecases.asks import BenchChanges, ErrorEstimate
from bywire.usecases.declare import NOTHING, Ask, Form, use_case

if TYPE_CHECKING:
    from bywire.api.comparison import Comparable, Comparison
    from bywire.core.typing import Progress

Runs = Annotated[
    "Comparable",
    Ask(
        "Result folders of run --out, bench files, or experiments.",
        "Runs",
        metavar="RUN RUN...",
        known=("experiments", "generic_experiments"),
        files=".toml",
        offered=("results", "benches"),
    ),
]
IsFull = Annotated[
    bool,
    Ask(
        "Also show settings and key figures that are equal.",
        "Show what is the same, too",
        name="full",
    ),
]


def _read(*runs: Path, overrides: Mapping[str, str]) -> None:
    from bywire.api.comparison import require_comparable
    from bywire.bench import bench_file
    from bywire.bench.result_folder import record_of

    for each in runs:
        if each.is_dir():
            record_of(each)
    for bench in require_comparable(runs, overrides):
        bench_file.read(bench, overrides)


@use_case("compare", form=Form("Compare runs", "Compare", "runs"), check=_read)
def compare(
    *runs: Runs,
    overrides: BenchChanges = NOTHING,
    is_full: IsFull = False,
    progress: "Progress | None" = None,
    estimate_error: ErrorEstimate = True,
) -> "Comparison":
    """Compare runs: settings and key figures that differ, verdicts, curves on top of each other.

    Parameters
    ----------
    runs
        Two or more, each a result folder (what ``run --out`` or `BenchResult.write` leaves), a
        `BenchResult`, or what is run now: a `Bench`, a bench file, an experiment's name. A result
        folder goes before an experiment of its name.
    overrides
        Changes of every bench that is run now, as ``--set`` takes them.
    is_full
        Whether settings and key figures that are the same are shown as well.
    progress
        Called with a label and the finished share, 0 to 1.
    estimate_error
        Whether what is run now is run in half and double steps too; see `bywire.run`. Key figures
        that differ by less than both are off, as estimated or as a folder says, are not distinct.

    Returns
    -------
    Comparison
        What differs in settings and parameters, and the key figures of all runs in SI units.

    Raises
    ------
    InputError
        For fewer than two runs, folders that are not finished or damaged, and benches that
        cannot be set up.
    RunError
        When a run fails.
    KeyboardInterrupt
        When interrupted: half a run compares with nothing.
    """
    from bywire.api.comparison import compared

    return compared(runs, overrides, is_full, progress, estimate_error)
