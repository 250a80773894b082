"""Missing compiler, broken compiler, and damaged kernel cache."""

from __future__ import annotations

import shutil
import stat
import sys
from pathlib import Path

import pytest
from command_line import BRAKING, QUICK, refused

from bywire.simulation import engine
from bywire.simulation.compiler import find_compiler

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="shell scripts as compilers")


def program(path: Path, text: str) -> str:
    """Write an executable script and return its path."""
    path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path)


@pytest.fixture
def anew(bywire, monkeypatch):
    """Return a function that calls ``bywire`` without cached kernels or a known compiler."""

    def call(*arguments, **environment):
        monkeypatch.setattr(engine, "_PREPARED", {})
        monkeypatch.delenv("BYWIRE_CC_QUICK", raising=False)  # a compiler's label states it
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        find_compiler.cache_clear()
        return bywire(*arguments)

    yield call
    find_compiler.cache_clear()


def test_two_runs_without_a_compiler_warn_once_and_agree(process, bywire, bench):
    text = 'experiment = "friction-ramp"\nparameters = "dardanelli2010"\n[options]\n'
    path = bench(text + 'i_max = "0.1 A"\nslope = "2 A/s"\n')
    slow = process("run", path, "--json", "--no-error-estimate", BYWIRE_CC="none")
    assert slow.status == 0
    assert len(slow.lines) == 1
    assert slow.err.startswith("bywire: warning: no C compiler")
    assert "bywire[compiler]" in slow.err
    fast = bywire("run", path, "--json", "--no-error-estimate")
    for name, kpi in fast.object["kpis"].items():
        expected = kpi["value"] if kpi["value"] is None else pytest.approx(kpi["value"], rel=1e-6)
        assert slow.object["kpis"][name]["value"] == expected


def test_broken_compiler_is_3_with_one_message(anew, bench, tmp_path):
    cache = str(tmp_path / "cache")
    outcome = anew("run", bench(), "--json", BYWIRE_CC="/bin/false", BYWIRE_CACHE=cache)
    assert (outcome.status, outcome.out) == (3, "")
    assert outcome.lines[0].endswith("rejected a generated kernel:") or len(outcome.lines) == 1
    assert len(outcome.lines) <= 3
    assert "BYWIRE_CC" in outcome.lines[-1]
    assert not list(Path(cache).glob("*.so"))


def test_compiler_that_complains_is_quoted(anew, bench, tmp_path):
    script = 'case "$*" in *--version*) echo "cc 1.0";; *) echo "no such flag" >&2; exit 1;; esac'
    cc = program(tmp_path / "cc", script)
    outcome = anew("run", bench(), BYWIRE_CC=cc, BYWIRE_CACHE=str(tmp_path / "cache"))
    assert (outcome.status, outcome.out) == (3, "")
    assert "cc 1.0 rejected a generated kernel:\nno such flag" in outcome.err
    assert "Traceback" not in outcome.err


def test_compiler_that_is_not_there(anew, bench):
    outcome = anew("run", bench(), BYWIRE_CC="no-such-compiler")
    refused(outcome, "BYWIRE_CC = 'no-such-compiler' is not a program", status=3)


def test_cache_that_is_a_file_is_no_obstacle(anew, bench, tmp_path):
    taken = tmp_path / "taken"
    taken.write_text("mine", encoding="utf-8")
    assert anew("run", bench(), BYWIRE_CACHE=str(taken)).status == 0
    assert taken.read_text(encoding="utf-8") == "mine"


def damaged(path: Path) -> None:
    """Cut a file in half."""
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])


def test_damaged_cache_is_compiled_anew(anew, process, bench, tmp_path):
    made, cache = tmp_path / "made", tmp_path / "cache"
    command = ("run", bench(BRAKING + QUICK), "--json", "--no-error-estimate")
    first = anew(*command, BYWIRE_CACHE=str(made))
    shutil.copytree(made, cache)  # a module loaded here would not be loaded again
    for suffix, call in ((".so", process), (".sha256", anew)):
        (victim,) = cache.glob(f"*{suffix}")
        damaged(victim)
        again = call(*command, BYWIRE_CACHE=str(cache))
        assert (again.status, again.err) == (0, "")
        assert again.object == first.object
        kept = {p.suffix for p in cache.iterdir()} - {".json"}  # for later commands
        assert kept == {".sha256", ".so"}
