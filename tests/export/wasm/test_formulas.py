"""Formulas as a table that the loader compiles: all operations, loops, and stored values."""

from __future__ import annotations

import json
import math
import random
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bywire.core.errors import CompilerError
from bywire.export.wasm import module
from bywire.export.wasm.module import OPERATIONS, Formula, table
from bywire.simulation.graph import BOOLEAN, Graph, Node, Operation

NODE = shutil.which("node")
pytestmark = pytest.mark.skipif(NODE is None, reason="there is no node to run the formulas in")
COMPILER = Path(module.__file__).with_name("formulas.mjs")
DRIVER = """
import { readFileSync } from "node:fs";
const { area, loop, turns } = JSON.parse(readFileSync("task.json"));
const memory = new WebAssembly.Memory({ initial: 1 }), base = 64;
const working = new Float64Array(memory.buffer, base, area.length);
working.set(area);
const exported = { memory };
for (const op of CALLED) exported[op] = Math[op];
const made = await functionsOf(new Uint8Array(readFileSync("table")).buffer, exported, base);
const left = made.map((each, k) => (k === loop ? each(turns) : each()) ?? null);
console.log(JSON.stringify({ area: [...working], left }));
"""
AS_PYTHON: dict[str, Any] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "neg": lambda a: -a,
    "inv": lambda a: 1.0 / a,
    "fabs": abs,
    "sqrt": math.sqrt,
    "floor": np.floor,
    "ceil": np.ceil,
    "copysign": math.copysign,
    "fmax": lambda a, b: a if a > b else b,
    "fmin": lambda a, b: a if a < b else b,
    "lt": lambda a, b: a < b,
    "le": lambda a, b: a <= b,
    "eq": lambda a, b: a == b,
    "ne": lambda a, b: a != b,
    "not": lambda a: not a,
    "and": lambda a, b: bool(a and b),
    "or": lambda a, b: bool(a or b),
    "if_else_zero": lambda c, a: a if c else 0.0,
    "select": lambda c, a, b: a if c else b,
    "pow": math.pow,
    **{op: getattr(math, op) for op in ("exp", "log", "sin", "cos", "tan", "atan", "tanh")},
}


def computed(
    made: list[Formula], area: list[float], folder: Path, loop: int = -1, turns: int = 0
) -> tuple[list[float], list[int | None]]:
    """Return the working memory after one run of each formula in Node, and the results."""
    places = {("x", k): k for k in range(len(area))}
    (folder / "table").write_bytes(table(made, places))
    (folder / "task.json").write_text(json.dumps({"area": area, "loop": loop, "turns": turns}))
    (folder / "run.mjs").write_text(COMPILER.read_text() + DRIVER)
    done = subprocess.run(
        [str(NODE), "run.mjs"], cwd=folder, capture_output=True, text=True, check=True, timeout=60
    )
    said = json.loads(done.stdout)
    return said["area"], said["left"]


def grown(graph: Graph, seed: int, count: int) -> list[Node]:
    """Return nodes of random operations, each in turn, with inputs that are valid for all."""
    chance = random.Random(seed)
    numbers = [graph.leaf("x", k) for k in range(6)] + [graph.constant(c) for c in (0.0, 0.7, -3.0)]
    truths: list[Node] = []
    for n in range(count):
        op = OPERATIONS[n % len(OPERATIONS)]
        if op in ("not", "and", "or") or (op in ("if_else_zero", "select") and not truths):
            if len(truths) < 2:
                continue
            args = chance.sample(truths, 1 if op == "not" else 2)
        else:
            code = getattr(AS_PYTHON[op], "__code__", None)
            several = code.co_argcount if code else 2 if op in ("copysign", "pow") else 1
            args = chance.choices(numbers, k=several)
            if op in ("if_else_zero", "select"):
                args[0] = chance.choice(truths)
            if op in ("log", "sqrt", "inv", "pow"):  # of what is above zero
                args[0] = graph.intern(Operation("fabs", (args[0],)))
                args[0] = graph.intern(Operation("add", (args[0], graph.constant(0.5))))
            if op in ("exp", "pow", "tan"):  # of what is small
                args[-1] = graph.intern(Operation("tanh", (args[-1],)))
        node = graph.intern(Operation(op, tuple(args)))
        (truths if op in BOOLEAN else numbers).append(node)
    return [*numbers[9:], *truths]


def evaluated(graph: Graph, roots: list[Node], area: list[float]) -> list[float]:
    values: list[float] = []
    for operation in graph.nodes:
        if operation.op == "leaf":
            values.append(area[operation.args[1]])
        elif operation.op == "const":
            values.append(float(operation.args[0]))
        else:
            values.append(AS_PYTHON[operation.op](*(values[a] for a in operation.args)))
    return [float(values[root]) for root in roots]


@pytest.mark.parametrize("seed", range(3))
def test_every_operation_is_what_it_is_in_python(tmp_path: Path, seed: int) -> None:
    graph, area = Graph(), [0.3, -1.7, 2.5, 40.0, -0.01, 0.0, *[0.0] * 1000]
    roots = grown(graph, seed, 900)
    used = {graph.nodes[n].op for n in graph.read_by(roots)}
    assert used >= set(OPERATIONS)
    half = len(roots) // 2  # what the first keeps, the second reads
    made = [
        Formula(graph, [(6 + k, node) for k, node in enumerate(part)])
        for part in (roots[:half], roots)
    ]
    got, _ = computed(made, area, tmp_path)
    expected = evaluated(graph, roots, area)
    np.testing.assert_allclose(got[6 : 6 + len(roots)], expected, rtol=1e-12, atol=1e-300)
    assert len({round(x, 9) for x in expected}) > 200


def test_what_a_formula_kept_is_read_where_it_wrote_it(tmp_path: Path) -> None:
    graph = Graph()
    x, y = graph.leaf("x", 0), graph.leaf("x", 1)
    square = graph.apply("mul", x, x)
    changed = Formula(graph, [(0, graph.constant(5.0))])  # of which the kept square knows nothing
    last = Formula(graph, [(3, graph.apply("add", square, y)), (0, y), (1, x)])
    area, _ = computed([Formula(graph, [(2, square)]), changed, last], [3.0, 1.0, 0, 0], tmp_path)
    assert area == [1.0, 5.0, 9.0, 10.0]  # and results are written when all are computed


@pytest.mark.parametrize(("turns", "left"), [(3, 0), (9, 5)])
def test_a_loop_ends_where_its_first_result_is_up(tmp_path: Path, turns: int, left: int) -> None:
    """x, y -> y, x + y until x > 5; the sum adds y before each turn."""
    graph = Graph()
    x, y = graph.leaf("x", 0), graph.leaf("x", 1)
    up = graph.apply("lt", graph.constant(5.0), x)
    turn = [(0, up), (0, y), (1, graph.apply("add", x, y)), (2, y)]
    loop = Formula(graph, turn, again=2)
    area, said = computed([Formula(graph, []), loop], [1.0, 2.0, 0.5], tmp_path, 1, turns)
    a, b, total = 1.0, 2.0, 0.5
    for _ in range(turns - left):
        a, b, total = b, a + b, total + b
    assert (area, said[1]) == ([a, b, total], left)


def test_more_than_the_table_can_tell_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_MOST", 40)
    graph = Graph()
    x = total = graph.leaf("x", 0)
    for _ in range(40):
        total = graph.intern(Operation("mul", (total, x)))
    with pytest.raises(CompilerError, match="49 operands, but a module can contain only 40"):
        table([Formula(graph, [(0, total)])], {("x", 0): 0})
