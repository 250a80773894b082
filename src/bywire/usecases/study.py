"""Sizing study: comparison of brake designs at equal demands."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from bywire.core.errors import UnknownNameError, unknown_name
from bywire.core.libraries import on_one_thread
from bywire.usecases.asks import ParameterSetName
from bywire.usecases.declare import NOTHING, Ask, Command, Form, use_case

if TYPE_CHECKING:
    from bywire.api.study import AskedStudy, StudyResult
    from bywire.core.typing import Progress

SizingName = Annotated[
    str, Ask("Sizing study (see 'bywire list studies').", "Sizing study", known=("studies",))
]
SizingChanges = Annotated[
    Mapping[str, Any],
    Ask(
        "Change an option or a parameter, e.g. t_90=120ms.",
        "Changes",
        name="set",
        metavar="KEY=VALUE",
    ),
]


def _read(name: str, parameters: str, overrides: Mapping[str, Any]) -> "AskedStudy":
    from bywire.api.study import asked_study

    return asked_study(name, parameters, overrides)


def _require_sizing(name: str, **others: Any) -> None:
    """Reject an unknown sizing study; suggest the study file that the user may have meant."""
    from bywire.core.brake import loaded_files
    from bywire.studies.meant_study import meant_study
    from bywire.synthesis.study import STUDIES

    del others
    if STUDIES.get(name) is not None:
        return
    file = meant_study(Path(name))
    if file is not None:
        raise UnknownNameError(
            f"unknown sizing study {name!r}. To run the study file {file}, type 'bywire study run "
            f"{file}'",
            name="sizing study",
            value=name,
            valid=f"bywire study run {file}",
        )
    if loaded_files():
        raise STUDIES.unknown(name)  # explains how a user's brake declares a sizing study
    error = str(unknown_name("sizing study", name, STUDIES.all()))
    more = (
        ". To load your own brake, add --system PATH. To run a study file, type 'bywire study run "
        "FILE'"
    )
    raise UnknownNameError(
        error if error.endswith("?") else error + more, name="sizing study", value=name
    )


@use_case(
    Command("study size", before=_require_sizing),
    form=Form("Sizing study", "Compare designs", "name", name="size"),
    check=_read,
)
@on_one_thread()
def study(
    name: SizingName,
    parameters: ParameterSetName = "",
    overrides: SizingChanges = NOTHING,
    *,
    progress: "Progress | None" = None,
) -> "StudyResult":
    """Compare brake designs at equal demands to find the best design, its limits and its cost.

    Parameters
    ----------
    name
        Name of the study.
    parameters
        Parameter set. Default: the main one of the study's brake.
    overrides
        Changes as SI numbers or texts with units. Names with a dot are the brake's parameters, and
        all others are the study's options.
    progress
        Called with a label and the finished share, 0 to 1.

    Returns
    -------
    StudyResult
        The designs with their figures in SI units, the best, and its limits.

    Raises
    ------
    InputError
        For unknown names, values out of range, and changes without effect.
    """
    from bywire.api.study import StudyResult
    from bywire.core.typing import silent

    definition, named, par, options = _read(name, parameters, overrides)
    findings = definition.compute(par, options, progress or silent)
    return StudyResult(definition, named, par, options, findings)
