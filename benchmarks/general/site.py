"""Build time of the documentation site, from scratch and again without changes."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

from benchmarks.commands import environment
from benchmarks.result import Result, at_most, failed
from benchmarks.suite import Part
from bywire.core.child_process import python_command
from bywire.core.libraries import how_to_install

COLD, WARM = 180.0, 20.0
"""goals [s]"""
_GOALS = {"docs.build_s": COLD, "docs.rebuild_s": WARM}
_LEFT = (".*", "_build", "_generated", "__pycache__", "results", "*.egg-info")


def measured(root: Path = Path(__file__).parents[2]) -> list[Result]:
    """Measure the site in a copy of a clone, which leaves the clone's own site unchanged.

    ``root``: the clone; default: the clone that contains this file.
    """
    if importlib.util.find_spec("sphinx") is None:
        return _skipped(f"not installed: {how_to_install('docs')}")
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "clone"
        shutil.copytree(root, copy, ignore=shutil.ignore_patterns(*_LEFT))
        seconds = []
        for _ in range(2):
            begin = time.perf_counter()
            done = _made(copy)
            seconds.append(time.perf_counter() - begin)
            try:
                done.check_returncode()
            except subprocess.CalledProcessError as error:
                return [failed(name, error, "s", f"<= {goal:g}") for name, goal in _GOALS.items()]
    cold, warm = seconds
    return [
        at_most("docs.build_s", cold, COLD, "s", "full build: sources, gallery, live pages"),
        at_most("docs.rebuild_s", warm, WARM, "s", "rebuild without changes"),
    ]


def _made(root: Path) -> subprocess.CompletedProcess[str]:
    """Build the site as ``tasks.py docs`` does."""
    options = ("-q", "-W", "-n", "-b", "html", "docs", "docs/_build")
    return subprocess.run(
        python_command("-m", "sphinx", *options),
        cwd=root,
        check=False,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        errors="replace",
        env={"OMP_NUM_THREADS": "1", **environment()},
    )


def _skipped(why: str) -> list[Result]:
    return [Result(name, None, "s", f"<= {goal:g}", None, why) for name, goal in _GOALS.items()]


PART = Part("site", measured)
