"""The benchmark as a whole: a part that fails is a row, and what was measured is kept."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator

import pytest

from benchmarks import suite
from benchmarks.motorcycle import cvodes, others
from benchmarks.result import Result, at_most
from benchmarks.suite import Part, measure
from bywire.core.catalog import parameters
from bywire.core.errors import RunError


def sound() -> list[Result]:
    return [at_most("sound.time", 1.0, 2.0, "s", "measured")]


def broken() -> Iterator[Result]:
    yield at_most("broken.first", 3.0, 2.0, "s", "measured")
    raise AttributeError("'float' object has no attribute 'value'")


def refused() -> list[Result]:
    raise RunError("no such processor")


def ended() -> list[Result]:
    raise subprocess.CalledProcessError(3, ["bywire"], stderr="reading\nno such bench\n")


def interrupted() -> Iterator[Result]:
    yield at_most("interrupted.first", 1.0, 2.0, "s", "measured")
    raise KeyboardInterrupt


@pytest.fixture
def parts(monkeypatch):
    def have(**parts):
        found = {name: Part(name, part) for name, part in parts.items()}
        monkeypatch.setattr(suite, "declared", lambda kind: found)

    return have


def test_a_part_that_fails_is_a_row_with_its_reason(parts):
    parts(broken=broken, refused=refused, ended=ended, sound=sound)
    done = measure()
    assert [r.id for r in done.results] == [
        "broken.first",
        "broken",
        "refused",
        "ended",
        "sound.time",
    ]
    reasons = {r.id: r.note for r in done.results if r.is_failed}
    place, _, text = reasons.pop("broken").partition(": ")
    assert "suite.py, line" in place
    assert text == "AttributeError: 'float' object has no attribute 'value'"
    assert reasons == {
        "refused": "no such processor",
        "ended": "exit status 3: no such bench",
    }
    assert done.failures[1:] == [f"{name} failed: {reason}" for name, reason in reasons.items()]
    assert done.failures[0] == f"broken failed: {place}: {text}"
    assert not done.holds
    table = str(done)
    assert "AttributeError" in table
    assert "sound.time" in table


def test_a_missed_goal_is_no_failure(parts):
    parts(sound=lambda: [at_most("slow.time", 3.0, 2.0, "s", "measured")])
    assert measure().holds


def test_an_interrupt_keeps_what_was_measured(parts):
    parts(sound=sound, interrupted=interrupted, never=sound)
    done = measure()
    assert done.status == "interrupted"
    assert [r.id for r in done.results] == ["sound.time", "interrupted.first"]
    assert json.dumps(done.as_object()["results"])
    assert done.as_object()["status"] == "interrupted"


def test_a_peer_that_fails_leaves_the_others(monkeypatch):
    def solve(*_: object) -> None:
        raise ValueError("another version of it")

    monkeypatch.setattr(others, "PEERS", [others.Peer("cvodes", 30.0), others.Peer("lsoda", 200.0)])
    monkeypatch.setattr(others, "_plain", lambda run: (1.0,))
    monkeypatch.setattr(cvodes, "solve", solve)
    first, second, *unmeasured = others.others(parameters("dardanelli2010"))
    assert (first.id, first.is_failed) == ("peer.cvodes", True)
    assert "ValueError: another version of it" in first.note
    assert (second.id, second.is_failed) == ("peer.lsoda", False)
    assert second.value is not None
    assert all(each.note for each in unmeasured)
