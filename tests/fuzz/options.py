"""Every option and argument of every command, with a value that is too long, large or small."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import xarray as xr

from bywire.cli.app import program
from bywire.data.writing import write_measurement

LONG = 70_000
"""characters of the longest values"""
BRAKING = ["hard-braking", "--set", "options.duration=30 ms", "--set", "options.settle=10 ms"]
COMMANDS: dict[str, list[str]] = {
    "list": ["battery"],
    "run": BRAKING,
    "compare": ["hard-braking", "release", *BRAKING[1:3]],
    "page": [*BRAKING, "--out", "page.html"],
    "serve": ["none"],
    "reproduce": ["none"],
    "benchmark": ["none"],
    "linearize": ["pressure"],
    "frequency-response": ["current", "--frequencies", "100 Hz, 200 Hz"],
    "agreement": ["current", "--frequencies", "100 Hz, 200 Hz"],
    "margins": ["pressure"],
    "life": ["life.toml"],
    "procedure": ["procedure.toml"],
    "signoff": ["signoff.toml"],
    "faults": ["campaign.toml"],
    "design": ["current"],
    "convert": ["measured.csv", "made.csv", "--force"],
    "identify": ["seal-friction", "--synthetic", "1", "--starts", "1"],
    "replay": ["measured.csv", "--bench", "hard-braking", "--input", "p_set=p_mc"],
    "check": ["adc"],
    "new": ["drum"],
    "study run": ["study.toml", "--cases", "4"],
    "study resume": ["studied"],
    "study extend": ["studied"],
    "study report": ["studied"],
    "study status": ["studied"],
    "study surrogate": ["studied"],
    "study size": ["stability"],
    "export controller": ["hard-braking", "--out", "ecu"],
    "export fmu": [*BRAKING, "--out", "unit"],
    "export wasm": [*BRAKING, "--out", "wasm"],
}
"""a line of each that is right, or for some ends early"""
_CRITERION = """[[criteria]]
name = "released"
signal = "p_mc"
below = "1 bar"
lasting = "5 ms"
"""
_KEYS = (
    "options.duration",
    "options.settle",
    "simulation.step",
    "simulation.error",
    "simulation.record",
    "motor.R_m",
    "simulation.seed",
    "ecu.T_s",
    "options.p_to",
    "p_mc",
    "p_set",
    "nrmse",
    "bandwidth",
    "i_max",
)
_SEEN = ("a", "motor.R_m", "options.duration", "parameters")
_SIZES = (
    "0",
    "-1",
    "1e-9",
    "1e-300",
    "5e-324",
    "1e9",
    "1e15",
    "1e300",
    "1e400",
    "nan",
    "inf",
    "9" * 19,
    "9" * 400,
    "0." + "0" * 400 + "1",
)
_UNITS = ("", " Hz", " s", " ms", " bar", " ohm", " A", " %", " rad", " m", " N*m")


@cache
def options() -> dict[str, list[str]]:
    """Return the options of every command that take a value, with those of arguments as ``""``."""
    found: dict[str, list[str]] = {}

    def walk(command: Any, path: list[str]) -> None:
        below = getattr(command, "commands", None)
        for name, each in (below or {}).items():
            walk(each, [*path, name])
        if not below:
            names = [p.opts[0] for p in command.params if not getattr(p, "is_flag", False)]
            found[" ".join(path)] = sorted({n if n.startswith("-") else "" for n in names})

    walk(program(), [])
    return found


def long_values() -> Iterator[tuple[str, str, str]]:
    """Yield every command and option with values that are far too long."""
    for command, names in options().items():
        for name in names:
            for long in ("x" * LONG, "1" * LONG, f"1 {'m' * LONG}", "a, " * (LONG // 3)):
                for text in (long, f"{long}=1", *(f"{key}={long}" for key in _SEEN)):
                    yield command, name, text


def prepared(folder: Path) -> Path:
    """Write what commands read into a folder."""
    time = np.arange(50) * 1e-3
    data = xr.Dataset(
        {"p_mc": ("time", 1e5 * (10.0 + np.sin(50.0 * time)), {"units": "Pa"})},
        {"time": ("time", time, {"units": "s"})},
    )
    write_measurement(data, folder / "measured.csv", overwrite=True)
    head = 'bench = "hard-braking"\n[set]\n"options.duration" = "30 ms"\n'
    (folder / "study.toml").write_text(f'{head}[vary]\n"motor.R_m" = "+-5 %"\n')
    only = '[campaign]\nonly = ["pressure.stuck"]\n'
    (folder / "campaign.toml").write_text(head + only + _CRITERION)
    (folder / "life.toml").write_text('life = "none"\n')
    (folder / "procedure.toml").write_text('procedure = "none"\n')
    (folder / "signoff.toml").write_text('[[requirement]]\nid = "R"\ntext = "It brakes."\n')
    return folder


def words_with(command: str, option: str, text: str) -> list[str]:
    """Return a command with a value of an option, or of its first argument where that is empty."""
    base = COMMANDS[command]
    return [*command.split(), *([text, *base[1:]] if not option else [*base, option, text])]


def command_line(rng: Random) -> list[str]:
    """Return a command with a value that is too large, too small or not a number at all."""
    command = rng.choice(sorted(set(options()) - {"benchmark", "reproduce"}))
    option = rng.choice(options()[command])
    sizes = [rng.choice(_SIZES) + rng.choice(_UNITS) for _ in range(2)]
    text = rng.choice(
        (
            sizes[0],
            ", ".join(sizes),
            f"{sizes[0]}:{sizes[1]}:{rng.choice(_SIZES)}",
            f"{rng.choice(_KEYS)}={sizes[0]}",
            f"{rng.choice(_KEYS)} <= {sizes[0]}",
            f"motor.R_m={sizes[0]}:{sizes[1]}:{rng.choice(_SIZES)}",
            f"{rng.choice(_KEYS)}={sizes[0]}",
            f"motor.R_m=0.3 ohm:0.4 ohm:{rng.choice(_SIZES)}",
        )
    )
    return words_with(command, option, text)
