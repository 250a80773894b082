"""Time from a slider's move on a page to the painted curve, in a real browser."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.browser import browser
from benchmarks.result import Result, at_most
from bywire.core.errors import RunError

_MOVES, _FIRST = 60, 10  # the first moves do not count, because they compile
_MEDIAN, _MOST = 50.0, 100.0  # ms
_MOVE = """async (moves) => {
  const slider = document.querySelector(".chosen input[type=range]"), taken = [];
  for (let k = 0; k < moves; ++k) {
    const begun = performance.now();
    const drawn = new Promise((done) => {
      const told = ({ data }) => {
        if (!data.time) return; // of loops
        worker.removeEventListener("message", told);
        done();
      };
      worker.addEventListener("message", told);
    });
    slider.value = 480 + (k % 40);
    slider.dispatchEvent(new Event("input"));
    await drawn;
    await new Promise((painted) => requestAnimationFrame(() => setTimeout(painted)));
    taken.push(performance.now() - begun);
  }
  return taken;
}"""


def page_latency(name: str, write: Callable[[Path], object]) -> list[Result]:
    """Measure a page in the system's browser, without a window or a graphics processor.

    Parameters
    ----------
    name
        Name of the median's figure. The other figure has ``_95`` before its unit.
    write
        ``write(path)``: writes the page. The benchmark moves its first slider.
    """
    slow = name.replace("_ms", "_95_ms")
    try:
        with tempfile.TemporaryDirectory() as folder, browser() as opened:
            file = Path(folder) / "page.html"
            write(file)
            page = opened.new_page(viewport={"width": 1280, "height": 900})
            page.goto(file.as_uri())
            page.wait_for_function("() => run !== null && !busy")
            times = np.array(page.evaluate(_MOVE, _FIRST + _MOVES)[_FIRST:])
    except RunError as error:
        return [Result(each, None, "ms", note=str(error)) for each in (name, slow)]
    note = f"slider to painted curve, headless, software rendering, {_MOVES} moves"
    return [
        at_most(name, float(np.median(times)), _MEDIAN, "ms", f"{note}: median"),
        at_most(slow, float(np.percentile(times, 95.0)), _MOST, "ms", f"{note}: 95 %"),
    ]
