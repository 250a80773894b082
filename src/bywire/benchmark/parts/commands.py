"""Speed of commands: those of every brake, and those that no brake has a part in."""

from __future__ import annotations

from bywire.benchmark.commands import COMMANDS, Command, measured
from bywire.benchmark.suite import Part

GENERAL = (
    Command("command.help", ("--help",), 0.6),
    Command("command.list", ("list",), 0.6),
)

PART = Part("commands", lambda: measured([*COMMANDS.all().values()]))
