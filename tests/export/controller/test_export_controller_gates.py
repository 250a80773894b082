"""Gates of the generated C: sanitizers, coverage, mutants, reproducible text, and a target."""

from __future__ import annotations

import os
import random
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from exported_ecu import BRAKES, bench_of, build, needs_compiler

from bywire.export.controller.harness import FLAGS, SMALL_FLAGS
from bywire.usecases.export import export_controller

MUTANTS = 40
SOME = 20
MOST_BRANCHES = "slip by rules"
IN_TURN = [
    each if each == MOST_BRANCHES else pytest.param(each, marks=pytest.mark.trust)
    for each in BRAKES
]
"""one structure here, all of them in the trust runs"""


@needs_compiler
@pytest.mark.parametrize("structure", IN_TURN)
def test_sanitizers_find_nothing(structure: str, tmp_path: Path) -> None:
    export_controller(bench_of(structure), tmp_path)
    checks = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g")
    done = build(tmp_path, *FLAGS, *checks).run()
    assert (done.returncode, done.stderr) == (0, "")


@needs_compiler
@pytest.mark.skipif(shutil.which("gcov") is None, reason="gcov is not installed")
@pytest.mark.parametrize("structure", IN_TURN)
def test_vectors_run_every_line(structure: str, tmp_path: Path) -> None:
    made = export_controller(bench_of(structure), tmp_path)
    assert build(tmp_path, "-std=c99", "-O0", "--coverage").run().returncode == 0
    name = made.program.name
    for part in ("ecu", "io"):
        said = subprocess.run(
            ["gcov", f"harness-{name}_{part}.gcda"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        (share,) = re.findall(rf"File '.*{name}_{part}\.c'\nLines executed:([0-9.]+)%", said)
        assert float(share) == 100.0


@needs_compiler
@pytest.mark.parametrize(
    ("structure", "count"),
    [
        ("moment and position", SOME),
        *(
            pytest.param(each, MUTANTS, marks=pytest.mark.trust)
            for each in (
                "moment and position",
                "gains that differ by region",
                "slip by PI",
                "slip by rules",
            )
        ),
    ],
)
def test_vectors_kill_mutants(structure: str, count: int, tmp_path: Path) -> None:
    vectors = 2000 if count == MUTANTS else 600
    name = export_controller(bench_of(structure), tmp_path, vectors=vectors).program.name
    source = tmp_path / f"{name}_ecu.c"
    original = source.read_text()
    objects = []
    for part in ("io", "parameters", "harness"):
        objects.append(str(tmp_path / f"{part}.o"))
        subprocess.run(
            ["gcc", "-std=c99", "-c", str(tmp_path / f"{name}_{part}.c"), "-o", objects[-1]],
            check=True,
        )
    alive = []
    for number, text in enumerate(mutants(original, count)):
        source.write_text(text)
        program = str(tmp_path / f"mutant_{number}")
        command = ["gcc", "-std=c99", "-ffp-contract=off", str(source), *objects, "-o", program]
        subprocess.run([*command, "-lm"], check=True)
        if subprocess.run([program], capture_output=True, check=False).returncode == 0:
            alive.append(number)
    assert len(alive) <= 0.05 * count, alive


def mutants(source: str, count: int) -> list[str]:
    """Return copies of a source with one operator or number of its laws changed in each.

    Ones become zeros and all other numbers grow by one: flags are 0 or 1, and others than these
    would count alike. For the same reason halves between flags and modes are not tried as limits.
    """
    bodies = source.index("\nstatic ", source.rindex("typedef"))
    changes = {
        " + ": " - ",
        " - ": " + ",
        " * ": " / ",
        " / ": " * ",
        " < ": " <= ",
        " > ": " >= ",
        " <= ": " < ",
        " >= ": " > ",
    }
    text = re.sub(r"/\*.*?\*/", lambda m: " " * len(m.group()), source, flags=re.DOTALL)
    sign = "|".join(map(re.escape, changes))
    places = [m for m in re.finditer(rf"{sign}|\b\d+\.\d+", text) if m.start() > bodies]
    places = [m for m in places if not re.match(r" [<>] \d\.5", text[m.start() :])]
    made = []
    for place in random.Random(1).sample(places, min(count, len(places))):
        token = place.group()
        other = changes.get(token) or repr(0.0 if float(token) == 1.0 else float(token) + 1.0)
        made.append(source[: place.start()] + other + source[place.end() :])
    assert len(made) >= 0.9 * count
    return made


def test_text_is_the_same_in_every_process(tmp_path: Path) -> None:
    code = (
        "import sys, bywire; bywire.export_controller("
        "'straight-stop', sys.argv[1], vectors=20, precision='single')"
    )
    folders = [tmp_path / process for process in ("another", "this")]
    seed = "2" if os.environ.get("PYTHONHASHSEED") == "1" else "1"
    environment = {**os.environ, "PYTHONHASHSEED": seed}
    subprocess.run([sys.executable, "-c", code, str(folders[0])], env=environment, check=True)
    export_controller("straight-stop", folders[1], vectors=20, precision="single")
    first, second = ({p.name: p.read_bytes() for p in f.iterdir()} for f in folders)
    assert first == second
    assert len(first) == 13


@pytest.mark.skipif(
    shutil.which("arm-none-eabi-gcc") is None, reason="arm-none-eabi-gcc is not installed"
)
def test_single_fits_a_small_target(tmp_path: Path) -> None:
    made = export_controller(
        bench_of("pressure, sine dither"), tmp_path, precision="single", vectors=1
    )
    name = made.program.name
    target = ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")
    read_only = 0
    for part in ("ecu", "io", "parameters"):
        compiled = str(tmp_path / f"{part}.o")
        subprocess.run(
            [
                "arm-none-eabi-gcc",
                *SMALL_FLAGS,
                *target,
                "-c",
                str(tmp_path / f"{name}_{part}.c"),
                "-o",
                compiled,
            ],
            check=True,
        )
        said = subprocess.run(
            ["arm-none-eabi-size", compiled], capture_output=True, text=True, check=True
        ).stdout
        text, data, bss, *_ = map(int, said.splitlines()[1].split()[:3])
        read_only += text
        assert data == bss == 0
    assert read_only <= 2048
    assert made.program.memory_size <= 128


ADDON = next(Path("/usr/lib").glob("*/cppcheck/addons/misra.py"), Path("misra.py"))
ADVISORY = {"12.1"}
"""rules whose findings are known: 12.1 wants parentheses where the order is clear to readers"""


@pytest.mark.skipif(
    shutil.which("cppcheck") is None or not ADDON.exists(),
    reason="cppcheck and its addon misra.py are not installed",
)
@pytest.mark.parametrize(
    ("structure", "precision"),
    [(BRAKES[0], "single"), (BRAKES[1], "double"), (BRAKES[2], "double")],
)
def test_misra_finds_nothing_that_is_required(
    structure: str, precision: str, tmp_path: Path
) -> None:
    made = export_controller(
        bench_of(structure), tmp_path, precision=precision, vectors=1, dbc=True
    )
    found: dict[str, list[str]] = {}
    for part in ("ecu", "io", "parameters", "instance", "can"):
        source = tmp_path / f"{made.program.name}_{part}.c"
        subprocess.run(["cppcheck", "--dump", "--std=c99", "-q", str(source)], check=True)
        said = subprocess.run(
            [sys.executable, str(ADDON), "--no-summary", f"{source}.dump"],
            capture_output=True,
            text=True,
            check=False,
        )
        for line in (said.stdout + said.stderr).splitlines():
            rule = re.search(r"misra-c2012-([0-9.]+)", line)
            if rule is not None:
                found.setdefault(rule[1], []).append(line)
    assert set(found) <= ADVISORY, {r: lines for r, lines in found.items() if r not in ADVISORY}
