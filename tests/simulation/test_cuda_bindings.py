"""Valid calls of NVIDIA's bindings, with an emulated driver library."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bywire.core.errors import DeviceError
from bywire.simulation import cuda
from bywire.simulation.compiler import SINGLE, compile_library, find_compiler
from bywire.simulation.cuda import emit_cuda
from bywire.simulation.cuda_device import find_device
from bywire.simulation.engine import prepare
from bywire.simulation.ensemble import Ensemble, simulate_ensemble
from bywire.simulation.run import simulate
from bywire.simulation.stages import build_stages
from emulated_driver import compiled_here
from systems.two_mass import rig

LIBRARY = Path(__file__).with_name("emulated_libcuda.c")


MASSES = np.linspace(0.8, 1.6, 70)


def computed() -> Ensemble:
    cuda.MOST = 64  # two batches, whose rows are lines of one array
    return simulate_ensemble(rig(0.024), {"m_1": MASSES}, ["x_1"], engine="cuda")


def require_bindings() -> None:
    """Skip where they are not installed, and where a driver is there, which would be loaded."""
    pytest.importorskip("cuda.bindings.driver", reason="bywire[gpu] is not installed")
    nvrtc = pytest.importorskip("cuda.bindings.nvrtc")
    try:
        nvrtc.nvrtcVersion()
    except RuntimeError:
        pytest.skip("the library of NVRTC is not installed")
    try:
        find_device()
    except DeviceError as error:
        if "library is missing" in str(error):
            return
    pytest.skip("a driver is installed")


@pytest.mark.skipif(sys.platform != "linux", reason="the library is one of Linux")
def test_what_comes_through_the_bindings_is_what_runs_give(tmp_path):
    require_bindings()
    compiler, run = find_compiler(), rig(0.024)
    if compiler is None:
        pytest.skip("no C compiler")
    prepared = prepare(run.model, run.par)
    outputs = (tuple(prepared.outputs).index("x_1"),)
    kernel = compiled_here(emit_cuda(build_stages(prepared.program, outputs=outputs)))
    (tmp_path / "libcuda.so.1").symlink_to(
        compile_library(LIBRARY.read_text(encoding="utf-8"), SINGLE, compiler)
    )
    tests = Path(__file__).parents[1]
    script = (
        f"import sys; sys.path[:0] = [{str(tests)!r}, {str(Path(__file__).parent)!r}]\n"
        "import numpy as np, test_cuda_bindings\n"
        "there = test_cuda_bindings.computed()\n"
        f"np.save({str(tmp_path / 'there.npy')!r}, there.values); print(there.engine)\n"
    )
    libraries = os.pathsep.join((str(tmp_path), os.environ.get("LD_LIBRARY_PATH", "")))
    environment = {"LD_LIBRARY_PATH": libraries, "EMULATED_KERNEL": str(kernel)}
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, **environment},
        text=True,
        capture_output=True,
        check=False,
    )
    assert done.stdout == "CUDA C, emulated below the bindings\n", done.stderr
    there = np.load(tmp_path / "there.npy")
    for k in (0, 69):
        alone = simulate(rig(0.024, m_1=MASSES[k]), ["x_1"], "compiled")
        np.testing.assert_array_equal(there[k], alone.values)
