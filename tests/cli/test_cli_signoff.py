"""Sign-off as a command: from the list to the document, and again without computing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from command_line import BRAKING, QUICK, Outcome, no_half_files, refused

LIST = """
[[requirement]]
id = "R"
text = "The pressure reaches its set point."

[[evidence]]
shows = "R"
bench = "bench.toml"
error_estimate = false
limit = "peak_current <= 30 A"

[[evidence]]
shows = "R"
loop = "pressure"
limit = "gain margin >= 12 dB"
"""


def test_from_the_list_to_the_document_and_again(
    bywire: Callable[..., Outcome], bench: Callable[..., Path], tmp_path: Path
) -> None:
    bench(BRAKING + QUICK)
    file, out = tmp_path / "list.toml", tmp_path / "out"
    file.write_text(LIST)
    first = bywire("signoff", file, "--out", out, "--json")
    assert first.status == 0
    (requirement,) = first.object["requirements"]
    assert requirement["outcome"] == "met"
    assert all((out / each["report"]).is_file() for each in requirement["evidence"])
    assert {"report.html", "signoff.json", "junit.xml"} <= {each.name for each in out.iterdir()}
    written = (out / "report.html").stat().st_mtime_ns
    affected = bywire("signoff", file, "--out", out, "--changed", "--json")
    assert affected.object["compute"] == []
    assert (out / "report.html").stat().st_mtime_ns == written  # nothing is written
    file.write_text(LIST.replace("30 A", "3 A"))
    second = bywire("signoff", file, "--out", out, "--json")
    assert second.status == 1
    assert second.object["changes"][0] == "R is missed; it was met"
    assert "peak_current <= 3 A" in second.object["changes"][1]
    assert "requirement R is missed" in second.err
    no_half_files(out)


def test_a_wrong_list_is_one_error_before_a_folder_is_made(
    bywire: Callable[..., Outcome], tmp_path: Path
) -> None:
    file, out = tmp_path / "list.toml", tmp_path / "out"
    file.write_text(LIST)
    refused(bywire("signoff", file, "--out", out), "list.toml, line 6", "bench.toml")
    assert not out.exists()
    file.write_text('experiment = "hard-braking"\n')
    refused(bywire("signoff", file, "--out", out), "bywire run")
