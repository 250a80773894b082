"""Programs and kernels of models, built once per structure, and the choice of the engine.

Without a cache, a command would have to build, simplify and emit the whole graph again to find a
model's compiled kernel. Each command therefore caches the data for runs next to the library: the
library's name and digest, the layout of the state vector, and the Jacobians for checking the
contacts. For kernels in lanes, there is one entry for each selection of outputs. Everything else is
built on demand.

A stale entry would silently give wrong numbers. bywire therefore caches only kernels of its own
models, whose files are all in `source_state`. A user's model may depend on unknown files, such as
tables. bywire never caches a model that fails a check.
"""

from __future__ import annotations

import hashlib
import json
import sys
import threading
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, Protocol, TypeVar, cast

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from bywire.core.engines import declared_engines
from bywire.core.errors import CompilerError, unknown_name
from bywire.core.interrupts import interrupts_deferred
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.signals import Signal, signals_of
from bywire.core.sources import source_state
from bywire.simulation.compiler import (
    Compiler,
    find_compiler,
    is_intact,
    keep_text,
    load,
    processor,
    sha256,
    usable_folder,
)
from bywire.simulation.native import Request, SingleKernel, text_digest
from bywire.simulation.schedule import Layout
from bywire.simulation.virtual_machine import VirtualMachine

if TYPE_CHECKING:
    from bywire.simulation.program import Program


class Keepable(Protocol):
    """Kernel with data that can be cached."""

    ENTRY: str
    layout: Layout
    library: Path
    compiler: Compiler


class Identity(int):
    """An object's address, which identifies it within this process."""


@dataclass(frozen=True)
class KeptKernel:
    """Kernel that an earlier command built.

    Parameters
    ----------
    library
        File of the kernel. None if the model passed its checks, but needed no kernel for single
        runs.
    compiler
        Label of the compiler.
    jacobians
        ``Program.contact_jacobians``, serialized by CasADi; empty for lanes.
    digest
        Digest of the kernel's C code; empty for lanes.
    """

    layout: Layout
    library: Path | None
    compiler: str
    jacobians: str
    digest: str

    @cached_property
    def contact_jacobians(self) -> Any:
        """See ``Program``."""
        return ca.Function.deserialize(self.jacobians)


@dataclass(frozen=True)
class Place:
    """File of a structure's cached kernel, and the state of the sources for which it is valid.

    Parameters
    ----------
    file
        File in the folder of compiled kernels. There is one file per structure, so files do not
        accumulate.
    state
        Digest of the sources.
    """

    file: Path
    state: str

    def in_lanes(self, selection: tuple[int, ...], in_pairs: bool, ends: int) -> Place:
        """Return the place of the kernel in lanes that records the outputs with these indices."""
        name = _digest(repr((self.file.name, selection, in_pairs, ends)))[:32]
        return Place(self.file.with_name(f"lanes-{name}.json"), self.state)

    def kept(self) -> KeptKernel | None:
        """Return the cached kernel, or None if it is missing, stale or damaged."""
        try:
            digest, _, text = self.file.read_text(encoding="utf-8").partition("\n")
            if digest != _digest(text):
                return None
            entry = json.loads(text)
            if entry["state"] != self.state:
                return None
            if not entry["library"]:
                return KeptKernel(Layout({}, {}), None, "", entry["jacobians"], entry["text"])
            library = self.file.with_name(entry["library"])
            entry_point = entry["entry"]
            if not (sha256(library) == entry["digest"] and is_intact(library, entry_point)):
                return None
            load(library, entry_point)
            layout = Layout(entry["start"], entry["length"])
            return KeptKernel(layout, library, entry["compiler"], entry["jacobians"], entry["text"])
        except (OSError, ValueError, KeyError, TypeError, CompilerError):
            return None

    def keep(self, kernel: Keepable, contact_jacobians: Any = None, digest: str = "") -> None:
        """Cache a kernel and the digest of its C code, unless a source file has changed."""
        self._keep(
            contact_jacobians,
            {
                "start": kernel.layout.start,
                "length": kernel.layout.length,
                "library": kernel.library.name,
                "entry": kernel.ENTRY,
                "digest": sha256(kernel.library),
                "compiler": kernel.compiler.label,
                "text": digest,
            },
        )

    def keep_model(self, contact_jacobians: Any, digest: str) -> None:
        """Record that a model passed its checks, with Jacobians and digest but no kernel."""
        self._keep(contact_jacobians, {"library": "", "text": digest})

    def _keep(self, contact_jacobians: Any, kernel: dict[str, Any]) -> None:
        if _running_state() != self.state:
            return
        serialized = "" if contact_jacobians is None else contact_jacobians.serialize()
        text = json.dumps({"state": self.state, "jacobians": serialized, **kernel})
        keep_text(self.file, f"{_digest(text)}\n{text}")


def place_of(model: Model, structure: tuple[object, ...]) -> Place | None:
    """Return the place of a structure's kernel, or None if it must not be cached.

    Parameters
    ----------
    structure
        Result of ``engine.structure_of``, with the types of the model and of its parameters.
    """
    types = _types(structure)
    if type(model) not in types or not all(map(_is_ours, types)) or _identities(structure):
        return None
    state = _running_state()
    if not state:
        return None
    names = [f"{kind.__module__}.{kind.__qualname__}" for kind in types]
    rest = _without_types(structure)
    built_by = (ca.CasadiMeta.version(), np.__version__, sys.version, processor())
    home = str(Path(sys.modules[__name__].__file__ or ""))
    name = _digest(repr((names, rest, built_by, home)))[:32]
    return Place(usable_folder() / f"kernel-{name}.json", state)


def _running_state() -> str:
    """Return the digest of the sources, or "" if this process may run other sources."""
    state = source_state()
    return state.digest if state.is_running else ""


def _is_ours(kind: type) -> bool:
    """Return whether a class and all its bases in bywire are defined in their ``__module__``."""
    for base in kind.__mro__:
        if base.__module__.partition(".")[0] in ("builtins", "typing", "pydantic"):
            continue
        module = sys.modules.get(base.__module__)
        is_there = getattr(module, base.__name__, None) is base
        if not (base.__module__.startswith("bywire.") and is_there):
            return False
    return True


def _types(value: object) -> list[type]:
    """Return the classes in a structure, including those of nested models."""
    if isinstance(value, tuple):
        return [kind for each in value for kind in _types(each)]
    return [value] if isinstance(value, type) else []


def _without_types(value: object) -> object:
    """Return a structure without classes, whose addresses are invalid in other processes."""
    if isinstance(value, tuple):
        return [_without_types(each) for each in value if not isinstance(each, type)]
    return value


def _identities(value: object) -> bool:
    """Return whether a structure contains the address of an object."""
    if isinstance(value, tuple):
        return any(_identities(each) for each in value)
    return isinstance(value, Identity)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


# --- Engines

CUDA = "cuda"
"""name of the engine on a graphics processor"""

_LOCK = threading.RLock()
_P = ParamSpec("_P")
_T = TypeVar("_T")


def built_once(build: Callable[_P, _T]) -> Callable[_P, _T]:
    """Return a function that builds once for each set of arguments; other threads wait for it."""
    cached = cache(build)

    @wraps(build)
    def waiting(*arguments: _P.args, **named: _P.kwargs) -> _T:
        with _LOCK:
            return cached(*arguments, **named)  # type: ignore[arg-type]

    return waiting


def engine_names() -> tuple[str, ...]:
    """Return the names of all engines: built-in engines, then declared engines."""
    return ("auto", "compiled", "virtual-machine", CUDA, *declared_engines())


class Engine(Protocol):
    """Engine that advances a run."""

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
        """Run the frames from begin to end in place."""
        ...


class Prepared:
    """Program and engines for one structure of a model.

    The program is built immediately, so an invalid model fails here. If an earlier command
    cached the kernel, the program is built on demand.

    ``place``: place of this structure's cached kernels; None if bywire must not cache them.
    """

    def __init__(self, model: Model, par: ParameterSet) -> None:
        self.model = model  # stays alive while its address identifies a structure
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
        """See ``Program``."""
        kept = self._kept
        return self.program.contact_jacobians if kept is None else kept.contact_jacobians

    @property
    def digest(self) -> str:
        """Digest of this structure's equations, computed from its kernel's C code.

        Comments, names and file names in the Python source do not affect the C code.
        """
        with _LOCK:
            if not self._digest:
                from bywire.simulation.emit_single import emit_single
                from bywire.simulation.stages import build_stages

                self._digest = text_digest(emit_single(build_stages(self.program)))
            return self._digest

    def keep_model(self) -> None:
        """Record that the model passed its checks, unless a cached kernel already implies it."""
        if self.place is not None and self._kept is None and not self._engines:
            self.place.keep_model(self.program.contact_jacobians, self._digest)

    def engine(self, kind: str = "auto") -> Engine:
        """Return the engine for single runs.

        Parameters
        ----------
        kind
            ``"compiled"``, ``"virtual-machine"``, ``"cuda"`` (a graphics processor), or a declared
            engine (see `core.engines`). ``"auto"`` selects the compiled engine if there is a
            compiler. Otherwise, it selects the virtual machine, with a single warning.

        Raises
        ------
        UnknownNameError
            For any other name.
        CompilerError
            For ``"compiled"`` or a declared engine without a compiler.
        DeviceError
            For ``"cuda"`` without a graphics processor, its driver or the extra.
        ModelError
            When a declared engine does not support the model.
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
            from bywire.simulation.cuda import CudaEngine

            return CudaEngine(self.program)
        compiler = None if kind == "virtual-machine" else find_compiler()
        make = declared_engines().get(kind)
        if compiler is not None:
            kernel = self._kernel(compiler)
            engine: Engine = kernel if make is None else make(self.model, self._par, kernel)
            return engine
        if kind == "compiled" or make is not None:
            raise CompilerError(
                "there is no C compiler. Install one, or the extra bywire[compiler], or use "
                "engine = 'auto'",
                name="engine",
                value=kind,
                valid="auto",
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
    """Return program and kernels for a model's structure; they apply to any numbers in ``par``."""
    key = structure_of(model, par)
    with _LOCK:
        if key not in _PREPARED:
            _PREPARED[key] = Prepared(model, par)
        return _PREPARED[key]


def structure_of(model: Model, par: ParameterSet) -> tuple[object, ...]:
    """Return the key of a model's structure: its type, its own fields, and the choices."""
    return (*_makeup(model), type(par), _in_order(tuple(par.choices().items())))


def are_alike(model: Model, par: ParameterSet, like: Model, like_par: ParameterSet) -> bool:
    """Return whether two models have the same structure (`structure_of`), without computing keys.

    This is fast, because thousands of cases per second share the model and the choices.
    """
    is_same = model is like or _makeup(model) == _makeup(like)
    return is_same and type(par) is type(like_par) and par.has_choices_of(like_par)


def _makeup(model: Model) -> tuple[object, ...]:
    """Return the type of a model and the key of its own values."""
    fields = sorted(getattr(model, "__dict__", {}).items())
    return (type(model), tuple((name, _fingerprint(value)) for name, value in fields))


@lru_cache(maxsize=256)
def _in_order(choices: tuple[tuple[str, Any], ...]) -> tuple[tuple[str, str], ...]:
    return tuple(sorted((name, str(value)) for name, value in choices))


def _fingerprint(value: object) -> object:
    """Return the key of a model's own value: its content if possible, otherwise its identity."""
    if isinstance(value, np.ndarray):
        return (value.shape, value.dtype.str, value.tobytes())
    if isinstance(value, (str, int, float, bool, type(None))):
        return repr(value)
    if isinstance(value, (tuple, list)):
        return tuple(_fingerprint(v) for v in value)
    if isinstance(value, Mapping):
        return tuple((str(k), _fingerprint(v)) for k, v in value.items())
    if hasattr(value, "balance") and hasattr(value, "tasks"):  # a nested model
        return _makeup(cast(Model, value))
    return Identity(id(value))  # stays alive with the model in Prepared


@cache
def _warn_once() -> None:
    warnings.warn(
        "no C compiler was found, so runs use the virtual machine, which is about 200 times "
        "slower. Install a C compiler or the extra bywire[compiler]",
        stacklevel=2,
    )
