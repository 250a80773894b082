"""NVIDIA's compiler accepts the generated kernels; it needs no graphics processor."""

from __future__ import annotations

import re

import pytest

from bywire.bench.bench_file import read
from bywire.bench.kpis.families import FAMILIES
from bywire.core.errors import CompilerError, DeviceError
from bywire.simulation.cuda import ENTRY, EXTREMES, EXTREMES_ENTRY, emit_cuda
from bywire.simulation.cuda_device import cuda_binary
from bywire.simulation.engine import prepare
from bywire.simulation.stages import build_stages
from raising import raises


@pytest.fixture(scope="module", autouse=True)
def nvrtc():
    """Return NVIDIA's compiler; skip where it is not installed."""
    nvrtc = pytest.importorskip("cuda.bindings.nvrtc", reason="bywire[gpu] is not installed")
    try:
        nvrtc.nvrtcVersion()
    except RuntimeError:
        pytest.skip("the library of NVRTC is not installed")
    return nvrtc


@pytest.fixture(scope="module")
def kernel() -> str:
    (run,) = read("hard-braking", {}).runs().values()
    program = prepare(run.model, run.par).program
    return emit_cuda(build_stages(program, outputs=(0, 10)))


@pytest.fixture(autouse=True)
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("BYWIRE_CACHE", str(tmp_path))
    return tmp_path


@pytest.mark.parametrize("capability", [80, 90])
def test_a_kernel_is_compiled_for_a_processor_and_kept(capability, kernel, empty_cache):
    binary = cuda_binary(kernel, capability, ENTRY)
    assert binary.startswith(b"\x7fELF")
    assert f"{ENTRY}\0".encode() in binary
    (kept,) = empty_cache.glob("*.cubin")
    assert kept.read_bytes() == binary
    kept.write_bytes(binary[:-1])  # damaged: compiled anew
    assert cuda_binary(kernel, capability, ENTRY) == binary == kept.read_bytes()


def test_a_processor_that_is_too_new_gets_what_its_driver_compiles(kernel):
    text = cuda_binary(kernel, 999, ENTRY).decode()
    assert f".visible .entry {ENTRY}(" in text
    # Every operation says how it is rounded: the driver may fuse those alone that do not.
    assert len(re.findall(r"\bmul\.rn\.f64", text)) > 100
    assert not re.findall(r"\b(?:add|sub|mul)\.f64", text)


@pytest.mark.parametrize("family", ["step_response", "vehicle_stop"])
def test_key_figures_are_compiled_with_the_same_rounding(family):
    loops = FAMILIES.find(family).loops
    assert loops is not None
    text = cuda_binary(loops.cuda_text, 999, loops.entry).decode()
    assert f".visible .entry {loops.entry}(" in text
    assert len(re.findall(r"\bmul\.rn\.f64", text)) > 10
    assert not re.findall(r"\b(?:add|sub|mul)\.f64|\bfma\.", text)
    assert cuda_binary(EXTREMES, 80, EXTREMES_ENTRY).startswith(b"\x7fELF")


def test_a_processor_that_is_too_old_is_refused(kernel):
    with raises(DeviceError, name="NVRTC", value="1.0", valid="and later"):
        cuda_binary(kernel, 10, ENTRY)


def test_what_the_compiler_refuses_is_said():
    with pytest.raises(CompilerError, match=r"(?s)NVRTC rejected a generated kernel:.*expected"):
        cuda_binary("KERNEL void bw_run_cases(double) { 1 +; }", 90, ENTRY)
