"""A table stimulus out of a file, relative to the bench file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import bywire
from bywire.core.errors import FileError, InputError, ParameterError

BENCH = """
experiment = "open-loop"
parameters = "dardanelli2010"
[options]
duration = "0.3 s"
[stimulus]
kind = "table"
file = "current.csv"
"""


def written(folder: Path, table: str, more: str = "") -> Path:
    (folder / "current.csv").write_text(table)
    path = folder / "bench.toml"
    path.write_text(BENCH + more)
    return path


def test_nodes_come_from_the_file_and_time_from_its_first_row(tmp_path: Path) -> None:
    path = written(tmp_path, "time [s],current [mA]\n5.0,0\n5.1,500\n5.2,500\n")
    recording = bywire.run(bywire.load(path)).recording
    expected = np.interp(recording["time"].values, [0.0, 0.1, 0.2], [0.0, 0.5, 0.5])
    # The source holds its value over 0.1 ms.
    np.testing.assert_allclose(recording["i"].values, expected, atol=1e-3)


@pytest.mark.parametrize(
    ("table", "more", "kind", "words"),
    [
        ("time [s],a [A],b [A]\n0,1,2\n1,1,2\n", "", FileError, "several columns"),
        ("time [s],a [V]\n0,1\n0.1,1\n", "", FileError, "drives A"),
        ("time [s],a [A]\n0,1\n0.1,1\n", 'times = "0 s"', ParameterError, "either file, or"),
        ("time [s],a [A]\n0,1\n0.1,1\n", 'column = "b"', InputError, "b"),
    ],
)
def test_what_does_not_fit_is_refused(
    tmp_path: Path, table: str, more: str, kind: type[Exception], words: str
) -> None:
    with pytest.raises(kind, match=words):
        bywire.load(written(tmp_path, table, more))
