"""Several ECUs in one C or C++ program, and the symbols that a calibration tool needs."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from exported_ecu import needs_compiler

from bywire.core.errors import ParameterError, quoted
from bywire.export.controller.harness import FLAGS, WARNINGS
from bywire.usecases.export import export_controller
from raising import raises

ECUS: dict[str, tuple[str, str]] = {
    "front": ("hard-braking", "double"),
    "front_single": ("hard-braking", "single"),
    "rear": ("moment-pulses", "double"),
    "rear_single": ("moment-pulses", "single"),
}
PARTS = ("ecu", "io", "parameters", "instance", "can")
TICKS = 200


@pytest.fixture(scope="module")
def exports(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Two ECUs in both precisions, each with its own name."""
    folder = tmp_path_factory.mktemp("ecus")
    return {
        name: export_controller(
            experiment, folder / name, precision=precision, vectors=5, dbc=True, name=name
        )
        for name, (experiment, precision) in ECUS.items()
    }


def main(names: list[str], exports: dict[str, Any]) -> str:
    """Return a program that prints the bits of memories after some ticks."""
    lines = ["#include <stdio.h>", "#include <string.h>"]
    for name in names:
        lines += [f'#include "{name}_{part}.h"' for part in ("ecu", "io", "can", "instance")]
    lines.append("int main(void)\n{")
    for name in names:
        steps = exports[name].program.steps
        lines += [
            f"    {name}_instance_init();",
            f"    {name}_Plant {name}_x;",
            f"    {name}_Stimulus {name}_u;",
            f"    memset(&{name}_x, 0, sizeof {name}_x);",
            f"    memset(&{name}_u, 0, sizeof {name}_u);",
            f"    for (int k = 0; k < {TICKS}; ++k) {{",
        ]
        for step in steps:
            given = {
                "memory": f"&{name}_memory",
                "par": f"&{name}_active",
                "x": f"&{name}_x",
                "u": f"&{name}_u",
            }
            call = ", ".join(given[short] for _, short in step.arguments)
            lines.append(f"        {step.name}({call});")
        lines += [
            "    }",
            "    {",
            "        uint32_t bits = 2166136261u;",
            "        unsigned char data[8];",
            f"        const unsigned char *bytes = (const unsigned char *)&{name}_memory;",
            f"        for (unsigned k = 0; k < sizeof {name}_memory; ++k)",
            "            bits = (bits ^ bytes[k]) * 16777619u;",
            f"        {name}_can_fill(0u, &{name}_memory, data);",
            f'        printf("{name} %08lx %02x%02x\\n", (unsigned long)bits, data[0],',
            f"            data[1] + ({name}_instance_apply() == 0u ? 0 : 256));",
            "    }",
        ]
    return "\n".join([*lines, "    return 0;", "}", ""])


def said(names: list[str], exports: dict[str, Any], scratch: Path, compiler: str) -> str:
    """Return the output of a program that contains ECUs."""
    scratch.mkdir()
    objects = []
    for name in names:
        for part in PARTS:
            objects.append(str(scratch / f"{name}_{part}.o"))
            source = str(exports[name].folder / f"{name}_{part}.c")
            subprocess.run(
                ["gcc", *FLAGS, *WARNINGS, "-Werror", "-g", "-c", source, "-o", objects[-1]],
                check=True,
            )
    source = scratch / ("main.c" if compiler == "gcc" else "main.cpp")
    source.write_text(main(names, exports))
    standard = ["-std=c99"] if compiler == "gcc" else ["-std=c++11", "-Wall", "-Wextra", "-Werror"]
    headers = [f"-I{exports[name].folder}" for name in names]
    made = str(scratch / "program")
    subprocess.run(
        [compiler, *standard, *headers, str(source), *objects, "-o", made, "-lm"], check=True
    )
    return subprocess.run([made], capture_output=True, text=True, check=True).stdout


@needs_compiler
@pytest.mark.parametrize(
    "compiler",
    [
        "gcc",
        pytest.param(
            "g++",
            marks=pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed"),
        ),
    ],
)
def test_ecus_and_precisions_link_into_one_program(
    compiler: str, exports: dict[str, Any], tmp_path: Path
) -> None:
    together = said(list(ECUS), exports, tmp_path / "together", compiler)
    alone = [said([name], exports, tmp_path / name, "gcc") for name in ECUS]
    assert together == "".join(alone)
    assert len(set(together.split()[1::3])) == len(ECUS)


@needs_compiler
@pytest.mark.skipif(shutil.which("nm") is None, reason="nm is not installed")
def test_a_calibration_tool_finds_its_symbols_in_ram(
    exports: dict[str, Any], tmp_path: Path
) -> None:
    said(["front"], exports, tmp_path / "front", "gcc")
    listed = subprocess.run(
        ["nm", str(tmp_path / "front" / "program")], capture_output=True, text=True, check=True
    ).stdout
    kinds = {line.split()[-1]: line.split()[-2] for line in listed.splitlines() if line}
    links = re.findall(r'SYMBOL_LINK "(\w+)\.', (exports["front"].folder / "front.a2l").read_text())
    assert set(links) == {"front_memory", "front_calibration"}
    assert all(kinds[name] in "BDbd" for name in links)  # memory that can be written


def test_every_symbol_that_a_linker_sees_begins_with_the_name(
    exports: dict[str, Any], tmp_path: Path
) -> None:
    for part in PARTS:
        made = str(tmp_path / f"{part}.o")
        source = str(exports["rear"].folder / f"rear_{part}.c")
        subprocess.run(["gcc", "-std=c99", "-c", source, "-o", made], check=True)
        listed = subprocess.run(["nm", "-g", made], capture_output=True, text=True, check=True)
        for line in listed.stdout.splitlines():
            kind, name = line.split()[-2:]
            assert kind == "U" or name.startswith("rear_"), line


def test_out_of_range_calibration_is_not_taken_over(
    exports: dict[str, Any], tmp_path: Path
) -> None:
    folder = exports["front"].folder
    source = tmp_path / "main.c"
    source.write_text(
        """#include <math.h>
#include <stdio.h>
#include "front_instance.h"
int main(void)
{
    front_instance_init();
    front_calibration.ecu.pressure.k_p = NAN;
    front_calibration.ecu.current.D_max = 1.5;
    const unsigned refused = front_instance_apply();
    const int is_kept = front_active.ecu.current.D_max <= 1.0;
    front_calibration = front_parameters;
    front_calibration.ecu.current.D_max = 0.25;
    front_calibration.ecu.filter.f_c = 50.0;
    const unsigned taken = front_instance_apply();
    printf("%u %d %u %g %g\\n", refused, is_kept, taken, front_active.ecu.current.D_max,
           front_active.ecu.filter.angle);
    return 0;
}
""".replace("\\\\n", "\\n")
    )
    made = str(tmp_path / "program")
    sources = [str(folder / f"front_{part}.c") for part in ("ecu", "io", "parameters", "instance")]
    subprocess.run(
        ["gcc", *FLAGS, f"-I{folder}", str(source), *sources, "-o", made, "-lm"], check=True
    )
    done = subprocess.run([made], capture_output=True, text=True, check=True).stdout
    assert done == f"2 1 0 0.25 {3.141592653589793 * 50.0 * 1e-3:g}\n"


@pytest.mark.parametrize("name", ["int", "class", "2nd", "a b", "_a", "é", "a" * 61, "../x"])
def test_a_name_that_c_cannot_use_is_refused(name: str, tmp_path: Path) -> None:
    valid = "a letter, then letters, digits and underscores"
    with raises(ParameterError, name="name", value=quoted(name), valid=valid):
        export_controller("hard-braking", tmp_path / "out", name=name)
    assert not (tmp_path / "out").exists()
