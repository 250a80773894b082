"""Selection of a graphics processor, and errors if one is missing."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import pytest

from bywire.core.errors import DeviceError, ParameterError
from bywire.simulation.cuda_device import find_device
from emulated_driver import EmulatedDriver, Status, emulated
from raising import raises


@pytest.fixture
def driver() -> Iterator[EmulatedDriver]:
    with emulated(EmulatedDriver()) as driver:
        yield driver


def test_the_first_one_computes_or_the_one_that_is_named(driver, monkeypatch):
    driver.count = 2
    assert find_device().label == "emulated 0"
    find_device.cache_clear()
    monkeypatch.setenv("BYWIRE_GPU", "1")
    assert find_device().label == "emulated 1"


@pytest.mark.parametrize("wanted", ["2", "-1", "first"])
def test_one_that_is_not_there_is_refused(wanted, driver, monkeypatch):
    driver.count = 2
    monkeypatch.setenv("BYWIRE_GPU", wanted)
    with raises(ParameterError, name="BYWIRE_GPU", value=wanted, valid="0 to 1"):
        find_device()


@pytest.mark.parametrize(
    ("started", "count", "said"),
    [
        (RuntimeError("no library"), 1, "the driver's library is missing"),
        (Status.CUDA_ERROR_NO_DEVICE, 1, "CUDA_ERROR_NO_DEVICE"),
        (Status.CUDA_SUCCESS, 0, "no NVIDIA graphics processor. Check that nvidia-smi lists one"),
    ],
)
def test_a_machine_without_one_is_told(started, count, said, driver):
    driver.started, driver.count = started, count
    with pytest.raises(DeviceError, match=f"{said}.*or use engine = 'auto'"):
        find_device()


def test_one_that_is_full_before_it_begins_is_told(driver, monkeypatch):
    full, unknown = Status.CUDA_ERROR_OUT_OF_MEMORY, Status.CUDA_ERROR_INVALID_CONTEXT
    monkeypatch.setattr(driver, "cuDevicePrimaryCtxRetain", lambda _: (full, None))
    monkeypatch.setattr(driver, "cuMemGetInfo", lambda: (unknown, None, None))
    with raises(DeviceError, name="emulated 0", value="memory"):
        find_device()


def test_what_is_not_installed_is_named_with_the_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "cuda.bindings.driver", None)
    find_device.cache_clear()
    with pytest.raises(DeviceError, match=r"in your clone: pip install -e .\.\[gpu"):
        find_device()
