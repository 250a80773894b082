"""A graphics processor emulated by this machine's: what NVIDIA's bindings of its driver do.

Its memory is this machine's. A kernel is the CUDA C as it was emitted, compiled as C: a few
definitions stand before it, and behind it a loop over the threads.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import IntEnum
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from bywire.simulation import cuda, cuda_device
from bywire.simulation.compiler import SINGLE, compile_library, find_compiler, load
from bywire.simulation.engine import Engine, Prepared

_BEFORE = """
#include <stdint.h>
#include <string.h>
#include <math.h>
#define KERNEL
#define LITERAL(type) (type)
#define __launch_bounds__(threads)
static _Thread_local struct { unsigned x; } threadIdx, blockIdx, blockDim;
"""
_BEHIND = """
void emulated(unsigned blocks, unsigned threads, void **given) {
  blockDim.x = threads;
  for (blockIdx.x = 0; blockIdx.x < blocks; ++blockIdx.x)
    for (threadIdx.x = 0; threadIdx.x < threads; ++threadIdx.x)
      {entry}({arguments});
}
"""
_HEAD = re.compile(r"^KERNEL void __launch_bounds__\(\d+\) (\w+)\(([^)]*)\)", re.M)


class Status(IntEnum):
    """What the driver's functions return first."""

    CUDA_SUCCESS = 0
    CUDA_ERROR_OUT_OF_MEMORY = 2
    CUDA_ERROR_DEVICE_UNAVAILABLE = 46
    CUDA_ERROR_NO_DEVICE = 100
    CUDA_ERROR_INVALID_CONTEXT = 201
    CUDA_ERROR_ECC_UNCORRECTABLE = 214
    CUDA_ERROR_UNSUPPORTED_PTX_VERSION = 222
    CUDA_ERROR_ILLEGAL_ADDRESS = 700
    CUDA_ERROR_LAUNCH_TIMEOUT = 702
    CUDA_ERROR_PRIMARY_CONTEXT_ACTIVE = 708
    CUDA_ERROR_LAUNCH_FAILED = 719
    CUDA_ERROR_NOT_PERMITTED = 800
    CUDA_ERROR_SYSTEM_DRIVER_MISMATCH = 803
    CUDA_ERROR_UNKNOWN = 999


OK = Status.CUDA_SUCCESS


def compiled_here(source: str) -> Path:
    """Return the library of a kernel, whose function ``emulated`` runs blocks of threads."""
    compiler = find_compiler()
    if compiler is None:
        pytest.skip("no C compiler")
    head = _HEAD.search(source)
    assert head
    arguments = [
        f"*({'void *' if '*' in each else 'double'} *)given[{k}]"
        for k, each in enumerate(head[2].split(","))
    ]
    behind = _BEHIND.replace("{entry}", head[1]).replace("{arguments}", ", ".join(arguments))
    return compile_library(_BEFORE + source + behind, SINGLE, compiler, "emulated")


class EmulatedDriver:
    """The module ``cuda.bindings.driver``, as far as it is used.

    Parameters
    ----------
    capacity
        Memory [byte].
    """

    CUdevice_attribute = SimpleNamespace(
        CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MAJOR=75,
        CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MINOR=76,
        CU_DEVICE_ATTRIBUTE_COMPUTE_MODE=20,
    )
    CUmemorytype = SimpleNamespace(CU_MEMORYTYPE_HOST=1, CU_MEMORYTYPE_DEVICE=2)
    CUDA_MEMCPY2D = SimpleNamespace

    def __init__(self, capacity: int = 1 << 30) -> None:
        self.capacity, self.count = capacity, 1
        self.started: Any = OK
        self.places: dict[int, Any] = {}
        self.locked: dict[int, Any] = {}  # this machine's memory
        self.launches: list[int] = []  # threads of each that computes cases
        self.entries: list[str] = []  # of all launches
        self.libraries: dict[str, Path] = {}  # of the last kernel with each name
        self.most = 0  # bytes that were taken at once
        self.copies = 0  # to this machine's memory
        self.version, self.mode = 12040, 0
        self.is_lost: Callable[[], bool] = lambda: False  # the context

    @property
    def taken(self) -> int:
        return sum(len(each) for each in self.places.values())

    def left(self, place: int) -> int:
        """Return the number of bytes from an address to the end of its memory."""
        return next(
            start + len(room) - place
            for start, room in self.places.items()
            if start <= place < start + len(room)
        )

    def cuInit(self, flags: int) -> Any:
        if isinstance(self.started, Exception):
            raise self.started
        return (self.started,)

    def cuDeviceGetCount(self) -> Any:
        return OK, self.count

    def cuDeviceGet(self, number: int) -> Any:
        return OK, number

    def cuDeviceGetName(self, length: int, device: int) -> Any:
        return OK, f"emulated {device}".encode().ljust(length, b"\0")

    def cuDeviceGetAttribute(self, kind: int, device: int) -> Any:
        return OK, {75: 9, 76: 0, 20: self.mode}[kind]

    def cuDriverGetVersion(self) -> Any:
        return OK, self.version

    def cuDevicePrimaryCtxRetain(self, device: int) -> Any:
        return OK, "context"

    def cuDevicePrimaryCtxSetFlags(self, device: int, flags: int) -> Any:
        return (OK,)

    def cuMemHostAlloc(self, size: int, flags: int) -> Any:
        room = ctypes.create_string_buffer(size)
        ctypes.memset(room, 0xFF, size)
        self.locked[ctypes.addressof(room)] = room
        return OK, ctypes.addressof(room)

    def cuMemFreeHost(self, place: int) -> Any:
        del self.locked[place]
        return (OK,)

    def cuCtxSetCurrent(self, context: str) -> Any:
        assert context == "context"
        return (OK,)

    def cuCtxSynchronize(self) -> Any:
        return (OK,)

    def cuMemGetInfo(self) -> Any:
        return OK, self.capacity - self.taken, self.capacity

    def cuMemAlloc(self, size: int) -> Any:
        if self.taken + size > self.capacity:
            return Status.CUDA_ERROR_OUT_OF_MEMORY, None
        room = ctypes.create_string_buffer(size)
        ctypes.memset(room, 0xFF, size)  # what is read before it is written is no number
        self.places[ctypes.addressof(room)] = room
        self.most = max(self.most, self.taken)
        return OK, ctypes.addressof(room)

    def cuMemFree(self, place: int) -> Any:
        del self.places[place]
        return (OK,)

    def cuMemcpyHtoD(self, place: int, array: int, size: int) -> Any:
        assert size <= self.left(place)
        ctypes.memmove(place, array, size)
        return (OK,)

    def cuMemcpyDtoH(self, array: int, place: int, size: int) -> Any:
        assert size <= self.left(place)
        ctypes.memmove(array, place, size)
        self.copies += 1
        return (OK,)

    def cuMemcpy2D(self, given: Any) -> Any:
        size, count = given.WidthInBytes, given.Height
        assert (given.srcMemoryType, given.dstMemoryType) == (2, 1)
        assert given.dstPitch >= size
        assert given.srcPitch >= size
        assert given.srcPitch * (count - 1) + size <= self.left(given.srcDevice)
        for k in range(count):
            line = given.srcDevice + k * given.srcPitch
            ctypes.memmove(given.dstHost + k * given.dstPitch, line, size)
        self.copies += 1
        return (OK,)

    def cuModuleLoadData(self, binary: bytes) -> Any:
        source = binary.decode()
        library, head = compiled_here(source), _HEAD.search(source)
        assert head
        self.libraries[head[1]] = library
        return OK, load(library, "emulated")

    def cuModuleGetFunction(self, module: Any, name: bytes) -> Any:
        assert name.startswith(b"bw_")
        return OK, (name.decode(), module.emulated)

    def cuLaunchKernel(self, function: Any, *given: int) -> Any:
        blocks, _, _, threads, _, _, _, _, arguments, _ = given
        entry, run = function
        self.entries.append(entry)
        if entry == cuda.ENTRY:
            self.launches.append(blocks * threads)
        if self.is_lost():
            return (Status.CUDA_ERROR_ECC_UNCORRECTABLE,)
        run(blocks, threads, ctypes.c_void_p(arguments))
        return (OK,)

    def cuGetErrorString(self, status: Status) -> Any:
        return OK, b"the driver states why"


@contextmanager
def emulated(driver: EmulatedDriver) -> Iterator[EmulatedDriver]:
    """Have a driver's processors in place of this machine's; kernels stay text."""
    kept = Prepared.engine

    def engine(prepared: Prepared, kind: str = "auto") -> Engine:
        """Return an engine; on a graphics processor, a new one for this driver."""
        return prepared._build(kind) if kind == "cuda" else kept(prepared, kind)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Prepared, "engine", engine)
        patch.setattr(cuda_device, "bindings", lambda _: driver)
        patch.setattr(cuda_device, "cuda_binary", lambda source, *_: source.encode())
        cuda_device.find_device.cache_clear()
        try:
            yield driver
        finally:
            cuda_device.find_device.cache_clear()
