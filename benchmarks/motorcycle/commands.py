"""Whole commands on the motorcycle brake: runs, the paper, a design, a replay."""

from __future__ import annotations

from benchmarks.commands import Command

_REQUIRED = (
    "bandwidth >= 10 Hz",
    "phase margin >= 60 deg",
    "overshoot <= 15 %",
    "steady state error <= 1 %",
)
_REQUIREMENTS = tuple(word for text in _REQUIRED for word in ("--require", text))

COMMANDS = (
    Command("command.run", ("run", "hard-braking"), 0.95),
    Command("command.run_out", ("run", "hard-braking", "--out", "{folder}/run"), 1.8),
    Command(
        "command.replay",
        ("replay", "{folder}/own/run.nc", "--bench", "hard-braking", "--input", "p_set=p_ref"),
        3.0,
        ("run", "hard-braking", "--set", "options.duration=2 s", "--out", "{folder}/own"),
    ),
    Command("command.reproduce", ("reproduce", "dardanelli2010"), 12.0),
    Command("command.design", ("design", "pressure", *_REQUIREMENTS), 20.0),
)
