"""For another command's file, the error states the file's kind and the right command."""

from __future__ import annotations

from itertools import permutations

import pytest
from command_line import BRAKING, refused

FILES = {
    "bench": BRAKING,
    "study": 'bench = "hard-braking"\n[vary]\n"motor.R_m" = "+-5 %"\n[design]\ncases = 64\n',
    "life": 'life = "wedge-pads"\n',
    "procedure": 'procedure = "A stop"\nexperiment = "straight-stop"\n',
    "campaign": 'bench = "hard-braking"\n[vary]\n"motor.R_m" = "+-5 %"\n[[criteria]]\n',
}
COMMANDS = {
    "bench": ("run",),
    "study": ("study", "run"),
    "life": ("life",),
    "procedure": ("procedure",),
    "campaign": ("faults",),
}
WORDS = {kind: f"a {kind}" for kind in FILES} | {"campaign": "a fault campaign"}


@pytest.mark.parametrize(("given", "wanted"), [*permutations(FILES, 2)])
def test_a_file_of_another_kind_is_named(bywire, bench, tmp_path, monkeypatch, given, wanted):
    monkeypatch.chdir(tmp_path)
    path = bench(FILES[given], "some.toml")
    takes = f"'bywire {' '.join(COMMANDS[given])} {path}'"
    refused(
        bywire(*COMMANDS[wanted], path),
        f"{path}: this is {WORDS[given]}, not {WORDS[wanted]}",
        takes,
    )
    assert [each.name for each in tmp_path.iterdir()] == ["some.toml"]


@pytest.mark.parametrize(
    ("command", "text", "texts"),
    [
        (("run",), BRAKING + 'bench = "hard-braking"\n', ["bench file 'bench'"]),
        (("study", "run"), f'bench = "hard-braking"\n{BRAKING}', ["study file 'experiment'"]),
        (("study", "run"), 'bench = "hard-braking"\n[values]\n', ["study file 'values'"]),
        (("faults",), 'bench = "hard-braking"\n[values]\n', ["[[criteria]] is missing"]),
        (("faults",), 'bench = "hard-braking"\n[[criteria]]\n[design]\n', ["file 'design'"]),
        (("life",), 'life = "wedge-pads"\nbench = "hard-braking"\n', ["life file 'bench'"]),
    ],
)
def test_a_key_too_many_makes_no_file_of_another_kind(
    bywire, bench, tmp_path, monkeypatch, command, text, texts
):
    monkeypatch.chdir(tmp_path)
    refused(bywire(*command, bench(text)), "unknown key" if "file" in texts[0] else "", *texts)


def test_a_study_is_no_suggestion_for_a_bench(bywire, bench, tmp_path):
    bench(FILES["study"], "hard_braking_study.toml")
    refused(bywire("run", tmp_path / "hard_braking.toml"), "check the path")
    path = bench(name="hard_breaking.toml")
    refused(bywire("run", tmp_path / "hard_braking.toml"), f"did you mean {path}?")


def test_a_bench_lies_in_a_folder_of_benches(bywire, bench, tmp_path):
    (tmp_path / "benches").mkdir()
    path = bench(name="benches/braking.toml")
    bench(name="brakings.toml")
    refused(bywire("run", tmp_path / "braking.toml"), f"did you mean {path}?")


def test_the_nearest_experiment_is_named(bywire):
    refused(bywire("run", "hard-brakin"), "did you mean hard-braking?")
