"""The row of a graphics processor is measured, or says why it is not."""

from __future__ import annotations

from benchmarks.declared import declared
from benchmarks.motorcycle import graphics_processor
from benchmarks.suite import Part
from emulated_driver import EmulatedDriver, emulated


def test_it_is_measured_where_there_is_one(monkeypatch):
    assert "graphics processor" in declared(Part)
    monkeypatch.setattr(graphics_processor, "LANES", 2)
    monkeypatch.setattr(graphics_processor, "THREADS", 3)
    monkeypatch.setattr(graphics_processor, "_ROUNDS", 1)
    with emulated(EmulatedDriver()):
        ratio, difference = graphics_processor.measured()
    assert (ratio.id, ratio.goal) == ("study.gpu_ratio", ">= 50")
    assert 0.0 < ratio.value < 50.0
    assert ratio.holds is False
    assert (difference.value, difference.holds) == (0.0, True)


def test_without_one_it_says_why():
    driver = EmulatedDriver()
    driver.count = 0
    with emulated(driver):
        for each in graphics_processor.measured():
            assert (each.value, each.holds) == (None, None)
            assert "no NVIDIA graphics processor" in each.note
