"""No compiler, a broken one, and a damaged cache of kernels."""

from __future__ import annotations

import stat
import sys
from pathlib import Path

import pytest
from command_line import BRAKING, QUICK, refused

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="shell scripts as compilers")


def program(path: Path, text: str) -> str:
    """Write an executable script and return its path."""
    path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path)


def test_without_a_compiler_the_run_warns_once_and_agrees(process, bench):
    path = bench()
    slow = process("run", path, "--json", BYWIRE_CC="none")
    assert slow.status == 0
    assert len(slow.lines) == 1
    assert slow.err.startswith("bywire: warning: no C compiler")
    assert "bywire[compiler]" in slow.err
    fast = process("run", path, "--json")
    for name, kpi in fast.object["kpis"].items():
        expected = kpi["value"] if kpi["value"] is None else pytest.approx(kpi["value"], rel=1e-6)
        assert slow.object["kpis"][name]["value"] == expected


def test_two_runs_without_a_compiler_warn_once(process, bench):
    text = 'experiment = "friction-ramp"\nparameters = "dardanelli2010"\n[options]\n'
    path = bench(text + 'i_max = "0.1 A"\nslope = "2 A/s"\n')
    outcome = process("run", path, BYWIRE_CC="none")
    assert outcome.status == 0
    assert outcome.err.count("no C compiler") == 1


def test_broken_compiler_is_3_with_one_message(process, bench, tmp_path):
    cache = str(tmp_path / "cache")
    outcome = process("run", bench(), "--json", BYWIRE_CC="/bin/false", BYWIRE_CACHE=cache)
    assert (outcome.status, outcome.out) == (3, "")
    assert outcome.lines[0].endswith("refused a generated kernel:") or len(outcome.lines) == 1
    assert len(outcome.lines) <= 3
    assert "set BYWIRE_CC to another C compiler" in outcome.lines[-1]
    assert not list(Path(cache).glob("*.so"))


def test_compiler_that_complains_is_quoted(process, bench, tmp_path):
    script = 'case "$*" in *--version*) echo "cc 1.0";; *) echo "no such flag" >&2; exit 1;; esac'
    cc = program(tmp_path / "cc", script)
    outcome = process("run", bench(), BYWIRE_CC=cc, BYWIRE_CACHE=str(tmp_path / "cache"))
    assert (outcome.status, outcome.out) == (3, "")
    assert "cc 1.0 refused a generated kernel:\nno such flag" in outcome.err
    assert "Traceback" not in outcome.err


def test_compiler_that_is_not_there(process, bench):
    outcome = process("run", bench(), BYWIRE_CC="no-such-compiler")
    refused(outcome, "BYWIRE_CC = 'no-such-compiler' names no program", status=3)


def test_cache_that_is_a_file_is_no_obstacle(process, bench, tmp_path):
    taken = tmp_path / "taken"
    taken.write_text("mine", encoding="utf-8")
    environment = {"BYWIRE_CACHE": str(taken), "TMPDIR": str(tmp_path)}
    assert process("run", bench(), **environment).status == 0
    assert taken.read_text(encoding="utf-8") == "mine"


def damaged(path: Path) -> None:
    """Cut a file in half."""
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])


@pytest.mark.parametrize("suffix", [".so", ".sha256"])
def test_damaged_cache_is_compiled_anew(process, bench, tmp_path, suffix):
    cache = tmp_path / "cache"
    path = bench(BRAKING + QUICK)
    first = process("run", path, "--json", BYWIRE_CACHE=str(cache))
    (victim,) = cache.glob(f"*{suffix}")
    damaged(victim)
    second = process("run", path, "--json", BYWIRE_CACHE=str(cache))
    assert (second.status, second.err) == (0, "")
    assert second.object == first.object
    kept = {p.suffix for p in cache.iterdir()} - {".json"}  # what a later command may take
    assert kept == {".sha256", ".so"}
