"""Studies of many cases: time per hard-braking run, its simulation part, and commands."""

from __future__ import annotations

import math
import os
import subprocess
import tempfile
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from benchmarks.commands import environment
from benchmarks.judging import CHUNKS, simulated_and_judged
from benchmarks.result import Result, at_least, at_most
from benchmarks.stated_error import of_stated_error
from benchmarks.suite import Part
from bywire.core.child_process import python_command
from bywire.core.libraries import allow_dask
from bywire.data.file_format import library
from bywire.studies.executor import CLUSTER_MEMORY, CLUSTER_SETTINGS, Cluster, Executor, Pool
from bywire.studies.plan import CHUNK, StudyPlan
from bywire.studies.store import Origin, StudyStore, computed_chunk, computed_chunks
from bywire.studies.study_file import read_study

_STUDY = """
bench = "hard-braking"
[vary]
"motor.R_m" = "+-5 %"
"motor.K_e" = "+-5 %"
"seal.T_pr" = { kind = "log-normal", sd = "20 %" }
[requirements]
overshoot = "<= 15 % with 90 %"
"""
# Like studies/tolerances.toml: five quantities, three key figures with requirements.
_MANY = """
bench = "hard-braking"
[vary]
"motor.R_m" = { kind = "normal", sd = "4 %" }
"motor.K_e" = "+-5 %"
"seal.T_pr" = { kind = "log-normal", sd = "20 %" }
"caliper.K_pd" = { kind = "triangular", low = "-15 %", high = "+15 %" }
"supply.V_bat" = { kind = "uniform", low = "11 V", high = "14.4 V" }
[[correlation]]
of = ["motor.R_m", "motor.K_e"]
value = -0.6
[design]
cases = 10_000
[requirements]
overshoot = "<= 15 % with 99 %"
steady_state_error = "<= 0.1 bar"
rise_time = "<= 100 ms with 95 %"
"""
_STATED = ("0.1 %", "1 %")  # numerical errors that the bench of a study states
_COMMANDS = 2  # number of commands, of which the faster one counts
_CASES_AT = CHUNKS * CHUNK  # cases that are computed together
_ROUNDS = 6
_WARM = 4  # warm-up chunks of each process
_STEADY = 4.0  # s of measurement: a cluster's last tasks take half a second
_TURNS = 3  # turns of processes and cluster, of which the fastest counts
_CASES = 1024  # cases of the study whose memory is measured
# The kernel's own value for this program, without its workers.
_MEMORY = """
import sys
from bywire.cli.main import main
try:
    main()
except SystemExit:
    pass
with open("/proc/self/status") as status:
    print(next(line.split()[1] for line in status if line.startswith("VmHWM")), file=sys.stderr)
"""


def studies() -> Iterator[Result]:
    """Measure the cases of a study on one core, and the memory of the study command."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "study.toml"
        path.write_text(_STUDY, encoding="utf-8")
        plan = read_study(path)
        computed_chunk(plan, 0, threads=1)  # the kernel is built
        whole = min(_seconds(plan) for _ in range(_ROUNDS)) / _CASES_AT
        simulated, judged = simulated_and_judged(plan, _ROUNDS)
        stored = min(_stored(plan, path, Path(folder) / str(k)) for k in range(_ROUNDS)) / _CASES_AT
        cores = os.cpu_count() or 1
        yield at_most(
            "study.million_seconds",
            1e6 * whole / cores,
            600.0,
            "s",
            f"a million stops with all key figures on {cores} cores, {1e3 * whole:.3g} ms of core "
            f"time each, measured over {_CASES_AT} stops",
        )
        yield at_most(
            "study.kpi_share",
            judged / simulated,
            0.05,
            "1",
            f"key figures, {1e6 * judged:.3g} us per case, relative to its simulation with noise, "
            f"{1e3 * simulated:.3g} ms",
        )
        yield _of_steps(Path(folder))
        beside = whole - simulated + stored
        yield at_most(
            "study.beside_share",
            beside / simulated,
            0.06,
            "1",
            f"creating, checking, judging and storing cases, {1e6 * beside:.3g} us per case, of "
            f"which storing {1e6 * stored:.3g} us, relative to the simulation",
        )
        many = Path(folder) / "many.toml"
        many.write_text(_MANY, encoding="utf-8")
        for error in _STATED:
            yield from of_stated_error(many, error, f"study.error_{error.split()[0]}")
        yield _command(Path(folder))
        if Path("/proc/self/status").exists():
            yield _memory(path, Path(folder) / "out")
        if find_spec("distributed") is not None:
            yield _efficiency(plan, cores, whole * CHUNK)


def _seconds(plan: StudyPlan) -> float:
    begin = time.process_time()
    computed_chunks(plan, range(CHUNKS), threads=1)
    return time.process_time() - begin


def _stored(plan: StudyPlan, file: Path, folder: Path) -> float:
    """Return the processor time to store the same cases [s]."""
    store, given = StudyStore(folder), computed_chunks(plan, range(CHUNKS), threads=1)
    store.open(plan, Origin(file))
    begin = time.process_time()
    for chunk, columns in given:
        store.write(chunk, columns, plan.column_units)
    return time.process_time() - begin


def _of_steps(folder: Path) -> Result:
    """Measure the same for pressure steps, which also have a static gain."""
    path = folder / "steps.toml"
    path.write_text(_STUDY.replace("hard-braking", "pressure-step"), encoding="utf-8")
    simulated, judged = simulated_and_judged(read_study(path), _ROUNDS)
    return at_most(
        "study.step_kpi_share",
        judged / simulated,
        0.05,
        "1",
        f"the same for pressure steps: {1e6 * judged:.3g} us and {1e3 * simulated:.3g} ms",
    )


def _command(folder: Path) -> Result:
    """Measure a study command from start to report, with kernels already built."""
    study, seconds, spent = folder / "many.toml", [], []
    study.write_text(_MANY, encoding="utf-8")
    for k in range(_COMMANDS + 1):
        before, begin = _of_children(), time.perf_counter()
        fewer = () if k else ("--cases", "512")
        line = python_command(
            "-m", "bywire", "study", "run", str(study), "--out", str(folder / f"many-{k}"), *fewer
        )
        subprocess.run(line, env=environment(), capture_output=True, check=True)
        seconds.append(time.perf_counter() - begin)
        spent.append(_of_children() - before)
    cores = os.cpu_count() or 1
    return at_most(
        "study.command_seconds",
        min(seconds[1:]),
        8.0,
        "s",
        f"a study of 10,000 stops from command line to report on {cores} cores, warm, wall time; "
        f"{min(spent[1:]):.3g} s of processor time in all its processes",
    )


def _of_children() -> float:
    """Return the processor time of all finished child processes [s]."""
    ended = os.times()
    return ended.children_user + ended.children_system


def _memory(study: Path, out: Path) -> Result:
    line = python_command(
        "-c",
        _MEMORY,
        "study",
        "run",
        str(study),
        "--out",
        str(out),
        "--cases",
        str(_CASES),
        "--workers",
        "1",
        "--json",
    )
    done = subprocess.run(
        line,
        env=environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        check=True,
    )
    peak = float(done.stderr.split()[-1]) * 1024.0 / 1e6
    return at_most("study.memory", peak, 500.0, "MB", f"peak of a study of {_CASES} cases")


def _efficiency(plan: StudyPlan, cores: int, seconds: float) -> Result:
    """Compare the workers of a cluster on this machine with plain processes, after warm-up.

    Both run in turn, because the speed of a shared machine varies. ``seconds``: time of one chunk.
    """
    allow_dask()
    distributed = library("distributed", "clusters", "cluster")
    config = library("dask", "clusters", "cluster").config
    memory = {f"distributed.nanny.pre-spawn-environ.{k}": v for k, v in CLUSTER_MEMORY.items()}
    chunks = math.ceil(_STEADY * cores / seconds)
    plain, clustered = [], []
    with (
        config.set(CLUSTER_SETTINGS | memory),
        distributed.LocalCluster(
            n_workers=cores, threads_per_worker=1, dashboard_address=None
        ) as cluster,
    ):
        for _ in range(_TURNS):
            plain.append(_rate(Pool(cores), plan, cores, chunks))
            clustered.append(_rate(Cluster(cluster.scheduler_address), plan, cores, chunks))
    return at_least(
        "study.efficiency",
        max(clustered) / max(plain),
        0.95,
        "1",
        f"cases per second of {cores} dask.distributed workers, started as in docs/studies.md, "
        f"relative to {cores} plain processes; the best of {_TURNS} turns each",
    )


def _rate(executor: Executor, plan: StudyPlan, cores: int, chunks: int) -> float:
    """Return chunks per second [1/s], after each process has computed several."""
    with executor.opened(plan) as compute:
        computed = compute(range(_WARM * cores + chunks))
        for _ in range(_WARM * cores):
            next(computed)
        begin = time.perf_counter()
        count = sum(1 for _ in computed)
        return count / (time.perf_counter() - begin)


PART = Part("studies", studies)
