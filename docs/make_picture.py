"""Record the animated picture in the README: ``python docs/make_picture.py``.

A browser opens the page of hard braking, and its slider changes the proportional gain of the
pressure controller. The curves and key figures follow. The script needs Chromium
(``BROWSER``, or on the path).
"""

from __future__ import annotations

import io
import math
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

ROOT = Path(__file__).resolve().parents[1]
TARGET = ROOT / "docs" / "images" / "live_page.webp"
VARIED = ("ecu.pressure.k_p", "motor.R_m", "caliper.K_pd")
SIZE = (1400, 800)  # px of the window
SHOWN = (980, 560)  # px of the picture
FRAMES = 28
PERIOD = 130  # ms between frames
READY = "() => run !== null && !busy"
MOVE = """(share) => {
  run = null;
  const slider = document.querySelector("input[type=range]");
  slider.value = share;
  slider.dispatchEvent(new Event("input"));
}"""


def frame(page: Page, share: float) -> Image.Image:
    """Return the page with its first slider at a position, in thousandths of its range."""
    page.evaluate(MOVE, round(share))
    page.wait_for_function(READY)
    page.wait_for_timeout(350)  # the page draws hidden curves later
    shot = Image.open(io.BytesIO(page.screenshot()))
    return shot.convert("RGB").resize(SHOWN, Image.Resampling.LANCZOS)


def main() -> int:
    """Write the picture."""
    browser = os.environ.get("BROWSER") or shutil.which("chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        file = Path(folder) / "bench.html"
        varied = [word for name in VARIED for word in ("--vary", name)]
        bench = ROOT / "benches" / "hard_braking.toml"
        command = [sys.executable, "-m", "bywire", "page", bench, *varied, "--out", file]
        subprocess.run(list(map(str, command)), check=True, cwd=ROOT)
        opened = playwright.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        page = opened.new_page(viewport={"width": SIZE[0], "height": SIZE[1]}, color_scheme="light")
        page.goto(file.as_uri())
        page.wait_for_function(READY)
        turns = (math.sin(2.0 * math.pi * k / FRAMES) for k in range(FRAMES))
        frames = [frame(page, 500.0 + 300.0 * turn) for turn in turns]
        opened.close()
    frames[0].save(
        TARGET, save_all=True, append_images=frames[1:], duration=PERIOD, loop=0, quality=60
    )
    print(f"{TARGET.relative_to(ROOT)}: {TARGET.stat().st_size / 1e3:.0f} kB")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
