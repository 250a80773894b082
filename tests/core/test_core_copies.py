"""Copies of a process: only where nothing of it would be missing in them, and deaf to Ctrl-C."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from multiprocessing import active_children
from pathlib import Path

import pytest

from bywire.core.callers import command_line
from bywire.core.copies import may_copy, processes

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="of Linux alone")


def test_a_command_may_be_copied_while_it_runs_no_threads_and_a_program_never(monkeypatch):
    monkeypatch.setattr(threading, "active_count", lambda: 1)  # the tests' own threads
    assert not may_copy()
    with command_line():
        assert may_copy()
        monkeypatch.undo()
        done = threading.Event()
        thread = threading.Thread(target=done.wait)
        thread.start()
        assert not may_copy()
        done.set()
        thread.join()


def test_copies_do_not_hear_an_interrupt_that_their_maker_hears():
    """They know what it knows, and end with the block, whatever they are at."""
    heard: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: heard.append(number))
    _told.append("by their maker")
    try:
        with processes(1, _told.append, "at first", is_copied=True) as pool:
            (copy,) = active_children()
            os.kill(copy.pid, signal.SIGINT)
            assert pool.submit(_known).result() == ["by their maker", "at first"]
            os.kill(os.getpid(), signal.SIGINT)
            pool.submit(time.sleep, 60.0)
            begin = time.monotonic()
    finally:
        signal.signal(signal.SIGINT, before)
        _told.clear()
    assert time.monotonic() - begin < 10.0
    assert copy.exitcode == -signal.SIGTERM
    assert heard == [signal.SIGINT]


def test_copies_end_when_their_maker_is_killed(tmp_path):
    code = """
import os, signal, sys, time
from bywire.core.copies import processes
with processes(2, list, is_copied=True) as pool:
    for each in pool.map(time.sleep, [0.1, 0.1]): pass
    from multiprocessing import active_children
    print(*[each.pid for each in active_children()], flush=True)
    pool.submit(time.sleep, 60.0)
    os.kill(os.getpid(), signal.SIGKILL)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == -signal.SIGKILL
    copies = [int(text) for text in done.stdout.split()]
    assert len(copies) == 2
    until = time.monotonic() + 10.0
    while any(map(_is_there, copies)) and time.monotonic() < until:
        time.sleep(0.02)
    assert not any(map(_is_there, copies))


def test_a_copy_that_is_killed_within_its_answer_keeps_nobody_waiting():
    """The pool waits for the rest of the answer then, and the other copy for its turn."""
    code = """
import os, signal, sys, time
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import Connection
from bywire.core.copies import processes

send = Connection._send

def cut(self, answer, *more):
    if len(answer) > 100_000:
        os.write(self.fileno(), bytes(answer[:1000]))
        os.kill(os.getpid(), signal.SIGKILL)
    send(self, answer, *more)

Connection._send = cut
with processes(2, list, is_copied=True) as pool:
    cut_short, other = pool.submit(bytes, 1_000_000), pool.submit(time.sleep, 0.2)
    for each in (cut_short, other):
        try:
            each.result()
        except BrokenProcessPool:
            print("broken")
with processes(2, list, is_copied=True) as pool:
    print(pool.submit(len, "as ever").result())
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.stdout, done.stderr) == ("broken\nbroken\n7\n", "")


_told: list[str] = []


def _known() -> list[str]:
    return list(_told)


def _is_there(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def test_a_program_without_a_guard_is_not_run_again_in_processes_that_load_anew(tmp_path):
    """It is what a notebook's cell becomes when it is saved; each process would start more."""
    program = tmp_path / "program.py"
    program.write_text(
        "from bywire.core.copies import processes\n"
        "print('begun')\n"
        "with processes(2, list, is_copied=False) as pool:\n"
        "    print(sum(pool.map(abs, [-1, -2])))\n"
    )
    done = subprocess.run([sys.executable, program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "begun\n3\n", "")
