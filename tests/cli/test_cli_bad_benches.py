"""bywire rejects every file in ``tests/benches_bad`` with one line that its header specifies."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "benches_bad"
FILES = sorted(FOLDER.glob("*.toml"))
MARK = "# expect: "


def expected(path: Path) -> list[str]:
    """Return the texts that the message about a file must contain."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return [line.removeprefix(MARK) for line in lines if line.startswith(MARK)]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_bad_bench_file_gets_one_clear_line(bywire, tmp_path, path):
    started = time.process_time()
    status, out, err = bywire("run", path, "--out", tmp_path / "out")
    assert status == 2
    assert out == ""
    assert err.startswith("bywire: error: ")
    assert len(err.strip().splitlines()) == 1
    assert len(err) < 500
    for text in expected(path):
        assert text in err
    assert time.process_time() - started < 5.0  # independent of the machine's load
    assert not list(tmp_path.glob("out/*"))  # rejected before bywire writes anything


@pytest.mark.parametrize("name", ["syntax", "unknown_experiment", "negative", "wrong_unit"])
def test_whoever_asks_for_json_gets_the_same_line(bywire, name):
    """Files are read as text, bench and parameters, and a scalar never replaces an object."""
    path = FOLDER / f"{name}.toml"
    status, out, err = bywire("run", path, "--json")
    assert (status, out) == (2, "")
    assert err == bywire("run", path).err


def test_every_file_says_what_it_expects():
    assert len(FILES) > 70
    assert all(expected(path) for path in FILES)


def test_message_names_the_file(bywire):
    path = FOLDER / "negative.toml"
    assert f"{path}: motor.R_m" in bywire("run", path).err


@pytest.mark.parametrize("name", ["negative", "wrong_unit", "unknown_option", "step_zero"])
def test_the_corrected_file_runs(bywire, bench, name):
    """The test above can fail, because bywire accepts a file without its mistake."""
    text = (FOLDER / f"{name}.toml").read_text(encoding="utf-8")
    for wrong, right in (
        ('"-0.4 ohm"', '"0.4 ohm"'),
        ('"9 bar"', '"9 mm"'),
        ("p_too", "p_to"),
        ("step = 0", 'step = "20 us"'),
    ):
        text = text.replace(wrong, right)
    assert bywire("run", bench(text)).status == 0
