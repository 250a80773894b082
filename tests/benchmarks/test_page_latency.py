"""A page's latency is not measured where no browser is, and says why."""

from __future__ import annotations

import shutil
import sys

import pytest

from benchmarks.page_latency import page_latency


@pytest.mark.parametrize(
    ("hide", "reason"), [("playwright.sync_api", "playwright"), ("", "Chromium")]
)
def test_without_a_browser_there_is_a_reason_and_no_page(monkeypatch, tmp_path, hide, reason):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    if hide:
        monkeypatch.setitem(sys.modules, hide, None)
    else:
        pytest.importorskip("playwright")
    results = page_latency("page.latency_ms", lambda path: pytest.fail("written for nothing"))
    assert [each.id for each in results] == ["page.latency_ms", "page.latency_95_ms"]
    assert all(each.value is None and reason in each.note for each in results)
