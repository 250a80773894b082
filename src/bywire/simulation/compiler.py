"""The C compiler: found once, run on generated source, results cached by content."""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import os
import platform
import subprocess
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from bywire.core.child_process import find_program, module_command, run_program
from bywire.core.errors import CompilerError
from bywire.core.scratch import process_folder, scratch_folder
from bywire.simulation.kernel_cache import digest_of, is_intact, load, sha256, usable_folder

# Kernels compare and select all the time: without these, maxima become branches. A compiler that
# fuses a product and a sum where it sees fit rounds a case in lanes otherwise than alone, and on
# another processor otherwise again: 1 % of the time in lanes is not worth that.
KERNEL_MATH = (
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-signed-zeros",
    "-ffinite-math-only",
    "-ffp-contract=off",
)
_STRICT = ("-Werror=implicit-function-declaration",)
_COMMON = ("-shared", "-fPIC", "-std=c11", *KERNEL_MATH, *_STRICT)
# Packing a few scalars costs more than it saves. So does computing both sides of a choice that goes
# the same way for thousands of substeps: with branches a run is a seventh quicker.
_BRANCHES = ("-fno-if-conversion", "-fno-if-conversion2", "-mtune=native")
# Values that are shared across a kernel's branches are shared already: looking for more takes an
# eighth of the compiler's time, and registers.
_SHARED = ("-fno-tree-pre", "-fno-gcse")
PLAIN = ("-O2", "-fno-tree-vectorize", *_BRANCHES, *_SHARED)
_X86 = platform.machine().lower() in ("x86_64", "amd64")
_HERE = ("-march=native",)
_WIDE = (*_HERE, *(("-mprefer-vector-width=512",) if _X86 else ()))
_SCHEDULED = ("-fschedule-insns", "-fsched-pressure")  # a tenth quicker
# Of this processor a single run takes no vectors, but more registers, and instructions that keep
# both operands. Only with these does scheduling pay here.
SINGLE = (*PLAIN, *_HERE, *_SCHEDULED)
VECTOR = ("-O2", "-fopenmp-simd", *_WIDE, *_SCHEDULED)
# Two vectors that take turns stand in the order in which they hide each other's waiting: scheduled
# before registers are given out, they take 6 % longer.
IN_TURN = ("-O2", "-fopenmp-simd", *_WIDE)
# Half the time of -O2, and kernels as quick as by -O1. What is rare in them is told to leave it.
_QUICK = ("-Og", "-fira-region=one", "-DQUICK")
_GCC_ONLY = frozenset({*_BRANCHES, *_SHARED, *_SCHEDULED, "-fira-region=one"})
TIMEOUT = 300.0
_OTHERWISE = (
    "set BYWIRE_CC to another C compiler, or to none, with which runs are about 200 times slower"
)


@dataclass(frozen=True)
class Compiler:
    """How to call a C compiler.

    Parameters
    ----------
    command
        Program and leading arguments.
    label
        What messages and recordings call it, with its version.
    quick
        Whether it takes half the time for kernels that give the same digits by GCC and run a
        tenth slower.
    """

    command: tuple[str, ...]
    label: str
    quick: bool = False

    def flags(self, wanted: tuple[str, ...]) -> tuple[str, ...]:
        """Return what it is told of flags for GCC at full optimization."""
        if self.quick:
            rest = (each for each in wanted if each != "-O2" and each not in _SCHEDULED)
            wanted = (*_QUICK, *rest)
        is_clang = "clang" in self.label
        return tuple(flag for flag in wanted if not (is_clang and flag in _GCC_ONLY))


@cache
def find_compiler() -> Compiler | None:
    """Return the system's C compiler, else that of the extra ``bywire[compiler]``, else None.

    ``BYWIRE_CC`` names another one; ``BYWIRE_CC=none`` does without; ``BYWIRE_CC_QUICK=1`` has
    it compile quickly, for many kernels that run shortly.
    """
    wanted = os.environ.get("BYWIRE_CC", "")
    if wanted == "none":
        return None
    is_quick = _is_quick()
    if wanted:
        if program := find_program(wanted):
            return _labeled((program,), is_quick)
        raise CompilerError(
            f"BYWIRE_CC = {wanted!r} names no program: "
            "unset it, or set it to a C compiler or 'none'"
        )
    commands: list[tuple[str, ...]] = [
        (path,) for name in ("cc", "gcc", "clang") if (path := find_program(name))
    ]
    if command := bundled_compiler():
        commands.append(command)
    for command in commands:
        with contextlib.suppress(CompilerError):  # a broken one must not hide the next
            return _labeled(command, is_quick)
    return None


def bundled_compiler() -> tuple[str, ...] | None:
    """Return the command of the extra's C compiler, for all systems; None where it is missing."""
    return module_command("ziglang", "cc")


def _is_quick() -> bool:
    """Return whether kernels shall be compiled quickly.

    Raises
    ------
    CompilerError
        When ``BYWIRE_CC_QUICK`` says something else than 0 or 1.
    """
    quick = os.environ.get("BYWIRE_CC_QUICK") or "0"
    if quick not in ("0", "1"):
        raise CompilerError(f"BYWIRE_CC_QUICK = {quick!r} is not valid: set it to 0 or 1")
    return quick == "1"


def _labeled(command: tuple[str, ...], is_quick: bool) -> Compiler:
    try:
        done = run_program([*command, "--version"], 60.0)
    except (OSError, subprocess.TimeoutExpired) as error:
        reason = getattr(error, "strerror", None) or "it took longer than 60 s"
        what = f"the C compiler {command[0]} does not start ({reason})"
        raise CompilerError(f"{what}: {_OTHERWISE}") from None
    if done.returncode != 0:
        what = f"the C compiler {command[0]} does not tell its version"
        raise CompilerError(f"{what}: {_OTHERWISE}")
    first = (done.stdout.splitlines() or [Path(command[0]).name])[0].strip()
    # Said in the label, by which kept kernels and recordings tell compilers apart.
    return Compiler(command, f"{first}, quick" if is_quick else first, is_quick)


def load_library(
    source: str, flags: tuple[str, ...], compiler: Compiler, entry: str
) -> tuple[ctypes.CDLL, Path]:
    """Return the loaded library of a C source, and its file, which is compiled where it must be.

    Parameters
    ----------
    entry
        Name of a function that it must have.

    Raises
    ------
    CompilerError
        With the first lines of the compiler's message.
    """
    library = compile_library(source, flags, compiler, entry)
    try:
        return load(library, entry), library
    except CompilerError:  # of another system, or garbled before its digest was made
        digest_of(library).unlink(missing_ok=True)
    library = compile_library(source, flags, compiler, entry)
    return load(library, entry), library


def compile_library(
    source: str, flags: tuple[str, ...], compiler: Compiler, entry: str = ""
) -> Path:
    """Return the file of the shared library of a C source, compiled unless the cache has it.

    The library is written to a temporary name and renamed, so that processes which compile the
    same kernel at once do not disturb each other. A digest beside it guards against damage.

    Parameters
    ----------
    flags
        ``SINGLE``, ``VECTOR`` for kernels that use the processor's vectors, ``PLAIN`` for what
        leaves this machine, or others.
    entry
        Name of a function that it must have.

    Raises
    ------
    CompilerError
        With the first lines of the compiler's message.
    """
    flags = compiler.flags(flags)
    built_for = processor() if "-march=native" in flags else platform.machine()
    parts = "\0".join((source, *_COMMON, *flags, compiler.label, built_for))
    key = hashlib.sha256(parts.encode()).hexdigest()[:32]
    folder = usable_folder().absolute()
    library = folder / f"{key}.so"
    if is_intact(library, entry):
        return library
    try:
        if _compiled_into(library, source, flags, compiler):
            return library
        folder = process_folder()
        library = folder / f"{key}.so"
        _compiled_into(library, source, flags, compiler)
    except OSError as error:
        raise CompilerError(
            f"a compiled kernel cannot be written to {folder} ({error.strerror}): make room there, "
            "or set BYWIRE_CACHE to another folder"
        ) from None
    return library


def _compiled_into(library: Path, source: str, flags: tuple[str, ...], compiler: Compiler) -> bool:
    """Write a library with its digest; return False if somebody deleted its folder meanwhile."""
    try:
        with scratch_folder(library.parent) as scratch:
            text, built, fresh = scratch / "kernel.c", scratch / "kernel.so", scratch / "digest"
            try:
                text.write_text(source)
                _compile(compiler, flags, text, built)
                fresh.write_text(sha256(built))
                os.replace(built, library)
                os.replace(fresh, digest_of(library))
            except (OSError, CompilerError):
                if scratch.is_dir():
                    raise
                return False
    except FileNotFoundError:
        if library.parent.is_dir():
            raise
        return False
    return True


@cache
def processor() -> str:
    """Return what tells processors of different abilities apart that share a cache folder."""
    try:
        with Path("/proc/cpuinfo").open() as lines:  # of which there are many where cores are
            return next(line for line in lines if line.startswith(("flags", "Features"))).rstrip()
    except (OSError, StopIteration):
        return f"{platform.machine()} {platform.processor()}"


def _compile(compiler: Compiler, flags: tuple[str, ...], source: Path, target: Path) -> None:
    command = [*compiler.command, *_COMMON, *flags, str(source), "-o", str(target), "-lm"]
    try:
        done = run_program(command, TIMEOUT)
    except subprocess.TimeoutExpired:
        raise CompilerError(
            f"{compiler.label} took longer than {TIMEOUT:g} s for a kernel: {_OTHERWISE}"
        ) from None
    except OSError as error:
        reason = error.strerror or str(error)
        raise CompilerError(f"{compiler.label} did not run ({reason}): {_OTHERWISE}") from None
    if done.returncode != 0 or not target.exists():
        message = "\n".join(done.stderr.splitlines()[:6]) or "without a message"
        raise CompilerError(
            f"{compiler.label} refused a generated kernel:\n{message}\n{_OTHERWISE}"
        )
