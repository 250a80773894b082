"""Comparison of runs: result folders are read, benches and experiments are run."""

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
        "Also show what is equal",
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
        Two or more, each a result folder (written by ``run --out`` or `BenchResult.write`), a
        `BenchResult`, or a bench to run: a `Bench`, a bench file, an experiment's name. A result
        folder takes precedence over an experiment of the same name.
    overrides
        Changes of every bench that this call runs, as ``--set`` takes them.
    is_full
        Whether to also show equal settings and key figures.
    progress
        Called with a label and the finished share, 0 to 1.
    estimate_error
        Whether to repeat the runs of this call in half and double steps; see `bywire.run`. Key
        figures are not distinct if they differ by less than their numerical errors, as estimated
        here or recorded in a result folder.

    Returns
    -------
    Comparison
        Differences in settings and parameters, and the key figures of all runs in SI units.

    Raises
    ------
    InputError
        For fewer than two runs, incomplete or damaged folders, and benches that cannot be set up.
    RunError
        If a run fails.
    KeyboardInterrupt
        If interrupted: an incomplete run cannot be compared.
    """
    from bywire.api.comparison import compared

    return compared(runs, overrides, is_full, progress, estimate_error)
