"""What a command keeps of a prepared model, so that the next one need not evaluate it on symbols.

To know which compiled kernel is a model's, its whole graph had to be built, simplified and emitted
again. Kept is what runs need beside the library: its name and digest, the layout of the state
vector, and the Jacobians that judge the contacts; of kernels in lanes one for every choice of
outputs. All else is built when it is asked for.

A stale entry would be a wrong number in silence. So kept are only our own models, whose files are
all in `source_state`: what another's model is made of, tables read from elsewhere for instance,
cannot be known. A model that fails a check is never kept.
"""

from __future__ import annotations

import hashlib
import json
import sys
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import casadi as ca
import numpy as np

from bywire.core.errors import CompilerError
from bywire.core.model import Model
from bywire.core.sources import source_state
from bywire.simulation.compiler import Compiler, processor
from bywire.simulation.kernel_cache import is_intact, keep_text, load, sha256, usable_folder
from bywire.simulation.layout import Layout


class Keepable(Protocol):
    """A kernel, as far as it can be kept."""

    ENTRY: str
    layout: Layout
    library: Path
    compiler: Compiler


class Identity(int):
    """The address of an object: it tells structures apart in this process, and in no other."""


@dataclass(frozen=True)
class KeptKernel:
    """A kernel that an earlier command built.

    Parameters
    ----------
    library
        None where that command needed no kernel for single runs: the model is sound all the same.
    compiler
        Label of the compiler that made it.
    jacobians
        ``Program.contact_jacobians``, as CasADi writes a function down; empty in lanes.
    digest
        Of the kernel's C; empty in lanes.
    """

    layout: Layout
    library: Path | None
    compiler: str
    jacobians: str
    digest: str

    @cached_property
    def contact_jacobians(self) -> Any:
        """As in ``Program``."""
        return ca.Function.deserialize(self.jacobians)


@dataclass(frozen=True)
class Place:
    """Where the kernel of a structure is kept, and for which state of the files.

    Parameters
    ----------
    file
        In the folder of compiled kernels; one for every structure, so that they do not pile up.
    state
        Digest of the sources.
    """

    file: Path
    state: str

    def in_lanes(self, selection: tuple[int, ...], in_pairs: bool, ends: int) -> Place:
        """Return where the kernel in lanes is kept that records some outputs, by index."""
        name = _digest(repr((self.file.name, selection, in_pairs, ends)))[:32]
        return Place(self.file.with_name(f"lanes-{name}.json"), self.state)

    def kept(self) -> KeptKernel | None:
        """Return what is kept there; None where there is nothing, or it is stale or damaged."""
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
        """Keep a kernel with the digest of its C, unless a file has changed since it was loaded."""
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
        """Keep that a model is sound, with its contacts' Jacobians and digest, but no kernel."""
        self._keep(contact_jacobians, {"library": "", "text": digest})

    def _keep(self, contact_jacobians: Any, kernel: dict[str, Any]) -> None:
        if _running_state() != self.state:
            return
        said = "" if contact_jacobians is None else contact_jacobians.serialize()
        text = json.dumps({"state": self.state, "jacobians": said, **kernel})
        keep_text(self.file, f"{_digest(text)}\n{text}")


def place_of(model: Model, structure: tuple[object, ...]) -> Place | None:
    """Return where the kernel of a structure is kept; None where it must not be.

    Parameters
    ----------
    structure
        As ``engine.structure_of`` returns it, with the types of the model and of its parameters.
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
    """Return the digest of the sources if this process is sure to run them; else nothing."""
    state = source_state()
    return state.digest if state.is_running else ""


def _is_ours(kind: type) -> bool:
    """Return whether a class and all that it inherits from bywire stand where they say."""
    for base in kind.__mro__:
        if base.__module__.partition(".")[0] in ("builtins", "typing", "pydantic"):
            continue
        module = sys.modules.get(base.__module__)
        is_there = getattr(module, base.__name__, None) is base
        if not (base.__module__.startswith("bywire.") and is_there):
            return False
    return True


def _types(value: object) -> list[type]:
    """Return the classes in a structure, those of models within models too."""
    if isinstance(value, tuple):
        return [kind for each in value for kind in _types(each)]
    return [value] if isinstance(value, type) else []


def _without_types(value: object) -> object:
    """Return a structure without its classes, whose addresses say nothing in another process."""
    if isinstance(value, tuple):
        return [_without_types(each) for each in value if not isinstance(each, type)]
    return value


def _identities(value: object) -> bool:
    """Return whether a structure holds the address of an object."""
    if isinstance(value, tuple):
        return any(_identities(each) for each in value)
    return isinstance(value, Identity)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
