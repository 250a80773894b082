"""Sliders in a notebook, and tables that sort."""

from __future__ import annotations

import importlib
import math

import pytest

import bywire
from bywire.api.notebook import ends_of
from bywire.core.errors import FileError, ParameterError, UnknownNameError
from bywire.core.parameters import leaf_fields
from bywire.report.page import fragment_html

BENCH = bywire.Bench("hard-braking", "dardanelli2010", options={"settle": 0.05, "duration": 0.1})


@pytest.fixture(scope="module")
def result():
    return bywire.run(BENCH, estimate_error=False)


def test_a_slider_runs_the_bench_again(result):
    pytest.importorskip("ipywidgets")
    shown = result.interact("motor.R_m", "seal.T_pr")
    slider, other, message, image, table = shown.children
    assert slider.description == "motor.R_m [\u03a9]"
    assert slider.value == pytest.approx(0.35)
    assert 10.0**slider.min == pytest.approx(0.35 / 4)
    assert 10.0**other.max == pytest.approx(4 * result.bench.par.value("seal.T_pr"))
    before = (bytes(image.value), table.value)
    assert before[0].startswith(b"\x89PNG")
    slider.value = 0.7
    assert bytes(image.value) != before[0]
    assert table.value != before[1]
    slider.value = 0.35
    assert table.value == before[1]
    assert message.value == ""


def test_a_value_that_fails_leaves_the_sliders_usable(result, monkeypatch):
    pytest.importorskip("ipywidgets")
    from bywire.api import run as run_module

    shown = result.interact("motor.R_m")
    slider, message = shown.children[:2]

    def fails(*_, **__):
        raise ParameterError("no rest <here>")

    with monkeypatch.context() as patched:
        patched.setattr(run_module, "run_once", fails)
        failing = result.interact("motor.R_m")
        failing.children[0].value = 0.5
        assert failing.children[1].value == "<b>no rest &lt;here&gt;</b>"
    slider.value = 0.5
    assert message.value == ""


def test_names_that_do_not_exist_are_errors_with_the_nearest(result):
    pytest.importorskip("ipywidgets")
    with pytest.raises(UnknownNameError, match=r"motor\.R_m"):
        result.interact("motor.R_mm")
    with pytest.raises(UnknownNameError, match="time-traces"):
        result.interact("motor.R_m", figure="time-trace")
    with pytest.raises(ParameterError, match="at least one"):
        result.interact()


def test_without_ipywidgets_one_error_names_the_extra(result, monkeypatch):
    known = importlib.import_module

    def missing(name, *others):
        if name == "ipywidgets":
            raise ImportError(name)
        return known(name, *others)

    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(FileError, match=r"ipywidgets.*\.\[notebook\]"):
        result.interact("motor.R_m")


def test_ends_stay_in_the_declared_range():
    values = BENCH.par.leaves()
    known = {n: leaf for n, leaf in leaf_fields(type(BENCH.par)).items() if n in values}
    for name, leaf in known.items():
        value = values[name]
        if value == 0.0 and math.inf in (-leaf.low, leaf.high):
            with pytest.raises(ParameterError, match="Change it first"):
                ends_of(leaf, value)
            continue
        low, high = ends_of(leaf, value)
        assert leaf.admits(low), name
        assert leaf.admits(high), name
        assert low <= value <= high, name


def test_a_click_on_a_heading_sorts_the_rows(result, chromium):
    page = chromium.new_page()
    page.set_content(result._repr_html_())
    column = """(k) => [...document.querySelectorAll(".bywire table")].map((table) =>
      [...table.tBodies[0].rows].map((row) => row.cells[k].textContent))"""
    before = page.evaluate(column, 0)
    tables = page.locator(".bywire table")
    which = next(k for k in range(tables.count()) if len(before[k]) > 4)
    heading = tables.nth(which).locator("thead th").first
    heading.click()
    assert page.evaluate(column, 0)[which] == sorted(before[which], key=str.casefold)
    assert heading.get_attribute("aria-sort") == "ascending"
    heading.click()
    assert page.evaluate(column, 0)[which] == sorted(before[which], key=str.casefold)[::-1]
    page.close()


def test_pages_have_no_script_to_sort(result, tmp_path):
    assert "bywireSorts" in fragment_html(result.document())
    result.write(tmp_path / "out")
    assert "bywireSorts" not in (tmp_path / "out" / "report.html").read_text()
