"""Sign-off of a brake: from a list of requirements to one document."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from bywire.usecases.declare import Ask, Command, use_case

if TYPE_CHECKING:
    from bywire.api.signoff import Affected, SignOff
    from bywire.core.typing import Progress
    from bywire.signoff.plan import SignOffPlan

SignOffFile = Annotated[
    str | Path, Ask("Sign-off file (TOML) with requirements and evidence.", metavar="FILE")
]
SignOffFolder = Annotated[
    str | Path | None,
    Ask("Sign-off folder. Default: the file's name without its suffix.", is_folder=True),
]
IsChanged = Annotated[
    bool, Ask("Only show the evidence to compute, and the requirements that it affects.")
]
Since = Annotated[
    Path | None,
    Ask(
        "Folder or signoff.json of an earlier sign-off with which the document compares this one. "
        "Default: the last sign-off in the folder."
    ),
]


def _read(file: str | Path) -> "SignOffPlan":
    from bywire.signoff.signoff_file import read_signoff
    from bywire.usecases.evidence.readers import READERS

    return read_signoff(file, READERS)


def _require_file(file: str | Path, **others: Any) -> None:
    from bywire.data.toml_file import read_toml

    del others
    read_toml(Path(file), "sign-off file")


def _named_as_file(file: str | Path, **others: Any) -> Path:
    del others
    return Path(Path(file).stem)


@use_case(
    Command(
        "signoff",
        status_1="unless every requirement is met",
        before=_require_file,
        default_folder=_named_as_file,
    ),
    check=_read,
)
def sign_off(
    file: SignOffFile,
    out: SignOffFolder = None,
    *,
    changed: IsChanged = False,
    since: Since = None,
    progress: "Progress | None" = None,
) -> "SignOff | Affected":
    """Compute the evidence for a list of requirements, and write one document to sign.

    bywire computes only evidence that is missing from the folder, or whose inputs have changed.
    After an interruption, the same call therefore continues the sign-off.

    Parameters
    ----------
    file
        Sign-off file (see ``docs/signoff.md``).
    out
        Sign-off folder. Default: the file's name without its suffix, in the current folder.
    changed
        Whether to compute nothing, and only return what changed inputs affect.
    since
        Folder or ``signoff.json`` of an earlier sign-off with which the document compares this one.
        Default: the last sign-off in the folder.
    progress
        Called with a label and the completed fraction, 0 to 1.

    Returns
    -------
    SignOff
        Verdict on every requirement, with its evidence in SI units.
    Affected
        With ``changed``: the evidence to compute, and the requirements that it affects.

    Raises
    ------
    InputError
        If the file is invalid.
    RunError
        If a process is killed. If a computation fails, its evidence is missing.
    KeyboardInterrupt
        If interrupted. Finished evidence stays in the folder.
    """
    from bywire.api.signoff import Affected, SignOff
    from bywire.core.typing import silent
    from bywire.signoff.earlier import earlier_signoff
    from bywire.signoff.running import completed
    from bywire.signoff.store import EvidenceStore

    plan = _read(file)
    store = EvidenceStore(Path(out) if out is not None else Path(Path(file).stem))
    if changed:
        return Affected(plan, store)
    previous, compared_with = earlier_signoff(store.folder, since)
    kept, failures = completed(plan, store, progress or silent)
    return SignOff(plan, store.folder, kept, failures, previous, compared_with)
