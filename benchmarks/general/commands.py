"""Speed of commands, those of all brakes and those without a brake."""

from __future__ import annotations

from benchmarks.commands import Command, measured
from benchmarks.declared import declared
from benchmarks.suite import Part

GENERAL = (
    Command("command.help", ("--help",), 0.6),
    Command("command.list", ("list",), 0.3),
)

PART = Part("commands", lambda: measured([*declared(Command).values()]))
