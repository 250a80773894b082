"""Studies whose processes are killed, client and workers: what is kept is whole, the rest comes."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from functools import cache
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import pandas as pd

import bywire
from bywire.core.scratch import PREFIX

CASES = 512
"""of a study: eight chunks"""
_STUDY = """
bench = "hard-braking"
[set]
"options.duration" = "40 ms"
"options.settle" = "10 ms"
[vary]
"motor.R_m" = { kind = "normal", sd = "4 %" }
"motor.K_e" = "+-5 %"
[requirements]
peak_current = "<= 25 A with 90 %"
"""
_MOST = 4  # kills of a case
_LONGEST = 120.0  # s that a command may take to end


def case(rng: Random, folder: Path, kills: int = 0) -> str:
    """Kill a study again and again, finish it, and say what is wrong with what it gave."""
    path, out = folder / "study.toml", folder / "out"
    path.write_text(_STUDY, encoding="utf-8")
    for _ in range(kills or rng.randint(1, _MOST)):
        workers = rng.choice(("1", "2"))
        wrong = _killed(rng, path, out, workers)
        if wrong:
            return f"with {workers} workers: {wrong}"
    whole = bywire.run_study(path, out, cases=CASES, workers=1).cases
    if not whole.equals(_reference()):
        return "the finished study is not the one that nobody killed"
    left = [str(p) for p in out.rglob(f"{PREFIX}*")]
    return f"{left} stay" if left else ""


def _killed(rng: Random, path: Path, out: Path, workers: str) -> str:
    """Start a study, and kill its client or a worker of it after a while."""
    line = [sys.executable, "-m", "bywire.cli", "study", "run", str(path), "--out", str(out),
            "--cases", str(CASES), "--workers", workers]  # fmt: skip
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    with subprocess.Popen(
        line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=env
    ) as process:
        time.sleep(rng.uniform(0.5, 7.0))
        below = _children(process.pid)
        victim = rng.choice(below) if below and rng.random() < 0.5 else process.pid
        with contextlib.suppress(ProcessLookupError):
            os.kill(victim, signal.SIGKILL)
        try:
            _, said = process.communicate(timeout=_LONGEST)
        except subprocess.TimeoutExpired:
            process.kill()
            return "its processes do not end after one was killed"
    give_up = time.monotonic() + _LONGEST
    while any(Path(f"/proc/{each}").exists() for each in below):
        if time.monotonic() > give_up:
            return "a worker goes on without its client"
        time.sleep(0.1)
    if process.returncode not in (0, 1, 3, -signal.SIGKILL) or "Traceback" in said:
        return f"status {process.returncode}: {said[-800:]}"
    return ""


def _children(pid: int) -> list[int]:
    """Return the workers that a process has started (Linux)."""
    try:
        below = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        lines = {int(x): Path(f"/proc/{x}/cmdline").read_bytes() for x in below}
    except OSError:  # it has ended
        return []
    return [each for each, line in lines.items() if b"resource_tracker" not in line]


@cache
def _reference() -> pd.DataFrame:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "study.toml"
        path.write_text(_STUDY, encoding="utf-8")
        return bywire.run_study(path, Path(folder) / "out", cases=CASES, workers=1).cases
