"""What a library imports although nobody here uses it."""

import subprocess
import sys

import pytest

pytest.importorskip("dask")
_RECORDING = "import sys, xarray; xarray.DataArray([1.0]); "
_LEFT_OUT = "from bywire.core.unneeded import *; leave_out_dask(); "
_AGAIN = "allow_dask(); import dask; print('again')"


@pytest.mark.parametrize(
    ("code", "said"),
    [
        (_LEFT_OUT + _RECORDING + "print('dask.array' in sys.modules); " + _AGAIN, "False\nagain"),
        (_RECORDING + "print('dask.array' in sys.modules)", "True"),  # else it may go
    ],
)
def test_a_recording_needs_no_dask(code, said):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == said
