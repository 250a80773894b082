"""Benches whose pages are tested in Node and in a browser."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

import bywire
from bywire.report import live_page

NODE = shutil.which("node")
DRIVER = Path(__file__).with_name("drive_page.mjs")
SCRIPTS = Path(live_page.__file__).parent
needs_node = pytest.mark.skipif(NODE is None, reason="no node runs the scripts of pages")
SHORT = {"t_hold": "60 ms", "pulses": 1, "t_low": "20 ms", "t_high": "20 ms", "settle": "20 ms"}
BENCHES = {
    "motorcycle": bywire.Bench(
        "hard-braking",
        "dardanelli2010",
        overrides={"adc.noise": 0.0},
        options={"settle": 0.1, "duration": 0.3},
        requirements={"overshoot": "<= 15 %"},
    ),
    "wedge": bywire.Bench("moment-pulses", "roberts2003", options=SHORT),
}
VARIED = {
    "motorcycle": ("motor.R_m", "seal.T_pr", "caliper.K_pd", "fluid.beta"),
    "wedge": ("wedge.mu_B", "motor_1.R_ref", "heart.K_W", "caliper.K_cal"),
}


def tried(page: bywire.BenchPage, folder: Path, *tasks: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the output of the page's scripts."""
    task = folder / "task.json"
    task.write_text(json.dumps(tasks))
    call = [str(NODE), str(DRIVER), str(page.file), str(SCRIPTS), str(task)]
    subprocess.run(call, check=True, timeout=120)
    answers: list[dict[str, Any]] = json.loads(Path(f"{task}.out").read_text())
    return answers
