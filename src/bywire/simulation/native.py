"""Compiled kernels: emitted, compiled, loaded, called through raw pointers."""

from __future__ import annotations

import ctypes
import hashlib
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.typing import Array
from bywire.simulation.compiler import SINGLE, Compiler, load_library
from bywire.simulation.kernel_cache import load
from bywire.simulation.layout import Layout
from bywire.simulation.schedule import Schedule

if TYPE_CHECKING:
    from bywire.simulation.program import Program


_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.S)


@dataclass(frozen=True)
class Request:
    """What a kernel works on, as contiguous arrays.

    Parameters
    ----------
    parameters
        Shape (np,).
    stimulus
        Shape (stimulus rows, nu).
    selection
        Indices of the outputs to record, int32.
    """

    schedule: Schedule
    parameters: Array
    stimulus: Array
    selection: NDArray[np.int32]


@dataclass(frozen=True)
class Ends:
    """Where the signals recorded at both ends of the rows alone go.

    Parameters
    ----------
    values
        Shape (signals, cases, 2), those of a signal in one piece.
    frames
        Those of the first and the last row.
    """

    values: Array
    frames: tuple[int, int]


def plan_array(schedule: Schedule, begin: int, end: int, selected: int) -> NDArray[np.int64]:
    """Return the kernel's plan for frames begin..end; the row of the last frame at the end."""
    return np.array(
        [
            begin,
            end,
            int(end == schedule.frames),
            schedule.substeps,
            schedule.stimulus_frames,
            schedule.record_frames,
            -(-begin // schedule.record_frames),
            selected,
            *schedule.task_frames,
        ],
        dtype=np.int64,
    )


def pointer(array: NDArray[Any]) -> ctypes.c_void_p:
    """Return the address of a C-contiguous array."""
    if not array.flags.c_contiguous:
        raise ValueError("kernels take C-contiguous arrays only")
    return ctypes.c_void_p(array.ctypes.data)


def text_digest(text: str) -> str:
    """Digest of a kernel's C: what it computes, without comments."""
    return hashlib.sha256(_COMMENT.sub("", text).encode()).hexdigest()


class SingleKernel:
    """Compiled kernel for one run."""

    ENTRY = "bw_run"
    """its function in the library"""

    def __init__(
        self, layout: Layout, library: Path, compiler: Compiler, digest: str = ""
    ) -> None:
        self.layout, self.library, self.compiler = layout, library, compiler
        self.digest = digest
        self.label = f"compiled C, {compiler.label}"
        self._run = load(library, self.ENTRY)[self.ENTRY]
        self._run.restype = None

    @classmethod
    def of(cls, program: Program, compiler: Compiler) -> SingleKernel:
        """Emit the kernel of a program, and compile it unless the cache has it."""
        from bywire.simulation.emission import layout_of
        from bywire.simulation.emit_single import emit_single
        from bywire.simulation.stages import build_stages

        stages = build_stages(program)
        text = emit_single(stages)
        _, library = load_library(text, SINGLE, compiler, cls.ENTRY)
        return cls(layout_of(stages), library, compiler, text_digest(text))

    def advance(self, request: Request, state: Array, begin: int, end: int, rows: Array) -> None:
        """Run frames begin..end: renews ``state`` and fills ``rows`` in place.

        Parameters
        ----------
        state
            State vector, see ``layout.Layout``.
        rows
            Shape (recorded rows of these frames, selected outputs).
        """
        plan = plan_array(request.schedule, begin, end, request.selection.size)
        self._run(
            pointer(request.parameters),
            ctypes.c_double(request.schedule.step),
            pointer(request.stimulus),
            pointer(state),
            pointer(plan),
            pointer(request.selection),
            pointer(rows),
        )
