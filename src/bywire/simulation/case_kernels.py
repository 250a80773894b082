"""Kernels for many cases: lanes of the processor's vectors, or threads of a graphics processor.

The engine's name selects the kind. Both kinds have the same interface and compute a group of cases
at a time.
"""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from bywire.core.errors import unknown_name
from bywire.core.machine import worker_count
from bywire.core.typing import Array
from bywire.simulation.compiler import IN_TURN, VECTOR, Compiler, find_compiler, load, load_library
from bywire.simulation.engine import CUDA, Prepared, built_once, engine_names
from bywire.simulation.native import Ends, plan_array, pointer, run_in_calls
from bywire.simulation.schedule import Layout, Schedule

if TYPE_CHECKING:
    from bywire.simulation.cuda import CudaKernel, HeldRows
    from bywire.simulation.cuda_device import CudaDevice
    from bywire.simulation.program import Program

PAIRED = 32
"""minimum number of cases for kernels that alternate two vectors, because fewer leave lanes idle"""


class CaseKernel(Protocol):
    """Kernel for many cases, a group at a time.

    Parameters
    ----------
    lanes
        Number of cases in a group.
    at_once
        Best number of calling threads.
    shares_stimuli
        Whether it reads a stimulus without repetitions, `native.Inputs`.
    """

    layout: Layout
    label: str
    lanes: int
    at_once: int
    shares_stimuli: bool

    def rows(self, cases: int, rows: int) -> Array:
        """Return an array for the recorded rows, shape (cases, rows, signals)."""
        ...

    def array(self, shape: tuple[int, ...]) -> Array:
        """Return an array that the kernel fills fast; its values are not determined."""
        ...

    def hold(self, shape: tuple[int, int, int]) -> HeldRows | None:
        """Return rows of shape (signals, cases, rows) that stay on a device; None for an array."""
        ...

    def advance(
        self,
        schedule: Schedule,
        parameters: Array,
        stimulus: Any,
        vector: Array,
        rows: Any,
        end: int,
        begin: int = 0,
        ends: Ends | None = None,
    ) -> None:
        """Run the frames from begin to end for one group; see `LaneKernel.advance`."""
        ...


class LaneKernel:
    """Compiled kernel for a group of cases and a selection of signals.

    ``signals``: number of recorded outputs. ``ends``: number of outputs at the end of the list that
    the kernel records only in the first and last rows.
    """

    ENTRY = "bw_run_lanes"
    """name of the kernel's function in the library"""
    shares_stimuli = False

    def __init__(
        self, layout: Layout, library: Path, compiler: Compiler, signals: int, ends: int = 0
    ) -> None:
        self.layout, self.library, self.compiler = layout, library, compiler
        self._signals, self.ends = signals - ends, ends
        loaded = load(library, self.ENTRY)
        self.lanes, self.at_once = int(loaded.bw_lanes()), worker_count()
        self.label = f"compiled C in {self.lanes} lanes, {compiler.label}"
        self._run = loaded[self.ENTRY]
        self._run.restype = ctypes.c_int64

    @classmethod
    def of(
        cls,
        program: Program,
        compiler: Compiler,
        selection: tuple[int, ...],
        in_pairs: bool,
        ends: int = 0,
    ) -> LaneKernel:
        """Emit the kernel of a program, and compile it unless it is in the cache.

        ``in_pairs``: whether there are enough cases for two alternating vectors, which the kernel
        uses only if they save time. ``ends``: see `LaneKernel`.
        """
        from bywire.simulation.emit_lanes import emit_lanes, takes_turns
        from bywire.simulation.stages import build_stages, layout_of

        stages = build_stages(program, outputs=selection)
        in_turn = in_pairs and takes_turns(stages)
        flags = IN_TURN if in_turn else VECTOR
        _, library = load_library(emit_lanes(stages, in_turn, ends), flags, compiler, cls.ENTRY)
        return cls(layout_of(stages), library, compiler, len(selection), ends)

    def rows(self, cases: int, rows: int) -> Array:
        """Return an array for the recorded rows; see `CaseKernel`."""
        return np.empty((cases, rows, self._signals))

    def array(self, shape: tuple[int, ...]) -> Array:
        """Return an uninitialized array; see `CaseKernel`."""
        return np.empty(shape)

    def hold(self, shape: tuple[int, int, int]) -> None:
        """Return nothing, because a processor's rows are arrays; see `CaseKernel`."""
        return

    def advance(
        self,
        schedule: Schedule,
        parameters: Array,
        stimulus: Array,
        vector: Array,
        rows: Array,
        end: int,
        begin: int = 0,
        ends: Ends | None = None,
    ) -> None:
        """Run the frames from begin to end for one group; update ``vector`` and fill ``rows``.

        Parameters
        ----------
        parameters
            Shape (np, lanes).
        stimulus
            Shape (rows, nu) for all lanes, or (rows, nu, lanes).
        vector
            State vectors, shape (entries, lanes).
        rows
            Shape (cases, recorded rows of these frames, signals), with any strides. Lanes beyond
            the last case are not recorded.
        ends
            Destination for the signals that are recorded only in the first and last rows. None for
            a kernel without such signals, and if these frames contain neither of the two rows.
        """
        own = stimulus.ndim == 3
        apart = [stride // rows.itemsize for stride in rows.strides]
        at = (-1, -1, 0) if ends is None else (*ends.frames, ends.values.strides[0] // 8)

        def call(first: int, last: int, row: int) -> int:
            plan = plan_array(schedule, first, last, self._signals)
            plan = np.array([*plan, int(own), len(rows), *apart, *at], dtype=np.int64)
            return int(
                self._run(
                    pointer(parameters),
                    ctypes.c_double(schedule.step),
                    pointer(stimulus),
                    pointer(vector),
                    pointer(plan),
                    ctypes.c_void_p(rows.ctypes.data + row * rows.strides[1]),
                    ctypes.c_void_p(None if ends is None else ends.values.ctypes.data),
                )
            )

        run_in_calls(schedule, begin, end, call)


def is_side_by_side(engine: str) -> bool:
    """Return whether an engine computes many cases side by side on this machine.

    Raises
    ------
    UnknownNameError
        When the engine is unknown.
    """
    if engine not in engine_names():
        raise unknown_name("engine", engine, engine_names())
    return engine == CUDA or (engine in ("auto", "compiled") and find_compiler() is not None)


def case_kernel(
    prepared: Prepared,
    engine: str,
    selection: tuple[int, ...],
    count: int,
    schedule: Schedule,
    ends: int = 0,
) -> CaseKernel:
    """Return the kernel for a number of cases that records the outputs with these indices.

    ``ends``: see `LaneKernel`.

    Raises
    ------
    DeviceError
        For ``cuda`` without a graphics processor, or without enough memory on it.
    """
    if engine == CUDA:
        from bywire.simulation.cuda_device import find_device

        return cuda_kernel(prepared, find_device(), selection, ends).for_cases(count, schedule)
    compiler = find_compiler()
    assert compiler is not None
    return lane_kernel(prepared, compiler, selection, count >= PAIRED, ends)


@built_once
def cuda_kernel(
    prepared: Prepared, device: CudaDevice, selection: tuple[int, ...], ends: int = 0
) -> CudaKernel:
    """Return a graphics processor's kernel for the outputs with these indices; built only once."""
    from bywire.simulation.cuda import CudaKernel
    from bywire.simulation.stages import build_stages

    return CudaKernel(device, build_stages(prepared.program, outputs=selection), ends)


@built_once
def lane_kernel(
    prepared: Prepared,
    compiler: Compiler,
    selection: tuple[int, ...],
    in_pairs: bool = False,
    ends: int = 0,
) -> LaneKernel:
    """Return the kernel that records the outputs with these indices; built only once.

    The function uses a kernel from an earlier command unchanged. ``in_pairs``, ``ends``: see
    `LaneKernel.of`.
    """
    place = None if prepared.place is None else prepared.place.in_lanes(selection, in_pairs, ends)
    kept = None if place is None else place.kept()
    if kept is not None and kept.library is not None and kept.compiler == compiler.label:
        return LaneKernel(kept.layout, kept.library, compiler, len(selection), ends)
    kernel = LaneKernel.of(prepared.program, compiler, selection, in_pairs, ends)
    if place is not None:
        place.keep(kernel)
        prepared.keep_model()
    return kernel
