"""Parts of a source are made beside each other: each shared run once, and none after a failure."""

import threading
from types import SimpleNamespace

import pytest

from bywire.core.errors import RunError
from bywire.reproduction import reproduction as shared
from bywire.reproduction.reproduction import Part, Reproduction, reproduced

EMPTY = Reproduction("made-up", "Nobody, 2010")


def asked_bench(*asked: object) -> SimpleNamespace:
    """Return a bench that is nothing but its arguments."""
    values = SimpleNamespace(flat=lambda: asked)
    return SimpleNamespace(par=values, chosen_options=values, chosen_stimuli=asked)


@pytest.fixture(autouse=True)
def two_cores_and_any_bench(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    monkeypatch.setattr(shared, "Bench", asked_bench)
    monkeypatch.setattr(shared, "run", lambda bench: SimpleNamespace(status="finished"))


def made(runs: shared.Runs, title: str) -> Part:
    runs.bench("hard-braking", "dardanelli2010")
    return Part(title, "", ())


def test_a_shared_run_is_made_once_and_parts_keep_their_order(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    begun, both_ask = [], threading.Barrier(2, timeout=20.0)

    def run(bench: object) -> SimpleNamespace:
        begun.append(bench)
        return SimpleNamespace(status="finished")

    def first(runs: shared.Runs) -> Part:
        both_ask.wait()  # only passed where the other part runs at the same time
        return made(runs, "first")

    def second(runs: shared.Runs) -> Part:
        both_ask.wait()
        return made(runs, "second")

    monkeypatch.setattr(shared, "run", run)
    whole = reproduced(EMPTY, shared.Runs(), {"1": first, "2": second}, lambda items: ())
    assert [part.title for part in whole.parts] == ["first", "second"]
    assert len(begun) == 1


@pytest.mark.parametrize("error", [RunError("left the numbers"), KeyboardInterrupt()])
def test_after_a_failure_no_run_begins(error: BaseException) -> None:
    others_run, refused = threading.Event(), []

    def fails(runs: shared.Runs) -> Part:
        others_run.wait(20.0)
        raise error

    def goes_on(runs: shared.Runs) -> Part:
        others_run.set()
        for k in range(100_000):  # the failure is heard of a moment later
            try:
                runs.bench("hard-braking", "dardanelli2010", stimulus={"k": k})
            except KeyboardInterrupt:
                refused.append(k)
                raise
        return Part("never stopped", "", ())

    with pytest.raises(type(error)):
        reproduced(EMPTY, shared.Runs(), {"1": fails, "2": goes_on}, lambda items: ())
    assert len(refused) == 1
