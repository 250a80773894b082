"""Studies whose processes are killed, client and workers: what is kept is whole, the rest comes."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import pandas as pd

import bywire
from bywire.core.scratch import PREFIX
from fuzz.forked import Forked

RARE = 19.05  # A, which few cases exceed
_STUDY = """
bench = "hard-braking"
[set]
"options.duration" = "40 ms"
"options.settle" = "10 ms"
[vary]
"motor.R_m" = {{ kind = "normal", sd = "4 %" }}
"motor.K_e" = "+-5 %"
[requirements]
peak_current = "<= {limit} A with {probability} %"
[design]
{design}
"""
DESIGNS = {
    "monte-carlo": _STUDY.format(
        limit=25, probability=90, design='kind = "monte-carlo"\ncases = 512'
    ),
    "subset-simulation": _STUDY.format(
        limit=RARE,
        probability=99.9,
        design='kind = "subset-simulation"\ncases = 3200\ncases_per_level = 640',
    ),
    "importance-sampling": _STUDY.format(
        limit=RARE, probability=99.9, design='kind = "importance-sampling"\ncases = 1280'
    ),
}
_CLUSTER = """
import sys
from bywire.core.libraries import allow_dask
allow_dask()
from distributed import LocalCluster
if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""
KILLED: Counter[str] = Counter()
"""processes killed until now, by what they were"""
_MOST = 4  # kills of a case
_FORKED = 0.9  # of the clients
_WHERE = (*("pool",) * 7, "cluster")
_LONGEST = 120.0  # s that a command may take to end


def case(
    rng: Random,
    folder: Path,
    kills: int = 0,
    design: str = "",
    where: str = "",
    forked: bool = False,
) -> str:
    """Kill a study again and again, finish it, and say what is wrong with what it gave.

    ``design``, ``where``: one of `DESIGNS`, and ``pool`` or ``cluster``; drawn where empty.
    ``forked``: whether most clients are copies of this process, which takes a third of the time.
    """
    design = design or rng.choice(("monte-carlo", "monte-carlo", *DESIGNS))
    where = where or rng.choice(("pool", "pool", "cluster") if not forked else _WHERE)
    path, out = folder / "study.toml", folder / "out"
    path.write_text(DESIGNS[design], encoding="utf-8")
    with _computing(rng, folder, where) as (options, further):
        for _ in range(kills or rng.randint(1, _MOST * (2 if forked else 1))):
            wrong = _killed(rng, path, out, options, further, forked and rng.random() < _FORKED)
            if wrong:
                return f"{design} with {' '.join(options)}: {wrong}"
    whole = bywire.run_study(path, out, workers=1).cases
    if not whole.equals(_reference(design)):
        return f"the finished study ({design}, {where}) is not the one that nobody killed"
    left = [str(p) for p in out.rglob(f"{PREFIX}*")]
    return f"{left} stay" if left else ""


@contextlib.contextmanager
def _computing(rng: Random, folder: Path, where: str) -> Iterator[tuple[list[str], int]]:
    """Yield options that say who computes, and the process whose children do; 0 for none."""
    if where == "pool":
        yield ["--workers", rng.choice(("1", "2"))], 0
        return
    path = folder / "cluster.py"
    path.write_text(_CLUSTER, encoding="utf-8")
    with subprocess.Popen(
        [sys.executable, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=_environment(),
    ) as cluster:
        assert cluster.stdout is not None
        address = cluster.stdout.readline().strip()
        try:
            yield ["--cluster", address], cluster.pid
        finally:
            cluster.communicate("")


def _environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


def _started(words: list[str], errors: Path, forked: bool) -> subprocess.Popen[str] | Forked:
    """Start a command."""
    if forked:
        return Forked(words, errors)
    return subprocess.Popen(
        [sys.executable, "-m", "bywire.cli", *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=_environment(),
    )


def _killed(
    rng: Random, path: Path, out: Path, options: list[str], further: int, forked: bool
) -> str:
    """Start a study, and kill its client or a worker of it after a while."""
    words = ["study", "run", str(path), "--out", str(out), *options]
    with _started(words, path.with_name("errors"), forked) as process:
        _waited(rng, process, out / "chunks", 2.0 if forked else 9.0)
        below = _children(process.pid)
        workers = [*below, *(_children(further) if further else [])]
        victim = rng.choice(workers) if workers and rng.random() < 0.5 else process.pid
        if process.poll() is None:
            KILLED["clients" if victim == process.pid else "workers"] += 1
            KILLED["of a cluster"] += bool(further)
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


def _waited(
    rng: Random, process: subprocess.Popen[str] | Forked, chunks: Path, longest: float
) -> None:
    """Wait for any time [s], or until a further chunk is there and a moment more."""
    if rng.random() < 0.3:
        time.sleep(rng.uniform(0.0, longest))
        return
    before, give_up = len([*chunks.glob("*")]), time.monotonic() + _LONGEST
    while process.poll() is None and time.monotonic() < give_up:
        if len([*chunks.glob("*")]) > before:
            time.sleep(rng.expovariate(40.0 / longest))
            return
        time.sleep(0.005)


def _children(pid: int) -> list[int]:
    """Return the workers that a process has started (Linux)."""
    try:
        tasks = Path(f"/proc/{pid}/task").glob("*/children")  # of every thread
        below = [each for task in tasks for each in task.read_text().split()]
        lines = {int(x): Path(f"/proc/{x}/cmdline").read_bytes() for x in below}
    except OSError:  # it has ended
        return []
    return [each for each, line in lines.items() if b"resource_tracker" not in line]


@cache
def _reference(design: str) -> pd.DataFrame:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "study.toml"
        path.write_text(DESIGNS[design], encoding="utf-8")
        return bywire.run_study(path, Path(folder) / "out", workers=1).cases
