"""Whole processes: cold and warm start, and peak memory."""

from __future__ import annotations

import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median

from benchmarks.commands import environment
from benchmarks.result import Result, at_most
from benchmarks.suite import Part
from bywire.core.child_process import python_command

_BENCH = 'experiment = "hard-braking"\nparameters = "dardanelli2010"\n'
_ROUNDS = 5
# Use the kernel's own value for this program, because getrusage would include the parent's peak.
_MEMORY = """
import sys
from bywire.cli.main import main
try:
    main()
except SystemExit:
    pass
with open("/proc/self/status") as status:
    peak = next(line.split()[1] for line in status if line.startswith("VmHWM"))
print(peak, file=sys.stderr)
"""


def processes() -> Iterator[Result]:
    """Measure ``bywire run`` as a user starts it."""
    with tempfile.TemporaryDirectory() as folder:
        bench = Path(folder) / "bench.toml"
        bench.write_text(_BENCH)
        cold = [
            _seconds(bench, {"BYWIRE_CACHE": str(Path(folder) / f"cold{k}")})
            for k in range(_ROUNDS)
        ]
        yield at_most("start.cold", median(cold), 3.0, "s", "first run, empty kernel cache")
        warm_cache = {"BYWIRE_CACHE": str(Path(folder) / "cold0")}
        warm = [_seconds(bench, warm_cache) for _ in range(_ROUNDS)]
        yield at_most("start.warm", median(warm), 1.0, "s", "run with a warm kernel cache")
        if Path("/proc/self/status").exists():
            yield _memory(bench, warm_cache)


def _seconds(bench: Path, changes: dict[str, str]) -> float:
    command = python_command("-m", "bywire.cli", "run", str(bench), "--json")
    begin = time.perf_counter()
    subprocess.run(command, env=environment() | changes, stdout=subprocess.DEVNULL, check=True)
    return time.perf_counter() - begin


def _memory(bench: Path, changes: dict[str, str]) -> Result:
    command = python_command(
        "-c", _MEMORY, "run", str(bench), "--json", "--set", "options.duration=60 s"
    )
    done = subprocess.run(
        command,
        env=environment() | changes,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        check=True,
    )
    peak = float(done.stderr.split()[-1]) * 1024.0 / 1e6
    return at_most("memory.60s", peak, 500.0, "MB", "peak of a 60 s run recorded at 1 kHz")


PART = Part("start-up", processes)
