"""Ctrl-C is deferred until the end of a block, and never lost."""

from __future__ import annotations

import signal
import threading
import time
import weakref

import pytest

from bywire.core.interrupts import interrupt_handled, interrupts_deferred, interrupts_noted


@pytest.fixture(autouse=True)
def handler():
    """Restore the handler of the process."""
    before = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_nothing_happens_without_an_interrupt():
    with interrupts_deferred():
        pass
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_interrupt_comes_when_the_block_has_ended():
    steps = []

    def work() -> None:
        signal.raise_signal(signal.SIGINT)
        steps.append("after the signal")
        signal.raise_signal(signal.SIGINT)
        steps.append("at the end")

    with pytest.raises(KeyboardInterrupt), interrupts_deferred():
        work()
    assert steps == ["after the signal", "at the end"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_error_of_the_block_passes():
    with pytest.raises(ValueError, match="own"), interrupts_deferred():
        raise ValueError("own")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_interrupt_comes_before_the_error_that_it_may_have_caused():
    """A compiler in the same terminal gets the Ctrl-C as well, and fails."""

    def work() -> None:
        signal.raise_signal(signal.SIGINT)
        raise ValueError("killed")

    with pytest.raises(KeyboardInterrupt), interrupts_deferred():
        work()


def test_blocks_may_be_nested():
    with pytest.raises(KeyboardInterrupt), interrupts_deferred(), interrupts_deferred():
        signal.raise_signal(signal.SIGINT)


def test_an_interrupt_that_python_drops_is_raised_again(capsys: pytest.CaptureFixture[str]) -> None:
    class Thing:
        pass

    def work() -> None:
        thing = Thing()
        reference = weakref.ref(thing, lambda _: signal.raise_signal(signal.SIGINT))
        del thing  # what its callback raises has nowhere to go
        assert reference() is None
        time.sleep(5.0)

    with pytest.raises(KeyboardInterrupt), interrupts_noted():
        work()
    assert "Traceback" not in capsys.readouterr().err


def test_ignored_interrupts_stay_ignored():
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with interrupts_deferred():
        signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


def test_other_threads_are_left_alone():
    found = []

    def work():
        with interrupts_deferred():
            found.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found == [signal.default_int_handler]


def test_an_interrupt_that_is_swallowed_is_known():
    with interrupts_noted() as was_interrupted:
        assert not was_interrupted()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        assert was_interrupted()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_interrupt_that_was_kept_back_is_known_too():
    with interrupts_noted() as was_interrupted:
        with pytest.raises(KeyboardInterrupt), interrupts_deferred():
            signal.raise_signal(signal.SIGINT)
        assert was_interrupted()


def swallowing(seconds: float) -> int:
    """Interrupt, swallow it as CasADi does where it looks at arguments, and go on for a while."""
    scope = {"__name__": "casadi.casadi", "signal": signal, "time": time}
    code = """
def swallow():
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:
        pass
"""
    exec(code, scope)
    scope["swallow"]()
    steps = 0
    give_up = time.monotonic() + seconds
    while time.monotonic() < give_up:
        time.sleep(0.01)
        steps += 1
    return steps


def test_an_interrupt_that_casadi_swallows_comes_again():
    started = time.monotonic()
    with interrupts_noted(), pytest.raises(KeyboardInterrupt):
        swallowing(10.0)
    assert time.monotonic() - started < 5.0


def test_an_interrupt_that_is_heard_does_not_come_again():
    with interrupts_noted() as was_interrupted:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            interrupt_handled()
        time.sleep(0.5)
        assert was_interrupted()
    time.sleep(0.3)


def test_the_user_may_press_twice():
    with interrupts_noted():
        for _ in range(2):
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)
            interrupt_handled()
