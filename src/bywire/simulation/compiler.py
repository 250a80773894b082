"""The C compiler, and the folder of compiled kernels: only the user may write there.

A file is run only if it, its folder and every folder above belong to the user or to root, and
nobody else may write to them; of the folders above, one like ``/tmp`` will do, where others cannot
replace what is not theirs. Digests tell damage, not intent: who can write a library can write its
digest. On Windows rights are not modes, and the user's folders are taken as they are.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import os
import platform
import stat
import struct
import subprocess
import sys
import warnings
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from platformdirs import user_cache_path

from bywire.core.child_process import find_program, module_command, run_program
from bywire.core.errors import CompilerError
from bywire.core.scratch import process_folder, replacing, scratch_folder

if sys.platform != "win32":
    import grp
    import pwd


def cache_folder() -> Path:
    """Return the folder of compiled kernels (``BYWIRE_CACHE`` moves it)."""
    moved = os.environ.get("BYWIRE_CACHE")
    return Path(moved) if moved else user_cache_path("bywire", "bywire") / "kernels"


def usable_folder() -> Path:
    """Return a folder for kernels that exists, can be written, and is the user's alone.

    The cache folder, else a fresh temporary one for this process.

    Raises
    ------
    CompilerError
        When ``BYWIRE_CACHE`` names a folder that others may write to, or a relative one.
    """
    folder = cache_folder()
    if not folder.is_absolute():  # in whatever folder one works, somebody else's perhaps
        if "BYWIRE_CACHE" in os.environ:
            raise CompilerError(
                f"BYWIRE_CACHE = {folder} is relative, so that kernels of the working folder would "
                f"run: name an absolute folder, such as {folder.absolute()}, or unset it",
                name="BYWIRE_CACHE",
                value=str(folder),
                valid="an absolute folder",
            )
        return process_folder()
    try:
        for each in reversed((folder, *folder.parents)):  # each, or those above get other rights
            each.mkdir(mode=0o700, exist_ok=True)
        with scratch_folder(folder):
            pass
    except OSError:
        return process_folder()
    place = open_to_others(folder)
    if not place:
        return folder
    advice = f"{place} is not yours alone, and others could put code there"
    if "BYWIRE_CACHE" in os.environ:
        raise CompilerError(
            f"BYWIRE_CACHE = {folder}: {advice}: name a new folder within a folder that only you "
            "can write to, or unset it",
            name="BYWIRE_CACHE",
            value=str(folder),
        )
    _warn_once(f"compiled kernels are not kept: {advice}: set BYWIRE_CACHE to a folder of yours")
    return process_folder()


@cache
def _warn_once(text: str) -> None:
    warnings.warn(text, stacklevel=3)


def open_to_others(path: Path) -> str:
    """Return what others may write to of a file or folder and the folders above; else nothing.

    Raises
    ------
    OSError
        When it is not there.
    """
    if sys.platform == "win32":
        return ""
    resolved = path.resolve(strict=True)
    is_folder = resolved.is_dir()
    for steps, each in enumerate((resolved, *resolved.parents)):
        status = each.stat(follow_symlinks=False)
        is_above = steps > (0 if is_folder else 1)
        if status.st_uid not in (os.getuid(), 0) or not _is_closed(status, is_above):
            return str(each)
    return ""


def _is_closed(status: os.stat_result, is_above: bool) -> bool:
    """Return whether only its owner may write to a file or folder."""
    by_others = status.st_mode & stat.S_IWOTH
    by_group = status.st_mode & stat.S_IWGRP and not _is_private(status.st_gid)
    return not (by_others or by_group) or bool(is_above and status.st_mode & stat.S_ISVTX)


def _is_private(group: int) -> bool:
    """Return whether a group is a user's own, as many systems make one for each."""
    if sys.platform == "win32":
        return True
    try:
        entry, user = grp.getgrgid(group), pwd.getpwuid(os.getuid())
    except KeyError:
        return False
    is_personal = user.pw_gid == group and entry.gr_name == user.pw_name
    return is_personal and set(entry.gr_mem) <= {user.pw_name}


def keep_text(path: Path, text: str) -> None:
    """Write a file of the folder completely or not at all."""
    with contextlib.suppress(OSError), replacing(path) as fresh:
        fresh.write_text(text, encoding="utf-8")


def is_intact(library: Path, entry: str) -> bool:
    """Return whether a library is the user's, has a function, and is what its digest was made of.

    Parameters
    ----------
    entry
        Name of the function; any library will do without.
    """
    try:
        content = _content(library)
        digest = _content(digest_of(library)).decode()
    except (OSError, ValueError):  # missing, of somebody else, or no text at all
        return False
    is_same = hashlib.sha256(content).hexdigest() == digest
    return is_same and _is_whole(content) and f"{entry}\0".encode() in content


def digest_of(library: Path) -> Path:
    """Return the file with the digest of a library."""
    return library.with_suffix(".sha256")


def _content(path: Path) -> bytes:
    """Return the bytes of a file that only the user could have written."""
    place = open_to_others(path)
    if place:
        raise PermissionError(place)
    return path.read_bytes()


def _is_whole(content: bytes) -> bool:
    """Return whether a library is as long as its header says: the system would crash on others."""
    if content[:4] != b"\x7fELF":
        return len(content) > 4  # of another system
    if len(content) < 64 or content[4] != 2:
        return False
    (table,) = struct.unpack_from("=Q", content, 40)
    size, count = struct.unpack_from("=HH", content, 58)
    return bool(table) and len(content) >= table + size * count


def load(library: Path, entry: str) -> ctypes.CDLL:
    """Load a library; whose it is, is looked at once more.

    Nobody but the user and root can then put another in its place in between.

    Raises
    ------
    CompilerError
        When it is not the user's alone, or cannot be loaded.
    """
    try:
        place = open_to_others(library)
        if place:
            raise CompilerError(
                f"{library} is not loaded: {place} is not yours alone, and others could put code "
                "there: set BYWIRE_CACHE to a new folder within a folder that only you can write "
                "to",
                name=str(library),
            )
        loaded = ctypes.CDLL(str(library.resolve(strict=True)))
        getattr(loaded, entry)
    except (OSError, AttributeError) as error:
        raise CompilerError(f"{library} cannot be loaded ({error}): delete it") from None
    return loaded


def sha256(path: Path) -> str:
    """Return the digest of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


# --- The compiler

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
    """C compiler and how to call it.

    Parameters
    ----------
    command
        Program and leading arguments.
    label
        Name in messages and recordings, with its version.
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
            f"BYWIRE_CC = {wanted!r} is not a program: "
            "unset it, or set it to a C compiler or 'none'",
            name="BYWIRE_CC",
            value=wanted,
            valid="a C compiler or 'none'",
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
        raise CompilerError(
            f"BYWIRE_CC_QUICK = {quick!r} is not valid: it must be 0 or 1",
            name="BYWIRE_CC_QUICK",
            value=quick,
            valid="0 or 1",
        )
    return quick == "1"


def _labeled(command: tuple[str, ...], is_quick: bool) -> Compiler:
    try:
        done = run_program([*command, "--version"], 60.0)
    except (OSError, subprocess.TimeoutExpired) as error:
        reason = getattr(error, "strerror", None) or "it took longer than 60 s"
        text = f"the C compiler {command[0]} does not start ({reason}): {_OTHERWISE}"
        raise CompilerError(text, name=command[0]) from None
    if done.returncode != 0:
        text = f"the C compiler {command[0]} does not report its version: {_OTHERWISE}"
        raise CompilerError(text, name=command[0])
    first = (done.stdout.splitlines() or [Path(command[0]).name])[0].strip()
    # Part of the label, which identifies the compiler in kept kernels and recordings.
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
    """Return a digest of the processor's features, for machines that share a cache folder."""
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
            f"{compiler.label} rejected a generated kernel:\n{message}\n{_OTHERWISE}"
        )
