"""Whole commands on the wedge brake: a run, and the paper."""

from __future__ import annotations

from benchmarks.commands import Command

COMMANDS = (
    Command("wedge.command.run", ("run", "moment-pulses"), 0.95),
    Command("wedge.command.run_out", ("run", "moment-pulses", "--out", "{folder}/wedge"), 1.8),
    Command("wedge.command.reproduce", ("reproduce", "roberts2003"), 12.0),
)
