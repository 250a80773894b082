"""A short round of generated input; the long ones are run by hand, see ``fuzz/__main__.py``."""

from __future__ import annotations

import os
import sys
from itertools import groupby
from pathlib import Path
from random import Random

import pytest

from bywire.data import limited_source
from fuzz import inputs, judge, kills, options, study_kills
from fuzz.__main__ import KINDS, tried
from fuzz.judge import judged

SEED = 20261122
KILLED = 1261
"""seed of a case in which a braking that replaces a characteristic is interrupted after 1.3 s"""
KILLED_STUDY = 38
"""seed of a case in which the client of two workers is killed after 3 s"""
SECONDS = 0.5
"""of a processor, for each kind"""


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("kind", KINDS)
def test_nothing_goes_wrong_with_generated_input(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if kind in ("measurement", "layout"):
        for name in ("h5py", "asammdf", "pyarrow"):
            pytest.importorskip(name)
    monkeypatch.setattr(limited_source, "SECONDS", 20.0)
    wrong, through = tried(kind, SEED, 0, 40, SECONDS)
    assert wrong == []
    if kind in ("bench", "command", "layout"):
        assert through > 0.7  # what is to be admissible is carried through, but for contradictions


REPLAYED = {
    "a divisor is searched": [
        "run",
        "hard-braking",
        "--set",
        "simulation.step=1 ns",
        "--set",
        "simulation.record=0.1234567891234567 s",
    ],
    "a period far from any": ["run", "moment-pulses", "--set", "control.T_fast=365.9670339332694s"],
    "a period of ages": ["run", "moment-pulses", "--set", "control.T_fast=1.3e19s"],
    "and its loop": ["margins", "position", "--set", "control.T_fast=1.3e19s"],
    "an open balance": [
        "run",
        "hard-braking",
        "--set",
        "pipeline.k_lf=3.2e-19",
        "--set",
        "options.duration=40 ms",
    ],
    "a long name": ["run", "hard-braking", "--set", "x" * 400 + "=1"],
}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("case", REPLAYED)
def test_what_went_wrong_once(case: str) -> None:
    assert judged(REPLAYED[case]).wrong == ""


@pytest.mark.filterwarnings("ignore")
def test_no_message_repeats_a_long_value(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two options of every command; ``options.long_values`` lists all of them."""
    monkeypatch.chdir(options.prepared(tmp_path))
    monkeypatch.setattr(judge, "LONGEST", 3100)
    rng = Random(SEED)
    by_command = groupby(options.long_values(), key=lambda value: value[0])
    each = [value for _, values in by_command for value in rng.sample(list(values), 2)]
    commands = {command for command, _, _ in each}
    assert commands == set(options.COMMANDS), "add what it is called with to options.COMMANDS"
    wrong = [
        f"{command} {name}: {said}"
        for command, name, text in each
        if (said := judged(options.words_with(command, name, text)).wrong)
    ]
    assert wrong == []


@pytest.mark.parametrize(
    "words",
    [
        ["frequency-response", "position", "--frequencies", "1e-9 Hz"],
        ["frequency-response", "pressure", "--frequencies", "1e-5 Hz, 1 Hz"],
        ["agreement", "pressure", "--frequencies", "1e-9 Hz"],
        ["frequency-response", "position", "--excitation", "multisine", "--frequencies", "1e-9 Hz"],
        ["linearize", "pressure", "--reduce", "1" * 5000],
        ["margins", "pressure", "--over", f"motor.R_m=0.3 ohm:0.4 ohm:{'9' * 5000}"],
        ["study", "run", "weights.toml"],
    ],
    ids=["sine", "sines", "agreement", "lines", "order", "count", "weights"],
)
def test_a_number_that_takes_too_much_is_refused(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    values = f'values = ["+1 %", "-1 %"], weights = [1, {"9" * 400}]'
    (tmp_path / "weights.toml").write_text(
        f'bench = "hard-braking"\n[vary]\n"motor.R_m" = {{ kind = "discrete", {values} }}\n'
    )
    verdict = judged(words)
    assert (verdict.status, verdict.wrong) == (2, "")


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_a_command_that_is_ended_midway_leaves_one_result_or_a_word(tmp_path: Path) -> None:
    assert kills.case(Random(KILLED), tmp_path) == ""


@pytest.mark.trust
@pytest.mark.skipif(sys.platform != "linux", reason="signals, and the list of a process's children")
def test_a_study_whose_client_is_killed_leaves_no_worker_and_goes_on(tmp_path: Path) -> None:
    """Its workers would wait for jobs forever."""
    assert study_kills.case(Random(KILLED_STUDY), tmp_path, 1, "monte-carlo", "pool") == ""


def test_a_case_comes_again() -> None:
    first, again, other = (inputs.bench_text(Random(k)) for k in (3, 3, 4))
    assert first == again != other
