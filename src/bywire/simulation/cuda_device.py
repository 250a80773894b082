"""NVIDIA graphics processor: compiler, driver, memory, and errors.

The compiler, NVIDIA's NVRTC library, needs no graphics processor and no driver. bywire caches its
output with the compiled kernels.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import importlib
import math
import os
import threading
import time
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from multiprocessing import parent_process
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.callers import is_command_line
from bywire.core.errors import CompilerError, DeviceError, ParameterError, quoted
from bywire.core.libraries import how_to_install
from bywire.core.pairs import read_count
from bywire.core.scratch import scratch_folder
from bywire.core.typing import Array
from bywire.simulation.c_runtime import CUDA
from bywire.simulation.compiler import digest_of, is_intact, sha256, usable_folder
from bywire.simulation.native import pointer

# Fused multiply-add operations would round differently from the processor's kernels. The second
# option is necessary because the source does not declare each function as a device function. C++20
# has designated initializers, like C.
OPTIONS = ("--fmad=false", "--device-as-default-execution-space", "--std=c++20")
OTHERWISE = "or use engine = 'auto', which computes on this machine's processor"


def bindings(name: str) -> ModuleType:
    """Return a module of NVIDIA's bindings, ``"driver"`` or ``"nvrtc"``.

    Raises
    ------
    DeviceError
        When the extra with the module is not installed. The message contains the install command.
    """
    try:
        return importlib.import_module(f"cuda.bindings.{name}")
    except ImportError:
        raise DeviceError(
            "engine 'cuda' needs NVIDIA's bindings and compiler, which are not installed. Install "
            f"them ({how_to_install('gpu')}), {OTHERWISE}",
            name="engine",
            value="cuda",
        ) from None


def cuda_binary(source: str, capability: int, entry: str) -> bytes:
    """Return a kernel's code for a graphics processor; compile it unless it is in the cache.

    Parameters
    ----------
    source
        CUDA C of the kernel.
    capability
        The processor's compute capability: ten times the major number plus the minor number, for
        example 90.
    entry
        Name of the kernel's function.

    Returns
    -------
    bytes
        Machine code, or PTX for the driver to compile if the compiler does not support the
        processor yet.

    Raises
    ------
    DeviceError
        When the compiler is missing, or no longer supports the processor.
    CompilerError
        With the first lines of the compiler's message.
    """
    nvrtc = bindings("nvrtc")
    try:
        version: list[int] = _given(nvrtc.nvrtcVersion())
        known: list[int] = _given(nvrtc.nvrtcGetSupportedArchs())[0]
    except RuntimeError:  # the bindings are installed, but the library is not
        raise DeviceError(
            f"bywire cannot load NVIDIA's compiler NVRTC. Install it ({how_to_install('gpu')}), "
            f"{OTHERWISE}",
            name="NVRTC",
        ) from None
    target = max((each for each in known if each <= capability), default=0)
    if not target:
        raise DeviceError(
            f"NVRTC {version[0]}.{version[1]} supports graphics processors with compute "
            f"capability {min(known) / 10:.1f} and later, but this one has "
            f"{capability / 10:.1f}. Install an older release of NVRTC, {OTHERWISE}",
            name="NVRTC",
            value=f"{capability / 10:.1f}",
            valid=f"{min(known) / 10:.1f} and later",
        )
    is_own = target == capability
    options = (f"--gpu-architecture={'sm' if is_own else 'compute'}_{target}", *OPTIONS)
    text = CUDA + source
    key = hashlib.sha256("\0".join((text, *options, *map(str, version))).encode()).hexdigest()[:32]
    file = usable_folder() / f"{key}.cubin"
    if is_intact(file, entry):
        return file.read_bytes()
    binary = _compiled(nvrtc, text, options, is_own)
    if not is_own:  # the driver caches the code that it compiles from PTX
        return binary
    with contextlib.suppress(OSError), scratch_folder(file.parent) as scratch:
        built, fresh = scratch / "kernel.cubin", scratch / "digest"
        built.write_bytes(binary)
        fresh.write_text(sha256(built))
        os.replace(built, file)
        os.replace(fresh, digest_of(file))
    return binary


def _compiled(nvrtc: Any, text: str, options: tuple[str, ...], is_own: bool) -> bytes:
    (program,) = _given(nvrtc.nvrtcCreateProgram(text.encode(), b"kernel.cu", 0, [], []))
    try:
        given = [each.encode() for each in options]
        (error,) = nvrtc.nvrtcCompileProgram(program, len(given), given)
        if int(error):
            log = _text(nvrtc.nvrtcGetProgramLogSize, nvrtc.nvrtcGetProgramLog, program)
            lines = log.rstrip(b"\0").decode(errors="replace").splitlines()
            message = "\n".join(line for line in lines if line.strip())[:2000] or error.name
            text = f"NVRTC rejected a generated kernel:\n{message}\n{OTHERWISE.capitalize()}"
            raise CompilerError(text, name="NVRTC")
        if is_own:
            return _text(nvrtc.nvrtcGetCUBINSize, nvrtc.nvrtcGetCUBIN, program)
        return _text(nvrtc.nvrtcGetPTXSize, nvrtc.nvrtcGetPTX, program)
    finally:
        nvrtc.nvrtcDestroyProgram(program)


def _text(size_of: Any, fill: Any, program: Any) -> bytes:
    """Return a text property of a program. The bindings write to an existing buffer."""
    (size,) = _given(size_of(program))
    content = bytes(bytearray(size))
    _given(fill(program, content))
    return content


def _given(answer: Any) -> Any:
    """Return the results of a function of the compiler, without its status.

    Raises
    ------
    CompilerError
        When the status is an error.
    """
    status, *values = answer
    if int(status):
        text = f"NVRTC failed ({status.name}). Reinstall it ({how_to_install('gpu')}), {OTHERWISE}"
        raise CompilerError(text, name="NVRTC", value=status.name)
    return values


# --- The device and its driver

VARIABLE = "BYWIRE_GPU"
"""environment variable that selects one of several graphics processors by number"""
_NO_DRIVER = "the driver's library is missing"
_BLOCKING = 4  # CU_CTX_SCHED_BLOCKING_SYNC
_MEGA = 1e6
_LEAST = 12000  # version of the driver's interface, 1000 major + 10 minor, as for NVRTC 12
_EXCLUSIVE = 3  # CU_COMPUTEMODE_EXCLUSIVE_PROCESS
_UNUSED = 8  # blocks of page-locked memory that are kept for later arrays
_PATIENCE, _POLLED = 10.0, 0.05  # s: wait of a study's process for memory, and between attempts
_PITCH = 2**31 - 1  # maximum distance of two lines in a copy [byte]

# Statuses of the driver, CUresult, by what the user can do about them.
_OUT_OF_MEMORY = 2
_IN_USE = 46  # DEVICE_UNAVAILABLE, by the device's compute mode
_NOT_LOCKED = {_OUT_OF_MEMORY, 304, 800, 801}  # of this machine's memory, which needs no lock
_ALREADY_ACTIVE = 708  # PRIMARY_CONTEXT_ACTIVE
_TOO_OLD = {
    200: "INVALID_IMAGE",
    209: "NO_BINARY_FOR_GPU",
    218: "INVALID_PTX",
    222: "UNSUPPORTED_PTX_VERSION",
}
_MISMATCH = {803: "SYSTEM_DRIVER_MISMATCH", 804: "COMPAT_NOT_SUPPORTED_ON_DEVICE"}
_DAMAGED = {214: "ECC_UNCORRECTABLE", 220: "NVLINK_UNCORRECTABLE", 226: "CONTAINED"}
_TOO_LONG = 702  # LAUNCH_TIMEOUT
FLOAT = 8
"""size of a number [byte]"""


class CudaDevice:
    """NVIDIA graphics processor.

    Parameters
    ----------
    driver
        ``cuda.bindings.driver``, after ``cuInit``.
    number
        Number of the graphics processor, >= 0.
    """

    def __init__(self, driver: Any, number: int) -> None:
        self._driver, self._lock = driver, threading.RLock()
        self.label = f"graphics processor {number}"
        self._device = self._checked(driver.cuDeviceGet(number))
        name = self._checked(driver.cuDeviceGetName(128, self._device))
        self.label = name.split(b"\0")[0].decode(errors="replace")
        self._version = int(self._checked(driver.cuDriverGetVersion()))
        if self._version < _LEAST:
            raise self._too_old()
        major, minor, mode = map(
            self._attribute,
            ("COMPUTE_CAPABILITY_MAJOR", "COMPUTE_CAPABILITY_MINOR", "COMPUTE_MODE"),
        )
        self._capability = 10 * major + minor
        self.is_exclusive = mode == _EXCLUSIVE and not self._attribute("MPS_ENABLED")
        # A waiting thread leaves its core to other work. The flag is only a request, because
        # another library of this process may already have set the flags.
        flagged = driver.cuDevicePrimaryCtxSetFlags(self._device, _BLOCKING)
        if int(flagged[0]) != _ALREADY_ACTIVE:
            self._checked(flagged)
        self._free: list[tuple[int, int]] = []
        self._loaded: dict[str, Any] = {}
        self._context = self._checked(driver.cuDevicePrimaryCtxRetain(self._device))

    def _attribute(self, name: str) -> int:
        """Return an attribute of the device; zero if the bindings do not know it yet."""
        kind = getattr(self._driver.CUdevice_attribute, f"CU_DEVICE_ATTRIBUTE_{name}", None)
        if kind is None:
            return 0
        return int(self._checked(self._driver.cuDeviceGetAttribute(kind, self._device)))

    def load(self, source: str, entry: str) -> Any:
        """Return the function of a kernel, loaded once.

        Raises
        ------
        CompilerError
            With the compiler's message.
        """
        with self._current():
            if source not in self._loaded:
                binary = cuda_binary(source, self._capability, entry)
                module = self._checked(self._driver.cuModuleLoadData(binary))
                function = self._driver.cuModuleGetFunction(module, entry.encode())
                self._loaded[source] = self._checked(function)
            return self._loaded[source]

    def free(self) -> int:
        """Return the number of free bytes."""
        with self._current():
            return int(self._checked(self._driver.cuMemGetInfo())[0])

    def host_array(self, shape: tuple[int, ...]) -> Array:
        """Return an uninitialized array in page-locked memory, which the device fills directly.

        The system maps new memory page by page, which takes longer than filling it. This method
        therefore reuses the memory of recent arrays to which no reference remains. If memory cannot
        be locked, the array uses ordinary memory.
        """
        size = max(math.prod(shape) * FLOAT, 8)
        with self._current():
            fitting = [each for each in self._free if size <= each[1] <= 2 * size]
            if fitting:
                block = min(fitting, key=lambda each: each[1])
                self._free.remove(block)
            else:
                while len(self._free) >= _UNUSED:
                    self._checked(self._driver.cuMemFreeHost(self._free.pop(0)[0]))
                locked = self._driver.cuMemHostAlloc(size, 0)
                if int(locked[0]) in _NOT_LOCKED:
                    return np.empty(shape)
                block = int(self._checked(locked)), size
        held = (ctypes.c_byte * block[1]).from_address(block[0])
        weakref.finalize(held, self._free.append, block).atexit = False
        memory = memoryview(held)  # keeps it
        return np.frombuffer(memory, dtype=float, count=math.prod(shape)).reshape(shape)

    def keep(self, size: int) -> int:
        """Return the address of a number of bytes that stay until they are dropped.

        Raises
        ------
        DeviceError
            When there is not enough free memory.
        """
        with self._current():
            return int(Memory(self._driver, self._checked).room(size))

    def drop(self, place: int) -> None:
        """Free memory that was kept; a failed kernel has already invalidated it."""
        with self._current():
            self._driver.cuMemFree(place)

    @contextmanager
    def working(self) -> Iterator[Memory]:
        """Reserve the device and memory on it. The memory is freed at the end."""
        with self._current():
            memory = Memory(self._driver, self._checked)
            try:
                yield memory
            except BaseException:
                memory.give_back()  # a failed kernel has already invalidated everything
                raise
            for status in memory.give_back():
                self._checked(status)

    @contextmanager
    def _current(self) -> Iterator[None]:
        """Reserve the device for the calling thread. The device has only one queue anyway."""
        with self._lock:
            self._checked(self._driver.cuCtxSetCurrent(self._context))
            yield

    def _checked(self, answer: Any, size: int = 0) -> Any:
        """Return the results of a driver function, without its status.

        Raises
        ------
        DeviceError
            When the status is an error. ``size``: number of requested bytes.
        """
        status, *values = answer
        if not int(status):
            return values[0] if len(values) == 1 else values
        if int(status) == _OUT_OF_MEMORY:
            raise self._full(size)
        if int(status) in _TOO_OLD:
            raise self._too_old(f" ({status.name})")
        raise self._failed(status)

    def _full(self, size: int) -> DeviceError:
        """Return the error for insufficient memory; ``size``: requested bytes, 0 if unknown."""
        unknown, *sizes = self._driver.cuMemGetInfo()  # this call may also fail
        left = (
            ""
            if int(unknown)
            else " ({:.4g} of {:.4g} MB are free)".format(*(each / _MEGA for each in sizes))
        )
        need = f"{size / _MEGA:.3g} MB" if size else "memory"
        return DeviceError(
            f"{self.label} cannot allocate {need}{left}. Close other programs that use this "
            f"graphics processor, select another one with {VARIABLE}, {OTHERWISE}",
            name=self.label,
            value=need,
        )

    def _too_old(self, status: str = "") -> DeviceError:
        """Return the error for a driver that cannot load kernels."""
        version = getattr(self, "_version", 0)
        supported = f"{version // 1000}.{version % 1000 // 10}"
        return DeviceError(
            f"the driver of {self.label} supports CUDA {supported}, which is too old for the "
            f"kernels{status}. Install a driver for CUDA {_LEAST // 1000} or later, at least as "
            f"new as the installed NVRTC, {OTHERWISE}",
            name="driver",
            value=supported,
            valid=f"CUDA {_LEAST // 1000} or later",
        )

    def _failed(self, status: Any) -> DeviceError:
        """Return the error for a device that cannot compute, or has stopped computing."""
        code, why = int(status), f"({status.name})"
        if code == _IN_USE:
            text = (
                f"{self.label} is in use by another process, and its compute mode does not allow "
                f"another one {why}. End that process, which nvidia-smi lists, select another "
                f"graphics processor with {VARIABLE}, ask an administrator to run 'nvidia-smi "
                f"-c DEFAULT', {OTHERWISE}"
            )
        elif code in _DAMAGED:
            text = (
                f"{self.label} has an uncorrectable memory error {why}. {_again()}. If the error "
                "recurs, ask an administrator to run 'nvidia-smi --gpu-reset', "
                f"{OTHERWISE}"
            )
        elif code == _TOO_LONG:
            text = (
                f"the system ended a kernel on {self.label}, because the kernel took too long for "
                f"a graphics processor that drives a display {why}. Select another graphics "
                f"processor with {VARIABLE}, {OTHERWISE}"
            )
        else:
            given = self._driver.cuGetErrorString(status)  # this call may also fail
            reason = (b"" if int(given[0]) else given[1] or b"").decode(errors="replace")
            text = f"{self.label} failed: {reason or status.name} {why}. {_again()}, {OTHERWISE}"
        return DeviceError(text, name=self.label, value=status.name)


def _again() -> str:
    """Return the advice after a failure, which also affects later calls in the same process."""
    return "Rerun the command" if is_command_line() else "Start Python again and rerun the call"


class Memory:
    """Memory blocks on a graphics processor that are freed together, with operations on them.

    Parameters
    ----------
    driver, checked
        The driver, and a function that raises errors for its statuses.
    """

    def __init__(self, driver: Any, checked: Callable[..., Any]) -> None:
        self._driver, self._checked = driver, checked
        self._places: list[Any] = []

    def room(self, size: int) -> Any:
        """Return the address of a number of uninitialized bytes.

        Raises
        ------
        DeviceError
            When there is not enough free memory.
        """
        # Other processes of a study free their memory at the end of their turn.
        until = time.monotonic() + (_PATIENCE if parent_process() is not None else 0.0)
        given = self._driver.cuMemAlloc(max(size, 8))
        while int(given[0]) == _OUT_OF_MEMORY and time.monotonic() < until:
            time.sleep(_POLLED)
            given = self._driver.cuMemAlloc(max(size, 8))
        place = self._checked(given, size)
        self._places.append(place)
        return place

    def put(self, place: Any, array: NDArray[Any]) -> None:
        """Copy a C-contiguous array to an address."""
        if array.nbytes:
            self._checked(self._driver.cuMemcpyHtoD(place, pointer(array).value, array.nbytes))

    def get(self, place: Any, array: NDArray[Any]) -> None:
        """Copy consecutive numbers at an address into an array with any strides.

        Lines of numbers with equal strides need only one copy.
        """
        if not array.nbytes:
            return
        *outer, (count, pitch), (width, apart) = _lines(array)
        if apart != array.itemsize:
            whole = np.empty(array.shape, array.dtype)
            self.get(place, whole)
            array[...] = whole
            return
        if pitch > _PITCH:
            outer, count = [*outer, (count, pitch)], 1
        begin, size = array.ctypes.data, width * array.itemsize
        for number, where in enumerate(np.ndindex(*(length for length, _ in outer))):
            line = begin + sum(k * stride for k, (_, stride) in zip(where, outer, strict=True))
            self._get_lines(int(place) + number * count * size, line, size, count, pitch)

    def _get_lines(self, place: int, line: int, size: int, count: int, pitch: int) -> None:
        """Copy consecutive lines at an address to addresses at a distance [byte]."""
        driver = self._driver
        if count == 1:
            self._checked(driver.cuMemcpyDtoH(line, place, size))
            return
        copied = driver.CUDA_MEMCPY2D()
        copied.srcMemoryType = driver.CUmemorytype.CU_MEMORYTYPE_DEVICE
        copied.dstMemoryType = driver.CUmemorytype.CU_MEMORYTYPE_HOST
        copied.srcDevice, copied.srcPitch = place, size
        copied.dstHost, copied.dstPitch = line, pitch
        copied.WidthInBytes, copied.Height = size, count
        self._checked(driver.cuMemcpy2D(copied))

    def run(self, function: Any, blocks: int, threads: int, arguments: Sequence[Any]) -> None:
        """Run a kernel and wait for its end; the arguments are addresses and floats."""
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

    def give_back(self) -> list[Any]:
        """Free all memory, and return the driver's answers."""
        return [self._driver.cuMemFree(place) for place in self._places]


def _lines(array: NDArray[Any]) -> list[tuple[int, int]]:
    """Return length and distance [byte] of each axis, at least two, with as few as possible."""
    axes = [(1, 0), (1, array.itemsize)]
    for length, stride in zip(array.shape, array.strides, strict=True):
        last_length, last_stride = axes[-1]
        if length == 1:
            continue
        if last_length == 1:
            axes[-1] = length, stride
        elif last_stride == length * stride:
            axes[-1] = last_length * length, stride
        else:
            axes.append((length, stride))
    return axes


@cache
def find_device() -> CudaDevice:
    """Return the graphics processor to use: the first one, or the one in ``BYWIRE_GPU``.

    Raises
    ------
    DeviceError
        When there is no graphics processor or driver, or the extra ``bywire[gpu]`` is not
        installed.
    ParameterError
        When ``BYWIRE_GPU`` is not the number of a graphics processor.
    """
    driver = bindings("driver")
    try:
        status, count = driver.cuInit(0)[0], 0
        if not int(status):
            status, count = driver.cuDeviceGetCount()
        reason = "" if not int(status) else status.name
        if int(status) in _MISMATCH:
            raise DeviceError(
                f"the library of NVIDIA's driver does not match the driver that the system has "
                f"loaded ({reason}). Restart the machine to complete the driver update, "
                f"{OTHERWISE}",
                name="driver",
                value=reason,
            )
    except RuntimeError:
        reason, count = _NO_DRIVER, 0
    if reason or not count:
        why = f" ({reason})" if reason else ""
        raise DeviceError(
            f"engine 'cuda' finds no NVIDIA graphics processor{why}. Check that nvidia-smi lists "
            f"one, {OTHERWISE}",
            name="engine",
            value="cuda",
            valid="engine = 'auto'",
        )
    requested = os.environ.get(VARIABLE, "0")
    number = read_count(requested)
    if number is None or number >= count:
        raise ParameterError(
            f"{VARIABLE} = {quoted(requested)} is not valid: it must be "
            f"{'0' if count == 1 else f'0 to {count - 1}'}, the number of a graphics processor",
            name=VARIABLE,
            value=requested,
            valid="0" if count == 1 else f"0 to {count - 1}",
        )
    try:
        return CudaDevice(driver, number)
    except RuntimeError as error:  # of the bindings, for a function that a driver does not have
        raise DeviceError(
            f"the driver is too old for NVIDIA's bindings ({error}). Install a driver for CUDA "
            f"{_LEAST // 1000} or later, {OTHERWISE}",
            name="driver",
            valid=f"CUDA {_LEAST // 1000} or later",
        ) from None
