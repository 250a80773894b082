"""Selection of a graphics processor, and errors if one is missing."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from typing import Any, NoReturn

import numpy as np
import pytest

from bywire.core.errors import DeviceError, ParameterError
from bywire.simulation import cuda_device
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


def failing(status: Status) -> Callable[..., Any]:
    return lambda *_: (status, None)


@pytest.mark.parametrize(
    ("function", "status", "said"),
    [
        (
            "cuDevicePrimaryCtxRetain",
            Status.CUDA_ERROR_DEVICE_UNAVAILABLE,
            "emulated 0 is in use by another process.*nvidia-smi lists.*BYWIRE_GPU.*-c DEFAULT",
        ),
        (
            "cuDevicePrimaryCtxRetain",
            Status.CUDA_ERROR_ECC_UNCORRECTABLE,
            "emulated 0 has an uncorrectable memory error.*rerun the call.*--gpu-reset",
        ),
        (
            "cuDevicePrimaryCtxSetFlags",
            Status.CUDA_ERROR_UNKNOWN,
            "emulated 0 failed: the driver states",
        ),
        (
            "cuDeviceGet",
            Status.CUDA_ERROR_UNKNOWN,
            "graphics processor 0 failed: the driver states why",
        ),
        (
            "cuInit",
            Status.CUDA_ERROR_SYSTEM_DRIVER_MISMATCH,
            "does not match the driver.*Restart the machine",
        ),
    ],
)
def test_one_that_cannot_be_used_is_told(function, status, said, driver, monkeypatch):
    monkeypatch.setattr(driver, function, failing(status))
    with pytest.raises(DeviceError, match=rf"{said}.*or use engine = 'auto'"):
        find_device()


def test_a_driver_that_is_too_old_is_told(driver, monkeypatch):
    driver.version = 11080
    with raises(DeviceError, name="driver", value="11.8", valid="CUDA 12 or later"):
        find_device()
    driver.version = 12000
    monkeypatch.setattr(
        driver, "cuModuleLoadData", failing(Status.CUDA_ERROR_UNSUPPORTED_PTX_VERSION)
    )
    with pytest.raises(DeviceError, match=r"CUDA 12\.0, which is too old.*as new as.*NVRTC"):
        find_device().load("", "bw_run_cases")
    find_device.cache_clear()

    def missing(*_: Any) -> NoReturn:
        raise RuntimeError('Function "cuDriverGetVersion" not found')

    monkeypatch.setattr(driver, "cuDriverGetVersion", missing)
    with pytest.raises(DeviceError, match=r"too old for NVIDIA's bindings.*Install a driver"):
        find_device()


def test_a_context_that_another_library_has_begun_is_used(driver, monkeypatch):
    active = Status.CUDA_ERROR_PRIMARY_CONTEXT_ACTIVE
    monkeypatch.setattr(driver, "cuDevicePrimaryCtxSetFlags", failing(active))
    assert find_device().label == "emulated 0"


def test_memory_that_cannot_be_locked_is_ordinary_memory(driver, monkeypatch):
    monkeypatch.setattr(driver, "cuMemHostAlloc", failing(Status.CUDA_ERROR_NOT_PERMITTED))
    assert find_device().host_array((3, 2)).shape == (3, 2)
    monkeypatch.setattr(driver, "cuMemHostAlloc", failing(Status.CUDA_ERROR_LAUNCH_FAILED))
    with raises(DeviceError, name="emulated 0", value="CUDA_ERROR_LAUNCH_FAILED"):
        find_device().host_array((3, 2))


def test_memory_of_earlier_arrays_is_used_again(driver):
    device = find_device()
    first = [device.host_array((k, 1000)).ctypes.data for k in (1, 4, 16)]
    again = [device.host_array((k, 1000)).ctypes.data for k in (16, 4, 1)]
    assert again == first[::-1]
    for k in range(30):
        assert device.host_array((1, 10 * 3**k % 9973 + 1)).shape
    assert len(driver.locked) <= 9


def test_a_process_of_a_study_waits_for_memory_of_the_others(driver, monkeypatch):
    monkeypatch.setattr(cuda_device, "parent_process", lambda: "the study")
    monkeypatch.setattr(cuda_device, "_POLLED", 0.0)
    device, plain, answers = find_device(), driver.cuMemAlloc, [Status.CUDA_ERROR_OUT_OF_MEMORY] * 3
    monkeypatch.setattr(
        driver, "cuMemAlloc", lambda size: (answers.pop(), None) if answers else plain(size)
    )
    with device.working() as memory:
        assert memory.room(100)
    assert not answers
    monkeypatch.setattr(cuda_device, "_PATIENCE", 0.01)
    driver.capacity = 50
    with raises(DeviceError, name="emulated 0", value="MB"), device.working() as memory:
        memory.room(100)


def test_numbers_come_into_an_array_at_any_distances(driver):
    numbers = np.arange(24.0)
    for array in (
        np.empty((2, 3, 4)),
        np.empty((2, 3, 9))[:, :, 2:6],  # lines
        np.empty((2, 5, 4))[:, 1:4],  # one line for each of the first
        np.empty((4, 5, 6))[1:3, 1:4, 1:5],
        np.empty((3, 2, 8)).transpose(1, 0, 2)[:, :, ::2],
    ):
        with find_device().working() as memory:
            place = memory.room(numbers.nbytes)
            memory.put(place, numbers)
            memory.get(place, array)
        np.testing.assert_array_equal(array.ravel(), numbers)
    assert not driver.places


def test_what_is_not_installed_is_named_with_the_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "cuda.bindings.driver", None)
    find_device.cache_clear()
    with pytest.raises(DeviceError, match=r"in your clone: pip install -e .\.\[gpu"):
        find_device()
