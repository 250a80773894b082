"""C text of a model's data for the functions around its kernel: counts, tables, start values."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping

from bywire.export.exported import HEADING, Exported, Interface, Variable, finite_range, tables
from bywire.simulation.c_runtime import SCALAR
from bywire.simulation.schedule import COUNTERS

_PLACES = {
    "parameter": "PARAMETER",
    "stimulus": "STIMULUS",
    "state": "IN_STATE",
    "row": "IN_ROW",
    "sampled": "IN_SAMPLED",
    "rate": "IN_RATE",
    "mode": "IN_MODE",
    "closed": "IN_CLOSED",
    "indicator": "IN_INDICATOR",
    "events": "IN_EVENTS",
}


def model_header(
    made: Exported,
    faces: Interface,
    start: str,
    token: str,
    modes: Mapping[str, object] | None = None,
) -> str:
    """Return the C header of an exported part.

    Parameters
    ----------
    start
        C function of the initial values, empty for none.
    token
        Unique identifier of the model.
    modes
        Further counts, for a plant in model exchange.
    """
    schedule, n = made.schedule, made.program.sizes
    counts = {
        "TOKEN": text(token),
        "STEP": number(schedule.step),
        "SUBSTEPS": schedule.substeps,
        "TASKS": len(schedule.task_frames),
        "TASK_FRAMES": braced(map(str, schedule.task_frames)),
        "PARAMETERS": n.parameters,
        "STIMULI": n.stimulus,
        "ROWS": n.output,
        "STATES": n.x,
        "STATE": made.layout.total,
        "COUNTERS": COUNTERS,
        "VARIABLES": len(faces.variables),
        "IS_PLANT": int(faces.part == "plant"),
        "IS_ECU": int(faces.part == "ecu"),
        "X_AT": made.layout.start["x"],
        "M_AT": made.layout.start["m"],
        **(modes or {}),
    }
    defines = "\n".join(f"#define {name} {value}" for name, value in counts.items())
    values, name = made.run.par.leaves().values(), made.bench.name or made.bench.experiment
    states = made.run.model.State._fields
    names = [text(task.name) for task in made.run.model.tasks(made.run.par)]
    rows = ",\n  ".join(map(_row, faces.variables))
    begins = start or f"{HEADING} {{\n  (void)p, (void)state;\n}}\n"
    return f"""/* Made by bywire of the bench {comment(name)}. */
#ifndef MODEL_H
#define MODEL_H
{SCALAR}
{defines}

enum {{ {", ".join(_PLACES.values())} }};
enum {{ FIXED, TUNABLE, GIVEN, RESULT }};
typedef struct {{
  const char *name, *unit, *range;
  int place, kind, index;
  double low, high;
}} variable;

static const variable variables[] = {{
  {rows}
}};
/* How many numbers a variable of version 3.0 holds: a table stands where its first node does. */
static const int sizes[] __attribute__((unused)) = {braced(_sizes(faces))};
static const char *const task_names[] __attribute__((unused)) = {braced(names)};
static const char *const state_names[] = {braced(map(text, states))};
static const double p_start[] = {braced(map(number, values))};
static const double u_start[] __attribute__((unused)) = {braced(map(number, made.demanded))};
static const double state_start[] = {braced(map(number, made.vector))};

static {begins}
#endif
"""


def _sizes(faces: Interface) -> Iterator[str]:
    for nodes in tables(faces):
        yield str(len(nodes))
        yield from ("0" for _ in nodes[1:])


def _row(each: Variable) -> str:
    kind = {"parameter": "TUNABLE" if each.is_tunable else "FIXED", "input": "GIVEN"}.get(
        each.causality, "RESULT"
    )
    if each.leaf is None:
        low, high = (end if math.isfinite(end) else None for end in each.ends)
        wanted = _ends(each) or "any finite number"
    else:
        (low, high), wanted = finite_range(each.leaf), each.leaf.range_text
    unit = "" if each.unit == "1" else f" {each.unit}"
    return (
        f"{{{text(each.name)}, {text(unit)}, {text(wanted)}, {_PLACES[each.place]}, {kind}, "
        f"{each.index}, {'-HUGE_VAL' if low is None else number(low)}, "
        f"{'HUGE_VAL' if high is None else number(high)}}}"
    )


def _ends(each: Variable) -> str:
    unit = "" if each.unit == "1" else f" {each.unit}"
    low, high = each.ends
    parts = [f">= {low:g}{unit}"] * math.isfinite(low)
    return " and ".join([*parts, *([f"<= {high:g}{unit}"] * math.isfinite(high))])


def text(value: str) -> str:
    """Return a C string; non-ASCII characters as octal bytes."""
    encoded = value.encode("utf-8")
    return (
        '"'
        + "".join(
            f"\\{chr(b)}" if chr(b) in '"\\' else chr(b) if 32 <= b < 127 else f"\\{b:03o}"
            for b in encoded
        )
        + '"'
    )


def comment(value: str) -> str:
    """Return a text that cannot end a C comment, in one line."""
    return re.sub(r"[^\w .,:()=+-]", "_", value)


def number(value: float) -> str:
    """Return a number that C reads as exactly the same double."""
    if not math.isfinite(value):
        raise ValueError(f"{value} cannot be written in C")
    return json.dumps(float(value))


def braced(values: Iterable[str]) -> str:
    """Return an initializer; for an empty one, a form that is valid in C."""
    return f"{{{', '.join(values) or '0'}}}"
