"""A package for your own brake."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bywire.usecases.declare import Ask, Command, use_case

if TYPE_CHECKING:
    from bywire.api.new import NewBrake

BrakeName = Annotated[str, Ask("Name of the brake, e.g. my-brake.")]
ProjectFolder = Annotated[
    str | Path,
    Ask(
        "Parent folder of the new package; by default the current one.", name="out", is_folder=True
    ),
]


@use_case(Command("new", writes=""))
def new(name: BrakeName, folder: ProjectFolder = ".") -> "NewBrake":
    """Write a package for a brake of your own, with tests, that passes bywire check.

    Parameters
    ----------
    name
        Of the brake: small letters, digits and single dashes, such as ``my-brake``.
    folder
        Where its folder ``my-brake`` is made; the current one by default, made where it is missing.

    Returns
    -------
    NewBrake
        Its name, the folder of its project, and its package.

    Raises
    ------
    ParameterError
        When the name is none that Python and bywire can take, with the reason.
    FileError
        When there is such a folder already, or it cannot be written.
    """
    from bywire.api.new import NewBrake, write_package

    written = write_package(name, Path(folder).expanduser())
    package = written / "src" / name.replace("-", "_")
    return NewBrake(name.replace("_", "-"), written, package)
