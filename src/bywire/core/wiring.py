"""Wiring of an assembly, derived from its equations: completeness, and connections of parts."""

from __future__ import annotations

import inspect
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from bywire.core.assembly import Assembly, Evaluated, contact_count
from bywire.core.dimensions import Dimension, fits
from bywire.core.errors import ModelError, UnitError
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.signals import signals_of
from bywire.core.traced import Traced, names_in
from bywire.core.wires import Instant, Wire, instant_of

_AnyAssembly = Assembly[Any, Any]


def check_wiring(model: _AnyAssembly, par: ParameterSet) -> None:
    """Evaluate an assembly on dimensions, and check the units of its assignments and results.

    Raises
    ------
    ModelError
        When the wiring is incomplete or a unit is wrong. The message contains class, file and line,
        part, signal, both units, and the next step.
    """
    at = _Operands(model, par)
    w = at.wired("wire")
    _check_inputs(model, at, w)
    _check_held(model, par)
    _check_balance(model, at, w)
    _check_contacts(model, at)
    widths = at.evaluated("wire", model.widths, at.state, at.state, at.memory, at.par, at.contact)
    for name, value in zip(model.stops, widths, strict=True):
        label = "width of a stop operator"
        _require(model, "wire", name, value, signals_of(model.State)[name].unit, label)
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
    """Operands for the evaluation of an assembly on dimensions."""

    def __init__(self, model: _AnyAssembly, par: ParameterSet) -> None:
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
        forces = [
            self.balance.get(name) for name in (*model.frictions, *model.limits, *model.stops)
        ]
        self.reaction = tuple(forces)

    def tuple(self, kind: Any) -> Any:
        """Return a signal tuple of dimensions."""
        return kind._make(
            self.dimension(s.unit, f"{kind.__name__}.{name}")
            for name, s in signals_of(kind).items()
        )

    def forces(self, model: Any, par: Any) -> Iterator[Any]:
        """Yield the dimensions of an assembly's contact forces, including its subassemblies."""
        for part in model.parts.values():
            if any(part.group_sizes(par)):
                yield from self.tuple(part.element.Forces)
        for sub in model.subs.values():
            yield from self.forces(sub.assembly, sub.parameters(par))

    def dimension(self, unit: str, what: str) -> Dimension:
        """Return the dimension of a unit; an error contains the unit's owner."""
        try:
            if not unit:
                raise UnitError("the unit is missing. Write '1' for a pure number")
            return Dimension.of(unit)
        except UnitError as error:
            text = f"{_place(self.model)}: {what}: {error}"
            raise ModelError(text, name=what, value=unit) from None

    def wired(self, method: str) -> _AnyAssembly:
        """Return the assembly at an instant, with the lines that set its wires."""
        lines: dict[str, str] = {}
        wired: _AnyAssembly = self.evaluated(
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
        """Return the result of an equation; an error contains the equation's line."""
        try:
            return function(*arguments)
        except UnitError as error:
            where = _line_of(error, self.model)
            raise ModelError(
                f"{type(self.model).__name__}.{method}, {where}: {error}. Correct the equation or "
                "the declared unit of one of its quantities",
                name=f"{type(self.model).__name__}.{method}",
                value=error.value,
                valid=error.valid,
            ) from None


def _check_inputs(model: _AnyAssembly, at: _Operands, w: _AnyAssembly) -> None:
    instant = instant_of(w, "wire")
    for name, wire in _wires(type(model)).items():
        at.dimension(wire.signal.unit, name)
        if name not in instant.wires:
            raise ModelError(
                f"{_place(model)}: the wire {name} ({wire.signal.label}) is never set. Assign "
                f"w.{name} = ... [{wire.signal.unit}] in wire",
                name=name,
                valid=wire.signal.unit,
            )
        _require(
            model, "wire", name, instant.wires[name], wire.signal.unit, wire.signal.label, instant
        )
    for part in model.parts.values():
        if not part.has("Input"):
            continue
        value = vars(getattr(w, part.name))["_input"]
        if value is None:
            valid = f"{part.kind}.Input({', '.join(part.element.Input._fields)})"
            raise ModelError(
                f"{_place(model)}: the input of {part.name} is never wired. Assign w.{part.name}.u "
                f"= {valid} in wire",
                name=part.name,
                valid=valid,
            )
        for (field, signal), each in zip(
            signals_of(part.element.Input).items(), value, strict=True
        ):
            _require(
                model, "wire", f"{part.name}.u.{field}", each, signal.unit, signal.label, instant
            )
    for name, sub in model.subs.items():
        _check_inputs(sub.assembly, at, getattr(w, name))


def _check_held(model: _AnyAssembly, par: ParameterSet) -> None:
    """Check that the stimuli of the subassemblies have sources, and that their tasks run."""
    known = signals_of(model.Stimulus) | signals_of(model.Memory)
    running = {task.name for task in model.tasks(par)}
    for sub in model.subs.values():
        for name, source in sub.feeds.items():
            valid, unit = signals_of(sub.assembly.Stimulus)[name].unit, known[source].unit
            if not fits(Dimension.of(unit), valid):
                raise ModelError(
                    f"{sub.where}: its {name} is in {valid}, but its source {source} is in {unit}",
                    name=name,
                    value=unit,
                    valid=valid,
                )
        missing = [task.name for task in sub.tasks(par) if task.name not in running]
        if missing:
            raise ModelError(
                f"{_place(model, 'tasks')}: the task {missing[0]} of {sub.name} never runs. Add "
                "*super().tasks(par) to the return value of tasks",
                name=missing[0],
            )


def _check_balance(model: _AnyAssembly, at: _Operands, w: _AnyAssembly) -> None:
    rows = at.evaluated("balance", model.balance, at.state, at.state, at.memory, at.par, at.contact)
    for name, row in zip(model.State._fields, rows, strict=True):
        _require(model, "balance", name, row, str(at.balance[name]), "mass times its derivative")


def _check_contacts(model: _AnyAssembly, at: _Operands) -> None:
    gaps = at.evaluated("gap", model.gap, at.state, at.state, at.par)
    matrices = at.evaluated("compliance", model.compliance, at.par)
    forces = iter(at.contact)
    for group, rows in zip(gaps, matrices, strict=True):
        for overlap, row in zip(group, rows, strict=True):
            force = next(forces)
            valid = next((c * force for c in row if isinstance(c, Dimension)), overlap)
            if isinstance(overlap, Dimension) and not fits(overlap, str(valid)):
                raise ModelError(
                    f"{_place(model)}: an overlap is in {overlap}, but compliance times force is "
                    f"in {valid}. The units must match",
                    name="overlap",
                    value=str(overlap),
                    valid=str(valid),
                )


def _protocol(model: _AnyAssembly, at: _Operands, method: str) -> Iterator[Any]:
    """Yield the protocol functions that call a method, with their arguments."""
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
    model: _AnyAssembly,
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
        f"{unit}, but its assigned value is in {shown}. Correct the value or the declared unit",
        name=name,
        value=str(shown),
        valid=unit,
    )


def _assigned(name: str) -> str:
    """Return the name that was used to assign a wire or a part's input, which is one item."""
    return name.rpartition(".")[0] if ".u." in name else name


def _wires(cls: type[Any]) -> Mapping[str, Wire]:
    every = {k: v for base in reversed(cls.__mro__) for k, v in vars(base).items()}
    return {name: value for name, value in every.items() if isinstance(value, Wire)}


def _place(model: _AnyAssembly, method: str = "wire") -> str:
    """Return class, file and line of a method."""
    cls = type(model)
    function = getattr(cls, method)
    if function.__module__ in (Assembly.__module__, Evaluated.__module__):
        function = cls
    try:
        line = inspect.getsourcelines(function)[1]
        return f"{cls.__name__}, {inspect.getsourcefile(function)}, line {line}"
    except (OSError, TypeError):  # typed into a console, so it has no file
        return cls.__name__


def _line_of(error: BaseException, model: _AnyAssembly) -> str:
    """Return the innermost line outside the operations of dimensions."""
    checkers = {__file__, inspect.getsourcefile(Dimension), inspect.getsourcefile(fits)}
    frames = [
        f
        for f in traceback.extract_tb(error.__traceback__)
        if f.filename not in checkers and not f.filename.endswith("core/ops.py")
    ]
    return f"{frames[-1].filename}, line {frames[-1].lineno}" if frames else _place(model)


# --- Connections of parts
# ``wire`` and the tasks run once on numbers that record their computation. The assignment of a wire
# or an input marks its value. A value is connected to all values from which it is computed, up to
# the next mark.

Kind = Literal["part", "wire", "task", "stimulus"]
FRICTION = "friction"
"""port of a part for dry friction on its state"""


class Node(NamedTuple):
    """Part, wire, ECU task, or stimulus of the bench, with its name in the assembly."""

    kind: Kind
    name: str


STIMULUS = Node("stimulus", "demand")
"""demand from the bench or a driver"""


@dataclass(frozen=True)
class Connection:
    """Connection from one node to another.

    ``port``: the input of a part, or the signal that a task reads; empty if the target is a wire.
    """

    source: Node
    target: Node
    port: str = ""


@dataclass(frozen=True)
class Network:
    """An assembly as parts and wires.

    Parameters
    ----------
    name
        Name of the assembly.
    nodes
        The stimulus if a task reads it, then parts, wires and tasks in the order of declaration.
    labels
        Description of each node, such as the kind of a part's element, or a wire's label.
    ports
        Inputs of each part and task in order, by node. Wires have no ports.
    connections
        Connections without duplicates, in the order of their targets.
    """

    name: str
    nodes: tuple[Node, ...]
    labels: dict[Node, str]
    ports: dict[Node, tuple[str, ...]]
    connections: tuple[Connection, ...]

    def sources(self, node: Node, port: str = "") -> list[Node]:
        """Return the sources that are connected to a node's port."""
        return [c.source for c in self.connections if (c.target, c.port) == (node, port)]


def network(model: Assembly[Any, Any], par: Any) -> Network:
    """Return the parts of an assembly and their connections.

    Parameters
    ----------
    model
        An assembly.
    par
        Parameters, whose choices select the equations.
    """
    trace = _Trace(model, par)
    ports: dict[Node, tuple[str, ...]] = {}
    connections: dict[Connection, None] = {}

    def connect(target: Node, port: str, values: Any) -> None:
        for source in trace.sources(values):
            if source != target:
                connections[Connection(source, target, port)] = None

    for task, read in trace.ticks.items():
        ports[task] = tuple(read)
        for signal, source in read.items():
            connections[Connection(source, task, signal)] = None
    for name, value in trace.wires.items():
        connect(Node("wire", name), "", value)
    for name, part in model.parts.items():
        node, inputs = Node("part", name), trace.inputs.get(name)
        ports[node] = () if inputs is None else tuple(part.element.Input._fields)
        for port, value in zip(ports[node], inputs or (), strict=True):
            connect(node, port, value)
    for name in model.subs:
        node, read = Node("part", name), trace.memory_of(name)
        ports[node] = (*trace.ports[name], *read)
        for port, value in trace.ports[name].items():
            connect(node, port, value)
        for port, source in read.items():
            connections[Connection(source, node, port)] = None
    for state, bounds in zip(model.frictions, trace.frictions, strict=False):
        node = trace.owners[state]
        if any(source != node for source in trace.sources(bounds)):
            ports[node] = tuple(dict.fromkeys((*ports[node], FRICTION)))
            connect(node, FRICTION, bounds)
    found = tuple(connections)
    return Network(str(model.name), trace.nodes(found), trace.labels(), ports, found)


class _Trace:
    """An assembly's equations, run once on traced numbers."""

    def __init__(self, model: Assembly[Any, Any], par: Any) -> None:
        self.model = model
        self._marks: dict[int, tuple[Node, Any]] = {}
        self._kept: list[Traced] = []  # keeps the marks alive, because their identity matters
        self.owners = {
            part.state_name(state): Node("part", part.name)
            for part in model.parts.values()
            if part.has("State")
            for state in part.element.State._fields
        }
        self.owners |= {
            state: Node("part", name)
            for name, sub in model.subs.items()
            for state in sub.signals("State")
        }
        each: list[Any] = [*model.parts.values(), *model.subs.values()]
        paths = [one.path for one in each]
        self._paths = {
            one.path: Node("part", one.name) for one in each if paths.count(one.path) == 1
        }
        self._par = par.with_leaves({name: Traced(None, f".{name}") for name in par.leaves()})
        self._state = model.State._make(Traced(None, name) for name in model.State._fields)
        self._memory = model.Memory._make(Traced(None, f"m.{k}") for k in model.Memory._fields)
        self.fields: dict[str, Node] = {}
        ticks = list(self._ticks(par))
        self.ticks = {
            node: read
            | {
                k: self.fields[k]
                for k in model.Memory._fields
                if k in held and self.fields.get(k, node) != node
            }
            for node, read, held in ticks
        }
        counts = {part.name: sum(part.group_sizes(par)) for part in model.parts.values()}
        counts |= {
            name: contact_count(sub.assembly, sub.parameters(par))
            for name, sub in model.subs.items()
        }
        contact: tuple[Any, ...] = tuple(
            Traced(None, f"contact.{name}") for name, count in counts.items() for _ in range(count)
        )
        w = model.at(self._state, self._memory, self._par, contact, mark=self._mark)
        wires = instant_of(w, "wire").wires
        self.wires = {name: self._marks[id(value)][1] for name, value in wires.items()}
        inputs = {name: vars(getattr(w, name))["_input"] for name in model.parts}
        self.inputs = {
            name: tuple(self._marks[id(each)][1] for each in value)
            for name, value in inputs.items()
            if value is not None
        }
        self.frictions = model.friction(w)
        self.ports = {
            name: {
                port.name: self._marks[id(instant_of(inner, name).wires[port.name])][1]
                for port in inner.ports
            }
            for name, inner in ((name, getattr(w, name)) for name in model.subs)
        }

    def memory_of(self, name: str) -> dict[str, Node]:
        """Return the task that updates each field of a subassembly's memory, by its own names."""
        sub, node = self.model.subs[name], Node("part", name)
        own = dict(zip(sub.signals("Memory"), sub.assembly.Memory._fields, strict=True))
        raw = tuple(value for at, value in self._marks.values() if at == node)
        leaves = {str(each).removeprefix("m.") for each in names_in(raw) if str(each)[:2] == "m."}
        return {
            own[each]: self.fields[each] for each in own if each in leaves and each in self.fields
        }

    def _mark(self, name: str, value: Any) -> Any:
        """Return a value marked with its wire or input."""
        within = name.partition("/")[0]
        if within != name:
            node, is_one = Node("part", within), not isinstance(value, tuple)
            each = [self._marked(node, one) for one in ((value,) if is_one else value)]
            return each[0] if is_one else value._make(each)
        part = name.removesuffix(".u")
        node = Node("wire", name) if part == name else Node("part", part)
        if node.kind == "wire":
            return self._marked(node, value)
        return value._make(self._marked(node, each) for each in value)

    def _marked(self, node: Node, value: Any) -> Traced:
        marked = Traced(lambda same: same, value)
        self._marks[id(marked)] = (node, value)
        self._kept.append(marked)
        return marked

    def _ticks(self, par: Any) -> Iterator[tuple[Node, dict[str, Node], set[str]]]:
        """Yield each task, the sources of the signals that it reads, and the memory it uses."""
        stimulus = self.model.Stimulus._make(
            Traced(None, f"u.{k}") for k in self.model.Stimulus._fields
        )
        for task in self.model.tasks(par):
            node = Node("task", task.name)
            after = task.tick(self._state, self._memory, stimulus, self._par)
            changed = {
                name: value
                for name, value in after._asdict().items()
                if value is not getattr(self._memory, name)
            }
            self.fields |= dict.fromkeys(changed, node)
            leaves = {str(each) for each in names_in(tuple(changed.values()))}
            read = {name: self.owners[name] for name in self.model.State._fields if name in leaves}
            read |= {k: STIMULUS for k in stimulus._fields if f"u.{k}" in leaves}
            yield node, read, {name.removeprefix("m.") for name in leaves if name[:2] == "m."}

    def sources(self, values: Any) -> list[Node]:
        """Return the nodes that a value depends on, without duplicates."""
        marks = {key: node for key, (node, _) in self._marks.items()}
        nodes = [self._node(each) for each in names_in(values, marks)]
        return list(dict.fromkeys(node for node in nodes if node is not None))

    def _node(self, leaf: str | Node) -> Node | None:
        if isinstance(leaf, Node):
            return leaf
        kind, _, name = leaf.partition(".")
        if kind == "m" and name:
            return self.fields.get(name)
        if kind == "contact" and name:
            return Node("part", name)
        if leaf.startswith("."):
            groups = name.split(".")
            paths = (".".join(groups[:n]) for n in range(len(groups), 0, -1))
            return next((self._paths[path] for path in paths if path in self._paths), None)
        return self.owners.get(leaf)

    def nodes(self, connections: Iterable[Connection]) -> tuple[Node, ...]:
        """Return all nodes, with the stimulus only if it has a connection."""
        asked = [STIMULUS] if any(c.source == STIMULUS for c in connections) else []
        parts = (Node("part", name) for name in (*self.model.parts, *self.model.subs))
        return (*asked, *self.ticks, *(Node("wire", name) for name in self.wires), *parts)

    def labels(self) -> dict[Node, str]:
        """Return a description of each node."""
        cls = type(self.model)
        labels = {Node("wire", name): getattr(cls, name).signal.label for name in self.wires}
        labels |= {
            Node("part", name): part.kind.replace("_", " ")
            for name, part in self.model.parts.items()
        }
        labels |= {
            Node("part", name): str(sub.assembly.name).replace("-", " ")
            for name, sub in self.model.subs.items()
        }
        return labels | {STIMULUS: "of the bench"} | dict.fromkeys(self.ticks, "task of the ECU")
