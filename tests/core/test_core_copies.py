"""Copies of a process, which must have a single thread; the copies ignore Ctrl-C."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from multiprocessing import active_children
from pathlib import Path

import pytest

from bywire.core.copies import processes
from bywire.core.libraries import VARIABLES

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="of Linux alone")


def test_a_command_may_be_copied_while_it_has_one_thread_and_a_program_never():
    """The system counts the threads, because Python does not know those of libraries."""
    lines = """
import _thread, threading, time
from bywire.core.callers import command_line
from bywire.core.copies import may_copy
print(may_copy())
with command_line():
    print(may_copy())
    done = threading.Event()
    thread = threading.Thread(target=done.wait)
    thread.start()
    print(may_copy())
    done.set()
    thread.join()
    print(may_copy())
    _thread.start_new_thread(time.sleep, (60.0,))  # which threading does not count
    print(may_copy())
"""
    done = subprocess.run([sys.executable, "-c", lines], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True", "False", "True", "False"]


STUDY = """
bench = "hard-braking"
[set]
"options.duration" = "40 ms"
"options.settle" = "10 ms"
[vary]
"motor.R_m" = "+-4 %"
"motor.K_e" = "+-5 %"
[design]
cases = 128
[requirements]
peak_current = "<= 25 A"
"""
AUDITED = """
import os, sys
def count(event, args):
    if event == "os.fork":
        print("copied with", len(os.listdir("/proc/self/task")), "threads", file=sys.stderr)
sys.addaudithook(count)
from bywire.cli.main import process
process()
"""


def test_a_command_is_copied_with_a_single_thread(tmp_path):
    """For cases and for figures, whatever it has loaded: NumPy, pandas and pyarrow start threads.

    Python 3.12 and newer warn of copies of a process with threads.
    """
    pytest.importorskip("pyarrow")
    study = tmp_path / "study.toml"
    study.write_text(STUDY)
    done = subprocess.run(
        [
            sys.executable,
            "-W",
            "always",
            "-c",
            AUDITED,
            "study",
            "run",
            study,
            "--workers",
            "2",
            "--out",
            tmp_path / "out",
        ],
        env={k: v for k, v in os.environ.items() if k not in VARIABLES},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    copied = [line for line in done.stderr.splitlines() if line.startswith("copied with")]
    assert len(copied) >= (4 if (os.cpu_count() or 1) > 1 else 2)  # cases, figures
    assert set(copied) == {"copied with 1 threads"}
    assert "fork" not in done.stderr


# A process of tests has threads; commands that are copied have none.
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_copies_do_not_hear_an_interrupt_that_their_maker_hears():
    """They have the same data as the process, and end with the block even if they are busy."""
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
    assert copy.exitcode == -signal.SIGKILL
    assert heard == [signal.SIGINT]


LOADING = """
import os, signal, sys
from bywire.core.copies import processes

class Slow:
    def __reduce__(self):
        import time
        return time.sleep, (60.0,)

with processes(2, print, Slow(), is_copied=False) as pool:
    from multiprocessing import active_children
    print(*[each.pid for each in active_children()], flush=True)
    if sys.argv[1] == "loaded":
        import time
        time.sleep(3.0)
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize("when", ["starting", "loaded"])
def test_processes_that_still_load_end_when_their_maker_is_killed(when):
    """In silence: Python's own process that tidies up behind them has nothing to complain of."""
    done = subprocess.run(
        [sys.executable, "-c", LOADING, when],
        capture_output=True,
        text=True,
        check=False,
        timeout=50,
    )
    begun = [int(text) for text in done.stdout.split()]
    assert len(begun) == 2
    assert not any(map(_is_there, begun))  # they held the pipes until they ended
    assert done.stderr == ""


@pytest.mark.parametrize("name", ["multiprocessing", "pickle", "signal", "numpy"])
def test_no_module_of_the_working_folder_runs_in_a_new_process(tmp_path, name):
    (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'planted')!r}, 'w')\n")
    program = tmp_path / "elsewhere" / "program.py"
    program.parent.mkdir()
    program.write_text(
        "from bywire.core.copies import processes\n"
        "with processes(1, list, is_copied=False) as pool:\n"
        "    print(pool.submit(abs, -1).result())\n"
    )
    done = subprocess.run(
        [sys.executable, program], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.stderr) == ("1\n", "")
    assert not (tmp_path / "planted").exists()


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

close = Connection._close

def slowly(self, *more):
    close(self, *more)
    time.sleep(0.05)

Connection._send = cut
Connection._close = slowly  # who watches the pool closes its pipe, and who ends it may not again
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
