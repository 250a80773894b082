"""For all tests: collections of garbage, which look at all that is imported, are rare."""

import gc


def pytest_collection_finish() -> None:
    """Leave what is imported alone, and look at the rest every now and then: 3 % of the time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(1_000_000, 10, 10)
