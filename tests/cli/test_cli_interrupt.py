"""Ctrl-C: status 130, no traceback, and finished results stay."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from command_line import LONG, SCRIPT, Outcome, no_half_files

import bywire as package
from bywire.api.overview import overview
from bywire.bench.running import run
from bywire.core.scratch import UNFINISHED
from bywire.simulation.virtual_machine import VirtualMachine
from bywire.usecases import use_cases

posix = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")


def interrupted(wait_for: Path, pause: float, *arguments: str | Path) -> Outcome:
    """Start a run without a compiler, and interrupt it a while after a file has appeared."""
    with subprocess.Popen(
        [str(SCRIPT), "run", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "BYWIRE_CC": "none"},
    ) as running:
        give_up = time.monotonic() + 30.0
        while not wait_for.exists() and time.monotonic() < give_up:
            time.sleep(0.02)
        time.sleep(pause)
        running.send_signal(signal.SIGINT)
        try:
            out, err = running.communicate(timeout=30)
        except subprocess.TimeoutExpired:
            running.kill()
            raise
        return Outcome(running.returncode, out, err)


@posix
@pytest.mark.parametrize("pause", [0.0, 1.5], ids=["while it is set up", "while it runs"])
def test_interrupt_ends_with_130(bench, tmp_path, pause):
    out = tmp_path / "out"
    outcome = interrupted(out, pause, bench(LONG), "--out", out, "--json")
    assert outcome.status == 130
    assert "Traceback" not in outcome.err
    assert "bywire: interrupted" in outcome.lines[-1]
    no_half_files(tmp_path)
    if outcome.out:
        assert outcome.object["status"] == "interrupted"
        assert outcome.object["kpis"] == {}
    for path in out.glob("*.nc"):
        assert package.read_recording(path).attrs["status"] == "interrupted"


class InterruptedMachine(VirtualMachine):
    """Virtual machine in which Ctrl-C arrives in a given chunk."""

    calls, last = 0, 3

    def advance(self, *arguments):
        """Run the chunk, or raise the interrupt in the middle of it."""
        type(self).calls += 1
        if self.calls > self.last:
            raise KeyboardInterrupt
        super().advance(*arguments)


@pytest.fixture
def machine(monkeypatch):
    """Replace the real machine with the interrupted one."""
    monkeypatch.setattr("bywire.simulation.engine._PREPARED", {})
    monkeypatch.setattr("bywire.simulation.engine.VirtualMachine", InterruptedMachine)
    monkeypatch.setattr("bywire.simulation.engine.find_compiler", lambda: None)
    monkeypatch.setattr("bywire.simulation.engine._warn_once", lambda: None)
    monkeypatch.setattr(InterruptedMachine, "calls", 0)
    return InterruptedMachine


def test_partial_recording_is_kept(bywire, bench, tmp_path, machine):
    out = tmp_path / "out"
    outcome = bywire("run", bench(LONG), "--out", out, "--json")
    assert outcome.status == 130
    (line,) = outcome.lines
    assert line.startswith("bywire: interrupted")
    assert str(out) in line
    assert outcome.object["status"] == "interrupted"
    assert sorted(p.name for p in out.iterdir()) == ["result.json", "without-dither.nc"]
    assert sorted(outcome.object["files"]) == sorted(map(str, out.iterdir()))
    assert json.loads((out / "result.json").read_text())["status"] == "interrupted"
    recording = package.read_recording(out / "without-dither.nc")
    assert recording.attrs["status"] == "interrupted"
    assert recording.sizes["time"] > 16
    assert "i_filtered" in recording
    no_half_files(tmp_path)


@pytest.mark.parametrize("last", [0, 1])
def test_interrupt_before_anything_is_recorded(bywire, bench, tmp_path, machine, monkeypatch, last):
    monkeypatch.setattr(machine, "last", last)
    text = LONG.replace("friction-ramp", "hard-braking").replace('slope = "0.005 A/s"', "")
    outcome = bywire("run", bench(text), "--out", tmp_path / "out")
    assert outcome.status == 130
    assert "Traceback" not in outcome.err
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["result.json"]


def test_finished_runs_are_kept_when_the_next_one_is_interrupted(machine, monkeypatch, bench):
    text = LONG.replace("0.005 A/s", "20 A/s").replace("10 ms", "1 ms")
    monkeypatch.setattr(machine, "last", 10**9)

    def stop_at_the_second(label: str, share: float) -> None:
        if label == "with-dither":
            raise KeyboardInterrupt

    result = run(package.load(bench(text)), stop_at_the_second)
    assert result.status == "interrupted"
    statuses = {label: run.attrs["status"] for label, run in result.recordings.items()}
    assert statuses.pop("without-dither") == "done"
    assert statuses in ({}, {"with-dither": "interrupted"})


def test_interrupt_while_the_results_are_written(bywire, bench, tmp_path, monkeypatch):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("bywire.report.drawing.save_figure", stopped)
    text = 'experiment = "seal-stribeck"\nparameters = "dardanelli2010"\n'
    outcome = bywire("run", bench(text), "--out", tmp_path / "out")
    assert outcome.status == 130
    unfinished, interrupted = outcome.lines
    assert f"{tmp_path / 'out'} is incomplete" in unfinished
    assert interrupted == "bywire: interrupted"
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"curve.nc", UNFINISHED}


def test_interrupt_before_there_is_a_result_leaves_no_folder(bywire, bench, tmp_path, monkeypatch):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setitem(vars(use_cases()["run"]), "function", stopped)
    assert bywire("run", bench(), "--out", tmp_path / "new" / "out").status == 130
    assert [p.name for p in tmp_path.iterdir()] == ["bench.toml"]
    (tmp_path / "there").mkdir()
    assert bywire("run", bench(), "--out", tmp_path / "there").status == 130
    assert (tmp_path / "there").exists()


def test_interrupt_while_the_operating_point_is_looked_for(bywire, bench, tmp_path, machine):
    """Some experiments compute before their first run."""
    text = LONG.replace("friction-ramp", "pressure-step").replace('slope = "0.005 A/s"', "")
    outcome = bywire("run", bench(text), "--out", tmp_path / "out", "--json")
    assert outcome.status == 130
    assert outcome.object["status"] == "interrupted"
    assert len(outcome.lines) == 1


@pytest.mark.parametrize(
    "error", [RuntimeError, SystemError, NotImplementedError, SystemExit, None]
)
def test_an_interrupt_that_a_library_turns_into_something_else(bywire, bench, monkeypatch, error):
    """CasADi converts the interrupt where it calls Python, or ignores it."""

    def turned(*_, **__):
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        if error is None:
            return overview()
        raise error("SWIG director method error")

    monkeypatch.setitem(vars(use_cases()["run"]), "function", turned)
    outcome = bywire("run", bench())
    assert outcome.status == 130
    assert outcome.lines == ["bywire: interrupted"]


@posix
def test_interrupt_while_the_command_is_loaded():
    """Ctrl-C comes within the first tenths of a second, while libraries are imported."""
    code = (
        "import sys\n"
        "from bywire.cli.main import main\n"
        "sys.argv = ['bywire', 'list']\n"
        "class Stop:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'typer': import signal; signal.raise_signal(signal.SIGINT)\n"
        "sys.meta_path.insert(0, Stop())\n"
        "main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "bywire: interrupted\n")


@posix
def test_interrupt_within_text_that_is_executed_ends_with_130_too(tmp_path):
    """During creation of a data class, Python later ends by the signal unless bywire resets it."""
    (tmp_path / "interrupted.py").write_text(
        "import sys, types\n"
        "import bywire.core.brake, bywire.core.callers, bywire.core.sources\n"
        "import bywire.report.wording\n"
        "from bywire.cli.main import main\n"
        "text = 'import signal; signal.raise_signal(signal.SIGINT)'\n"
        "app = types.SimpleNamespace(program=lambda: lambda words, **_: exec(text))\n"
        "sys.modules['bywire.cli.app'] = app\n"
        "main()"
    )
    done = subprocess.run(
        [sys.executable, "-m", "interrupted"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (130, "bywire: interrupted\n")


@posix
def test_interrupt_after_all_is_said_changes_nothing():
    """During Python's cleanup, the function registered first is called last."""
    code = (
        "import atexit, signal, sys\n"
        "atexit.register(signal.raise_signal, signal.SIGINT)\n"
        "from bywire.cli.main import main\n"
        "sys.argv = ['bywire', '--version']\n"
        "main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.strip()


_LATE = (
    "import atexit, os, sys\n"
    "class Late:\n"
    "    def __del__(self, abort=os.abort): abort()\n"
    "late = Late()\n"
    "from bywire.cli import main as room\n"
    "main, sys.argv = room.main, ['bywire', '--version']\n"
    "room.main = lambda: (atexit.register(print, 'tidy', sys.modules.get('dask', 1)), main())\n"
    "room."
)


@posix
@pytest.mark.parametrize(("entry", "status"), [("process", 0), ("main", -signal.SIGABRT)])
def test_nothing_of_a_library_runs_when_all_is_said_and_tidied_up(entry, status):
    """CPython aborts if a library's thread or object calls it during finalization.

    The registered exit functions still run.
    """
    code = f"{_LATE}{entry}()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == status
    if status == 0:
        assert done.stdout.splitlines()[-1] == "tidy None"  # see `core.libraries`


def test_interrupt_while_graphs_are_built_is_not_lost(
    bywire, bench, tmp_path, machine, monkeypatch
):
    """CasADi would swallow the interrupt, and the run would continue to its end."""
    from bywire.simulation.program import build_program

    def interrupted_build(*arguments):
        signal.raise_signal(signal.SIGINT)
        return build_program(*arguments)

    monkeypatch.setattr("bywire.simulation.program.build_program", interrupted_build)
    monkeypatch.setattr(machine, "last", 10**9)
    outcome = bywire("run", bench(), "--out", tmp_path / "out", "--json")
    assert outcome.status == 130
    assert outcome.object["files"] == [str(tmp_path / "out" / "result.json")]
