"""Messages name flags to who typed a command, and arguments to who called a function."""

from __future__ import annotations

import pickle

import pytest

import bywire
from bywire.core.callers import command_line, in_callers_words
from bywire.core.errors import ParameterError, UnknownNameError


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ("with --set parameters=NAME (a, b)", 'with overrides={"parameters": "NAME"} (a, b)'),
        ("leave out --parameters and --set", "leave out parameters and overrides"),
        ("give --input STIMULUS=SIGNAL with", 'give inputs={"STIMULUS": "SIGNAL"} with'),
        ("state in --estimate-start 'x'", "state in states 'x'"),
        ("takes --system PATH, or bywire.load_system", "takes bywire.load_system"),
        ("resample it (bywire convert --rate), or", "resample it (bywire convert --rate), or"),
        ("'bywire convert --exclude nothing'", "'bywire convert --exclude nothing'"),
        ("file a--b.csv: 1--2", "file a--b.csv: 1--2"),
    ],
)
def test_flags_are_arguments_in_a_program(written: str, read: str) -> None:
    assert in_callers_words(written) == read
    with command_line():
        assert in_callers_words(written) == written
    assert in_callers_words(written) == read


def test_errors_of_functions_name_their_arguments() -> None:
    with pytest.raises(ParameterError) as caught:
        bywire.run("step")
    assert 'overrides={"parameters": "NAME"}' in str(caught.value)
    assert "--" not in str(caught.value)
    with command_line():
        assert "--set parameters=NAME" in str(caught.value)
        assert "--set parameters=NAME" in str(pickle.loads(pickle.dumps(caught.value)))
    with pytest.raises(UnknownNameError) as unknown:
        bywire.margins("xyzzy")
    assert "--system" not in str(unknown.value)
    assert "bywire.load_system" in str(unknown.value)
