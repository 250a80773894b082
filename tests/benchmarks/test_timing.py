"""Processor time is what work took itself, and the least of it is compared."""

import time

from benchmarks.timing import interleaved, least_ratio, processor_timed


def test_waiting_takes_no_processor_time():
    begin = time.perf_counter()
    seconds = processor_timed(lambda: time.sleep(0.05))()
    assert seconds < 0.5 * (time.perf_counter() - begin)


def test_a_disturbed_round_does_not_count():
    long, short = iter([9.0, 6.0, 8.0, 6.0]), iter([1.0, 3.0, 2.0, 5.0])  # the first ones warm up
    seconds = interleaved({"long": lambda: next(long), "short": lambda: next(short)}, 3)
    assert least_ratio(seconds, "long", "short") == 3.0
