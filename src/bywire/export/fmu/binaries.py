"""Binaries of an FMU: the kernel as the bench compiles it, the functions around it as C asks for.

The kernel may take all numbers as finite, which would delete the checks of what a client gives:
both are compiled apart.
"""

from __future__ import annotations

import platform
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from bywire.core.child_process import run_program
from bywire.core.errors import CompilerError, unknown_name
from bywire.simulation.compiler import (
    KERNEL_MATH,
    PLAIN,
    TIMEOUT,
    Compiler,
    bundled_compiler,
    find_compiler,
)

_LANGUAGE = ("-std=c11", "-fvisibility=hidden")


@dataclass(frozen=True)
class Platform:
    """A system that binaries are made for.

    Parameters
    ----------
    folder_2, folder_3
        Where they stand in an FMU of version 2.0 and of 3.0.
    suffix
        Ending of their file.
    triple
        How the compiler of the extra ``compiler`` calls it.
    """

    folder_2: str
    folder_3: str
    suffix: str
    triple: str


PLATFORMS: Mapping[str, Platform] = {
    "linux64": Platform("linux64", "x86_64-linux", ".so", "x86_64-linux-gnu.2.17"),
    "win64": Platform("win64", "x86_64-windows", ".dll", "x86_64-windows-gnu"),
    "darwin64": Platform("darwin64", "x86_64-darwin", ".dylib", "x86_64-macos"),
    "aarch64-linux": Platform("aarch64-linux", "aarch64-linux", ".so", "aarch64-linux-gnu.2.17"),
    "aarch64-darwin": Platform("aarch64-darwin", "aarch64-darwin", ".dylib", "aarch64-macos"),
}


def this_platform() -> str:
    """Return the name of the system that this is, of ``PLATFORMS``."""
    is_arm = platform.machine().lower() in ("aarch64", "arm64")
    if sys.platform == "win32":
        return "win64"
    if sys.platform == "darwin":
        return "aarch64-darwin" if is_arm else "darwin64"
    return "aarch64-linux" if is_arm else "linux64"


def compiled(sources: Path, kernel: str, functions: str, target: str, library: Path) -> str:
    """Compile the sources of an FMU to a shared library.

    Parameters
    ----------
    sources
        Their folder.
    kernel, functions
        File of the kernel, and that of the functions of the interface.
    target
        Name of the system, one of ``PLATFORMS``.
    library
        Where to.

    Returns
    -------
    str
        What the compiler is.

    Raises
    ------
    UnknownNameError
        For another system.
    CompilerError
        When there is no compiler for it, or it fails.
    """
    if target not in PLATFORMS:
        raise unknown_name("target", target, PLATFORMS)
    compiler, cross = _compiler_for(target)
    sources, library = sources.absolute(), library.absolute()
    position = () if target == "win64" else ("-fPIC",)
    objects = []
    for name, flags in ((kernel, (*KERNEL_MATH, *compiler.flags(PLAIN))), (functions, ("-O2",))):
        made = library.parent / f"{name}.o"
        given = [flag for flag in flags if not (cross and flag.startswith("-mtune"))]
        call = [*_LANGUAGE, *position, *given, "-c", str(sources / name), "-o", str(made)]
        _call(compiler, cross, call)
        objects.append(str(made))
    _call(compiler, cross, ["-shared", "-s", *objects, "-o", str(library), *_libraries(target)])
    for each in objects:
        Path(each).unlink()
    return compiler.label


def _libraries(target: str) -> list[str]:
    return [] if target == "win64" else ["-lm"]


def _compiler_for(target: str) -> tuple[Compiler, tuple[str, ...]]:
    """Return a compiler and what tells it for which system."""
    if target == this_platform():
        compiler = find_compiler()
        if compiler is None:
            raise CompilerError(
                "an FMU has a compiled model, and there is no C compiler: install one, or the "
                "extra bywire[compiler]"
            )
        return compiler, ()
    command = bundled_compiler()
    if command is None:
        raise CompilerError(
            f"target {target}: this system's compiler makes {this_platform()} only; install the "
            "extra bywire[compiler], which compiles for all"
        )
    return Compiler(command, "clang of the extra compiler"), ("-target", PLATFORMS[target].triple)


def _call(compiler: Compiler, cross: tuple[str, ...], arguments: list[str]) -> None:
    command = [*compiler.command, *cross, *arguments]
    try:
        done = run_program(command, TIMEOUT)
    except subprocess.TimeoutExpired:
        raise CompilerError(f"{compiler.label} took longer than {TIMEOUT:g} s for an FMU") from None
    except OSError as error:
        raise CompilerError(f"{compiler.label} did not run ({error.strerror or error})") from None
    if done.returncode != 0:
        message = "\n".join(done.stderr.splitlines()[:6]) or "without a message"
        raise CompilerError(f"{compiler.label} refused the sources of an FMU:\n{message}")
