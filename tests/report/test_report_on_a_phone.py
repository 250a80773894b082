"""Reports on a phone: value, limit and verdict are visible without scrolling sideways."""

from __future__ import annotations

from typing import Any

import pytest

import bywire

EDGES = """() => [...document.querySelectorAll('.scroll th')]
  .filter((each) => ['value', 'limit', 'verdict'].includes(each.textContent))
  .map((each) => each.getBoundingClientRect().right)"""
LIMITS = {"overshoot": "<= 3 %", "steady_state_error": "<= 0.01 bar"}


@pytest.mark.parametrize("width", [360, 390])
def test_limit_and_verdict_are_visible(chromium: Any, tmp_path: Any, width: int) -> None:
    bench = bywire.Bench("hard-braking", requirements=LIMITS)
    bywire.run(bench).write(tmp_path)
    page = chromium.new_page(viewport={"width": width, "height": 740})
    page.goto((tmp_path / "report.html").as_uri())
    edges = page.evaluate(EDGES)
    page.close()
    assert len(edges) == 8  # a heading for value of the energy balance too
    assert max(edges) <= width
