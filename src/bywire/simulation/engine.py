"""Programs and kernels of models, built once per structure, and which engine serves."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable, Mapping
from functools import cache, lru_cache, wraps
from typing import TYPE_CHECKING, Any, ParamSpec, Protocol, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from bywire.core.engines import declared_engines
from bywire.core.errors import CompilerError, unknown_name
from bywire.core.interrupts import interrupts_deferred
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.signals import Signal, signals_of
from bywire.simulation.compiler import Compiler, find_compiler
from bywire.simulation.kept_kernel import Identity, place_of
from bywire.simulation.layout import Layout
from bywire.simulation.native import Request, SingleKernel, text_digest
from bywire.simulation.virtual_machine import VirtualMachine

if TYPE_CHECKING:
    from bywire.simulation.program import Program

CUDA = "cuda"
"""engine that computes on a graphics processor"""

_LOCK = threading.RLock()
_P = ParamSpec("_P")
_T = TypeVar("_T")


def built_once(build: Callable[_P, _T]) -> Callable[_P, _T]:
    """Return a function that builds once per arguments; threads that ask meanwhile wait for it."""
    cached = cache(build)

    @wraps(build)
    def waiting(*arguments: _P.args, **named: _P.kwargs) -> _T:
        with _LOCK:
            return cached(*arguments, **named)  # type: ignore[arg-type]

    return waiting


def engine_names() -> tuple[str, ...]:
    """Return what may compute a run: ours, then what rooms above declare."""
    return ("auto", "compiled", "virtual-machine", CUDA, *declared_engines())


class Engine(Protocol):
    """What advances a run."""

    label: str
    layout: Layout

    def advance(
        self,
        request: Request,
        state: NDArray[np.float64],
        begin: int,
        end: int,
        rows: NDArray[np.float64],
    ) -> None:
        """Run frames begin..end in place."""
        ...


class Prepared:
    """Program and engines of one structure of a model.

    The program is built at once, so that a model that fails a check fails here, unless an earlier
    command did so and kept the kernel; else when it is asked for.

    ``place`` is where kernels of this structure are kept; None where they must not be.
    """

    def __init__(self, model: Model, par: ParameterSet) -> None:
        self.model = model  # alive as long as what is known by its identity
        self._par = par
        self._program: Program | None = None
        self._engines: dict[str, Engine] = {}
        self._digest = ""
        self.place = place_of(model, structure_of(model, par))
        self._kept = None if self.place is None else self.place.kept()
        if self._kept is None:
            self._program = self._built()
        else:
            self._digest = self._kept.digest

    @property
    def program(self) -> Program:
        """All symbolic functions."""
        with _LOCK:
            if self._program is None:
                self._program = self._built()
            return self._program

    def _built(self) -> Program:
        from bywire.simulation.program import build_program

        with interrupts_deferred():
            return build_program(self.model, self._par)

    @property
    def outputs(self) -> dict[str, Signal]:
        """Recorded signals, in order."""
        return signals_of(self.model.Output)

    @property
    def contact_jacobians(self) -> Any:
        """As in ``Program``."""
        kept = self._kept
        return self.program.contact_jacobians if kept is None else kept.contact_jacobians

    @property
    def digest(self) -> str:
        """What tells the equations of this structure from any others: that of its kernel's C.

        How the source is written does not matter: comments, names and files leave no trace in C.
        """
        with _LOCK:
            if not self._digest:
                from bywire.simulation.emit_single import emit_single
                from bywire.simulation.stages import build_stages

                self._digest = text_digest(emit_single(build_stages(self.program)))
            return self._digest

    def keep_model(self) -> None:
        """Keep that the model is sound, unless that is kept, or will be with a kernel."""
        if self.place is not None and self._kept is None and not self._engines:
            self.place.keep_model(self.program.contact_jacobians, self._digest)

    def engine(self, kind: str = "auto") -> Engine:
        """Return the engine for single runs.

        Parameters
        ----------
        kind
            ``"compiled"``, ``"virtual-machine"``, or ``"auto"``: compiled where there is a
            compiler, else the virtual machine, with one warning; ``"cuda"``: a graphics
            processor; or a declared one, see `core.engines`.

        Raises
        ------
        UnknownNameError
            For any other name.
        CompilerError
            For ``"compiled"`` or a declared engine without a compiler.
        DeviceError
            For ``"cuda"`` without a graphics processor, its driver or the extra.
        ModelError
            Where a declared engine cannot serve the model.
        """
        names = engine_names()
        if kind not in names:
            raise unknown_name("engine", kind, names)
        with _LOCK:
            if kind not in self._engines:
                self._engines[kind] = self._build(kind)
            return self._engines[kind]

    def _build(self, kind: str) -> Engine:
        if kind == CUDA:
            from bywire.simulation.cuda_kernel import CudaEngine

            return CudaEngine(self.program)
        compiler = None if kind == "virtual-machine" else find_compiler()
        make = declared_engines().get(kind)
        if compiler is not None:
            kernel = self._kernel(compiler)
            engine: Engine = kernel if make is None else make(self.model, self._par, kernel)
            return engine
        if kind == "compiled" or make is not None:
            raise CompilerError(
                "there is no C compiler: install one, or the extra bywire[compiler], or take "
                "engine = 'auto'"
            )
        if kind == "auto":
            _warn_once()
        return VirtualMachine(self.program)

    def _kernel(self, compiler: Compiler) -> SingleKernel:
        kept = self._kept
        if kept is not None and kept.library is not None and kept.compiler == compiler.label:
            return SingleKernel(kept.layout, kept.library, compiler, kept.digest)
        kernel = SingleKernel.of(self.program, compiler)
        self._digest = kernel.digest
        if self.place is not None:
            self.place.keep(kernel, self.program.contact_jacobians, kernel.digest)
        return kernel


_PREPARED: dict[tuple[object, ...], Prepared] = {}


def prepare(model: Model, par: ParameterSet) -> Prepared:
    """Return what is built for a model of this structure; the numbers of ``par`` do not matter."""
    key = structure_of(model, par)
    with _LOCK:
        if key not in _PREPARED:
            _PREPARED[key] = Prepared(model, par)
        return _PREPARED[key]


def structure_of(model: Model, par: ParameterSet) -> tuple[object, ...]:
    """Return what tells models of different structure apart: type, own fields, choices."""
    return (*_makeup(model), type(par), _in_order(tuple(par.choices().items())))


def are_alike(model: Model, par: ParameterSet, like: Model, like_par: ParameterSet) -> bool:
    """Return whether two models are of one structure, as `structure_of` tells, but without a key.

    Thousands of cases a second share the model and the choices.
    """
    is_same = model is like or _makeup(model) == _makeup(like)
    return is_same and type(par) is type(like_par) and par.has_choices_of(like_par)


def _makeup(model: Model) -> tuple[object, ...]:
    """Return the type of a model and what tells its own values apart."""
    fields = sorted(getattr(model, "__dict__", {}).items())
    return (type(model), tuple((name, _fingerprint(value)) for name, value in fields))


@lru_cache(maxsize=256)
def _in_order(choices: tuple[tuple[str, Any], ...]) -> tuple[tuple[str, str], ...]:
    return tuple(sorted((name, str(value)) for name, value in choices))


def _fingerprint(value: object) -> object:
    """Return what tells a model's own values apart: contents, else the object itself."""
    if isinstance(value, np.ndarray):
        return (value.shape, value.dtype.str, value.tobytes())
    if isinstance(value, (str, int, float, bool, type(None))):
        return repr(value)
    if isinstance(value, (tuple, list)):
        return tuple(_fingerprint(v) for v in value)
    if isinstance(value, Mapping):
        return tuple((str(k), _fingerprint(v)) for k, v in value.items())
    if hasattr(value, "balance") and hasattr(value, "tasks"):  # a model inside another one
        return _makeup(cast(Model, value))
    return Identity(id(value))  # kept alive by the model that Prepared holds


@cache
def _warn_once() -> None:
    warnings.warn(
        "no C compiler: runs use the virtual machine, about 200 times slower; "
        "install one, or the extra bywire[compiler]",
        stacklevel=2,
    )
