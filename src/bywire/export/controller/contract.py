"""Contract of a step of an exported ECU: valid inputs, and commands within their limits.

The step checks its inputs before the tick, and its memory and commands after it. The laws are
translated unchanged.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import casadi as ca

from bywire.core.errors import ModelError, place_of
from bywire.core.model import Model, Task
from bywire.core.parameters import ParameterSet
from bywire.core.signals import limits_of, ranges_of
from bywire.export.controller.c_text import c_name
from bywire.export.controller.structs import Structs
from bywire.export.controller.values import Expr, Group, Shape, Use
from bywire.simulation.symbols import SX, scalars, symbol_tuple

LARGEST = 1e15
"""upper limit of the magnitude of inputs, states and commands in SI units: squares and products of
such numbers are finite even in single precision"""
INPUT, RESULT = 1, 2
"""status of a step: ``INPUT`` for an invalid input, ``RESULT`` after a reset of the memory"""


@dataclass(frozen=True)
class CheckedInput:
    """A field of the plant (``x``) or of the stimulus (``u``) that a step checks.

    Parameters
    ----------
    low, high
        Ends of the valid range, infinite if the field declares none. `LARGEST` also applies.
    """

    kind: str
    field: str
    low: float
    high: float

    def accepts(self, value: float) -> bool:
        """Return whether a step accepts a value."""
        return abs(value) < LARGEST and self.low <= value <= self.high


@dataclass(frozen=True)
class Command:
    """A memory field that a step keeps within a limit.

    Parameters
    ----------
    by
        Name of the limit.
    limit
        C expression of the limit.
    is_input
        Whether the limit is a stimulus or a parameter. A stimulus limits the command, and a
        parameter limits the command's magnitude.
    """

    field: str
    by: str
    limit: Expr
    is_input: bool


def checked_inputs(model: Model, structs: Structs, uses: Iterable[Use]) -> list[CheckedInput]:
    """Return the inputs that a step reads, in the order of the model."""
    read = frozenset(uses)
    found = []
    for kind, cls in (("x", model.State), ("u", model.Stimulus)):
        struct, ranges = structs.of_tuple(cls), ranges_of(cls)
        for name in cls._fields:
            if ("field", struct.name, name) in read:
                found.append(CheckedInput(kind, name, *ranges.get(name, (-math.inf, math.inf))))
    return found


def commands(model: Model, renewed: Iterable[str], structs: Structs, shape: Shape) -> list[Command]:
    """Return the commands, with their limits, among the fields that a task updates.

    Raises
    ------
    ModelError
        If a limit is neither a parameter nor a stimulus.
    """
    limits, found = limits_of(model.Memory), []
    for name in renewed:
        if name not in limits:
            continue
        by = limits[name].by
        if by in model.Stimulus._fields:
            held = structs.of_tuple(model.Stimulus).name
            uses = frozenset({("field", held, by), ("local", "u"), ("own", "smaller")})
            found.append(Command(name, by, Expr(f"u->{c_name(by)}", uses=uses), True))
            continue
        limit = _parameter(structs, shape, by)
        if limit is None:
            raise ModelError(
                f"{place_of(model.Memory)}: {model.Memory.__qualname__}.{name} is limited by "
                f"{by!r}, which is not valid. Use the name of a parameter or a stimulus",
                name=f"{model.Memory.__qualname__}.{name}",
                value=repr(by),
                valid="a parameter or a stimulus",
            )
        found.append(Command(name, by, limit, False))
    return found


def _parameter(structs: Structs, shape: Shape, dotted: str) -> Expr | None:
    """Return a parameter in C, accessed with the pointer to all parameters."""
    group = Group(shape, Expr("par", uses=frozenset({("local", "par")})), pointer=True)
    text, uses = "par", set(group.expr.uses)
    *groups, last = dotted.split(".")
    for depth, name in enumerate((*groups, last)):
        kind: Any = shape.by_name.get(name)
        if kind is None or isinstance(kind, Shape) != (depth < len(groups)):
            return None
        uses.add(("field", structs.of_group(shape).name, name))
        text += f"{'.' if depth else '->'}{c_name(name)}"
        shape = kind
    return Expr(text, uses=frozenset(uses))


@dataclass(frozen=True)
class Held:
    """Access of a task to the memory.

    Parameters
    ----------
    renewed
        Fields that the task updates, in the order of the memory.
    read
        Fields whose value before the tick the task uses.
    """

    renewed: tuple[str, ...]
    read: frozenset[str]


def held_by(model: Model, par: ParameterSet, task: Task) -> Held:
    """Return the access of a task to the memory, found by a tick on symbols."""
    leaves, fields = tuple(par.leaves()), model.Memory._fields
    symbols = dict(zip(leaves, scalars(SX.sym("p", len(leaves))), strict=True))
    x, m, u = (
        symbol_tuple(cls, SX.sym("s", len(cls._fields)))
        for cls in (model.State, model.Memory, model.Stimulus)
    )
    after = task.tick(x, m, u, par.with_leaves(symbols) if leaves else par)
    renewed = tuple(n for n in fields if getattr(after, n) is not getattr(m, n))
    depends = {hash(each) for name in renewed for each in ca.symvar(SX(getattr(after, name)))}
    by_symbol = {hash(ca.symvar(SX(getattr(m, name)))[0]): name for name in fields}
    return Held(renewed, frozenset(by_symbol[each] for each in depends if each in by_symbol))
