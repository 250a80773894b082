"""A harness for a Cortex-M: compares with the vectors, counts instructions, measures the stack."""

from __future__ import annotations

from collections.abc import Sequence

from bywire.export.controller.c_text import c_name
from bywire.export.controller.harness import comparison
from bywire.export.controller.program import Program
from bywire.export.controller.trespassing import prepared, stepped
from bywire.export.controller.vectors import Vectors

SAMPLES = 100
"""vectors of a task whose instructions are counted, at most"""
_REPEATS = 40


def target_harness(program: Program, every: Sequence[Vectors]) -> str:
    """Return a program that says how many values differ, then a line of figures for every task."""
    name = program.name
    what = f"Tries the compiled ECU of {program.model.name} on a Cortex-M."
    tasks = [c_name(each.step.task.name) for each in every]
    calls = " + ".join(f"differing_{task}()" for task in tasks)
    breaches = " + ".join(f"breaches_{task}()" for task in tasks)
    measured = "".join(f"    measure_{task}();\n" for task in tasks)
    parts = [
        *comparison(program, every, what, '#include "target.h"'),
        *(_measured(program, each) for each in every),
        f"int main(void)\n{{\n    {name}_Memory memory;\n\n    {name}_ecu_init(&memory);\n"
        f'    say("differ ");\n    say_number((uint32_t)({calls}));\n'
        f'    say("\\nbits ");\n    say_number(bits);\n'
        f'    say("\\nbreaches ");\n    say_number((uint32_t)({breaches}));\n    say("\\n");\n'
        f"{measured}    return 0;\n}}",
    ]
    return "\n\n".join(parts) + "\n"


def _measured(program: Program, vectors: Vectors) -> str:
    task = c_name(vectors.step.task.name)
    set_up = "\n".join(prepared(program, vectors))
    return f"""static void measure_{task}(void)
{{
    uint32_t most = 0u, sum = 0u, count = 0u, depth = 0u;

    for (int k = 0; k < VECTORS_{task}; k += 1 + VECTORS_{task} / {SAMPLES + 1}) {{
{set_up}
        const {program.name}_Memory given = memory;
        uint32_t begin = SYST_CVR;
        for (int n = 0; n < {_REPEATS}; ++n) {{
            memory = given;
            IN_ORDER();
        }}
        const uint32_t without = counted_since(begin);
        begin = SYST_CVR;
        for (int n = 0; n < {_REPEATS}; ++n) {{
            memory = given;
            IN_ORDER();
            {stepped(vectors)}
        }}
        const uint32_t with = counted_since(begin);
        const uint32_t took = (with - without) * INSTRUCTIONS_PER_COUNT / {_REPEATS}u;
        most = (took > most) ? took : most;
        sum += took;
        count += 1u;
        memory = given;
        paint_stack();
        {stepped(vectors)}
        const uint32_t used = stack_used();
        depth = (used > depth) ? used : depth;
    }}
    say("task {task} ");
    say_number(most);
    say(" ");
    say_number((count > 0u) ? sum / count : 0u);
    say(" ");
    say_number(depth);
    say("\\n");
}}"""
