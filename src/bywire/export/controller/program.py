"""An ECU as a C program: its tasks, with all functions and structures that they need."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import FunctionType
from typing import Any

from bywire.core.errors import ModelError
from bywire.core.model import Model, Task
from bywire.core.parameters import ParameterSet
from bywire.export.controller.c_text import PRECISIONS, Precision, c_name, checked_name, unique
from bywire.export.controller.contract import (
    CheckedInput,
    Command,
    Held,
    checked_inputs,
    commands,
    held_by,
)
from bywire.export.controller.evaluation import called
from bywire.export.controller.functions import Body, CFunction, Statement, live
from bywire.export.controller.structs import Derivations, Derived, Member, Struct, Structs
from bywire.export.controller.translation import Executor, Translation
from bywire.export.controller.values import (
    Expr,
    Group,
    Known,
    Memories,
    Record,
    Shape,
    Site,
    Update,
    Use,
    shape_of,
)

_ROOMS = frozenset({"plant", "plants", "elements"})
"""folders with functions of the plant: converters, sensors, and limits of the power stage"""
OPS = "bywire.core.ops"
"""module of the elementary functions"""
_MOST = 30


@dataclass(frozen=True)
class Step:
    """A task as a C function: arguments, statements, and the resulting memory.

    Parameters
    ----------
    inputs
        Inputs that the function checks before the computation.
    commands
        Commands that the function limits after the computation.
    kept
        Updated memory fields that must be finite: commands, and fields whose value a later tick
        uses.
    """

    task: Task
    name: str
    arguments: tuple[tuple[str, str], ...]
    statements: tuple[Statement, ...]
    result: Expr | None
    commands: tuple[Command, ...] = ()
    inputs: tuple[CheckedInput, ...] = ()
    kept: tuple[str, ...] = ()

    @property
    def status(self) -> str:
        """Memory field with the status of the task's last call."""
        return f"status_{c_name(self.task.name)}"

    @property
    def uses(self) -> frozenset[Use]:
        """All dependencies of the task."""
        every = [each.value.uses for each in self.statements]
        every += [each.limit.uses for each in self.commands]
        return frozenset().union(*every, *([self.result.uses] if self.result else []))


@dataclass(frozen=True)
class Program:
    """A model's ECU in C.

    Parameters
    ----------
    name
        Prefix of files and functions.
    functions
        Laws and functions of the plant side, in the order of their calls.
    derived
        Derived parameters, which are stored next to the other parameters.
    """

    name: str
    precision: Precision
    model: Model
    par: ParameterSet
    steps: tuple[Step, ...]
    functions: tuple[CFunction, ...]
    structs: Structs
    constants: Mapping[str, float]
    uses: frozenset[Use]
    derived: tuple[Derived, ...]

    @property
    def plant_functions(self) -> list[CFunction]:
        """Functions of the plant interface of each tick, declared in a header."""
        return [each for each in self.functions if each.is_plant and each.module != OPS]

    def shown(self) -> list[Struct]:
        """Return the structures of the plant side that are not in the ECU's header."""
        names: set[str] = set()
        for each in self.plant_functions:
            names |= {a.declaration.removeprefix("const ").split()[0] for a in each.arguments}
            names.add(each.result)
            names |= {s.ctype for s in each.statements}
            names |= {use[1] for use in each.uses if use[0] == "struct"}
        known = {each.name: each for each in self.structs.ordered()}
        waiting = [known[n] for n in names if n in known]
        while waiting:
            for member in self.structs.kept(waiting.pop()):
                if member.ctype in known and member.ctype not in names:
                    names.add(member.ctype)
                    waiting.append(known[member.ctype])
        return [each for each in known.values() if each.name in names and not each.public]

    @property
    def libraries(self) -> tuple[str, ...]:
        """Functions of the C library that the ECU calls."""
        return tuple(sorted({use[1] for use in self.uses if use[0] == "library"}))

    @property
    def inexact(self) -> tuple[str, ...]:
        """Functions of the C library that the ECU calls and whose last digit differs by library."""
        exact = {"fabs", "sqrt", "fabsf", "sqrtf"}
        return tuple(each for each in self.libraries if each not in exact)

    def members(self, cls: type[Any]) -> list[Member]:
        """Return the fields of memory, plant or stimulus that exist in C."""
        if cls not in self.structs.known:
            return []
        return self.structs.kept(self.structs.of_tuple(cls))

    @property
    def memory_size(self) -> int:
        """Size of the memory in bytes: its numbers, and a status for each step."""
        real = 4 if self.precision.name == "single" else 8
        size = real * len(self.members(self.model.Memory)) + 4 * len(self.steps)
        return -(-size // real) * real

    @property
    def shape(self) -> Shape:
        """Structure of the parameters."""
        return shape_of(self.par)

    def parameters(self) -> list[tuple[str, Member]]:
        """Return the parameters that the ECU reads, by dotted name."""
        return [each for each in self.held() if not each[1].is_derived]

    def held(self) -> list[tuple[str, Member]]:
        """Return the members of the parameter structure, including derived numbers."""
        return list(self._leaves(self.shape, ""))

    def _leaves(self, shape: Shape, prefix: str) -> Any:
        struct = self.structs.of_group(shape)
        for member in self.structs.kept(struct):
            inner = shape.by_name.get(member.name)
            if isinstance(inner, Shape):
                yield from self._leaves(inner, f"{prefix}{member.name}.")
            else:
                yield f"{prefix}{member.name}", member


def program(model: Model, par: ParameterSet, precision: str = "double", name: str = "") -> Program:
    """Translate a model's tasks for the structure of its parameters.

    Parameters
    ----------
    name
        Prefix of files and symbols. The default is the model's name.

    Raises
    ------
    ParameterError
        If a name is not a valid C identifier.
    ModelError
        If code cannot be translated, with file, line and operation, or if the model contains
        another model with its own ECU.
    """
    for sub in getattr(model, "subs", {}).values():
        if any(sub.tasks(par)):
            raise ModelError(
                f"{model.name} contains a {sub.assembly.name} ({sub.label}) with its own ECU, but "
                "bywire exports only one ECU at a time. Export each ECU from an experiment that "
                f"contains only this ECU, such as those of {sub.assembly.name}",
                name=model.name,
                value=sub.label,
            )
    short = checked_name(name) if name else c_name(model.name).lower()
    used: frozenset[Use] | None = None
    copied: set[Site] = set()
    refused: set[tuple[str, str]] = set()
    shared: frozenset[type[Any]] = frozenset()
    held: dict[str, Held] | None = None
    for _ in range(_MOST):
        before = len(copied), len(refused), shared
        made = _translated(
            model, par, PRECISIONS[precision], short, used, copied, refused, shared, held
        )
        fields = frozenset(use for use in made.uses if use[0] == "field")
        shown = {each.name for each in made.shown()}
        shared |= {
            cls
            for cls, struct in made.structs.known.items()
            if struct.name in shown and isinstance(cls, type)
        }
        is_settled = fields == used and (len(copied), len(refused), shared) == before
        used = fields
        if held is None:  # after the translation, which reports its errors first
            held = {task.name: held_by(model, par, task) for task in model.tasks(par)}
        elif is_settled:
            return made
    raise ModelError(
        f"{model.name}: the set of fields that the ECU reads does not converge"
    )  # pragma: no cover


def _translated(
    model: Model,
    par: ParameterSet,
    precision: Precision,
    name: str,
    used: Any,
    copied: set[Site],
    refused: set[tuple[str, str]],
    shared: frozenset[type[Any]],
    held: Mapping[str, Held] | None,
) -> Program:
    public = {
        model.Stimulus: f"{name}_Stimulus",
        model.State: f"{name}_Plant",
        model.Memory: f"{name}_Memory",
        type(par): f"{name}_Parameters",
    }
    structs = Structs(
        precision,
        used,
        public,
        model.Memory,
        name,
        shared,
        names=set(public.values()),
        derivations=Derivations(refused),
    )
    homes = {cls.__module__ for cls in type(model).__mro__}

    def is_plant(function: FunctionType, arguments: Mapping[str, Any]) -> bool:
        if _ROOMS & set(function.__module__.split(".")[1:]):
            return True
        classes = {_class_of(each) for each in arguments.values()}
        return function.__module__ in homes and model.Memory not in classes

    made = Translation(structs, is_plant, name, names=set(public.values()), copied=copied)
    steps: list[Step] = []
    for task in model.tasks(par):
        steps.append(_step(made, model, par, task, name, {each.name for each in steps}, held or {}))
    by_name = {each.name: each for each in made.functions.values()}
    uses: set[Use] = set()
    for k, step in enumerate(steps):
        needed = _needed(step.uses, by_name)
        steps[k] = replace(step, inputs=tuple(checked_inputs(model, structs, needed)))
        uses |= needed
    reached = {use[1] for use in uses if use[0] == "call"}
    derived = tuple(structs.derivations.derived(frozenset(uses)))
    uses |= frozenset[Use]().union(*(each.uses for each in derived))
    functions = tuple(each for each in made.functions.values() if each.name in reached)
    constants = {use[1]: use[2] for use in sorted(u for u in uses if u[0] == "constant")}
    return Program(
        name,
        precision,
        model,
        par,
        tuple(steps),
        functions,
        structs,
        constants,
        frozenset(uses),
        derived,
    )


def _needed(uses: frozenset[Use], by_name: Mapping[str, CFunction]) -> set[Use]:
    """Return the dependencies of a text, including those of the functions that it calls."""
    found: set[Use] = set()
    waiting = [uses]
    while waiting:
        for use in waiting.pop():
            if use[0] == "call" and use not in found:
                waiting.append(by_name[use[1]].uses)
            found.add(use)
    return found


def _class_of(value: Any) -> Any:
    if isinstance(value, Update):
        value = value.record
    return getattr(value, "cls", None)


def _step(
    made: Translation,
    model: Model,
    par: ParameterSet,
    task: Task,
    name: str,
    taken: set[str],
    held: Mapping[str, Held],
) -> Step:
    """Return the step of a task, which calls the tick with the targets of the pointers."""
    structs = made.structs
    step = unique(f"{name}_ecu_step_{c_name(task.name)}", taken)
    body = Body(structs, Counter(), Memories(step, made.copied))
    given_as = {"memory": model.Memory, "x": model.State, "u": model.Stimulus}
    given: dict[str, Any] = {}
    for short, cls in given_as.items():
        body.fresh(short)
        given[short] = Record(cls, Expr(short, uses=frozenset({("local", short)})), pointer=True)
    body.fresh("par")
    here = Expr("par", uses=frozenset({("local", "par")}))
    structs.of_tuple(model.Memory)
    given["memory"] = body.memory.at(model.Memory, "memory", pointer=True)
    given["par"] = Group(shape_of(par), here, pointer=True, origin=("par",))
    body.fixed["par"] = shape_of(par)
    at = Executor(made, body, f"task {task.name!r} of {model.name}", {}, {})
    node = ast.parse(f"{c_name(task.name)}(x, m, u, par)", mode="eval").body
    assert isinstance(node, ast.Call)
    order = [given["x"], given["memory"], given["u"], given["par"]]
    value = body.settled(called(at, node, Known(task.tick), order, {}), "memory")
    is_there = isinstance(value, Record) and value.expr.text == "memory"
    result: Expr | None = None
    if not (is_there and body.memory.is_now(value)):
        result = body.rvalue(value)
    after = frozenset({("local", "memory")}) if result is None else result.uses
    body.memory.read(after)
    statements = live(body.statements, after)
    renewed = held[task.name].renewed if task.name in held else ()
    limited = commands(model, renewed, structs, shape_of(par))
    every = (after, *(s.value.uses for s in statements), *(c.limit.uses for c in limited))
    needed = {use[1] for each in every for use in each if use[0] == "local"}
    arguments = [(f"{structs.of_tuple(model.Memory).name} *memory", "memory")]
    for short in ("x", "u"):
        if short in needed:
            arguments.append((f"const {structs.of_tuple(given_as[short]).name} *{short}", short))
    if "par" in needed:
        arguments.append((f"const {structs.of_group(shape_of(par)).name} *par", "par"))
    read = frozenset[str]().union(*(each.read for each in held.values()))
    kept = read | {each.field for each in limited}
    return Step(
        task,
        step,
        tuple(arguments),
        tuple(statements),
        result,
        tuple(limited),
        kept=tuple(n for n in renewed if n in kept),
    )
