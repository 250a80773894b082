"""Jobs: computations in separate processes, their progress and their outcome."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import threading
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from bywire.core.brake import loaded_files
from bywire.core.child_process import start_python
from bywire.core.pairs import read_count
from bywire.server.exchange import RefusedError
from bywire.server.place import Place
from bywire.server.task import Task


def started(folder: Path) -> subprocess.Popen[bytes]:
    """Start a process that waits for its order and does not run code from the served folder."""
    return start_python("bywire.server.job_process", untrusted=(folder,))


def interrupt(process: subprocess.Popen[bytes]) -> None:
    """Interrupt a process in the same way as Ctrl-C interrupts a command."""
    if os.name == "posix":
        _signal(process, signal.SIGINT)
    elif process.poll() is None:
        process.terminate()


def kill(process: subprocess.Popen[bytes]) -> None:
    """Kill a process and all its child processes."""
    if os.name == "posix":
        _signal(process, signal.SIGKILL)
    elif process.poll() is None:
        process.kill()


def _signal(process: subprocess.Popen[bytes], number: int) -> None:
    if process.poll() is None:
        with contextlib.suppress(OSError):
            os.killpg(process.pid, number)


# --- Jobs

TOGETHER = 2
"""maximum number of jobs that compute at the same time"""
MOST = 100
"""maximum number of jobs that wait or compute"""
_KEPT = 200  # jobs in the list
_PATIENCE = 5.0  # s within which a job must end after an interrupt
_ENDED = ("done", "failed", "canceled")


@dataclass(eq=False)
class Job:
    """Job: a computation in a separate process.

    Parameters
    ----------
    number
        Number in the list of jobs.
    task, asked
        Task of the job, and the values of the task's fields.
    out
        Folder, or file, of its result.
    """

    number: int
    task: Task
    asked: Mapping[str, Any]
    out: Path
    state: Literal["waiting", "running", "done", "failed", "canceled"] = "waiting"
    progress: tuple[str, float] = ("", 0.0)
    message: str = ""
    reports: int = 0
    so_far: list[dict[str, Any]] = field(default_factory=list)
    result: Mapping[str, Any] = field(default_factory=dict)
    ended: threading.Event = field(default_factory=threading.Event)
    process: subprocess.Popen[bytes] | None = None
    is_unwanted: bool = False

    def shown(self, place: Place) -> dict[str, Any]:
        """Return the job's state for pages."""
        is_inside = not self.task.form.is_file
        page = "report.html" if self.reports else ""
        page = str(self.result.get("page", page))
        label, share = self.progress
        return {
            "number": self.number,
            "task": self.task.name,
            "title": self.task.form.title,
            "subject": self.task.said_of(self.asked),
            "state": self.state,
            "label": label,
            "share": share,
            "message": self.message,
            "reports": self.reports,
            "so_far": self.so_far if self.state == "running" else [],
            "said": list(self.result.get("said", ())),
            "holds": self.result.get("holds"),
            "headline": self.result.get("headline", ""),
            "folder": place.named(self.out) if is_inside else "",
            "report": f"{place.named(self.out)}/{page}" if is_inside and page else "",
        }


class Jobs:
    """Jobs of a server.

    Parameters
    ----------
    place
        The served folder, to which the jobs' paths are relative.
    """

    def __init__(self, place: Place) -> None:
        self._place = place
        self._jobs: dict[int, Job] = {}
        self._lock = threading.Lock()
        self._turn = threading.Semaphore(TOGETHER)
        self._is_open = True

    def start(self, task: Task, asked: Mapping[str, Any], out: Path | None = None) -> Job:
        """Start a job, or queue it.

        Raises
        ------
        RefusedError
            With status 409 if another job uses its folder, 429 if there are too many jobs, and 503
            during shutdown.
        """
        with self._lock:
            active = [each for each in self._jobs.values() if each.state not in _ENDED]
            if not self._is_open:
                raise RefusedError(503, "the server is shutting down")
            if len(active) >= MOST:
                raise RefusedError(429, f"{MOST} jobs are already waiting. Cancel some, or wait")
            same = [each.out for each in active if each.task is task and each.asked == asked]
            out = out or (same[0] if task.case.holds and same else self._folder(task, asked))
            if any(each.out == out for each in active):
                raise RefusedError(
                    409,
                    f"another job is already computing {task.said_of(asked)}. Wait, or cancel it",
                )
            job = Job(max(self._jobs, default=0) + 1, task, asked, out)
            self._jobs[job.number] = job
            over = len(self._jobs) - _KEPT
            for old in [each for each in self._jobs.values() if each.ended.is_set()][
                : max(over, 0)
            ]:
                del self._jobs[old.number]
        threading.Thread(target=self._run, args=(job,), daemon=True).start()
        return job

    def begun(self, task: Task, asked: Mapping[str, Any]) -> Path | None:
        """Return the folder with earlier results of the same task to continue there, or None."""
        return task.begun(asked, self._place, self._place.folders(_name(task, asked)))

    def all(self) -> list[Job]:
        """Return all jobs, latest first."""
        with self._lock:
            return sorted(self._jobs.values(), key=lambda job: -job.number)

    def find(self, number: str) -> Job:
        """Return a job.

        Raises
        ------
        RefusedError
            With status 404 if there is no such job.
        """
        with self._lock:
            job = self._jobs.get(read_count(number) or 0)
        if job is None:
            raise RefusedError(404, f"job {number[:20]!r} does not exist. See the list of jobs")
        return job

    def cancel(self, job: Job) -> None:
        """Cancel a job. Finished parts of a study stay in its folder."""
        with self._lock:
            job.is_unwanted = True
            process = job.process
        if process is not None:
            interrupt(process)
            watch = threading.Timer(_PATIENCE, kill, [process])
            watch.daemon = True
            watch.start()

    def close(self) -> None:
        """Cancel all jobs, and wait until they end."""
        with self._lock:
            self._is_open = False
        left = [job for job in self.all() if not job.ended.is_set()]
        for job in left:
            self.cancel(job)
        for job in left:
            job.ended.wait(2.0 * _PATIENCE)

    def _folder(self, task: Task, asked: Mapping[str, Any]) -> Path:
        if task.form.is_kept:
            return self._place.same_folder(task.said_of(asked))
        return self._place.fresh_folder(_name(task, asked))

    def _run(self, job: Job) -> None:
        # A user waits for a live page, so its job does not queue. Two studies could delay it by
        # hours.
        with nullcontext() if job.task.form.is_file else self._turn:
            try:
                self._compute(job)
            except OSError as error:
                job.state, job.message = "failed", f"cannot start the process: {error}"
            finally:
                with contextlib.suppress(OSError):  # not empty: it contains a result
                    job.out.rmdir()
                job.ended.set()

    def _compute(self, job: Job) -> None:
        with self._lock:
            if job.is_unwanted:
                job.state = "canceled"
                return
            job.state, job.process = "running", started(self._place.root)
        order = {
            "task": job.task.name,
            "asked": dict(job.asked),
            "folder": str(self._place.root),
            "out": str(job.out),
            "systems": list(loaded_files()),
        }
        process = job.process
        assert process.stdin is not None
        assert process.stdout is not None
        with contextlib.suppress(OSError):  # the process has ended, as its exit status will show
            process.stdin.write(json.dumps(order).encode() + b"\n")
            process.stdin.flush()
        last: dict[str, Any] = {}
        for line in process.stdout:
            last = self._hear(job, json.loads(line)) or last
        status = process.wait()
        process.stdin.close()
        process.stdout.close()
        _end(job, last, status)

    @staticmethod
    def _hear(job: Job, message: dict[str, Any]) -> dict[str, Any]:
        """Handle a message from the process, and return it if it is the final message."""
        if "progress" in message:
            label, share = message["progress"]
            job.progress = (str(label), float(share))
            return {}
        if "so_far" in message:
            job.so_far = message["so_far"]
            return {}
        if "report" in message:
            job.reports += 1
            return {}
        return message


def _name(task: Task, asked: Mapping[str, Any]) -> str:
    return f"{task.name}-{task.stem(asked)}"


def _end(job: Job, last: Mapping[str, Any], status: int) -> None:
    """Set the final state and message of a job."""
    if "done" in last:
        job.result, job.state = last["done"], "done"
    elif "error" in last:
        job.message, job.state = str(last["error"]), "failed"
    elif job.is_unwanted or "canceled" in last:
        job.message, job.state = str(last.get("canceled", "")), "canceled"
    else:
        how = f"signal {signal.Signals(-status).name}" if status < 0 else f"status {status}"
        job.message, job.state = (
            f"the process ended with {how}, probably because it ran out of memory. Reduce the "
            f"number of cases, or "
            f"run 'bywire {job.task.command}' in a terminal",
            "failed",
        )
