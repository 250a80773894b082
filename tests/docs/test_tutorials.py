"""Tutorials do what they say: their commands, files and Python, in their order."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import bywire
from systems.loading import loaded

ROOT = Path(__file__).parents[2]
TUTORIALS = [p for p in sorted((ROOT / "docs/tutorials").glob("*.md")) if p.stem != "index"]
_BLOCK = re.compile(r"```(?:\{code-block\} )?(\w+)\n(?::caption: (\S+)\n)?(.*?)```", re.S)
_START = "from bywire.cli.main import process; process()"
HYDRAULIC = ROOT / "examples" / "hydraulic_brake.py"


def test_the_hydraulic_brake_holds_its_pressure_and_is_as_slow_as_is_said() -> None:
    with loaded(HYDRAULIC):
        _holds_its_pressure()


def _holds_its_pressure() -> None:
    options = {"options.input": "p_set", "options.output": "p_mc", "options.end": "30 bar"}
    result = bywire.run("step", {"parameters": "hydraulic-1", **options})
    kpis = {kpi.name: kpi.value for kpi in result.kpis}
    assert kpis["rise_time"] == pytest.approx(95.1e-3, abs=0.1e-3)
    from hydraulic_brake import HydraulicBrake, Stimulus, held

    # Without dry friction the closed form has to rest: pressure, travel and current at once.
    par = bywire.parameters("hydraulic-1").replace(
        {"seal.F_pr": 0.0, "seal.f_p": 0.0, "seal.f_n": 0.0, "gear.eta": 1.0, "rack.eta": 1.0}
    )
    run = bywire.Run(
        HydraulicBrake(),
        par,
        *held(par, 30e5),
        duration=0.1,
        stimulus=lambda t: np.full((t.size, len(Stimulus._fields)), 30e5),
    )
    assert np.ptp(bywire.simulate(run)["p_mc"]) < 1e-4  # Pa


@pytest.mark.trust
@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_a_tutorial_runs_from_top_to_bottom(page: Path, tmp_path: Path) -> None:
    shutil.copy(HYDRAULIC, tmp_path)
    for folder in ("studies", "benches"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    for language, file, text in _BLOCK.findall(page.read_text(encoding="utf-8")):
        if file:
            (tmp_path / file).write_text(text.lstrip(), encoding="utf-8")
        elif language == "python":
            subprocess.run([sys.executable, "-c", text], cwd=tmp_path, check=True)
        elif language == "sh":
            for line in text.splitlines():
                _run(line, tmp_path)


def _run(line: str, folder: Path) -> None:
    expected = 1 if "exit status 1" in line else 0
    words = line.replace("--show-plot", "")
    if line.startswith("bywire "):
        words = f"{sys.executable} -c '{_START}' {line.removeprefix('bywire ')}"
    done = subprocess.run(words, shell=True, cwd=folder, capture_output=True, text=True)
    assert done.returncode == expected, f"{line}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
