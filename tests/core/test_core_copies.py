"""Copies of a process: only where nothing of it would be missing in them, and deaf to Ctrl-C."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time

import pytest

from bywire.core.callers import command_line
from bywire.core.copies import deaf_to_interrupts, may_copy

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


def test_a_copy_does_not_hear_an_interrupt_and_its_maker_hears_it_later():
    heard: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: heard.append(number))
    try:
        with deaf_to_interrupts():
            copy = os.fork()
            if not copy:
                time.sleep(0.3)
                os._exit(7)
            os.kill(copy, signal.SIGINT)
            os.kill(os.getpid(), signal.SIGINT)
            assert not heard
        assert heard == [signal.SIGINT]
        assert os.waitstatus_to_exitcode(os.waitpid(copy, 0)[1]) == 7
    finally:
        signal.signal(signal.SIGINT, before)
