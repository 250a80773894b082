"""Linear algebra uses one thread unless the user sets a number; a recording needs no dask."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from bywire.core.libraries import VARIABLES

THREADS = """
from threadpoolctl import threadpool_info
def threads():
    return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}
"""
OVERLAPPING = """
import scipy.linalg
from threadpoolctl import threadpool_limits
from bywire.core.libraries import on_one_thread
threadpool_limits(3, "blas")
with on_one_thread():
    assert threads() == {1}
assert threads() == {3}
first, second = on_one_thread(), on_one_thread()  # in threads, the first to begin may end first
first.__enter__()
second.__enter__()
first.__exit__(None, None, None)
assert threads() == {1}
second.__exit__(None, None, None)
assert threads() == {3}
"""
PUBLIC = """
import bywire, scipy.linalg
from threadpoolctl import threadpool_limits
seen = []
threadpool_limits(3, "blas")
bywire.identify("seal-friction", synthetic=1, progress=lambda label, share: seen.append(threads()))
assert seen and all(each == {1} for each in seen), seen
assert threads() == {3}
"""
PROCESS = """
import sys
from bywire.cli import main
def told():
    import numpy, scipy.linalg
    print(threads())
main.main = told
main.process()
"""


def said_by(lines: str, **chosen: str) -> str:
    """Return a program's output for a number of threads that the user sets."""
    kept = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    done = subprocess.run(
        [sys.executable, "-c", THREADS + lines],
        env=kept | chosen,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize("lines", [OVERLAPPING, PUBLIC])
def test_programs_get_back_what_they_had(lines):
    said_by(lines)


def test_commands_have_one_thread():
    assert said_by(PROCESS) == "{1}"


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="a BLAS has no more threads than cores")
@pytest.mark.parametrize("name", ["OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"])
def test_who_chooses_has_what_was_chosen(name):
    assert said_by(PROCESS, **{name: "2"}) == "{2}"


_RECORDING = "import sys, xarray; xarray.DataArray([1.0]); "
_LEFT_OUT = "from bywire.core.libraries import *; leave_out_dask(); "
_AGAIN = "allow_dask(); import dask; print('again')"


@pytest.mark.parametrize(
    ("code", "said"),
    [
        (_LEFT_OUT + _RECORDING + "print('dask.array' in sys.modules); " + _AGAIN, "False\nagain"),
        (_RECORDING + "print('dask.array' in sys.modules)", "True"),  # else it may go
    ],
)
def test_a_recording_needs_no_dask(code, said):
    pytest.importorskip("dask")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == said
