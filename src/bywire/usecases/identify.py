"""Identification of parameters with confidence intervals from measured or simulated data."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from bywire.core.callers import option
from bywire.core.errors import ParameterError
from bywire.core.libraries import on_one_thread
from bywire.usecases.asks import (
    CaseName,
    Changes,
    Inputs,
    LastOutFolder,
    MeaningFile,
    ParameterSetName,
    Time,
)
from bywire.usecases.declare import NOTHING, Ask, Command, Form, use_case

if TYPE_CHECKING:
    import xarray as xr

    from bywire.api.identification import Identification
    from bywire.api.trust import TrustStudy
    from bywire.core.typing import Progress
    from bywire.identification.question import Question

_ANY_BENCH = "Methods for any bench"
MethodName = Annotated[
    str, Ask("Method (see 'bywire list methods').", "Method", known=("methods",))
]
Measurements = Annotated[
    Sequence[Path],
    Ask(
        "Measurement files.",
        "Measurements",
        kind="files",
        metavar="[MEASUREMENT]...",
        is_positional=True,
    ),
]
MethodOptions = Annotated[
    Mapping[str, Any],
    Ask(
        "Option of the method (see 'bywire list METHOD').",
        "Method options",
        name="option",
        metavar="KEY=VALUE",
    ),
]
Starts = Annotated[
    int | None,
    Ask("Number of starting points. Default: 16, or 1 with --study.", "Starting points", least=1),
]
Seed = Annotated[
    int,
    Ask("Random seed of the starting points, or first seed with --study.", "Random seed", least=0),
]
Synthetic = Annotated[
    int | None,
    Ask(
        "Use a simulated measurement with this seed instead of a file.",
        "Simulated measurement",
        metavar="SEED",
        least=0,
    ),
]
Experiments = Annotated[
    int | None,
    Ask("Test the method on this number of simulated measurements.", metavar="COUNT", least=2),
]
AnyBench = Annotated[
    Path | None,
    Ask(
        "Bench file (TOML) or experiment.",
        "Bench",
        known=("experiments", "generic_experiments"),
        offered=("benches",),
        panel=_ANY_BENCH,
    ),
]
NoisyOutputs = Annotated[
    Mapping[str, str],
    Ask(
        "Measured output with its column and noise, e.g. 'p_mc=Pressure [psi] +- 0.02 bar'.",
        "Outputs",
        name="output",
        kind="names",
        metavar="SIGNAL[=COLUMN]",
        panel=_ANY_BENCH,
    ),
]
Unknowns = Annotated[
    Mapping[str, str],
    Ask(
        "Unknown to estimate, e.g. 'motor.R_m=0.1..1 ohm' or 'offset.i_meas'.",
        "Unknowns",
        name="unknown",
        kind="names",
        metavar="NAME[=LOW..HIGH]",
        panel=_ANY_BENCH,
    ),
]
Priors = Annotated[
    Mapping[str, str],
    Ask(
        "Prior knowledge of an unknown, e.g. 'motor.R_m=0.35 +- 0.02 ohm'.",
        "Prior knowledge",
        name="prior",
        kind="pairs",
        metavar="NAME=VALUE+-DEV",
        panel=_ANY_BENCH,
    ),
]
States = Annotated[
    Sequence[str],
    Ask(
        "State whose initial value is unknown, e.g. omega.",
        "Unknown initial values",
        name="estimate_start",
        metavar="STATE",
        panel=_ANY_BENCH,
    ),
]
Loss = Annotated[
    str,
    Ask(
        "Loss function: linear, soft_l1, huber or cauchy.",
        "Loss",
        words=("linear", "soft_l1", "huber", "cauchy"),
        panel=_ANY_BENCH,
    ),
]
Holdout = Annotated[
    Path | None,
    Ask(
        "Validation measurement, which the fit does not use.",
        "Validation measurement",
        kind="file",
        panel=_ANY_BENCH,
    ),
]


def _asked(
    method: MethodName,
    measurements: Measurements = (),
    mapping: MeaningFile = None,
    time: Time = "",
    parameters: ParameterSetName = "",
    overrides: Changes = NOTHING,
    options: MethodOptions = NOTHING,
    starts: Starts = None,
    seed: Seed = 1,
    synthetic: Synthetic = None,
    study: Experiments = None,
    bench: AnyBench = None,
    inputs: Inputs = NOTHING,
    outputs: NoisyOutputs = NOTHING,
    unknowns: Unknowns = NOTHING,
    priors: Priors = NOTHING,
    states: States = (),
    case: CaseName = "",
    loss: Loss = "",
    holdout: Holdout = None,
    out: LastOutFolder = None,
    progress: "Progress | None" = None,
) -> "Identification | TrustStudy":
    """Identify parameters, or test a method on many simulated experiments.

    The command has one flag for each field of a `Question`.
    """
    from bywire.api.trust import trust
    from bywire.identification.question import Question

    question = Question(bench, inputs, outputs, unknowns, priors, states, case, holdout, loss)
    shared: dict[str, Any] = {
        "parameters": parameters,
        "overrides": overrides,
        "question": question,
        "options": options,
        "seed": seed,
        "folder": out,
        "progress": progress,
    }
    if study is None:
        return identify(
            method,
            measurements,
            mapping=mapping,
            time=time,
            starts=starts or 16,
            synthetic=synthetic,
            **shared,
        )
    if measurements or synthetic is not None:
        raise ParameterError(
            f"{method} accepts only one of these: measurement files, {option('synthetic')} SEED, "
            f"or {option('study')} COUNT",
            name=option("study"),
            value=str(study),
        )
    for name, value in {"mapping": mapping, "time": time or None, "holdout": holdout}.items():
        if value is not None:
            raise ParameterError(
                f"{option(name)} applies only to measurement files. Remove it", name=option(name)
            )
    return trust(method, study, starts=starts or 1, **shared)


@use_case(
    Command("identify", status_1="if a check fails"),
    form=Form(
        "Identify parameters",
        "Identify",
        "method",
        fields=(
            "method",
            "measurements",
            "synthetic",
            "map",
            "time",
            "bench",
            "input",
            "output",
            "unknown",
            "prior",
            "estimate_start",
            "holdout",
            "loss",
            "case",
            "option",
            "starts",
            "seed",
            "parameters",
            "set",
        ),
    ),
    asked=_asked,
)
@on_one_thread()
def identify(
    method: str,
    measurements: "str | Path | xr.Dataset | Sequence[str | Path | xr.Dataset]" = (),
    parameters: str = "",
    overrides: Mapping[str, Any] = NOTHING,
    *,
    question: "Question | None" = None,
    mapping: str | Path | None = None,
    time: str = "",
    options: Mapping[str, Any] = NOTHING,
    starts: int = 16,
    seed: int = 1,
    synthetic: int | None = None,
    folder: str | Path | None = None,
    progress: "Progress | None" = None,
) -> "Identification":
    """Identify parameters and their confidence intervals from measurements.

    Parameters
    ----------
    method
        Name of the method (see ``bywire list methods``).
    measurements
        One measurement, or several records of one measurement, as files or results of
        `bywire.read_measurement`.
    parameters, overrides
        Parameter set from which the search starts (default: the main set of the method's brake),
        and changes to it as SI numbers or strings with units.
    question
        For methods for any bench: the bench, the measured outputs and the unknowns. For a method
        for a single brake, its ``outputs`` can specify the columns of the brake's signals.
    mapping
        File that maps columns of measurement files to signals.
    time
        Time column, such as ``"Zeit [s]"``, or a sample rate. Default: the one that the file
        declares.
    options
        Options of the method as SI numbers or strings with units.
    starts, seed
        Number of starting points, and the random seed of all starting points except the first.
    synthetic
        Seed of a simulated measurement, to use instead of a real one.
    folder
        Folder of the result. bywire rejects a folder with another method's result, and removes an
        earlier result of the same method. It saves the result of each finished start there, so that
        an interrupted search can continue.
    progress
        Called with a label and the completed fraction, 0 to 1.

    Returns
    -------
    Identification
        Parameters in SI units with their 95 % intervals, the checks of the result, and the
        measurements.

    Raises
    ------
    InputError
        If an argument is invalid, or a measurement cannot be used.
    KeyboardInterrupt
        If interrupted.

    Examples
    --------
    >>> import bywire
    >>> found = bywire.identify("seal-friction", synthetic=1)
    >>> found.holds
    True
    >>> list(found.tables()["Seal friction"]["parameter"])
    ['A', 'F_0', 'f']
    """
    from bywire.api.identification import Source, choose, identified
    from bywire.core.typing import silent
    from bywire.identification.question import Question

    question = Question() if question is None else question
    sources = [measurements] if isinstance(measurements, Source) else list(measurements)
    shown = silent if progress is None else progress
    chosen = choose(
        method,
        parameters,
        overrides,
        options,
        question,
        measurements=sources,
        mapping=mapping,
        time=time,
        progress=shown,
    )
    return identified(
        chosen,
        question,
        sources,
        mapping=mapping,
        time=time,
        synthetic=synthetic,
        folder=None if folder is None else Path(folder),
        starts=starts,
        seed=seed,
        progress=shown,
    )
