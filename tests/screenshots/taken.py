"""Screenshots that look the same on every machine: one font, no motion, few and large pixels."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.image import imread, imsave

from screenshots.compared import difference

STORED = Path(__file__).with_name("stored")
THEMES = ("light", "dark")
WIDTH, HEIGHT = 1000, 1800  # px of a window, and the most that is looked at of a page
PHONE = 390
COARSE = 4  # px of a page in one that is stored, either way
_LEVELS = 16  # brightness is stored in steps of so many, which a PNG takes less room for
_SETTLED = 400  # ms after which a page that has computed draws no more
_FONTS = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
_FONT = """(() => {
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  for (const [weight, text] of %s)
    document.fonts.add(new FontFace("Shot", bytes(text), { weight }));
  const sheet = new CSSStyleSheet();
  sheet.replaceSync("* { font-family: Shot !important }");
  document.adoptedStyleSheets = [sheet];
  const { get, set } = Object.getOwnPropertyDescriptor(CanvasRenderingContext2D.prototype, "font");
  Object.defineProperty(CanvasRenderingContext2D.prototype, "font", {
    get, set(font) { set.call(this, font.replace(/px .*/, "px Shot")); } });
})()"""


def _font() -> str:
    """Return a script that gives a page matplotlib's own font, whichever the machine has."""
    faces = [
        [weight, base64.b64encode((_FONTS / f"{name}.ttf").read_bytes()).decode()]
        for weight, name in (("400", "DejaVuSans"), ("600 900", "DejaVuSans-Bold"))
    ]
    return _FONT % faces


def taken(
    browser: Any,
    address: str,
    width: int = WIDTH,
    ready: str = "() => true",
    *,
    change: str = "",
    themes: Sequence[str] = THEMES,
) -> dict[str, np.ndarray]:
    """Return a screenshot of a page in each theme, reduced.

    Parameters
    ----------
    browser
        Opened by Playwright.
    address, width
        Of the page, and of the window [px].
    ready
        Script that tells whether the page is whole.
    change
        Script that spoils it first, for those who try whether that is seen.
    themes
        ``"light"``, ``"dark"``: the page opens in the first and changes to the next.

    Returns
    -------
    dict of numpy.ndarray
        Brightness of red, green and blue by theme, shape (rows, columns, 3).
    """
    context = browser.new_context(
        viewport={"width": width, "height": HEIGHT},
        color_scheme=themes[0],
        device_scale_factor=1,
        reduced_motion="reduce",
    )
    shots = {}
    try:
        context.add_init_script(_font())
        page = context.new_page()
        page.goto(address)
        page.wait_for_function(ready)
        page.wait_for_function("() => document.fonts.status === 'loaded'")
        if change:
            page.evaluate(change)
        for theme in themes:
            page.emulate_media(color_scheme=theme)
            page.wait_for_timeout(_SETTLED)
            png = page.screenshot(animations="disabled", caret="hide")
            shots[theme] = reduced(imread(io.BytesIO(png)))
    finally:
        context.close()
    return shots


def reduced(image: np.ndarray) -> np.ndarray:
    """Return the means of an image's squares; ``image``: 0 to 1, shape (rows, columns, 3 or 4)."""
    rows, columns = (size // COARSE for size in image.shape[:2])
    squares = image[: rows * COARSE, : columns * COARSE, :3]
    means = squares.reshape(rows, COARSE, columns, COARSE, 3).mean(axis=(1, 3))
    steps = np.round(255.0 * means / _LEVELS)
    return np.minimum(steps * _LEVELS, 255.0).astype(np.uint8)


def path_of(name: str) -> Path:
    """Return where the screenshot of a name is stored."""
    return STORED / f"{name}.png"


def stored(name: str) -> np.ndarray:
    """Return a stored screenshot."""
    return np.round(255.0 * imread(path_of(name))[..., :3]).astype(np.uint8)


def store(name: str, shot: np.ndarray) -> Path:
    """Store a screenshot, in place of one that is there."""
    kept = {"optimize": True, "compress_level": 9}
    imsave(path_of(name), shot, metadata={"Software": None}, pil_kwargs=kept)
    return path_of(name)


def differing(name: str, shots: Mapping[str, np.ndarray]) -> str:
    """Return in words where screenshots differ from the stored ones; empty where they do not.

    ``name``: of the subject; ``shots``: by theme.
    """
    said = []
    for theme, shot in shots.items():
        worst = difference(stored(f"{name}-{theme}"), shot)
        if worst.is_seen:
            x, y = (COARSE * place for place in (worst.column, worst.row))
            said.append(
                f"{name}, {theme}: differs from what is stored, most at {x} px from the left and "
                f"{y} px from the top ({100 * worst.share:.0f} % there); look at it, and if it is "
                f"meant: python tests/screenshots {name}"
            )
    return "; ".join(said)
