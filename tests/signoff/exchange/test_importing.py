"""Sign-offs whose requirements come from files of other tools, and the results in copies."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from bywire.api.signoff import SignOff
from bywire.core.errors import FileError, ParameterError, UnknownNameError
from bywire.signoff.signoff_file import read_signoff
from raising import raises
from signoff.closed_form import READERS
from signoff.test_verdicts import requirement, signed, spring

HOSTILE = '=HYPERLINK("x";<b>) &'
HEAD = 'requirements = "brake.csv"\n'
EXAMPLE = Path(__file__).with_name("brake.reqif")


def results_in(content: str) -> dict[str, dict[str, str]]:
    rows = csv.DictReader(io.StringIO(content, newline=""), delimiter=";")
    return {row["id"]: row for row in rows}


@pytest.fixture
def sign(tmp_path: Path) -> Callable[..., SignOff]:
    def sign(content: str, *entries: str) -> SignOff:
        (tmp_path / "brake.csv").write_bytes(content.encode())
        return signed(tmp_path, HEAD, *entries)

    return sign


def test_results_return_into_a_copy_of_the_table(
    sign: Callable[..., SignOff], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    content = f'\ufeffid;text;assumes\r\nR;large;A\r\n"{HOSTILE.replace(chr(34), chr(34) * 2)}";x;'
    made = sign(
        content,
        requirement("extra"),
        requirement("A", kind="assumption"),
        spring("R", [200e3]),
        spring("R", [150e3], name="=1"),
        spring(HOSTILE, [96e3], name="@b"),
    )
    assert [each.statement.id for each in made.requirements] == ["R", HOSTILE, "extra"]
    names = [path.name for path in made.write(tmp_path / "out")]
    assert "brake-verdicts.csv" in names
    copy = tmp_path / "out" / "brake-verdicts.csv"
    rows = results_in(copy.read_text(encoding="utf-8-sig"))
    assert list(rows) == ["R", HOSTILE]
    row = {name: text for name, text in rows["R"].items() if name.startswith("bywire.")}
    assert row == {
        "bywire.verdict": "undecided",
        "bywire.reason": "assumption A is not shown",
        "bywire.evidence": "spring R\nspring =1",
        "bywire.value": "200 N\n150 N",
        "bywire.limit": "force >= 100 N\nforce >= 100 N",
        "bywire.margin": "100 N\n50 N",
        "bywire.date": "2023-11-14",
    }
    assert rows[HOSTILE]["bywire.margin"] == "'-4 N"
    assert (tmp_path / "brake.csv").read_bytes() == content.encode()
    record = json.loads((tmp_path / "out" / "signoff.json").read_text())
    assert record["imported"]["sha256"] in (tmp_path / "out" / "report.html").read_text()

    (tmp_path / "brake.csv").write_bytes(copy.read_bytes())  # the next sign-off starts from it
    signed(tmp_path, (tmp_path / "list.toml").read_text())
    assert copy.read_bytes() == (tmp_path / "brake.csv").read_bytes()


def test_results_return_into_a_copy_of_a_reqif_file(tmp_path: Path) -> None:
    (tmp_path / "brake.reqif").write_bytes(EXAMPLE.read_bytes())
    head = 'requirements = "brake.reqif"\n[only]\nkind = "Requirement"\n'
    made = signed(tmp_path, head, spring("R-Ü 1", [99e3]))
    assert made.verdicts["R-Ü 1"].outcome == "missed"
    copy = (tmp_path / "out" / "brake-verdicts.reqif").read_text(encoding="utf-8")
    assert copy.count('THE-VALUE="missed"') == 1
    assert copy.count('THE-VALUE="-1 N"') == 1


def test_the_line_of_the_table_is_the_place_of_errors(sign: Callable[..., SignOff]) -> None:
    with raises(ParameterError, name="id", value="R") as caught:
        sign('id;text\nR;"a\nb"\nR;c\n')
    assert "brake.csv, line 4: " in str(caught.value)
    assert "brake.csv, line 2)" in str(caught.value)
    with raises(ParameterError, name="id", value="R") as caught:
        sign("id;text\nR;a\n", requirement("R"))
    assert "list.toml, line 3: " in str(caught.value)
    with raises(ParameterError, name="assumes", value="A") as caught:
        sign("id;text;assumes\nR;a;\nQ;b;A\n")
    assert "brake.csv, line 3: " in str(caught.value)


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ('[[requirement]]\nid = "R"\ntext = "a"\n[attributes]\nid = "x"', "attributes"),
        ('[[requirement]]\nid = "R"\ntext = "a"\n[only]\nkind = "x"', "only"),
        ('requirements = "x.csv"', "x.csv"),
        ('requirements = "x\\u0000.csv"', "x"),
    ],
)
def test_wrong_entries_of_the_sign_off_file(tmp_path: Path, text: str, name: str) -> None:
    (tmp_path / "list.toml").write_text(text)
    with raises((ParameterError if "[[" in text else FileError), name=name):
        read_signoff(tmp_path / "list.toml", READERS)


def test_evidence_for_an_unknown_row(sign: Callable[..., SignOff]) -> None:
    with raises(UnknownNameError, name="shows", value="Q", valid="R"):
        sign("id;text\nR;a\n", spring("Q", [1.0]))
