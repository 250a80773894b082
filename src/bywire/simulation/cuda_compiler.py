"""CUDA C compiled for a graphics processor by NVRTC, NVIDIA's compiler in a library.

It needs no graphics processor and no driver. What it made is kept beside compiled kernels.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import os
from types import ModuleType
from typing import Any

from bywire.core.errors import CompilerError, DeviceError
from bywire.core.extras import how_to_install
from bywire.core.scratch import scratch_folder
from bywire.simulation.c_runtime import CUDA
from bywire.simulation.kernel_cache import digest_of, is_intact, sha256, usable_folder

# A product and a sum in one rounding would give other digits than the processor's kernels. And
# kernels do not say of each of their functions that it runs there.
OPTIONS = ("--fmad=false", "--device-as-default-execution-space")
OTHERWISE = "or take engine = 'auto', which computes on this machine's processor"


def bindings(name: str) -> ModuleType:
    """Return a module of NVIDIA's bindings, ``"driver"`` or ``"nvrtc"``.

    Raises
    ------
    DeviceError
        When the extra that brings it is not installed, with the command.
    """
    try:
        return importlib.import_module(f"cuda.bindings.{name}")
    except ImportError:
        raise DeviceError(
            "engine 'cuda' takes NVIDIA's bindings and its compiler, which are not installed: "
            f"{how_to_install('gpu')}; {OTHERWISE}"
        ) from None


def cuda_binary(source: str, capability: int, entry: str) -> bytes:
    """Return what a kernel is for a graphics processor, compiled unless it is kept.

    Parameters
    ----------
    source
        CUDA C, as ``emit_cuda`` writes it.
    capability
        Of the processor, for instance 90: the major number ten times, and the minor one.
    entry
        Name of its function.

    Returns
    -------
    bytes
        Its own code; where the compiler does not know the processor yet, PTX, which the driver
        compiles.

    Raises
    ------
    DeviceError
        When the compiler is not there, or knows no processor as old.
    CompilerError
        With the first lines of the compiler's message.
    """
    nvrtc = bindings("nvrtc")
    try:
        _, *version = nvrtc.nvrtcVersion()
        _, known = nvrtc.nvrtcGetSupportedArchs()
    except RuntimeError:  # the bindings are there, and the library is not
        raise DeviceError(
            f"NVIDIA's compiler NVRTC cannot be loaded: {how_to_install('gpu')}; {OTHERWISE}"
        ) from None
    target = max((each for each in known if each <= capability), default=0)
    if not target:
        raise DeviceError(
            f"NVRTC {version[0]}.{version[1]} compiles for graphics processors of compute "
            f"capability {min(known) / 10:.1f} and later, not for {capability / 10:.1f}: take an "
            f"older release of it, {OTHERWISE}"
        )
    is_own = target == capability
    options = (f"--gpu-architecture={'sm' if is_own else 'compute'}_{target}", *OPTIONS)
    text = CUDA + source
    key = hashlib.sha256("\0".join((text, *options, *map(str, version))).encode()).hexdigest()[:32]
    file = usable_folder() / f"{key}.cubin"
    if is_intact(file, entry):
        return file.read_bytes()
    binary = _compiled(nvrtc, text, options, is_own)
    if not is_own:  # the driver keeps what it makes of PTX
        return binary
    with contextlib.suppress(OSError), scratch_folder(file.parent) as scratch:
        built, fresh = scratch / "kernel.cubin", scratch / "digest"
        built.write_bytes(binary)
        fresh.write_text(sha256(built))
        os.replace(built, file)
        os.replace(fresh, digest_of(file))
    return binary


def _compiled(nvrtc: Any, text: str, options: tuple[str, ...], is_own: bool) -> bytes:
    error, program = nvrtc.nvrtcCreateProgram(text.encode(), b"kernel.cu", 0, [], [])
    try:
        if not int(error):
            given = [each.encode() for each in options]
            (error,) = nvrtc.nvrtcCompileProgram(program, len(given), given)
        if int(error):
            said = _text(nvrtc.nvrtcGetProgramLogSize, nvrtc.nvrtcGetProgramLog, program)
            lines = said.rstrip(b"\0").decode(errors="replace").splitlines()
            message = "\n".join(line for line in lines if line.strip())[:2000] or error.name
            raise CompilerError(f"NVRTC refused a generated kernel:\n{message}\n{OTHERWISE}")
        if is_own:
            return _text(nvrtc.nvrtcGetCUBINSize, nvrtc.nvrtcGetCUBIN, program)
        return _text(nvrtc.nvrtcGetPTXSize, nvrtc.nvrtcGetPTX, program)
    finally:
        nvrtc.nvrtcDestroyProgram(program)


def _text(size_of: Any, fill: Any, program: Any) -> bytes:
    """Return what a program tells of itself; the bindings fill bytes that exist."""
    _, size = size_of(program)
    content = bytes(bytearray(size))
    fill(program, content)
    return content
