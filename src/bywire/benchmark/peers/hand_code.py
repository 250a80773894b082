"""Hand-written C of a brake: its source put together, compiled, loaded, called."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import CompilerError
from bywire.core.parameters import ParameterSet
from bywire.simulation.compiler import PLAIN, compile_library, find_compiler
from bywire.simulation.native import pointer
from bywire.simulation.run import Run

Array = NDArray[np.float64]

FOLDER = Path(__file__).parents[1]
THREADS = ("-O2", "-fopenmp")
WITHOUT_SUMS = ("-DWITHOUT_SUMS",)
"""leaves out the energies, whose outputs then mean nothing: where none of them is recorded"""
_COUNTERS = 2  # the first one: substeps that did not settle


@dataclass(frozen=True)
class Subject:
    """A brake, and the hand-written C that there is of it.

    Parameters
    ----------
    source, indices, shared
        Files in the benchmark's folder: the scheme; what it includes for the generated indices;
        what it includes for the parts that it shares with other schemes.
    model
        The brake's model, whose signals the indices name.
    flow
        NamedTuple of the integrals over the run.
    choices
        The choices that the C covers: name of a parameter, its admissible texts.
    """

    source: str
    indices: str
    model: Any
    flow: Any
    choices: Mapping[str, tuple[str, ...]]
    shared: tuple[str, ...] = ()

    @property
    def outputs(self) -> tuple[str, ...]:
        """The model's outputs in order."""
        return tuple(self.model.Output._fields)

    def enums(self, par: ParameterSet) -> str:
        """Return the C enums that name the entries of the arrays, in the model's own order."""
        lists: dict[str, Iterable[str]] = {
            "P": (name.replace(".", "_") for name in par.leaves()),
            "X": self.model.State._fields,
            "M": self.model.Memory._fields,
            "U": self.model.Stimulus._fields,
            "E": self.flow._fields,
            "O": self.model.Output._fields,
        }
        return "".join(
            f"enum {{ {', '.join(f'{prefix}_{name}' for name in (*names, 'COUNT'))} }};\n"
            for prefix, names in lists.items()
        )

    def text(self, par: ParameterSet, scheme: str | None = None) -> str:
        """Return the complete C source for the structure of a parameter set.

        Parameters
        ----------
        scheme
            Another file in place of ``source``.

        Raises
        ------
        ValueError
            When the set makes a choice that the hand-written C does not cover.
        """
        values = par.flat()
        for name, covered in self.choices.items():
            if values[name] not in covered:
                raise ValueError(
                    f"{name} = {values[name]!r}: the hand-written C covers "
                    f"{' and '.join(map(repr, covered))} only"
                )
        pieces = {self.indices: self.enums(par)}
        pieces |= {name: (FOLDER / name).read_text() for name in self.shared}
        path = FOLDER / (scheme or self.source)
        text = path.read_text()
        for name, piece in pieces.items():
            line = f'#include "{name}"\n'
            if line not in text:
                raise ValueError(f"{path} must include {name}")
            text = text.replace(line, piece)
        return text


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
    def extra(self) -> int:
        """The second counter, whose meaning the C states."""
        return int(self.state[:, -1].sum())


class HandCode:
    """The compiled library, for one run or for an ensemble of scalar runs on all cores.

    Parameters
    ----------
    subject
        The brake.
    par
        Any parameter set of the structure that the C covers.
    flags
        ``PLAIN`` for single runs, ``THREADS`` for ensembles, ``WITHOUT_SUMS`` beside either; on
        top of the flags that all kernels get, so that code is compared and not settings.

    Raises
    ------
    CompilerError
        Without a C compiler, or without its OpenMP when ``THREADS`` asks for it.
    """

    def __init__(
        self, subject: Subject, par: ParameterSet, flags: tuple[str, ...] = PLAIN
    ) -> None:
        self._subject = subject
        self.label, library = load(subject.text(par), flags)
        self._run, self._ensemble = library.hand_run, library.hand_ensemble
        self._run.restype = self._ensemble.restype = None

    def single(self, run: Run) -> Call:
        """Prepare one run, all outputs recorded."""
        outputs = self._subject.outputs
        shared, state, values = arrays(run, [run.par], outputs)
        arguments = (*plan_arguments(run, shared), pointer(state), pointer(values))
        return Call(outputs, values, state, _substeps(run), shared, lambda: self._run(*arguments))

    def ensemble(
        self, run: Run, cases: Sequence[ParameterSet], signals: Sequence[str]
    ) -> Call:
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
        shared, state, values = arrays(run, cases, signals)
        selected = np.array([self._subject.outputs.index(s) for s in signals], dtype=np.int32)
        arguments = (
            ctypes.c_int64(len(cases)),
            *plan_arguments(run, shared),
            pointer(state),
            ctypes.c_int64(selected.size),
            pointer(selected),
            pointer(values),
        )
        kept = (*shared, selected)
        count = len(cases) * _substeps(run)
        return Call(tuple(signals), values, state, count, kept, lambda: self._ensemble(*arguments))


def load(text: str, flags: tuple[str, ...]) -> tuple[str, ctypes.CDLL]:
    """Compile C and return what a table calls it, and the library.

    Raises
    ------
    CompilerError
        Without a C compiler, or when it refuses.
    """
    compiler = find_compiler()
    if compiler is None:
        raise CompilerError("the hand-written C needs a C compiler: install one")
    library = ctypes.CDLL(str(compile_library(text, flags, compiler)))
    return f"hand-written C, {compiler.label}, {' '.join(flags)}", library


def arrays(
    run: Run, cases: Sequence[ParameterSet], signals: Sequence[str]
) -> tuple[tuple[Array, Array], Array, Array]:
    """Return parameters and stimulus, the states at the start, and room for the outputs.

    Raises
    ------
    ValueError
        When the run records at another rate than its slowest controller's.
    """
    schedule = run.schedule()
    if schedule.record_frames != max(schedule.task_frames) or min(schedule.task_frames) != 1:
        raise ValueError(
            "the hand-written C records once per tick of the slowest controller: set record to "
            "its sample time"
        )
    parameters = np.array([list(par.leaves().values()) for par in cases], dtype=np.float64)
    stimulus = np.ascontiguousarray(run.stimulus(schedule.stimulus_times), dtype=np.float64)
    state = np.tile([*run.state, *run.memory, *[0.0] * _COUNTERS], (len(cases), 1))
    values = np.empty((len(cases), schedule.rows, len(signals)))
    return (parameters, stimulus), state, values


def plan_arguments(run: Run, shared: tuple[Array, Array]) -> tuple[Any, ...]:
    """Return the arguments of a C function that parameters, steps and stimulus make."""
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
