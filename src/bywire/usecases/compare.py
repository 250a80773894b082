"""Comparison of runs, read from result folders or computed from benches and experiments."""

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
        "Result folders from run --out, bench files, or experiments.",
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
        "Also show identical settings and key figures.",
        "Also show identical values",
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
    """Compare the settings, key figures, verdicts and curves of several runs.

    Parameters
    ----------
    runs
        Two or more runs. Each is a result folder (from ``run --out`` or `BenchResult.write`), a
        `BenchResult`, or a bench to run: a `Bench`, a bench file or an experiment's name. A result
        folder takes precedence over an experiment of the same name.
    overrides
        Changes to each bench that this call runs, in the same form as ``--set``.
    is_full
        Whether to also show identical settings and key figures.
    progress
        Called with a label and the completed fraction, 0 to 1.
    estimate_error
        Whether to rerun each bench with half and twice the step size (see `bywire.run`). A
        difference between key figures counts only if it exceeds their numerical errors, which
        bywire estimates here or reads from the result folder.

    Returns
    -------
    Comparison
        Differences in settings and parameters, and the key figures of all runs in SI units.

    Raises
    ------
    InputError
        If there are fewer than two runs, a folder is incomplete or damaged, or a bench is invalid.
    RunError
        If a run fails.
    KeyboardInterrupt
        If interrupted, because an incomplete run cannot be compared.
    """
    from bywire.api.comparison import compared

    return compared(runs, overrides, is_full, progress, estimate_error)
