"""For all tests: collections of garbage are rare, and what a process prepares serves the others."""

import gc

import pytest

from shared_kernels import share_kernels


def pytest_configure(config: pytest.Config) -> None:
    """Share kernels between the processes of a run."""
    run = getattr(config, "workerinput", {}).get("testrunuid")
    if run:
        share_kernels(run)


def pytest_collection_finish() -> None:
    """Leave what is imported alone, and look at the rest every now and then: 3 % of the time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(1_000_000, 10, 10)
