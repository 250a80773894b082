"""A headless browser for bench pages: the system's Chromium."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from bywire.core.child_process import find_program
from bywire.core.errors import RunError

_NAMES = ("chromium", "chromium-browser", "google-chrome")


@contextmanager
def browser() -> Iterator[Any]:
    """Open a browser, and close it at the end.

    Yields
    ------
    playwright.sync_api.Browser
        The system's Chromium. The benchmark never downloads one.

    Raises
    ------
    RunError
        If Chromium or Playwright is missing, or if Chromium does not start.
    """
    try:
        from playwright.sync_api import Error, sync_playwright
    except ImportError:
        raise RunError("playwright is missing. Run: pip install playwright") from None
    path = next(filter(None, map(find_program, _NAMES)), None)
    if path is None:
        raise RunError("Chromium is missing. Install the package chromium")
    with sync_playwright() as driver:
        try:
            opened = driver.chromium.launch(executable_path=path)
        except Error as error:
            raise RunError(f"{path} does not start: {str(error).splitlines()[0]}") from None
        try:
            yield opened
        finally:
            opened.close()
