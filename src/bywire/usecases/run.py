"""Run of a bench or experiment, with a check of its requirements."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, overload

from bywire.core.callers import option
from bywire.core.errors import InputError
from bywire.usecases.asks import BenchChanges, BenchName, ErrorEstimate
from bywire.usecases.declare import NOTHING, Ask, Command, Form, use_case

if TYPE_CHECKING:
    from bywire.api.run import BenchResult
    from bywire.api.run_over import BenchRange
    from bywire.bench.bench import Bench
    from bywire.core.typing import Progress

Over = Annotated[str, Ask("Range of values to run, e.g. motor.R_m=0.2ohm:0.6ohm:9.")]
Faults = Annotated[
    Sequence[str],
    Ask(
        "Fault to inject (see 'bywire list faults').",
        "Faults",
        name="fault",
        metavar="NAME[=VALUE][@ONSET]",
    ),
]
Engine = Annotated[
    str, Ask("Simulation engine, e.g. sil to run the ECU's compiled C code in the loop.")
]
Animate = Annotated[bool, Ask("Write an animation of each run as a web page. Requires --out.")]


def _read(bench: Path, overrides: Mapping[str, str], faults: Sequence[str]) -> None:
    from bywire.api.run import faulty
    from bywire.bench import bench_file

    _ = faulty(bench_file.read(bench, overrides), faults).injections


def _require_folder(animate: bool, out: Path | None, **others: Any) -> None:
    del others
    if animate and out is None:
        raise InputError(
            f"{option('animate')} needs a folder to write to. Add {option('out')}",
            name=option("animate"),
            valid=option("out"),
        )


@overload
def run(
    bench: "Bench | str | Path",
    overrides: Mapping[str, str] = ...,
    *,
    faults: Sequence[str] = ...,
    progress: "Progress | None" = None,
    engine: str = "auto",
    estimate_error: bool = True,
    animate: bool = ...,
) -> "BenchResult": ...


@overload
def run(
    bench: "Bench | str | Path",
    overrides: Mapping[str, str] = ...,
    *,
    over: str,
    faults: Sequence[str] = ...,
    progress: "Progress | None" = None,
    engine: str = "auto",
    estimate_error: bool = True,
    animate: bool = ...,
) -> "BenchRange": ...


@use_case(
    Command("run", status_1="unless every requirement is met", before=_require_folder),
    form=Form("Run with Python", "Run", fields=("bench", "set", "fault"), is_listed=False),
    check=_read,
)
def run(
    bench: BenchName,
    overrides: BenchChanges = NOTHING,
    *,
    over: Over = "",
    faults: Faults = (),
    progress: "Progress | None" = None,
    engine: Engine = "auto",
    estimate_error: ErrorEstimate = True,
    animate: Animate = False,
) -> "BenchResult | BenchRange":
    """Run a bench file or experiment, and check its results against its requirements.

    Parameters
    ----------
    bench
        A `Bench`, the path of a bench file, or the name of an experiment. An experiment runs with
        its defaults and its brake's main parameter set.
    overrides
        Changes to a bench file or experiment, in the same form as ``--set``.
    over
        Range, for example ``"motor.R_m=0.2 ohm:0.6 ohm:9"`` or ``"options.p_to=20 bar, 30 bar"``.
        All values run side by side, and the result is a `BenchRange`.
    faults
        Faults in addition to the bench's faults, in the same form as ``--fault``, for example
        ``"pressure.stuck=20 bar@1 s"``.
    progress
        Called with the run's label and the completed fraction, 0 to 1.
    engine
        ``compiled``, ``virtual-machine``, ``sil`` (the ECU's compiled C code in the loop, in double
        precision) or ``sil-single`` (in single precision). ``auto`` uses the bench's engine.
    estimate_error
        Whether to rerun everything with half and twice the step size to estimate the numerical
        error of key figures and recorded signals. If a key figure is closer to its limit than this
        error, the requirement is undecided.
    animate
        Whether to write an animation of each run as a web page to the result folder. The assembly
        must declare an animation.

    Returns
    -------
    BenchResult
        Recordings and key figures in SI units, verdicts on the requirements, and the energy balance
        in J.
    BenchRange
        For a range, the same results for each value.

    Raises
    ------
    InputError
        If the experiment cannot be set up.
    RunError
        If a run fails.
    """
    from bywire.api.run import bench_of, faulty, require_scene, run_once

    bench = faulty(bench_of(bench, overrides), faults)
    if animate:
        require_scene(bench, over)
    if over:
        from bywire.api.run_over import run_over

        return run_over(bench, over, progress, engine, estimate_error)
    return run_once(bench, progress, engine, estimate_error, animate)
