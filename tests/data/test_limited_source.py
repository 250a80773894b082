"""Files that a child process reads: whatever it does, one error says it, and no child stays."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from measurement_files import NEEDS, file_of, measurement
from misbehaving_format import FORMAT

from bywire.core.errors import FileError, UnitError
from bywire.core.typing import silent
from bywire.data import limited_source
from bywire.data.limited_source import limited
from bywire.data.measurement import read_measurement


@pytest.fixture
def read(tmp_path):
    """Return a function that reads a file by a reader that misbehaves as it says."""
    path = tmp_path / "a.odd"

    def run(wish, seconds=20.0, progress=silent):
        path.write_text(wish)
        with limited(path, FORMAT, seconds) as source:
            return source.read(["y", "t"], progress)

    return run


@pytest.mark.parametrize("when", ["early", "late"])
@pytest.mark.parametrize(
    ("wish", "text"),
    [
        ("crash", r"a\.odd: the library that reads an odd file failed"),
        ("abort", "is damaged, or needs more than.* GiB"),
        ("killed", r"\(SIGKILL\)"),
        ("memory", "needs more than .*GiB of memory to read.*fewer signals"),
        (
            "raise",
            r"a\.odd is damaged: .* as an odd file .*\(its parts are inconsistent\)",
        ),
        ("refuse", "refused"),
    ],
)
def test_every_way_to_fail_is_one_error_and_the_next_file_is_read(read, when, wish, text):
    read("")
    (child,) = limited_source._idle[os.getpid(), "misbehaving_format"]
    with pytest.raises(FileError, match=text):
        read(f"{when} {wish}")
    numbers = read("late print")
    np.testing.assert_array_equal(numbers["y"], np.arange(1000.0))
    assert limited_source._idle[os.getpid(), "misbehaving_format"] == [child]  # it forked for each


@pytest.mark.skipif(sys.platform != "linux", reason="children fork on Linux alone")
@pytest.mark.parametrize("name", ["netcdf", *NEEDS])
def test_a_child_that_forks_has_a_single_thread(tmp_path, monkeypatch, name):
    """A lock that another thread holds would stay locked in what is forked."""
    pytest.importorskip(NEEDS.get(name, "netCDF4"))
    monkeypatch.setattr(limited_source, "_idle", {})
    read_measurement(file_of(tmp_path, name))
    ((child,),) = limited_source._idle.values()
    assert len(os.listdir(f"/proc/{child._process.pid}/task")) == 1
    child.close()


@pytest.mark.parametrize("when", ["early", "late"])
@pytest.mark.parametrize("wish", ["hang", "spin"])
def test_a_reader_without_an_end_is_ended(read, when, wish):
    started = time.monotonic()
    with pytest.raises(FileError, match=r"no progress for 1 s.* local disk"):
        read(f"{when} {wish}", seconds=1.0)
    assert time.monotonic() - started < 10.0
    assert read("")["t"].size == 1000


def test_numbers_that_do_not_come_are_missed(read):
    with pytest.raises(FileError, match="'y' declares 1000 numbers, but 500 were read"):
        read("late cut")


def test_memory_is_counted_from_what_the_library_takes_itself(read, monkeypatch):
    monkeypatch.setattr(limited_source, "MOST_MEMORY", 2**24)
    assert read("")["y"].size == 1000
    with pytest.raises(FileError, match=r"needs more than 0.0156 GiB of memory"):
        read("late memory")


def test_what_a_reader_writes_is_limited_and_goes_with_it(read, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(limited_source, "MOST_MEMORY", 2**24)
    with pytest.raises(FileError, match=r"damaged: .* as an odd file .*File too large"):
        read("early large")


def test_other_systems_get_a_time_limit_and_a_warning(read, monkeypatch, tmp_path):
    monkeypatch.setattr(limited_source, "_IS_LINUX", False)
    monkeypatch.setattr(limited_source, "_idle", {})
    with pytest.warns(UserWarning, match="limits only the time to read an odd file"):
        assert read("")["y"].size == 1000
    for wish, text in {"crash": r"\(SIGSEGV\)", "hang": "no progress for 1 s"}.items():
        with pytest.warns(UserWarning, match="not the mem"), pytest.raises(FileError, match=text):
            read(f"late {wish}", seconds=1.0 if wish == "hang" else 20.0)
    assert not any(limited_source._idle.values())  # one for each file


def test_progress_goes_on_to_the_end(read):
    shares = []
    read("", progress=lambda label, share: shares.append(share))
    assert len(shares) == 8
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_a_progress_that_stops_ends_the_child(read):
    def stop(label, share):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        read("", progress=stop)
    assert not limited_source._idle[os.getpid(), "misbehaving_format"]
    assert read("")["y"].size == 1000


def test_an_error_of_the_user_keeps_the_child(tmp_path):
    path = file_of(tmp_path, "netcdf")
    key = (os.getpid(), "bywire.data.formats.netcdf")
    read_measurement(path)
    before = list(limited_source._idle[key])
    with pytest.raises(UnitError):
        read_measurement(path, {"signals": {"p_mc": {"unit": "mm"}}})
    assert limited_source._idle[key] == before
    assert read_measurement(path)["p_mc"].size == measurement()["p_mc"].size


def test_a_library_beside_the_file_is_not_loaded(tmp_path, monkeypatch):
    path = file_of(tmp_path, "netcdf")
    for name in ("netCDF4", "numpy", "json"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('loaded')")
    monkeypatch.chdir(tmp_path)
    limited_source._close_all()
    assert read_measurement(path.name)["p_mc"].size == 400


SCRIPT = """
import sys, time
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from misbehaving_format import FORMAT
from bywire.data.limited_source import limited
with limited(Path(sys.argv[1]), FORMAT) as source:
    print(source._child._process.pid, flush=True)
    source.read(["y"], lambda label, share: None)
"""


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_the_child_ends_with_ctrl_c(tmp_path):
    path, here = tmp_path / "a.odd", os.path.dirname(__file__)
    path.write_text("late spin")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    with subprocess.Popen(
        [sys.executable, "-c", SCRIPT, str(path), here],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=environment,
    ) as parent:
        group = int(parent.stdout.readline())
        time.sleep(0.3)
        os.killpg(group, 0)  # it runs, with the one that it forked
        parent.send_signal(signal.SIGINT)
        parent.wait(20)
    give_up = time.monotonic() + 10.0  # until the system has collected the one that was forked
    while runs(group):
        assert time.monotonic() < give_up
        time.sleep(0.02)


def runs(group):
    """Return whether a process of a group is there."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True
