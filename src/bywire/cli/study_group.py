"""The group of commands on studies, in which the name of a sizing study stands for a command."""

from __future__ import annotations

from typing import Any

from typer.core import TyperGroup

from bywire.core.errors import ParameterError

_SIZE = "size"


class StudyGroup(TyperGroup):
    """Commands of studies; the name of a sizing study stands for ``size NAME``."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # types of typer's own click
        """Return the command of the first word; see click."""
        if args and args[0].endswith(".toml"):
            raise ParameterError(f"a study file is run by 'bywire study run {args[0]}'")
        if args and not args[0].startswith("-") and args[0] not in self.commands:
            args = [_SIZE, *args]
        return super().resolve_command(ctx, args)
