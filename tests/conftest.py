"""For all tests: rare collections of garbage, which look at all that is imported; a browser."""

import gc
from collections.abc import Iterator
from typing import Any

import pytest


def pytest_collection_finish() -> None:
    """Leave what is imported alone, and look at the rest every now and then: 3 % of the time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(1_000_000, 10, 10)


@pytest.fixture(scope="module", autouse=True)
def forgotten_brakes() -> Iterator[None]:
    """Forget the brakes that a file's tests load, because other files' tests share the process."""
    from systems.loading import forgotten

    with forgotten():
        yield


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """Yield a browser; without one, tests that ask for it say that they are skipped, and why."""
    from benchmarks.browser import browser
    from bywire.core.errors import RunError

    try:
        opening = browser()
        opened = opening.__enter__()
    except RunError as error:
        pytest.skip(str(error))
    yield opened
    opening.__exit__(None, None, None)
