"""The C compiler, and the folder of compiled kernels, to which only the user may write.

bywire executes a file only if the file, its folder and every parent folder belong to the user or to
root, and nobody else may write to them. A parent folder may also be like ``/tmp``, where users
cannot replace each other's files. Digests detect damage but not malice, because anyone who can
write a library can also write its digest. On Windows, permissions are not file modes, and bywire
does not check the user's folders.
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
    """Return an existing, writable folder for kernels to which only the user may write.

    It is the cache folder if possible, otherwise a new temporary folder for this process.

    Raises
    ------
    CompilerError
        When ``BYWIRE_CACHE`` is a relative path, or a folder that others may write to.
    """
    folder = cache_folder()
    if not folder.is_absolute():  # relative to the working folder, which may be another user's
        if "BYWIRE_CACHE" in os.environ:
            raise CompilerError(
                f"BYWIRE_CACHE = {folder} is relative, so bywire would run kernels from the "
                f"working folder. Set an absolute folder, such as {folder.absolute()}, or unset it",
                name="BYWIRE_CACHE",
                value=str(folder),
                valid="an absolute folder",
            )
        return process_folder()
    try:
        for each in reversed(
            (folder, *folder.parents)
        ):  # one by one, so that each folder gets the same permissions
            each.mkdir(mode=0o700, exist_ok=True)
        with scratch_folder(folder):
            pass
    except OSError:
        return process_folder()
    place = open_to_others(folder)
    if not place:
        return folder
    advice = f"other users can write to {place}, so they could put code there"
    if "BYWIRE_CACHE" in os.environ:
        raise CompilerError(
            f"BYWIRE_CACHE = {folder}: {advice}. Set it to a new folder within a folder that only "
            "you can write to, or unset it",
            name="BYWIRE_CACHE",
            value=str(folder),
        )
    _warn_once(f"bywire does not cache kernels: {advice}. Set BYWIRE_CACHE to your own folder")
    return process_folder()


@cache
def _warn_once(text: str) -> None:
    warnings.warn(text, stacklevel=3)


def open_to_others(path: Path) -> str:
    """Return the first of a file and its parent folders to which others may write, or "".

    Raises
    ------
    OSError
        When the file does not exist.
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
    """Return whether a group is a user's private group, which many systems create."""
    if sys.platform == "win32":
        return True
    try:
        entry, user = grp.getgrgid(group), pwd.getpwuid(os.getuid())
    except KeyError:
        return False
    is_personal = user.pw_gid == group and entry.gr_name == user.pw_name
    return is_personal and set(entry.gr_mem) <= {user.pw_name}


def keep_text(path: Path, text: str) -> None:
    """Write a complete file in the folder, or nothing."""
    with contextlib.suppress(OSError), replacing(path) as fresh:
        fresh.write_text(text, encoding="utf-8")


def is_intact(library: Path, entry: str) -> bool:
    """Return whether a library belongs to the user, has a function, and matches its digest.

    Parameters
    ----------
    entry
        Name of the function; if empty, no function is required.
    """
    try:
        content = _content(library)
        digest = _content(digest_of(library)).decode()
    except (OSError, ValueError):  # missing, owned by another user, or not text
        return False
    is_same = hashlib.sha256(content).hexdigest() == digest
    return is_same and _is_whole(content) and f"{entry}\0".encode() in content


def digest_of(library: Path) -> Path:
    """Return the file with a library's digest."""
    return library.with_suffix(".sha256")


def _content(path: Path) -> bytes:
    """Return a file's bytes if only the user can have written them."""
    place = open_to_others(path)
    if place:
        raise PermissionError(place)
    return path.read_bytes()


def _is_whole(content: bytes) -> bool:
    """Return whether a library has the length in its header; loading any other would crash."""
    if content[:4] != b"\x7fELF":
        return len(content) > 4  # a format of another system
    if len(content) < 64 or content[4] != 2:
        return False
    (table,) = struct.unpack_from("=Q", content, 40)
    size, count = struct.unpack_from("=HH", content, 58)
    return bool(table) and len(content) >= table + size * count


def load(library: Path, entry: str) -> ctypes.CDLL:
    """Load a library, after checking its owner again.

    Between check and loading, only the user and root can replace it.

    Raises
    ------
    CompilerError
        When others may write to the library, or it cannot be loaded.
    """
    try:
        place = open_to_others(library)
        if place:
            raise CompilerError(
                f"bywire does not load {library}: other users can write to {place}, so they could "
                "put code there. Set BYWIRE_CACHE to a new folder within a folder that only you "
                "can write to",
                name=str(library),
            )
        loaded = ctypes.CDLL(str(library.resolve(strict=True)))
        getattr(loaded, entry)
    except (OSError, AttributeError) as error:
        text = f"bywire cannot load {library} ({error}). Delete this file"
        raise CompilerError(text, name=str(library)) from None
    return loaded


def sha256(path: Path) -> str:
    """Return the digest of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


# --- The compiler

# Kernels contain many comparisons and selections. Without these flags, maxima become branches. A
# compiler that fuses products and sums rounds a case in lanes differently from a single run, and
# differently on another processor. Saving 1 % of the time in lanes does not justify this.
KERNEL_MATH = (
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-signed-zeros",
    "-ffinite-math-only",
    "-ffp-contract=off",
)
_STRICT = ("-Werror=implicit-function-declaration",)
_COMMON = ("-shared", "-fPIC", "-std=c11", *KERNEL_MATH, *_STRICT)
# Packing a few scalars costs more than it saves. The same applies to computing both arms of a
# selection that is constant over thousands of substeps: with branches, a run is a seventh faster.
_BRANCHES = ("-fno-if-conversion", "-fno-if-conversion2", "-mtune=native")
# The emitter already shares values across a kernel's branches. A search for more takes an eighth of
# the compile time, and registers.
_SHARED = ("-fno-tree-pre", "-fno-gcse")
PLAIN = ("-O2", "-fno-tree-vectorize", *_BRANCHES, *_SHARED)
_X86 = platform.machine().lower() in ("x86_64", "amd64")
_HERE = ("-march=native",)
_WIDE = (*_HERE, *(("-mprefer-vector-width=512",) if _X86 else ()))
_SCHEDULED = ("-fschedule-insns", "-fsched-pressure")  # a tenth faster
# A single run does not use this processor's vectors, but it uses the additional registers, and
# instructions that preserve both operands. Scheduling saves time only with them.
SINGLE = (*PLAIN, *_HERE, *_SCHEDULED)
VECTOR = ("-O2", "-fopenmp-simd", *_WIDE, *_SCHEDULED)
# The statements of two alternating vectors are already in the order that hides their latencies.
# Scheduling before register allocation would make them 6 % slower.
IN_TURN = ("-O2", "-fopenmp-simd", *_WIDE)
# Half the compile time of -O2, with kernels as fast as -O1. Rare functions are not optimized.
_QUICK = ("-Og", "-fira-region=one", "-DQUICK")
_GCC_ONLY = frozenset({*_BRANCHES, *_SHARED, *_SCHEDULED, "-fira-region=one"})
TIMEOUT = 300.0
_OTHERWISE = (
    "Set BYWIRE_CC to another C compiler, or to none, which makes runs about 200 times slower"
)


@dataclass(frozen=True)
class Compiler:
    """C compiler and its command.

    Parameters
    ----------
    command
        Program and leading arguments.
    label
        Name in messages and recordings, with its version.
    quick
        Whether to compile in half the time. The kernels run 10 % slower. With GCC, the results are
        bit-identical.
    """

    command: tuple[str, ...]
    label: str
    quick: bool = False

    def flags(self, optimized: tuple[str, ...]) -> tuple[str, ...]:
        """Return this compiler's flags for GCC's flags at full optimization."""
        if self.quick:
            rest = (each for each in optimized if each != "-O2" and each not in _SCHEDULED)
            optimized = (*_QUICK, *rest)
        is_clang = "clang" in self.label
        return tuple(flag for flag in optimized if not (is_clang and flag in _GCC_ONLY))


@cache
def find_compiler() -> Compiler | None:
    """Return the system's C compiler, the one of the extra ``bywire[compiler]``, or None.

    ``BYWIRE_CC`` selects another compiler; ``BYWIRE_CC=none`` disables compilation.
    ``BYWIRE_CC_QUICK=1`` makes it compile quickly, for many kernels with short runs.
    """
    requested = os.environ.get("BYWIRE_CC", "")
    if requested == "none":
        return None
    is_quick = _is_quick()
    if requested:
        if program := find_program(requested):
            return _labeled((program,), is_quick)
        raise CompilerError(
            f"BYWIRE_CC = {requested!r} is not a program. "
            "Unset it, or set it to a C compiler or 'none'",
            name="BYWIRE_CC",
            value=requested,
            valid="a C compiler or 'none'",
        )
    commands: list[tuple[str, ...]] = [
        (path,) for name in ("cc", "gcc", "clang") if (path := find_program(name))
    ]
    if command := bundled_compiler():
        commands.append(command)
    for command in commands:
        with contextlib.suppress(CompilerError):  # a broken compiler must not hide the next one
            return _labeled(command, is_quick)
    return None


def bundled_compiler() -> tuple[str, ...] | None:
    """Return the command of the extra's C compiler, or None if it is not installed."""
    return module_command("ziglang", "cc")


def _is_quick() -> bool:
    """Return whether to compile kernels quickly.

    Raises
    ------
    CompilerError
        When ``BYWIRE_CC_QUICK`` is neither 0 nor 1.
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
        reason = getattr(error, "strerror", None) or "no answer after 60 s"
        text = f"the C compiler {command[0]} does not start ({reason}). {_OTHERWISE}"
        raise CompilerError(text, name=command[0]) from None
    if done.returncode != 0:
        text = f"the C compiler {command[0]} does not report its version. {_OTHERWISE}"
        raise CompilerError(text, name=command[0])
    first = (done.stdout.splitlines() or [Path(command[0]).name])[0].strip()
    # Include "quick", because the label identifies the compiler in cached kernels and recordings.
    return Compiler(command, f"{first}, quick" if is_quick else first, is_quick)


def load_library(
    source: str, flags: tuple[str, ...], compiler: Compiler, entry: str
) -> tuple[ctypes.CDLL, Path]:
    """Return the loaded library of a C source, and its file; compile it if necessary.

    Parameters
    ----------
    entry
        Name of a function that the library must have.

    Raises
    ------
    CompilerError
        With the first lines of the compiler's message.
    """
    library = compile_library(source, flags, compiler, entry)
    try:
        return load(library, entry), library
    except CompilerError:  # built on another system, or damaged before its digest was written
        digest_of(library).unlink(missing_ok=True)
    library = compile_library(source, flags, compiler, entry)
    return load(library, entry), library


def compile_library(
    source: str, flags: tuple[str, ...], compiler: Compiler, entry: str = ""
) -> Path:
    """Return the file of the shared library of a C source; compile it unless it is in the cache.

    The library is written to a temporary name and renamed, so that processes can compile the same
    kernel at the same time. A digest next to it detects damage.

    Parameters
    ----------
    flags
        ``SINGLE``, ``VECTOR`` for kernels that use the processor's vectors, ``PLAIN`` for code
        for other machines, or other flags.
    entry
        Name of a function that the library must have.

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
            f"bywire cannot write a compiled kernel to {folder} ({error.strerror}). Free some "
            "space there, or set BYWIRE_CACHE to another folder",
            name=str(folder),
        ) from None
    return library


def _compiled_into(library: Path, source: str, flags: tuple[str, ...], compiler: Compiler) -> bool:
    """Write a library with its digest; return False if its folder was deleted meanwhile."""
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
        with Path("/proc/cpuinfo").open() as lines:  # many lines: read only the first ones
            return next(line for line in lines if line.startswith(("flags", "Features"))).rstrip()
    except (OSError, StopIteration):
        return f"{platform.machine()} {platform.processor()}"


def _compile(compiler: Compiler, flags: tuple[str, ...], source: Path, target: Path) -> None:
    command = [*compiler.command, *_COMMON, *flags, str(source), "-o", str(target), "-lm"]
    try:
        done = run_program(command, TIMEOUT)
    except subprocess.TimeoutExpired:
        raise CompilerError(
            f"{compiler.label} exceeded its limit of {TIMEOUT:g} s for a kernel. {_OTHERWISE}",
            name=compiler.label,
            valid=f"{TIMEOUT:g} s",
        ) from None
    except OSError as error:
        reason = error.strerror or str(error)
        text = f"{compiler.label} did not start ({reason}). {_OTHERWISE}"
        raise CompilerError(text, name=compiler.label) from None
    if done.returncode != 0 or not target.exists():
        message = "\n".join(done.stderr.splitlines()[:6]) or "(no message)"
        raise CompilerError(
            f"{compiler.label} rejected a generated kernel:\n{message}\n{_OTHERWISE}",
            name=compiler.label,
        )
