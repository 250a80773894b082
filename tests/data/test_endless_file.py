"""A file on which the library runs without an end: every road ends, and at once with Ctrl-C."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest

import bywire
from bywire.cli.main import main
from bywire.core.errors import FileError
from bywire.data import limited_source
from bywire.data.measurement import read_measurement, read_trace, trace_names

SECONDS = 0.25
PEDAL = """
experiment = "pedal-tracking"
parameters = "dardanelli2010"
[options]
trace = "{path}"
"""


@pytest.fixture(params=[".nc"])
def endless(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return an HDF5 file whose heap of texts says that an object in it has no size."""
    h5py = pytest.importorskip("h5py")
    path = tmp_path / f"a{request.param}"
    with h5py.File(path, "w") as file:
        for name, unit in {"time": "s", "p_mc": "Pa"}.items():
            made = file.create_dataset(name, data=np.arange(200.0))
            made.attrs["units"], made.attrs["long_name"] = unit, f"name of {name}"
    content = bytearray(path.read_bytes())
    content[content.find(b"GCOL") + 48] = 128
    path.write_bytes(content)
    return path


@pytest.mark.parametrize(
    ("endless", "read"),
    [
        (".h5", read_measurement),
        (".mat", read_measurement),
        (".nc", read_measurement),
        (".nc", read_trace),
        (".nc", trace_names),
        (".nc", bywire.read_recording),
    ],
    indirect=["endless"],
)
def test_every_reader_ends(
    endless: Path, monkeypatch: pytest.MonkeyPatch, read: Callable[[Path], object]
) -> None:
    monkeypatch.setattr(limited_source, "SECONDS", SECONDS)
    started = time.monotonic()
    said = r"no progress for 0\.25 s"
    with pytest.raises(FileError, match=said):
        read(endless)
    assert time.monotonic() - started < 10.0


COMMANDS = {
    "convert": ["convert", "{path}", "{folder}/b.csv"],
    "replay": ["replay", "{path}", "--bench", "hard-braking"],
    "identify": ["identify", "friction-model", "{path}"],
    "run": ["run", "{bench}"],
}


@pytest.fixture
def words(endless: Path, tmp_path: Path) -> Callable[[str], list[str]]:
    """Return a function that gives what a command is asked with the file."""
    bench = tmp_path / "bench.toml"
    bench.write_text(PEDAL.format(path=endless))
    names = {"path": endless, "folder": tmp_path, "bench": bench}
    return lambda command: [word.format(**names) for word in COMMANDS[command]]


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize("command", COMMANDS)
def test_ctrl_c_ends_every_command_at_once(
    words: Callable[[str], list[str]],
    tmp_path: Path,
    command: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    children, within = [], limited_source.Child.within

    def interrupted(child: limited_source.Child, seconds: float) -> AbstractContextManager[None]:
        main_thread = threading.main_thread().ident
        assert main_thread is not None
        if not children:
            threading.Timer(0.3, signal.pthread_kill, (main_thread, signal.SIGINT)).start()
        children.append(child)
        return within(child, seconds)

    monkeypatch.setattr(limited_source.Child, "within", interrupted)
    monkeypatch.setattr(sys, "argv", ["bywire", *words(command)])
    started = time.monotonic()
    with pytest.raises(SystemExit) as ended:
        main()
    assert (ended.value.code, capsys.readouterr().err) == (130, "bywire: interrupted\n")
    assert time.monotonic() - started < 3.0
    assert not (tmp_path / "b.csv").exists()
    assert all(child._process.poll() is not None for child in children)


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_ctrl_c_ends_a_process_and_those_that_it_started(
    words: Callable[[str], list[str]], tmp_path: Path
) -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "bywire.cli", *words("convert")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        wait_for_reader(process)
        process.send_signal(signal.SIGINT)
        started = time.monotonic()
        _, said = process.communicate(timeout=30)
    assert (process.returncode, said) == (130, "bywire: interrupted\n")
    assert time.monotonic() - started < 3.0
    assert not (tmp_path / "b.csv").exists()
    assert not readers(process.pid)


def readers(parent: int) -> list[int]:
    """Return the processes that were started by another, and the ones that these forked."""
    text = subprocess.run(["ps", "-eo", "pid,ppid"], capture_output=True, text=True, check=True)
    pairs = [tuple(map(int, line.split())) for line in text.stdout.splitlines()[1:]]
    children = [pid for pid, above in pairs if above == parent]
    return [*children, *(each for child in children for each in readers(child))]


def wait_for_reader(process: subprocess.Popen[str]) -> None:
    """Wait until a process has a child that has forked one to read a file, and a bit."""
    give_up = time.monotonic() + 60.0
    while len(readers(process.pid)) < 2 and process.poll() is None:
        assert time.monotonic() < give_up
        time.sleep(0.05)
    time.sleep(0.3)
