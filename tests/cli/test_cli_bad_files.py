"""Files that are not bench files: missing, folders, binary, empty, hostile."""

from __future__ import annotations

import os
import time

import pytest
from command_line import BRAKING, PEDAL, QUICK, refused

NOT_TEXT = b"\x89HDF\r\n\x1a\n" + bytes(range(256))
DEEP = {
    "lists": "x = " + "[" * 100_000,
    "closed lists": "x = " + "[" * 2_000 + "]" * 2_000,
    "inline tables": "x = " + "{a = " * 100_000,
    "dotted key": "[set]\n" + "a." * 30_000 + "a = 1",
    "quoted key": "[set]\n" + '"a" . ' * 30_000 + "a = 1",
    "header": "[" + "a." * 30_000 + "a]",
    "two million words": "[set]\nnote = '" + "a.b " * 200_000 + "'",
}


def test_missing_file(bywire, tmp_path):
    refused(bywire("run", tmp_path / "none.toml"), "No such file", "none.toml", "check the path")


def test_missing_file_has_a_near_one(bywire, bench, tmp_path):
    path = bench(name="braking.toml")
    refused(bywire("run", tmp_path / "brakng.toml"), f"did you mean {path}?")


def test_folder(bywire, tmp_path):
    refused(bywire("run", tmp_path), "Is a directory")


@pytest.mark.skipif(not os.path.exists("/dev/zero"), reason="POSIX only")
def test_endless_file(bywire):
    refused(bywire("run", "/dev/zero"), "too large for a bench file")


def test_ten_megabytes(bywire, bench):
    path = bench(BRAKING + "# padding\n" * 1_000_000)
    started = time.process_time()
    refused(bywire("run", path), "larger than 1000 kB", "options.trace")
    assert time.process_time() - started < 2.0


@pytest.mark.parametrize("text", [b"", b"\n\n", b"# only a comment\n"])
def test_empty_file(bywire, bench, text):
    refused(bywire("run", bench(text)), "experiment is missing", "'bywire list experiments'")


@pytest.mark.parametrize(
    ("text", "texts"),
    [
        (
            'experiment = "hard-braking"',
            ['a line such as parameters = "dardanelli2010"', "names are dardanelli2010, dard"],
        ),
        ('experiment = "step"', ["parameters=NAME", "sport600", "roberts2003"]),
        ('experiment = "hard-breaking"', ["unknown experiment", "'hard-braking'"]),
        (
            'parameters = "roberts2003"',
            ['a line such as experiment = "current-loop"', "moment-ramp", "sine-sweep"],
        ),
        (
            'experiment = "hard-braking"\nparameters = "roberts2003"',
            ["is for a wedge-brake. Its parameter sets are dardanelli2010, dard"],
        ),
    ],
)
def test_missing_name_comes_with_the_names_that_fit(bywire, bench, text, texts):
    refused(bywire("run", bench(text)), *texts)


@pytest.mark.parametrize(
    ("change", "texts"),
    [
        ("experiment=step", ["options.input is missing", "--set options.input=p_set", "v_set"]),
        ("experiment=motor-open-loop", ["--set stimulus.kind=step"]),
        ("experiment=duty", ["--set options.input=p_set. Valid names are p_set, pedal_force"]),
    ],
)
def test_missing_option_comes_with_what_to_type(bywire, bench, change, texts):
    refused(bywire("run", bench('parameters = "dardanelli2010"'), "--set", change), *texts)


def test_missing_values_of_a_stimulus_come_with_what_to_type(bywire):
    changes = ["--set", "stimulus.kind=step", "--set", "stimulus.start=0 A"]
    typed = '--set "stimulus.end=VALUE A" --set "stimulus.t_step=VALUE s"'
    refused(bywire("run", "motor-open-loop", *changes), "end, t_step are missing", typed)


@pytest.mark.parametrize("text", [NOT_TEXT, BRAKING.encode("utf-16")])
def test_binary_file(bywire, bench, text):
    refused(bywire("run", bench(text)), "not UTF-8 text")


def test_zeros(bywire, bench):
    refused(bywire("run", bench(bytes(1000))), "not valid TOML", "line 1")


@pytest.mark.parametrize("kind", DEEP)
def test_deep_nesting_ends_quickly(bywire, bench, kind):
    path = bench(f"{BRAKING}\n{DEEP[kind]}\n")
    started = time.process_time()
    refused(bywire("run", path), str(path))
    assert time.process_time() - started < 5.0


def test_null_character_in_the_path(bywire, tmp_path):
    assert bywire("run", f"{tmp_path}/a\0b.toml").status == 2


@pytest.mark.parametrize("mark", [b"\xef\xbb\xbf", b""], ids=["with mark", "plain"])
@pytest.mark.parametrize("end", ["\n", "\r\n"], ids=["unix", "windows"])
def test_what_editors_of_other_systems_write_is_read(bywire, bench, mark, end):
    path = bench(mark + (BRAKING + QUICK).replace("\n", end).encode())
    assert bywire("run", path).status == 0


def test_file_name_that_is_no_text(bywire, tmp_path):
    path = os.fsencode(tmp_path) + b"/\xff.toml"
    with open(path, "wb") as stream:
        stream.write(b'experiment = "seal-stribeck"\nparameters = "dardanelli2010"\n')
    status, out, err = bywire("run", os.fsdecode(path), "--out", tmp_path / "out", "--json")
    assert (status, "Traceback" in err) == (0, False)
    assert '"bench": "?"' in out
    assert (tmp_path / "out" / "report.html").exists()


def test_messages_hold_no_control_characters(bywire, bench):
    outcome = bywire("run", bench(PEDAL + '[options]\ntrace = "\\u001b[31m"\n'))
    refused(outcome, "cannot be read")
    assert "\x1b" not in outcome.err
