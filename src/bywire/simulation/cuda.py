"""Many cases on a graphics processor, one thread per case: CUDA C, kernels, memory, and errors.

The compiler, NVIDIA's NVRTC library, needs no graphics processor and no driver. bywire caches its
output with the compiled kernels.
"""

from __future__ import annotations

import contextlib
import copy
import ctypes
import hashlib
import importlib
import math
import os
import threading
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from itertools import pairwise
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import CompilerError, DeviceError, ParameterError, quoted
from bywire.core.interrupts import raise_if_stopped
from bywire.core.libraries import how_to_install
from bywire.core.pairs import read_count
from bywire.core.scratch import scratch_folder
from bywire.core.typing import Array
from bywire.simulation.c_runtime import CUDA, ONE_LANE
from bywire.simulation.compiler import digest_of, is_intact, sha256, usable_folder
from bywire.simulation.emit_single import Caller, emit_single
from bywire.simulation.native import Ends, Inputs, Request, plan_array, pointer
from bywire.simulation.program import Program
from bywire.simulation.schedule import Layout, Schedule
from bywire.simulation.stages import Stages, build_stages, layout_of, leaf_count

# Fused products and sums would round differently from the processor's kernels. The second option is
# necessary because the source does not declare each function as a device function.
OPTIONS = ("--fmad=false", "--device-as-default-execution-space")
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
        _, *version = nvrtc.nvrtcVersion()
        _, known = nvrtc.nvrtcGetSupportedArchs()
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
    error, program = nvrtc.nvrtcCreateProgram(text.encode(), b"kernel.cu", 0, [], [])
    try:
        if not int(error):
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
    _, size = size_of(program)
    content = bytes(bytearray(size))
    fill(program, content)
    return content


# --- The device and its driver

VARIABLE = "BYWIRE_GPU"
"""environment variable that selects one of several graphics processors by number"""
_NO_DRIVER = "the driver's library is missing"
_OUT_OF_MEMORY = 2  # CUDA_ERROR_OUT_OF_MEMORY
_BLOCKING = 4  # CU_CTX_SCHED_BLOCKING_SYNC
_MEGA = 1e6
_FLOAT = 8  # bytes


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
        # A thread that waits leaves its core to other work. The flag is a wish: another library of
        # this process may have chosen already.
        driver.cuDevicePrimaryCtxSetFlags(self._device, _BLOCKING)
        self._free: list[tuple[int, int]] = []
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
        """Return the number of free bytes."""
        with self._current():
            return int(self._checked(self._driver.cuMemGetInfo())[0])

    def host_array(self, shape: tuple[int, ...]) -> Array:
        """Return an uninitialized array in page-locked memory, which the device fills directly.

        The system maps new memory page by page, which takes longer than to fill it. So the memory
        of an array that nothing refers to any more is used again. Memory that cannot be locked is
        ordinary memory.
        """
        size = max(math.prod(shape) * _FLOAT, 8)
        with self._current():
            fitting = [each for each in self._free if size <= each[1] <= 2 * size]
            if fitting:
                block = min(fitting, key=lambda each: each[1])
                self._free.remove(block)
            else:
                for address, _ in self._free:
                    self._driver.cuMemFreeHost(address)
                self._free.clear()
                status, address = self._driver.cuMemHostAlloc(size, 0)
                if int(status):
                    return np.empty(shape)
                block = int(address), size
        held = (ctypes.c_byte * block[1]).from_address(block[0])
        weakref.finalize(held, self._free.append, block).atexit = False
        memory = memoryview(held)  # keeps it
        return np.frombuffer(memory, dtype=float, count=math.prod(shape)).reshape(shape)

    @contextmanager
    def working(self) -> Iterator[Memory]:
        """Reserve the device and memory on it; the memory is freed at the end."""
        with self._current():
            memory = Memory(self._driver, self._checked)
            try:
                yield memory
            finally:
                memory.give_back()

    @contextmanager
    def _current(self) -> Iterator[None]:
        """Reserve the device for the calling thread. This costs no time: it has only one queue."""
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
            unknown, *sizes = self._driver.cuMemGetInfo()  # this call may also fail
            left = (
                ""
                if int(unknown)
                else " ({:.4g} of {:.4g} MB are free)".format(*(size / _MEGA for size in sizes))
            )
            need = f"{size / _MEGA:.3g} MB" if size else "memory"
            raise DeviceError(
                f"{self.label} cannot allocate {need}{left}. End other programs on this graphics "
                f"processor, select another one with {VARIABLE}, {OTHERWISE}",
                name=self.label,
                value=need,
            )
        _, reason = self._driver.cuGetErrorString(status)
        text = (reason or b"").decode(errors="replace") or status.name
        where = getattr(self, "label", "a graphics processor")
        message = f"{where} failed: {text} ({status.name}). Rerun the command, {OTHERWISE}"
        raise DeviceError(message, name=where, value=status.name)


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
        place = self._checked(self._driver.cuMemAlloc(max(size, 8)), size)
        self._places.append(place)
        return place

    def put(self, place: Any, array: NDArray[Any]) -> None:
        """Copy a C-contiguous array to an address."""
        if array.nbytes:
            self._checked(self._driver.cuMemcpyHtoD(place, pointer(array).value, array.nbytes))

    def get(self, place: Any, array: NDArray[Any]) -> None:
        """Copy memory at an address into a C-contiguous array."""
        if array.nbytes:
            self._checked(self._driver.cuMemcpyDtoH(pointer(array).value, place, array.nbytes))

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

    def give_back(self) -> None:
        """Free all memory."""
        for place in self._places:  # a failed kernel has already invalidated everything
            self._driver.cuMemFree(place)


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
    return CudaDevice(driver, number)


# --- Kernels of many cases
# The graphics processor computes cases in batches that fit into its memory, and each batch in time
# intervals. The host fetches the rows of each interval before the next interval starts. Intervals
# are short, so they do not block a display for long.
#
# Each number of a case is next to the same number of the next case. So threads that run together
# access adjacent memory. Rows have the layout of the caller's array. Each thread has its own
# branches and cuts, like a single run.

ENTRY = "bw_run_cases"
"""name of the kernel's function"""
THREADS = 64
"""threads per block; few, because each thread uses as many of the shared registers as possible"""

# After `stages.PLAN`: number of threads and of recorded cases, the first row of the stimulus in
# memory, the distances between the entries of two cases, rows and signals, the frames of the first
# and last rows, and for each number of a stimulus its place, and the distances between its values
# in two rows and in two cases.
_NUMBERS = 8
_BEGIN = """const int64_t cases = plan[8 + {tasks}], used = plan[9 + {tasks}];
  const int64_t ahead = plan[10 + {tasks}], by_case = plan[11 + {tasks}];
  const int64_t by_row = plan[12 + {tasks}], by_signal = plan[13 + {tasks}];
  const int64_t end0 = plan[14 + {tasks}], end1 = plan[15 + {tasks}];
  const int64_t *restrict us = plan + 16 + {tasks};
  const int64_t at = (int64_t)blockIdx.x * blockDim.x + threadIdx.x;
  if (at >= cases) return;
  state += at;
  rec += at * by_case;
  double p[{np} + 1];
  for (int k = 0; k < {np}; ++k) p[k] = par[k * cases + at];
  (void)chosen; (void)ends; (void)end0; (void)end1; (void)us; (void)used;"""

_THREADS = Caller(
    runtime=ONE_LANE,
    head=f"""KERNEL void __launch_bounds__({THREADS}) {ENTRY}(const double *restrict par, double h,
    const double *restrict u, double *restrict state, const int64_t *restrict plan,
    double *restrict rec, double *restrict ends)""",
    begin=_BEGIN,
    stimulus="u[us[3 * {k}] + at_row * us[3 * {k} + 1] + at * us[3 * {k} + 2]]",
    entry="state[{k} * cases]",
    row="const int64_t at_row = f / stim - ahead;\n    (void)at_row;",
    record="",
)
_RECORD = """if (at < used) {{{{
        double *row = rec + (f / every - row0) * by_row;
        for (int j = 0; j < {rows}; ++j) row[j * by_signal] = o[j];
        for (int j = {rows}; j < {{count}}; ++j) {{{{
          double *both = ends + 2 * ((j - {rows}) * used + at);
          if (f == end0) both[0] = o[j];
          if (f == end1) both[1] = o[j];
        }}}}
      }}}}"""


def emit_cuda(stages: Stages, ends: int = 0) -> str:
    """Return the CUDA C source of the kernel.

    It does not include the compiler's prologue, which is ``c_runtime.CUDA`` for NVRTC. ``ends``:
    number of outputs at the end of the list that the kernel records only in the first and last
    rows.
    """
    record = _RECORD.format(rows=len(stages.output) - ends)
    return emit_single(stages, replace(_THREADS, record=record))


# --- The kernel

MOST = 2**15
"""maximum number of cases in a batch: the number of threads that the largest processors can hold"""
_SUBSTEPS = 5000  # substeps per time interval
_SHARE = 0.5  # fraction of the free memory for a batch; thread stacks and other data need the rest


class CudaKernel:
    """Kernel for a batch of cases on a graphics processor.

    Parameters
    ----------
    device
        The graphics processor.
    stages
        Stages of the kernel for the requested signals.
    ends
        Number of signals at the end of the list that the kernel records only in the first and last
        rows.
    """

    at_once = 2
    """number of batches at a time: the host prepares or reads one while the device computes one"""
    shares_stimuli = True

    def __init__(self, device: CudaDevice, stages: Stages, ends: int = 0) -> None:
        self.layout: Layout = layout_of(stages)
        self.label = f"CUDA C, {device.label}"
        self.lanes = 1
        self._most = 2**62
        self._device, self._signals, self.ends = device, len(stages.output) - ends, ends
        self._inputs = leaf_count(stages, "p"), leaf_count(stages, "u")
        self._function = device.load(emit_cuda(stages, ends), ENTRY)

    def for_cases(self, count: int, schedule: Schedule) -> CudaKernel:
        """Return the kernel for batches that fit into memory, of about equal size.

        Raises
        ------
        DeviceError
            When a single case does not fit into memory.
        """
        free = self._device.free()
        room = int(_SHARE * free) - _plan_size(schedule, self._inputs[1])
        size, row = self._size(schedule), _FLOAT * self._signals
        least = size + row * _most_rows(schedule)
        most = min(MOST, room // least)
        if most < 1:
            raise DeviceError(
                f"{self._device.label} has {free / 1e6:.3g} MB free. A case may use half of it, "
                f"but needs {least / 1e6:.3g} MB. Record fewer signals, or record them less often",
                name=self._device.label,
                value=f"{least / 1e6:.3g} MB",
                valid=f"{free / 1e6:.3g} MB free",
            )
        batches = -(-count // most)
        sized = copy.copy(self)
        sized.lanes = -(-count // batches)
        sized._most = (room // sized.lanes - size) // max(row, 1)
        return sized

    def rows(self, cases: int, rows: int) -> Array:
        """Return an array for recorded rows in the device's layout; see `CaseKernel`."""
        return self.array((rows, self._signals, cases)).transpose(2, 0, 1)

    def array(self, shape: tuple[int, ...]) -> Array:
        """Return an uninitialized array that the device fills fast; see `CaseKernel`."""
        return self._device.host_array(shape)

    def advance(
        self,
        schedule: Schedule,
        parameters: Array,
        stimulus: Array | Inputs,
        vector: Array,
        rows: Array,
        end: int,
        begin: int = 0,
        ends: Ends | None = None,
    ) -> None:
        """Run the frames from begin to end for one batch; see ``case_kernels.LaneKernel.advance``.

        ``stimulus``: rows for all cases, shape (rows, nu), or `Inputs`.

        Raises
        ------
        DeviceError
            When the device fails, or other programs have allocated its memory in the meantime.
        KeyboardInterrupt
            When the user interrupts the run, or stops it in a thread.
        """
        inputs = (
            stimulus
            if isinstance(stimulus, Inputs)
            else Inputs.of(lambda _: stimulus.T, 1, self.lanes)
        )
        frames = (-1, -1) if ends is None else ends.frames
        with self._device.working() as memory:
            state, par = memory.room(vector.nbytes), memory.room(parameters.nbytes)
            memory.put(state, vector)
            memory.put(par, parameters)
            given = _Given(memory, inputs, _stimulus_rows(schedule))
            plan = memory.room(_plan_size(schedule, self._inputs[1]))
            pieces = _pieces(schedule, begin, end)
            counts = [rows_between(schedule, *piece) for piece in pieces]
            recording = _Recording(rows, counts, self._most, self.array)
            room = memory.room(recording.size)
            apart = np.empty(0) if ends is None else np.ascontiguousarray(ends.values)
            edges = memory.room(apart.nbytes)
            memory.put(edges, apart)
            for number, (first, last) in enumerate(pieces):
                raise_if_stopped()
                if not recording.fits(counts[number]):
                    recording.fetch(memory, room)
                if not recording.count:
                    recording.begin(counts[number:])
                ahead = first // schedule.stimulus_frames
                where = given.rows(ahead, last // schedule.stimulus_frames + 1)
                numbers = [*plan_array(schedule, first, last, self._signals)]
                numbers += [self.lanes, len(rows), ahead, *recording.apart, *frames, *where]
                memory.put(plan, np.array(numbers, dtype=np.int64))
                memory.run(
                    self._function,
                    -(-self.lanes // THREADS),
                    THREADS,
                    (
                        par,
                        float(schedule.step),
                        given.place,
                        state,
                        plan,
                        int(room) + recording.offset,
                        edges,
                    ),
                )
                recording.count += counts[number]
            recording.fetch(memory, room)
            memory.get(state, vector)
            if ends is not None:
                memory.get(edges, apart)
                ends.values[:] = apart

    def _size(self, schedule: Schedule) -> int:
        """Return the size in bytes of a case with its own stimulus, without recorded rows."""
        parameters, inputs = self._inputs
        stimulus = inputs * _stimulus_rows(schedule)
        return _FLOAT * (parameters + self.layout.total + stimulus + 2 * self.ends)


def _plan_size(schedule: Schedule, inputs: int) -> int:
    """Return the size of a kernel's plan in bytes."""
    return _FLOAT * (8 + len(schedule.task_frames) + _NUMBERS + 3 * inputs)


class _Given:
    """The stimulus of a batch on the device, a time interval at a time.

    Parameters
    ----------
    memory, inputs
        The device's memory, and the stimulus.
    most
        Maximum number of rows in an interval.
    """

    def __init__(self, memory: Memory, inputs: Inputs, most: int) -> None:
        self._memory, self._inputs = memory, inputs
        size = sum(len(each) * min(each.shape[1], most) for each in inputs.values)
        self.place = memory.room(_FLOAT * size)

    def rows(self, begin: int, end: int) -> list[int]:
        """Copy the rows from begin to end, and return the place and distances of each number."""
        parts = [each[:, begin:end] if each.shape[1] > 1 else each for each in self._inputs.values]
        if parts:
            self._memory.put(self.place, np.concatenate([part.ravel() for part in parts]))
        where, start = [], 0
        for part, each in zip(parts, self._inputs.values, strict=True):
            by_row = int(each.shape[1] > 1)
            where += [start, by_row, part.shape[1] if len(part) > 1 else 0]
            start += part.size
        return where


def _frames(schedule: Schedule) -> int:
    """Return the number of frames in a time interval."""
    return max(_SUBSTEPS // schedule.substeps, 1)


class _Recording:
    """Destination of the rows of several time intervals, in the order of the caller's array.

    If the rows fill the caller's array and have room on the device, they are fetched at the end,
    directly into the array. Otherwise, the rows of each interval go through a buffer.

    Parameters
    ----------
    rows
        The caller's array; see `CudaKernel.advance`.
    counts
        Number of rows of each interval.
    most
        Maximum number of rows on the device.
    array
        ``array(shape)`` allocates the buffer.
    """

    def __init__(
        self,
        rows: Array,
        counts: Sequence[int],
        most: int,
        array: Callable[[tuple[int, ...]], Array],
    ) -> None:
        self._rows, self._at, self.count = rows, 0, 0
        self._order = sorted(range(3), key=lambda axis: -rows.strides[axis])
        straight = rows[:, : sum(counts)].transpose(self._order)
        self._is_whole = straight.flags.c_contiguous and sum(counts) <= most
        self._most = sum(counts) if self._is_whole else max(counts)
        size = len(rows) * self._most * rows.shape[2]
        self._buffer = array((0 if self._is_whole else size,))
        self.size = _FLOAT * size
        self.begin([0])

    @property
    def offset(self) -> int:
        """Place of the next row on the device, from the first one [byte]."""
        return _FLOAT * self.apart[1] * self.count

    def fits(self, count: int) -> bool:
        """Return whether there is room for so many more rows."""
        return self.count + count <= self._planned

    def begin(self, counts: Sequence[int]) -> None:
        """Prepare the destination of the rows of the next intervals, as many as there is room."""
        totals = np.cumsum(counts)
        self._planned = int(totals[totals <= self._most].max(initial=counts[0]))
        shape = len(self._rows), self._planned, self._rows.shape[2]
        target = self._rows[:, self._at : self._at + self._planned].transpose(self._order)
        buffer = self._buffer[: math.prod(shape)] if not self._is_whole else None
        self._target = target
        self._place = (
            target if buffer is None else buffer.reshape([shape[axis] for axis in self._order])
        )
        strides = self._place.transpose(np.argsort(self._order)).strides
        self.apart = [stride // _FLOAT for stride in strides]

    def fetch(self, memory: Memory, room: Any) -> None:
        """Copy the rows into the caller's array."""
        if self.count:
            memory.get(room, self._place)
            if not self._is_whole:
                self._target[:] = self._place
        self._at += self.count
        self.count = 0


def rows_between(schedule: Schedule, begin: int, end: int) -> int:
    """Return the number of recorded rows from frame begin up to end, exclusive unless the run ends.

    The kernel counts them in the same way, using its plan.
    """
    every = schedule.record_frames
    return -(-(end + int(end == schedule.frames)) // every) - -(-begin // every)


def _stimulus_rows(schedule: Schedule) -> int:
    """Return the maximum number of stimulus rows that a time interval reads."""
    return _frames(schedule) // schedule.stimulus_frames + 2


def _most_rows(schedule: Schedule) -> int:
    """Return the maximum number of rows that a time interval records, including the last row."""
    return _frames(schedule) // schedule.record_frames + 2


def _pieces(schedule: Schedule, begin: int, end: int) -> list[tuple[int, int]]:
    """Return first and end frame of each time interval; at a run's end, only its row remains."""
    edges = [*range(begin, end, _frames(schedule)), end]
    return list(pairwise(edges)) or [(begin, end)]


class CudaEngine:
    """Single runs on the graphics processor: slow, but bit-identical to those in a batch."""

    def __init__(self, program: Program) -> None:
        self._kernel = CudaKernel(find_device(), build_stages(program))
        self.layout, self.label = self._kernel.layout, self._kernel.label

    def advance(self, request: Request, state: Array, begin: int, end: int, rows: Array) -> None:
        """Run the frames from begin to end in place; see ``engine.Engine``."""
        schedule, vector = request.schedule, state[:, None].copy()
        count = rows_between(schedule, begin, end)
        recorded = self._kernel.rows(1, count)
        self._kernel.advance(
            schedule, request.parameters[:, None], request.stimulus, vector, recorded, end, begin
        )
        rows[:count] = recorded[0][:, request.selection]
        state[:] = vector[:, 0]
