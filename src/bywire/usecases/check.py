"""Check of a brake, or one of its parts, against every contract."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bywire.usecases.declare import Ask, Command, use_case

if TYPE_CHECKING:
    from bywire.api.check import Check
    from bywire.contracts.evidence import Finding
    from bywire.core.typing import Progress

Checked = Annotated[
    str | None,
    Ask(
        "Brake, model, experiment, element, control law or parameter set. Default: the brake "
        "loaded with --system. Without --system, everything.",
        is_positional=True,
    ),
]


@use_case(Command("check", status_1="if a contract fails"))
def check(
    name: Checked = None,
    *,
    system: str | Path | None = None,
    progress: "Progress | None" = None,
) -> "Check":
    """Test a brake or an element against every contract.

    For elements and control laws, the contracts cover units, back ends, derivatives, energy,
    losses, parameter ranges, and saving and loading parameters. For models, they cover units, the
    solver's order, exact rest, energy during a run, engines, lanes, the linear model, and
    derivatives of a run. For experiments, they cover the assembly, figures, stimuli, signals and
    key figures that the experiment declares.

    Parameters
    ----------
    name
        Name of a brake, model, experiment, element, control law or parameter set. Default: the
        brake of ``system``. Without ``system``, all brakes loaded from files, or everything
        installed if there are none.
    system
        File or folder of a brake to load before the check. bywire executes its code.
    progress
        Called with the check's subject and the completed fraction, 0 to 1.

    Returns
    -------
    Check
        Contracts that pass, contracts that fail, and contracts that could not be checked.

    Raises
    ------
    UnknownNameError
        If the name is unknown. The message lists the closest matches.
    FileError, ModelError
        If the system cannot be loaded.

    Examples
    --------
    >>> check("plant.pedal").holds
    True
    """
    from bywire.api.check import Check
    from bywire.contracts.evidence import one_by_cause
    from bywire.contracts.subjects import demands_on
    from bywire.core.brake import brakes, load_system, loaded_files
    from bywire.report.bench_figures import FIGURES

    if system is not None:
        named = [load_system(system).name]
    else:
        files = loaded_files()
        named = [brake.name for brake in brakes().values() if brake.file in files]
    names: list[str | None] = [name] if name is not None else [*named] or [None]
    demands = [demand for each in names for demand in demands_on(each, FIGURES.all())]
    subject = ", ".join(each or "everything installed" for each in names)

    def settled() -> "Iterator[Finding]":
        for k, demand in enumerate(demands):
            if progress is not None:
                progress(subject, k / len(demands))
            yield demand.settle()

    return Check(subject, tuple(one_by_cause(settled())))
