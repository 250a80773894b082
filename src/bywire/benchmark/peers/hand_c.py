"""The hand-written C of ``hand_written.c``: compiled, loaded, called."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.assemblies.motorcycle_ecu import Memory, Stimulus
from bywire.assemblies.motorcycle_energy import Flow
from bywire.assemblies.motorcycle_output import Output
from bywire.assemblies.motorcycle_parameters import MotorcycleParameters as Par
from bywire.assemblies.motorcycle_plant import State
from bywire.core.errors import CompilerError
from bywire.simulation.compiler import PLAIN, compile_library, find_compiler
from bywire.simulation.native import pointer
from bywire.simulation.run import Run

Array = NDArray[np.float64]

SOURCE = Path(__file__).parents[1] / "hand_written.c"
THREADS = ("-O2", "-fopenmp")
WITHOUT_SUMS = ("-DWITHOUT_SUMS",)
"""leaves out the energies, whose outputs then mean nothing: where none of them is recorded"""
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
_COUNTERS = 2  # substeps that did not settle, and that were near a stop or the limit


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
    names, values
        Outputs, values of shape (cases, rows, signals); filled by each call.
    state
        State and Memory at the start, then counters; shape (cases, length); filled by each call.
    substeps
        Substeps of all cases together.
    """

    names: tuple[str, ...]
    values: Array
    state: Array
    substeps: int
    _inputs: tuple[NDArray[Any], ...]  # kept alive: the arguments are bare addresses
    _call: Callable[[], None]

    def __call__(self) -> float:
        """Compute once and return the seconds that it took."""
        begin = time.perf_counter()
        self._call()
        return time.perf_counter() - begin

    def __getitem__(self, name: str) -> Array:
        """Return one output, shape (cases, rows)."""
        return np.asarray(self.values[:, :, self.names.index(name)])

    @property
    def unsettled(self) -> int:
        """Substeps whose contacts did not settle."""
        return int(self.state[:, -2].sum())

    @property
    def careful(self) -> int:
        """Substeps near a stop or at the limit of the pressure."""
        return int(self.state[:, -1].sum())


class HandWritten:
    """The compiled library, for one run or for an ensemble of scalar runs on all cores.

    Parameters
    ----------
    par
        Any parameter set of the structure that it covers.
    flags
        ``PLAIN`` for single runs, ``THREADS`` for ensembles, ``WITHOUT_SUMS`` beside either; on
        top of the flags that all kernels get, so that code is compared and not settings.

    Raises
    ------
    CompilerError
        Without a C compiler, or without its OpenMP when ``THREADS`` asks for it.
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
        """Prepare one run, all outputs recorded."""
        shared, state, values = _arrays(run, [run.par], OUTPUTS)
        arguments = (*_arguments(run, shared), pointer(state), pointer(values))
        return Call(OUTPUTS, values, state, _substeps(run), shared, lambda: self._run(*arguments))

    def ensemble(self, run: Run, cases: Sequence[Par], signals: Sequence[str]) -> Call:
        """Prepare one run per parameter set, with the initial values and the stimulus of ``run``.

        Parameters
        ----------
        run
            Its own parameters count only as structure.
        cases
            Parameter sets.
        signals
            Outputs to record.
        """
        shared, state, values = _arrays(run, cases, signals)
        selected = np.array([OUTPUTS.index(s) for s in signals], dtype=np.int32)
        arguments = (
            ctypes.c_int64(len(cases)),
            *_arguments(run, shared),
            pointer(state),
            ctypes.c_int64(selected.size),
            pointer(selected),
            pointer(values),
        )
        kept = (*shared, selected)
        count = len(cases) * _substeps(run)
        return Call(tuple(signals), values, state, count, kept, lambda: self._ensemble(*arguments))


def _arrays(
    run: Run, cases: Sequence[Any], signals: Sequence[str]
) -> tuple[tuple[Array, Array], Array, Array]:
    """Return parameters and stimulus, the states at the start, and room for the outputs."""
    schedule = run.schedule()
    if (*schedule.task_frames, schedule.record_frames) != (1, 1):
        raise ValueError("the hand-written C records once per ECU tick: record = ecu.T_s")
    parameters = np.array([list(par.leaves().values()) for par in cases], dtype=np.float64)
    times = np.arange(schedule.rows, dtype=np.float64) * schedule.frame
    stimulus = np.ascontiguousarray(run.stimulus(times), dtype=np.float64)
    state = np.tile([*run.state, *run.memory, *[0.0] * _COUNTERS], (len(cases), 1))
    values = np.empty((len(cases), schedule.rows, len(signals)))
    return (parameters, stimulus), state, values


def _arguments(run: Run, shared: tuple[Array, Array]) -> tuple[Any, ...]:
    parameters, stimulus = shared
    schedule = run.schedule()
    return (
        pointer(parameters),
        ctypes.c_double(schedule.step),
        ctypes.c_int64(schedule.frames),
        ctypes.c_int64(schedule.substeps),
        pointer(stimulus),
    )


def _substeps(run: Run) -> int:
    schedule = run.schedule()
    return schedule.frames * schedule.substeps
