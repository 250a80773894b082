"""The hand-written C of ``hand_written.c``: compiled, loaded, called."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.assemblies.motorcycle_brake import Flow, Memory, Output, Par, State, Stimulus
from bywire.core.errors import CompilerError
from bywire.simulation.compiler import PLAIN, compile_library, find_compiler
from bywire.simulation.native import pointer
from bywire.simulation.run import Run

Array = NDArray[np.float64]

SOURCE = Path(__file__).parents[1] / "hand_written.c"
THREADS = ("-O2", "-fopenmp")
OUTPUTS = Output._fields
CHOICES = {
    "gear.law": "paper",
    "port.law": "makeup",
    "fluid.air": "none",
    "caliper.law": "linear",
    "pressure_sensor.place": "master-cylinder",
    "adc.law": "quantized",
    "ecu.filter.place": "after-dither",
    "ecu.dither.waveform": "sine",
    "drive.mode": "pressure",
}
_INCLUDE = '#include "hand_written_indices.h"\n'
_REACTIONS = 4  # friction, makeup flow, forces of the two stops
_COUNTERS = 2  # unsettled and repeated substeps


def indices(par: Par) -> str:
    """Return the C enums that name the entries of the arrays, in the model's own order."""
    lists: dict[str, Iterable[str]] = {
        "P": (name.replace(".", "_") for name in par.leaves()),
        "X": State._fields,
        "M": Memory._fields,
        "U": Stimulus._fields,
        "E": Flow._fields,
        "O": Output._fields,
    }
    return "".join(
        f"enum {{ {', '.join(f'{prefix}_{name}' for name in (*names, 'COUNT'))} }};\n"
        for prefix, names in lists.items()
    )


def source(par: Par) -> str:
    """Return the complete C source for the structure of a parameter set.

    Raises
    ------
    ValueError
        When the set makes a choice that the hand-written C does not cover.
    """
    for name, wanted in CHOICES.items():
        if par.flat()[name] != wanted:
            raise ValueError(
                f"{name} = {par.flat()[name]!r}: the hand-written C covers {wanted!r} only"
            )
    text = SOURCE.read_text()
    if _INCLUDE not in text:
        raise ValueError(f"{SOURCE} must include the generated indices: {_INCLUDE.strip()}")
    return text.replace(_INCLUDE, indices(par))


@dataclass(frozen=True)
class Call:
    """A prepared call: every use of it repeats the same computation from the start.

    Parameters
    ----------
    values
        Outputs, shape (cases, rows, signals); filled by each call.
    state
        State vectors at the end, shape (cases, length); filled by each call.
    substeps
        Substeps of all cases together.
    """

    values: Array
    state: Array
    substeps: int
    _start: Array
    _inputs: tuple[Array, ...]  # kept alive: the arguments are bare addresses
    _function: Any
    _arguments: tuple[Any, ...]

    def __call__(self) -> float:
        """Compute once and return the seconds that it took."""
        self.state[:] = self._start
        begin = time.perf_counter()
        self._function(*self._arguments)
        return time.perf_counter() - begin

    def signal(self, name: str) -> Array:
        """Return one output, shape (cases, rows)."""
        return self.values[:, :, OUTPUTS.index(name)]

    @property
    def unsettled(self) -> int:
        """Substeps whose contacts did not settle."""
        return int(self.state[:, -2].sum())

    @property
    def repeated(self) -> int:
        """Substeps that took more than one pass."""
        return int(self.state[:, -1].sum())


class HandWritten:
    """The compiled library, for one run or for an ensemble of scalar runs on all cores.

    Parameters
    ----------
    par
        Any parameter set of the structure that it covers.
    flags
        ``PLAIN`` for single runs (with the flags of bywire's own kernels, so that the
        comparison is of code and not of compiler settings), ``THREADS`` for ensembles.

    Raises
    ------
    CompilerError
        Without a C compiler, or when it has no OpenMP and ``THREADS`` is asked for.
    """

    def __init__(self, par: Par, flags: tuple[str, ...] = PLAIN) -> None:
        compiler = find_compiler()
        if compiler is None:
            raise CompilerError("the hand-written C needs a C compiler: install one")
        self.label = f"hand-written C, {compiler.label}, {' '.join(flags)}"
        library = ctypes.CDLL(str(compile_library(source(par), flags, compiler)))
        self._run, self._ensemble = library.hand_run, library.hand_ensemble
        self._run.restype = self._ensemble.restype = None

    def single(self, run: Run) -> Call:
        """Prepare one run; its recording interval must be the ECU's sample time."""
        return self._prepare(run, [run.par], single=True)

    def ensemble(self, run: Run, cases: Sequence[Par]) -> Call:
        """Prepare one run per parameter set, all with the initial values and stimulus of ``run``."""
        return self._prepare(run, cases, single=False)

    def _prepare(self, run: Run, cases: Sequence[Any], single: bool) -> Call:
        schedule = run.schedule()
        if (*schedule.task_frames, schedule.record_frames) != (1, 1):
            raise ValueError("the hand-written C records once per ECU tick: record = ecu.T_s")
        n, rows = len(cases), schedule.rows
        parameters = np.array([list(par.leaves().values()) for par in cases])
        rates = np.ascontiguousarray(run.stimulus(np.arange(rows) * schedule.frame))
        start = np.tile(_initial(run), (n, 1))
        state, values = start.copy(), np.empty((n, rows, len(OUTPUTS)))
        common = (
            pointer(parameters),
            ctypes.c_double(schedule.step),
            ctypes.c_int64(schedule.frames),
            ctypes.c_int64(schedule.substeps),
            pointer(rates),
            pointer(state),
            pointer(values),
        )
        return Call(
            values=values,
            state=state,
            substeps=n * schedule.frames * schedule.substeps,
            _start=start,
            _inputs=(parameters, rates),
            _function=self._run if single else self._ensemble,
            _arguments=common if single else (ctypes.c_int64(n), *common),
        )


def _initial(run: Run) -> Array:
    """Return the state vector of the C file at the start: state, increments, memory, the rest."""
    rest = len(Flow._fields) + _REACTIONS + _COUNTERS
    return np.concatenate([run.state, np.zeros(len(State._fields)), run.memory, np.zeros(rest)])
