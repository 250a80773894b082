"""A new brake's package, written from the template."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bywire.report.answer import Answer
from bywire.report.document import Document, Listing, Paragraph, Section
from bywire.template.new import write_package


@dataclass(frozen=True)
class NewBrake(Answer):
    """A package that was written.

    Parameters
    ----------
    name
        Of the brake.
    folder
        Its project: ``pyproject.toml``, ``README.md``, ``src`` and ``tests``.
    package
        What ``--system`` takes.
    """

    name: str
    folder: Path
    package: Path

    def document(self) -> Document:
        """Return what was written, and what to do next."""
        files = sorted(str(p.relative_to(self.folder)) for p in self.folder.rglob("*.py"))
        steps = [
            f"bywire check --system {self.package}",
            f"bywire run {self.name}-clamp --system {self.package}",
            f"bywire margins {self.name}-force --system {self.package}",
            f"pytest {self.folder / 'tests'}",
            f"pip install -e {self.folder}    # then every command finds it without --system",
        ]
        written = Paragraph(f"{self.name} stands in {self.folder}; its README says what is where")
        following = Listing(steps, "Next:")
        return Document(
            f"The brake {self.name}",
            "A package that passes bywire check, to be changed step by step.",
            sections=[Section("What was written", [written, Listing(files), following])],
            brief=[written, following],
            data=self._data(steps),
        )

    def _data(self, steps: list[str]) -> dict[str, Any]:
        return {
            "name": self.name, "folder": str(self.folder), "package": str(self.package),
            "next": steps,
        }  # fmt: skip


def new(name: str, folder: str | Path = ".") -> NewBrake:
    """Write the package of a new brake, with tests, that passes ``bywire check``.

    Parameters
    ----------
    name
        Of the brake: small letters, digits and single dashes, such as ``my-brake``.
    folder
        Where its folder ``my-brake`` is made; the current one by default.

    Raises
    ------
    ParameterError
        When the name is none that Python and bywire can take, with the reason.
    FileError
        When there is such a folder already, or it cannot be written.
    """
    written = write_package(name, Path(folder).expanduser())
    package = written / "src" / name.replace("-", "_")
    return NewBrake(name.replace("_", "-"), written, package)
