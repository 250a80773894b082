"""Package for your own brake."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bywire.usecases.declare import Ask, Command, use_case

if TYPE_CHECKING:
    from bywire.api.new import NewBrake

BrakeName = Annotated[str, Ask("Name of the brake, e.g. my-brake.")]
ProjectFolder = Annotated[
    str | Path,
    Ask(
        "Parent folder of the new package. Default: the current folder.", name="out", is_folder=True
    ),
]


@use_case(Command("new", writes=""))
def new(name: BrakeName, folder: ProjectFolder = ".") -> "NewBrake":
    """Create a package for your own brake, with tests, that passes 'bywire check'.

    Parameters
    ----------
    name
        Name of the brake, of lowercase letters, digits and single dashes, such as ``my-brake``.
    folder
        Parent folder of the new folder ``my-brake``, created if missing. Default: the current
        folder.

    Returns
    -------
    NewBrake
        The brake's name, its project folder, and its package.

    Raises
    ------
    ParameterError
        If the name is not valid for Python or bywire. The message states the reason.
    FileError
        If the folder already exists, or is not writable.
    """
    from bywire.api.new import NewBrake, write_package

    written = write_package(name, Path(folder).expanduser())
    package = written / "src" / name.replace("-", "_")
    return NewBrake(name.replace("_", "-"), written, package)
