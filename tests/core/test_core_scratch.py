"""Complete files or none, and no leftovers of killed processes."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bywire.core import scratch
from bywire.core.scratch import made_folder, process_folder, replacing, scratch_folder

posix = pytest.mark.skipif(sys.platform == "win32", reason="locks of POSIX")


def test_a_file_is_replaced_when_it_is_whole(tmp_path):
    target = tmp_path / "result.json"
    target.write_text("old")
    with replacing(target) as fresh:
        fresh.write_text("new")
        assert fresh.name == target.name
        assert target.read_text() == "old"
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


def test_a_file_that_fails_leaves_the_old_one(tmp_path):
    target = tmp_path / "result.json"
    target.write_text("old")

    def interrupted() -> None:
        with replacing(target) as fresh:
            fresh.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


WORK = """
import sys, time
from pathlib import Path
from bywire.core.scratch import process_folder, replacing
with replacing(Path(sys.argv[1]) / "run.nc") as fresh:
    fresh.write_text("half")
    (process_folder() / "large").write_text("large")
    print("working", flush=True)
    time.sleep(60.0)
"""


@posix
def test_what_a_killed_process_leaves_goes_with_the_next(tmp_path, monkeypatch):
    results, temporary = tmp_path / "results", tmp_path / "temporary"
    results.mkdir()
    temporary.mkdir()
    environment = {**os.environ, "TMPDIR": str(temporary)}
    started = subprocess.Popen(
        [sys.executable, "-c", WORK, str(results)], stdout=subprocess.PIPE, env=environment
    )
    with started:
        assert started.stdout is not None
        started.stdout.readline()
        (alive,) = results.iterdir()
        with replacing(results / "other.nc") as fresh:
            fresh.write_text("whole")
        assert alive in results.iterdir()  # its process still works
        started.send_signal(signal.SIGKILL)
        started.wait()
    assert len(list(temporary.iterdir())) == 1
    with replacing(results / "other.nc") as fresh:
        fresh.write_text("whole again")
    assert [p.name for p in results.iterdir()] == ["other.nc"]
    monkeypatch.setattr(scratch.tempfile, "gettempdir", lambda: str(temporary))
    own = scratch._folder_of.__wrapped__(os.getpid())
    assert list(temporary.iterdir()) == [own]


def test_a_process_has_a_folder_that_goes_with_it():
    command = "from bywire.core.scratch import process_folder as f; assert f() == f(); print(f())"
    done = subprocess.run(
        [sys.executable, "-c", command], capture_output=True, text=True, check=True
    )
    assert Path(done.stdout.strip()).name.startswith(scratch.PREFIX)
    assert not Path(done.stdout.strip()).exists()
    assert process_folder().stat().st_mode & 0o777 == 0o700


def test_without_locks_only_what_is_old_goes(tmp_path, monkeypatch):
    def missing(*_: object) -> None:
        raise OSError("no locks here")

    monkeypatch.setattr(scratch, "_lock", missing)
    young, old = tmp_path / f"{scratch.PREFIX}young", tmp_path / f"{scratch.PREFIX}old"
    for each in (young, old):
        each.mkdir()
    os.utime(old, (time.time() - 2 * 86400.0,) * 2)
    with scratch_folder(tmp_path):
        assert young.exists()
    assert list(tmp_path.iterdir()) == [young]


def test_a_folder_that_goes_while_others_are_listed_is_no_trouble(tmp_path, monkeypatch):
    """Two processes that compile side by side: one ends between the other's two looks."""
    left = tmp_path / f"{scratch.PREFIX}gone"
    left.mkdir()
    seen = Path.stat

    def gone(path, **how):
        if path == left:
            with contextlib.suppress(OSError):
                os.rmdir(left)
        return seen(path, **how)

    monkeypatch.setattr(Path, "stat", gone)
    with scratch_folder(tmp_path) as folder:
        assert folder.is_dir()
    assert not os.path.lexists(left)


def test_a_folder_that_stays_empty_goes_with_the_parents_that_were_made(tmp_path):
    (tmp_path / "kept").mkdir()
    with pytest.raises(KeyError), made_folder(tmp_path / "kept" / "a" / "b"):
        raise KeyError
    assert list(tmp_path.rglob("*")) == [tmp_path / "kept"]
    with made_folder(tmp_path / "kept" / "a" / "b"):
        (tmp_path / "kept" / "a" / "result").write_text("x")
    assert [path.name for path in (tmp_path / "kept" / "a").iterdir()] == ["result"]
    with made_folder(tmp_path / "kept"):  # was there
        pass
    with pytest.raises(OSError, match="cannot contain a null character"), made_folder(Path("a\0b")):
        pass
