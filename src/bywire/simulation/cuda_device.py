"""A graphics processor: CUDA C compiled for it, its memory, its kernels, and what goes wrong.

The compiler, NVIDIA's NVRTC in a library, needs no graphics processor and no driver. What it made
is kept beside compiled kernels.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import importlib
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from types import ModuleType
from typing import Any

from numpy.typing import NDArray

from bywire.core.errors import CompilerError, DeviceError, ParameterError, quoted
from bywire.core.libraries import how_to_install
from bywire.core.pairs import read_count
from bywire.core.scratch import scratch_folder
from bywire.simulation.c_runtime import CUDA
from bywire.simulation.kernel_cache import digest_of, is_intact, sha256, usable_folder
from bywire.simulation.native import pointer

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


# --- The device and its driver

VARIABLE = "BYWIRE_GPU"
"""environment variable with the number of the graphics processor, where there are several"""
_NO_DRIVER = "the driver's library is not there"
_OUT_OF_MEMORY = 2  # CUDA_ERROR_OUT_OF_MEMORY
_MEGA = 1e6


class CudaDevice:
    """A graphics processor of NVIDIA's.

    Parameters
    ----------
    driver
        ``cuda.bindings.driver``, after ``cuInit``.
    number
        Which one, >= 0.
    """

    def __init__(self, driver: Any, number: int) -> None:
        self._driver, self._lock = driver, threading.RLock()
        self._device = self._checked(driver.cuDeviceGet(number))
        name = self._checked(driver.cuDeviceGetName(128, self._device))
        self.label = name.split(b"\0")[0].decode(errors="replace")
        kinds = driver.CUdevice_attribute
        major, minor = (
            self._checked(driver.cuDeviceGetAttribute(kind, self._device))
            for kind in (
                kinds.CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MAJOR,
                kinds.CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MINOR,
            )
        )
        self._capability = 10 * int(major) + int(minor)
        self._context = self._checked(driver.cuDevicePrimaryCtxRetain(self._device))

    def load(self, source: str, entry: str) -> Any:
        """Return the function of a kernel.

        Raises
        ------
        CompilerError
            With the compiler's message.
        """
        binary = cuda_binary(source, self._capability, entry)
        with self._current():
            module = self._checked(self._driver.cuModuleLoadData(binary))
            return self._checked(self._driver.cuModuleGetFunction(module, entry.encode()))

    def free(self) -> int:
        """Return how many bytes are free."""
        with self._current():
            return int(self._checked(self._driver.cuMemGetInfo())[0])

    @contextmanager
    def working(self) -> Iterator[Memory]:
        """Have the device for oneself, and memory of it that is given back in the end."""
        with self._current():
            memory = Memory(self._driver, self._checked)
            try:
                yield memory
            finally:
                memory.give_back()

    @contextmanager
    def _current(self) -> Iterator[None]:
        """Have the calling thread alone work on the device: it is one queue anyway."""
        with self._lock:
            self._checked(self._driver.cuCtxSetCurrent(self._context))
            yield

    def _checked(self, answer: Any, wanted: int = 0) -> Any:
        """Return what a function of the driver gives behind its status.

        Raises
        ------
        DeviceError
            When the status is an error's; ``wanted``: bytes that were asked for.
        """
        status, *values = answer
        if not int(status):
            return values[0] if len(values) == 1 else values
        if int(status) == _OUT_OF_MEMORY:
            unknown, *sizes = self._driver.cuMemGetInfo()  # it may have no room to begin with
            left = (
                ""
                if int(unknown)
                else "{:.4g} of {:.4g} MB are free: ".format(*(size / _MEGA for size in sizes))
            )
            what = f"no room for {wanted / _MEGA:.3g} MB" if wanted else "no memory left"
            raise DeviceError(
                f"{self.label} has {what}: {left}end what else computes there, name another one "
                f"by {VARIABLE}, {OTHERWISE}"
            )
        _, said = self._driver.cuGetErrorString(status)
        text = (said or b"").decode(errors="replace") or status.name
        where = getattr(self, "label", "a graphics processor")
        raise DeviceError(f"{where} failed: {text} ({status.name}); start anew, {OTHERWISE}")


class Memory:
    """Memory of a graphics processor that is given back together, and what works on it.

    Parameters
    ----------
    driver, checked
        The driver, and what raises an error for its statuses.
    """

    def __init__(self, driver: Any, checked: Callable[..., Any]) -> None:
        self._driver, self._checked = driver, checked
        self._places: list[Any] = []

    def room(self, size: int) -> Any:
        """Return the place of so many bytes, whatever they hold.

        Raises
        ------
        DeviceError
            When there is no such room.
        """
        place = self._checked(self._driver.cuMemAlloc(max(size, 8)), size)
        self._places.append(place)
        return place

    def put(self, place: Any, array: NDArray[Any]) -> None:
        """Copy a C-contiguous array to a place."""
        if array.nbytes:
            self._checked(self._driver.cuMemcpyHtoD(place, pointer(array).value, array.nbytes))

    def get(self, place: Any, array: NDArray[Any]) -> None:
        """Fill a C-contiguous array with what stands at a place."""
        if array.nbytes:
            self._checked(self._driver.cuMemcpyDtoH(pointer(array).value, place, array.nbytes))

    def run(self, function: Any, blocks: int, threads: int, arguments: Sequence[Any]) -> None:
        """Run a kernel to its end; its arguments are places, and floats."""
        values = [
            ctypes.c_double(each) if isinstance(each, float) else ctypes.c_void_p(int(each))
            for each in arguments
        ]
        addresses = (ctypes.c_void_p * len(values))(*map(ctypes.addressof, values))
        self._checked(
            self._driver.cuLaunchKernel(
                function, blocks, 1, 1, threads, 1, 1, 0, 0, ctypes.addressof(addresses), 0
            )
        )
        self._checked(self._driver.cuCtxSynchronize())

    def give_back(self) -> None:
        """Free every place."""
        for place in self._places:  # a kernel that failed has taken everything with it
            self._driver.cuMemFree(place)


@cache
def find_device() -> CudaDevice:
    """Return the graphics processor that computes: the first one, or that of ``BYWIRE_GPU``.

    Raises
    ------
    DeviceError
        When there is none, or no driver, or the extra ``bywire[gpu]`` is not installed.
    ParameterError
        When ``BYWIRE_GPU`` names none.
    """
    driver = bindings("driver")
    try:
        status, count = driver.cuInit(0)[0], 0
        if not int(status):
            status, count = driver.cuDeviceGetCount()
        said = "" if not int(status) else status.name
    except RuntimeError:
        said, count = _NO_DRIVER, 0
    if said or not count:
        why = f" ({said})" if said else ""
        raise DeviceError(
            f"engine 'cuda' finds no graphics processor of NVIDIA's{why}: see that nvidia-smi "
            f"lists one, {OTHERWISE}"
        )
    wanted = os.environ.get(VARIABLE, "0")
    number = read_count(wanted)
    if number is None or number >= count:
        raise ParameterError(
            f"{VARIABLE} = {quoted(wanted)} names no graphics processor: there "
            f"{'is one, 0' if count == 1 else f'are {count}, 0 to {count - 1}'}"
        )
    return CudaDevice(driver, number)
