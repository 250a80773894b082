"""The C compiler and its cache: damage, races, failures, and runs without a compiler."""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np
import pytest

from bywire.core import scratch
from bywire.core.errors import CompilerError
from bywire.simulation import compiler as compiler_module
from bywire.simulation import engine as engine_module
from bywire.simulation.compiler import (
    PLAIN,
    VECTOR,
    Compiler,
    compile_library,
    find_compiler,
    load_library,
)
from bywire.simulation.ensemble import simulate_ensemble
from bywire.simulation.run import simulate
from bywire.simulation.sensitivity import simulate_with_sensitivities
from raising import raises
from simulation.small_library import SOURCE, system_compiler, twice
from systems.two_mass import rig


class Counting:
    """Replacement for the start of the compiler, which counts the starts."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.starts, run = 0, subprocess.run

        def counted(*args: object, **kwargs: object) -> object:
            self.starts += 1
            return run(*args, **kwargs)  # type: ignore[call-overload]

        monkeypatch.setattr(compiler_module.subprocess, "run", counted)


def test_compiled_once(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compiler, counting = system_compiler(), Counting(monkeypatch)
    first = compile_library(SOURCE, PLAIN, compiler)
    assert twice(first) == 42.0
    assert first.parent == cache
    assert compile_library(SOURCE, PLAIN, compiler) == first
    assert counting.starts == 1
    assert compile_library(SOURCE, ("-O1",), compiler) != first
    assert compile_library(SOURCE + "\n", PLAIN, compiler) != first
    assert counting.starts == 3


@pytest.mark.parametrize("damage", ["truncated", "flipped", "no digest", "empty"])
def test_a_damaged_entry_is_compiled_again(
    damage: str, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiler = system_compiler()
    library = compile_library(SOURCE, PLAIN, compiler)
    content = library.read_bytes()
    if damage == "no digest":
        library.with_suffix(".sha256").unlink()
    else:
        # A new file, as a copy that failed would leave: the old one may be mapped.
        library.unlink()
        middle = len(content) // 2
        flipped = content[:middle] + bytes([content[middle] ^ 255]) + content[middle + 1 :]
        kinds = {"truncated": content[:middle], "flipped": flipped, "empty": b""}
        library.write_bytes(kinds[damage])
    counting = Counting(monkeypatch)
    again = compile_library(SOURCE, PLAIN, compiler)
    assert counting.starts == 1
    assert twice(again) == 42.0
    compile_library(SOURCE, PLAIN, compiler)
    assert counting.starts == 1
    assert not [p for p in cache.iterdir() if p.suffix not in (".so", ".sha256")]


RACE = """
import sys
from simulation.small_library import SOURCE, system_compiler, twice
from systems.two_mass import rig
from bywire.simulation.run import simulate
print(repr(float(simulate(rig(0.01), engine="compiled")["x_1"][-1])))
"""


def test_two_processes_at_once(cache: Path) -> None:
    """Two processes compile into an empty cache, and both and a third one get the kernel."""
    tests = str(Path(__file__).parents[1])
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([tests, *sys.path])}
    command = [sys.executable, "-W", "error", "-c", RACE]

    def start() -> subprocess.Popen[str]:
        return subprocess.Popen(
            command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    both = [start(), start()]
    done = [process.communicate(timeout=100) for process in both]
    assert [process.returncode for process in both] == [0, 0], done
    expected = repr(float(simulate(rig(0.01))["x_1"][-1]))
    assert [out.strip() for out, _ in done] == [expected] * 2
    assert len(list(cache.glob("*.so"))) == 1
    assert len(list(cache.iterdir())) == 2


def test_no_compiler_falls_back_with_one_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BYWIRE_CC", "none")
    monkeypatch.setattr(engine_module, "_PREPARED", {})
    find_compiler.cache_clear()
    engine_module._warn_once.cache_clear()
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            results = [simulate(rig(0.002 + 1e-3 * k, rare=bool(k))) for k in range(2)]
            quiet = simulate(rig(0.002), engine="virtual-machine")
            cases = simulate_ensemble(rig(0.002), {"m_1": [0.8, 1.6]}, ["x_1"])
        with pytest.raises(CompilerError, match=r"bywire\[compiler\]"):
            simulate_with_sensitivities(rig(0.002), ["m_1"], ["x_1"])
        assert [w.category for w in caught] == [UserWarning]
        assert "bywire[compiler]" in str(caught[0].message)
        assert {r.engine for r in [*results, quiet, cases]} == {"virtual machine (no C compiler)"}
    finally:
        monkeypatch.undo()
        find_compiler.cache_clear()
    compiled = simulate(rig(0.002))["x_1"]
    np.testing.assert_allclose(results[0]["x_1"], compiled, rtol=1e-9)
    np.testing.assert_allclose(cases["x_1"][0], compiled, rtol=1e-9)
    np.testing.assert_allclose(cases["x_1"][1], simulate(rig(0.002, m_1=1.6))["x_1"], rtol=1e-9)


def test_native_code_is_kept_apart_per_processor(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A cache folder for several machines must not return instructions that one lacks."""
    compiler, native = system_compiler(), (*PLAIN, "-march=native")
    plain, here = (compile_library(SOURCE, flags, compiler) for flags in (PLAIN, native))
    monkeypatch.setattr(compiler_module, "processor", lambda: "flags: another one")
    assert compile_library(SOURCE, native, compiler) != here
    assert compile_library(SOURCE, PLAIN, compiler) == plain


def script(path: Path, text: str) -> Path:
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


def test_a_compiler_that_fails(cache: Path, tmp_path: Path) -> None:
    """The error quotes the compiler's message, and the cache stays empty."""
    broken = script(tmp_path / "brokencc", "echo 'fatal: no space left' >&2; exit 1")
    with pytest.raises(CompilerError, match=r"(?s)rejected a generated kernel.*no space left"):
        compile_library(SOURCE, PLAIN, Compiler((str(broken),), "broken 1.0"))
    with pytest.raises(CompilerError, match=r"rejected a generated kernel"):
        compile_library("this is not C\n", PLAIN, system_compiler())
    with raises(CompilerError, name="gone 1.0"):
        compile_library(SOURCE, PLAIN, Compiler((str(tmp_path / "gone"),), "gone 1.0"))
    assert list(cache.iterdir()) == []


def test_a_compiler_that_writes_nothing(cache: Path, tmp_path: Path) -> None:
    """Exit status 0 without a library is a failure too."""
    idle = script(tmp_path / "idlecc", "exit 0")
    with pytest.raises(CompilerError):
        compile_library(SOURCE, PLAIN, Compiler((str(idle),), "idle 1.0"))


def test_a_compiler_that_hangs(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiler_module, "TIMEOUT", 0.2)
    slow = Compiler((str(script(tmp_path / "slowcc", "exec sleep 20")),), "slow 1.0")
    with raises(CompilerError, name="slow 1.0", valid="0.2 s") as caught:
        compile_library(SOURCE, PLAIN, slow)
    assert "BYWIRE_CC" in str(caught.value)
    assert list(cache.iterdir()) == []


def test_choosing_a_compiler(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    find_compiler.cache_clear()
    try:
        named = script(tmp_path / "mycc", "echo 'my compiler 7'")
        monkeypatch.setenv("BYWIRE_CC", str(named))
        monkeypatch.delenv("BYWIRE_CC_QUICK", raising=False)
        usual = find_compiler()
        assert usual == Compiler((str(named),), "my compiler 7")
        for flags in (PLAIN, VECTOR):
            assert flags[0] == "-O2"
            assert usual.flags(flags) == flags
        find_compiler.cache_clear()
        monkeypatch.setenv("BYWIRE_CC_QUICK", "1")
        quick = find_compiler()
        assert quick == Compiler((str(named),), "my compiler 7, quick", quick=True)
        assert "-Og" in quick.flags(VECTOR)
        assert "-O2" not in quick.flags(VECTOR)
        find_compiler.cache_clear()
        monkeypatch.setenv("BYWIRE_CC_QUICK", "")
        assert find_compiler() == usual
        monkeypatch.setenv("BYWIRE_CC_QUICK", "very")
        for command in (str(named), ""):  # also where compilers that do not work are passed over
            find_compiler.cache_clear()
            monkeypatch.setenv("BYWIRE_CC", command)
            with pytest.raises(CompilerError, match="BYWIRE_CC_QUICK = 'very' is not valid"):
                find_compiler()
        find_compiler.cache_clear()
        monkeypatch.delenv("BYWIRE_CC_QUICK")
        monkeypatch.setenv("BYWIRE_CC", str(tmp_path / "missing"))
        with pytest.raises(CompilerError, match="missing' is not a program"):
            find_compiler()
    finally:
        monkeypatch.undo()
        find_compiler.cache_clear()


def test_a_cache_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels then go to a private temporary folder."""
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    monkeypatch.setenv("BYWIRE_CACHE", str(blocked / "kernels"))
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path))
    monkeypatch.setattr(scratch, "_folder_of", scratch._folder_of.__wrapped__)  # forgets the other
    library = compile_library(SOURCE, PLAIN, system_compiler())
    assert twice(library) == 42.0
    assert library.parent.parent == tmp_path
    assert stat.S_IMODE(library.parent.stat().st_mode) == 0o700


@pytest.mark.parametrize("content", [b"garbage", b"\x7fELF", "halved", "without the function"])
def test_a_library_that_is_none_is_rebuilt_and_not_loaded(cache, monkeypatch, content):
    """The digest matches, but the system would crash when it loads half a library."""
    compiler = system_compiler()
    library = compile_library(SOURCE, PLAIN, compiler, "twice")
    whole = library.read_bytes()
    made = {"halved": whole[: len(whole) // 2]}.get(content, content)
    if content == "without the function":
        made = compile_library("int other;", PLAIN, compiler).read_bytes()
    library.unlink()
    library.write_bytes(made)
    compiler_module.digest_of(library).write_text(compiler_module.sha256(library))
    loaded, again = load_library(SOURCE, PLAIN, compiler, "twice")
    assert again == library
    assert loaded.twice
    assert twice(library) == 42.0


def test_a_full_disk_is_said_with_a_way_out(cache, monkeypatch):
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(compiler_module, "_compile", full)
    with pytest.raises(CompilerError, match=rf"{cache}.*No space left.*set BYWIRE_CACHE"):
        compile_library(SOURCE, PLAIN, system_compiler())


@pytest.mark.parametrize("is_before", [True, False])
def test_a_cache_deleted_while_it_is_used_costs_nothing(cache, monkeypatch, is_before):
    """Kernels are then compiled in the process's temporary folder."""
    compile_it, usable = compiler_module._compile, compiler_module.usable_folder

    def in_a_deleted_one(*args: object) -> None:
        if cache.exists():
            shutil.rmtree(cache)
        compile_it(*args)  # type: ignore[arg-type]

    def deleted() -> Path:
        folder = usable()
        shutil.rmtree(folder)
        return folder

    if is_before:
        monkeypatch.setattr(compiler_module, "usable_folder", deleted)
    else:
        monkeypatch.setattr(compiler_module, "_compile", in_a_deleted_one)
    library = compile_library(SOURCE, PLAIN, system_compiler())
    assert library.parent == scratch.process_folder()
    assert twice(library) == 42.0
