"""Pieces computed side by side: each once, and kept by the asking thread when it is there."""

from __future__ import annotations

import threading

import pytest

from bywire.cases.runner import as_completed, complete
from bywire.core.interrupts import thread_pool


@pytest.mark.parametrize("workers", [1, 3])
def test_what_is_missing_is_computed_and_kept_by_who_asked(workers: int) -> None:
    computed, kept, shares = [], {}, []

    def square(k: int) -> int:
        computed.append(k)
        return k * k

    def keep(k: int, result: int) -> None:
        assert threading.current_thread() is threading.main_thread()
        kept[k] = result

    results = complete(
        range(6),
        {1: 1, 4: 16, 9: 81},  # what is kept of others is not asked for
        square,
        keep=keep,
        progress=lambda k, share: shares.append((k in kept, share)),
        workers=workers,
    )
    assert results == {k: k * k for k in range(6)}
    assert sorted(computed) == sorted(kept) == [0, 2, 3, 5]
    assert shares == [(True, pytest.approx(n / 6)) for n in (3, 4, 5, 6)]


@pytest.mark.parametrize("workers", [1, 2])
def test_an_interrupt_leaves_what_is_finished(workers: int) -> None:
    kept = {}

    def interrupt(k: int, share: float) -> None:
        if share > 0.4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        complete(range(5), {}, float, keep=kept.__setitem__, progress=interrupt, workers=workers)
    assert len(kept) == 3


def test_pieces_that_are_finished_come_before_one_that_failed() -> None:
    with thread_pool(1) as pool:
        computed = as_completed(pool, lambda k: 1 // k, [0, 1, 2])
        pool.submit(int).result()  # after all of them
        assert {next(computed), next(computed)} == {(1, 1), (2, 0)}
        with pytest.raises(ZeroDivisionError):
            next(computed)


def test_nothing_is_started_where_nothing_is_missing() -> None:
    done = complete([1], {1: 2}, float, keep=pytest.fail, progress=pytest.fail, pool=pytest.fail)
    assert done == {1: 2}


def test_few_pieces_are_begun_ahead() -> None:
    begun = []

    def pieces():
        for k in range(20):
            begun.append(k)
            yield k

    with thread_pool(2) as pool:
        results = as_completed(pool, str, pieces(), ahead=3)
        assert begun == [0, 1, 2]  # at once
        assert dict(results) == {k: str(k) for k in range(20)}
