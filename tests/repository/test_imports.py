"""Every module compiles and can be imported first, without a warning of its own."""

from __future__ import annotations

import subprocess
import sys
import warnings
from importlib.util import find_spec

from repository_sources import BENCHMARKS, MODULES, PACKAGE, ROOT

OPTIONAL = {"benchmarks.peers.traced": "jax"}
"""modules that import a library of an optional extra at once, and that library"""
LINES = """
import importlib, sys, warnings
warnings.filterwarnings("error", module=r"(bywire|benchmarks)\\b")
sys.path.append(sys.argv[1])  # of the benchmarks, which are not installed
for name in sys.argv[2:]:
    importlib.import_module(name)
"""


def test_every_module_compiles_and_is_imported_without_a_warning() -> None:
    names = []
    for path in [*MODULES, *BENCHMARKS]:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # of escapes, comparisons: newer Pythons warn of more
            compile(path.read_text(encoding="utf-8"), str(path), "exec")
        root = PACKAGE.parent if path in MODULES else ROOT
        parts = path.relative_to(root).with_suffix("").parts
        if not {"project", "__main__"} & set(parts):  # a template; what runs a command
            names.append(".".join(parts).removesuffix(".__init__"))
    assert len(names) > 500
    assert set(names) >= set(OPTIONAL)
    left_out = {name for name, library in OPTIONAL.items() if find_spec(library) is None}
    names = [name for name in names if name not in left_out]
    done = subprocess.run(
        [sys.executable, "-c", LINES, str(ROOT), *names],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
