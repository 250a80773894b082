"""Valid calls of NVIDIA's bindings, with an emulated driver library."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bywire.bench.bench_file import read
from bywire.bench.ensemble import KeyFigures, changed, key_figures_of
from bywire.core.errors import DeviceError
from bywire.simulation import cuda
from bywire.simulation.compiler import SINGLE, compile_library, find_compiler
from bywire.simulation.cuda_device import find_device
from bywire.simulation.ensemble import Ensemble, simulate_ensemble
from bywire.simulation.run import simulate
from emulated_driver import EmulatedDriver, emulated
from systems.two_mass import rig

LIBRARY = Path(__file__).with_name("emulated_libcuda.c")


MASSES = np.linspace(0.8, 1.6, 70)


def ensemble() -> Ensemble:
    cuda.MOST = 64  # two batches, whose rows are lines of one array
    return simulate_ensemble(rig(0.024), {"m_1": MASSES}, ["x_1"], engine="cuda")


def figures(engine: str = "cuda") -> KeyFigures:
    """Return key figures of which the rows stay on a graphics processor."""
    bench = read("hard-braking", {"options.duration": "30 ms", "options.settle": "10 ms"})
    benches = [changed(bench, {"seal.T_pr": T}) for T in (0.0019, 0.002, 0.0021)]
    return key_figures_of([replace(each, engine=engine) for each in benches])


COMPUTED = {"ensemble": ensemble, "figures": figures}


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
@pytest.mark.parametrize("computed", COMPUTED)
def test_what_comes_through_the_bindings_is_what_runs_give(computed, tmp_path):
    require_bindings()
    compiler = find_compiler()
    if compiler is None:
        pytest.skip("no C compiler")
    with emulated(EmulatedDriver()) as driver, pytest.MonkeyPatch.context() as patch:
        patch.setattr(cuda, "MOST", 64)
        COMPUTED[computed]()
    for name, kernel in driver.libraries.items():
        (tmp_path / name).symlink_to(kernel)
    (tmp_path / "libcuda.so.1").symlink_to(
        compile_library(LIBRARY.read_text(encoding="utf-8"), SINGLE, compiler)
    )
    tests, saved = Path(__file__).parents[1], tmp_path / "there.npy"
    script = (
        f"import sys; sys.path[:0] = [{str(tests)!r}, {str(Path(__file__).parent)!r}]\n"
        "import numpy as np, test_cuda_bindings as test\n"
        f"there = test.{computed}()\n"
        "is_ensemble = isinstance(there, test.Ensemble)\n"
        "values = there.values if is_ensemble else [each.values for each in there.figures]\n"
        f"np.save({str(saved)!r}, values); print(test.find_device().label)\n"
    )
    libraries = os.pathsep.join((str(tmp_path), os.environ.get("LD_LIBRARY_PATH", "")))
    environment = {"LD_LIBRARY_PATH": libraries, "EMULATED_KERNELS": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, **environment},
        text=True,
        capture_output=True,
        check=False,
    )
    assert done.stdout == "emulated below the bindings\n", done.stderr
    there = np.load(saved)
    if computed == "figures":
        assert "bw_step_response" in driver.libraries
        ours = figures("auto")
        np.testing.assert_array_equal(there, [each.values for each in ours.figures])
        return
    for k in (0, 69):
        alone = simulate(rig(0.024, m_1=MASSES[k]), ["x_1"], "compiled")
        np.testing.assert_array_equal(there[k], alone.values)
