"""A graphics processor through its driver: memory, kernels, and what goes wrong with them."""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

from numpy.typing import NDArray

from bywire.core.errors import DeviceError, ParameterError, quoted
from bywire.core.pairs import read_count
from bywire.simulation.cuda_compiler import OTHERWISE, bindings, cuda_binary
from bywire.simulation.native import pointer

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
