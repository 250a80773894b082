"""Whether an assembly is wired: every wire and input set once, all of them in their units."""

from __future__ import annotations

import inspect
import traceback
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from bywire.core.assembly import Assembly
from bywire.core.dimensions import Dimension, fits
from bywire.core.errors import ModelError, UnitError
from bywire.core.instants import Evaluated
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.signals import signals_of
from bywire.core.wires import Instant, Wire, instant_of

AnyAssembly = Assembly[Any, Any]


def check_wiring(model: AnyAssembly, par: ParameterSet) -> None:
    """Evaluate an assembly on dimensions and check what it sets and returns.

    Raises
    ------
    ModelError
        Naming class, file and line, part, signal, both units and what to do.
    """
    at = _Operands(model, par)
    w = at.wired("wire")
    _check_inputs(model, at, w)
    _check_held(model, par)
    _check_balance(model, at, w)
    _check_contacts(model, at)
    bounds = at.evaluated("friction", model.friction, w)
    for name, pair in zip(model.frictions, bounds, strict=False):
        for value in pair if isinstance(pair, tuple) and name in at.balance else ():
            _require(model, "friction", name, value, str(at.balance[name]))
    for method, kind in (("power", model.Flow), ("record", model.Output)):
        values = at.evaluated(method, *_protocol(model, at, method))
        for (name, signal), value in zip(signals_of(kind).items(), values, strict=True):
            if method == "power":
                value = value * at.second if isinstance(value, Dimension) or value else value
            _require(model, method, name, value, signal.unit, signal.label)


class _Operands:
    """What an assembly is evaluated on, and how."""

    def __init__(self, model: AnyAssembly, par: ParameterSet) -> None:
        self.model = model
        self.second = Dimension.of("s")
        self.state = self.tuple(model.State)
        self.memory = self.tuple(model.Memory)
        self.rate = model.State._make(each / self.second for each in self.state)
        fields = leaf_fields(type(par))
        numbers = {}
        for name in par.leaves():
            leaf = fields.get(name) or fields[name.rpartition(".")[0]]  # a node of a table
            numbers[name] = self.dimension(leaf.unit.symbol, f"parameter {name}")
        self.par = par.with_leaves(numbers)
        self.contact = tuple(self.forces(model, par))
        mass = self.evaluated("mass", model.mass, self.state, self.par)
        rates = dict(zip(model.State._fields, mass, strict=True))
        self.balance = {name: rate * getattr(self.rate, name) for name, rate in rates.items()}
        forces = [self.balance.get(name) for name in (*model.frictions, *model.limits)]
        self.reaction = tuple(forces)

    def tuple(self, kind: Any) -> Any:
        """Return a signal tuple of dimensions."""
        return kind._make(
            self.dimension(s.unit, f"{kind.__name__}.{name}")
            for name, s in signals_of(kind).items()
        )

    def forces(self, model: Any, par: Any) -> Iterator[Any]:
        """Yield the dimensions of an assembly's contact forces, of those within included."""
        for part in model.parts.values():
            if any(part.group_sizes(par)):
                yield from self.tuple(part.element.Forces)
        for sub in model.subs.values():
            yield from self.forces(sub.assembly, sub.parameters(par))

    def dimension(self, unit: str, what: str) -> Dimension:
        """Return the dimension of a unit; the error names what it belongs to."""
        try:
            if not unit:
                raise UnitError("it has no unit: write '1' for a pure number")
            return Dimension.of(unit)
        except UnitError as error:
            raise ModelError(f"{_place(self.model)}: {what}: {error}") from None

    def wired(self, method: str) -> AnyAssembly:
        """Return the assembly at an instant, with the lines in which its wires were set."""
        lines: dict[str, str] = {}
        wired: AnyAssembly = self.evaluated(
            method,
            lambda: self.model.at(
                self.state,
                self.memory,
                self.par,
                self.contact,
                rate=self.rate,
                reaction=self.reaction,
                lines=lines,
            ),
        )
        return wired

    def evaluated(self, method: str, function: Callable[..., Any], *arguments: Any) -> Any:
        """Return what an equation gives, its errors with their lines."""
        try:
            return function(*arguments)
        except UnitError as error:
            where = _line_of(error, self.model)
            raise ModelError(
                f"{type(self.model).__name__}.{method}, {where}: {error}: mend the equation or "
                "the unit that one of its quantities is declared with"
            ) from None


def _check_inputs(model: AnyAssembly, at: _Operands, w: AnyAssembly) -> None:
    instant = instant_of(w, "wire")
    for name, wire in _wires(type(model)).items():
        at.dimension(wire.signal.unit, name)
        if name not in instant.wires:
            raise ModelError(
                f"{_place(model)}: the wire {name} ({wire.signal.label}) is never set: assign "
                f"w.{name} = ... [{wire.signal.unit}] in wire"
            )
        _require(
            model, "wire", name, instant.wires[name], wire.signal.unit, wire.signal.label, instant
        )
    for part in model.parts.values():
        if not part.has("Input"):
            continue
        value = vars(getattr(w, part.name))["_input"]
        if value is None:
            raise ModelError(
                f"{_place(model)}: the input of {part.name} is never wired: assign w.{part.name}.u "
                f"= {part.kind}.Input({', '.join(part.element.Input._fields)}) in wire"
            )
        for (field, signal), each in zip(
            signals_of(part.element.Input).items(), value, strict=True
        ):
            _require(
                model, "wire", f"{part.name}.u.{field}", each, signal.unit, signal.label, instant
            )
    for name, sub in model.subs.items():
        _check_inputs(sub.assembly, at, getattr(w, name))


def _check_held(model: AnyAssembly, par: ParameterSet) -> None:
    """Check that the assemblies within get what feeds them, and that their tasks run."""
    known = signals_of(model.Stimulus) | signals_of(model.Memory)
    running = {task.name for task in model.tasks(par)}
    for sub in model.subs.values():
        for name, source in sub.feeds.items():
            wanted, given = signals_of(sub.assembly.Stimulus)[name].unit, known[source].unit
            if not fits(Dimension.of(given), wanted):
                raise ModelError(
                    f"{sub.where}: its {name} is in {wanted}, but is fed by {source} in {given}"
                )
        missing = [task.name for task in sub.tasks(par) if task.name not in running]
        if missing:
            raise ModelError(
                f"{_place(model, 'tasks')}: the task {missing[0]} of {sub.name} never runs: add "
                "*super().tasks(par) to what tasks returns"
            )


def _check_balance(model: AnyAssembly, at: _Operands, w: AnyAssembly) -> None:
    rows = at.evaluated("balance", model.balance, at.state, at.state, at.memory, at.par, at.contact)
    for name, row in zip(model.State._fields, rows, strict=True):
        _require(model, "balance", name, row, str(at.balance[name]), "mass times its derivative")


def _check_contacts(model: AnyAssembly, at: _Operands) -> None:
    gaps = at.evaluated("gap", model.gap, at.state, at.state, at.par)
    matrices = at.evaluated("compliance", model.compliance, at.par)
    forces = iter(at.contact)
    for group, rows in zip(gaps, matrices, strict=True):
        for overlap, row in zip(group, rows, strict=True):
            force = next(forces)
            wanted = next((c * force for c in row if isinstance(c, Dimension)), overlap)
            if isinstance(overlap, Dimension) and not fits(overlap, str(wanted)):
                raise ModelError(
                    f"{_place(model)}: an overlap in {overlap} meets a compliance times a force in "
                    f"{wanted}: they must be alike"
                )


def _protocol(model: AnyAssembly, at: _Operands, method: str) -> Iterator[Any]:
    """Yield the function of the protocol that a method is a part of, and its arguments."""
    if method == "power":
        yield from (
            model.powers,
            at.state,
            at.state,
            at.rate,
            at.memory,
            at.par,
            at.contact,
            at.reaction,
        )
    else:
        yield from (
            model.output,
            at.state,
            at.memory,
            at.par,
            at.contact,
            at.reaction,
            at.tuple(model.Flow),
        )


def _require(
    model: AnyAssembly,
    method: str,
    name: str,
    value: Any,
    unit: str,
    label: str = "",
    instant: Instant | None = None,
) -> None:
    if value is None or fits(value, unit):
        return
    where = ((instant.lines or {}) if instant else {}).get(_assigned(name), "").rstrip(",")
    shown = value if isinstance(value, Dimension) else "1"
    meaning = f" ({label})" if label else ""
    raise ModelError(
        f"{type(model).__name__}.{method}, {where or _place(model, method)}: {name}{meaning} is in "
        f"{unit}, but is given a quantity in {shown}: mend what is assigned or the declared unit"
    )


def _assigned(name: str) -> str:
    """Return what is assigned: of a part's input all at once."""
    return name.rpartition(".")[0] if ".u." in name else name


def _wires(cls: type[Any]) -> Mapping[str, Wire]:
    every = {k: v for base in reversed(cls.__mro__) for k, v in vars(base).items()}
    return {name: value for name, value in every.items() if isinstance(value, Wire)}


def _place(model: AnyAssembly, method: str = "wire") -> str:
    """Return class, file and line of a method."""
    cls = type(model)
    function = getattr(cls, method)
    if function.__module__ in (Assembly.__module__, Evaluated.__module__):
        function = cls
    try:
        line = inspect.getsourcelines(function)[1]
        return f"{cls.__name__}, {inspect.getsourcefile(function)}, line {line}"
    except (OSError, TypeError):  # typed in, not read from a file
        return cls.__name__


def _line_of(error: BaseException, model: AnyAssembly) -> str:
    """Return the innermost line outside of the numbers' own operations."""
    checkers = {__file__, inspect.getsourcefile(Dimension), inspect.getsourcefile(fits)}
    frames = [
        f
        for f in traceback.extract_tb(error.__traceback__)
        if f.filename not in checkers and not f.filename.endswith("core/ops.py")
    ]
    return f"{frames[-1].filename}, line {frames[-1].lineno}" if frames else _place(model)
