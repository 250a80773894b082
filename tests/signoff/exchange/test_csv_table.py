"""CSV: requirements with hostile texts, results back into the same table, and errors with lines."""

from __future__ import annotations

import csv
import io
import random
from pathlib import Path

import pytest

from bywire.core.errors import FileError, InputError, ParameterError, UnknownNameError
from bywire.signoff.exchange.csv_table import CsvTable
from bywire.signoff.exchange.importing import AttributeNames, imported_from
from bywire.signoff.exchange.requirements_file import LONGEST, RESULT_ATTRIBUTES, Result
from raising import raises

FILE = Path("brake.csv")
RESULT = Result(
    verdict="missed",
    reason="beyond the limit; by far",
    evidence="=cmd|' /C calc'!A0\nrun \"x\", y\tz",
    value="+4 N\n-1 N",
    limit="@SUM(1)",
    margin="-4 N",
    date="2026-11-27",
)


def cells_of(content: bytes, separator: str) -> list[list[str]]:
    """Return the cells as Python's module csv reads them."""
    text = content.decode("utf-8-sig")
    return list(csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True))


@pytest.mark.parametrize("separator", [";", ",", "\t"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_table_returns_with_results_and_everything_else_as_it_was(
    separator: str, mark: str, end: str
) -> None:
    rows = [
        ["ID", "Text", "owner"],
        ["R-Ü 1", '"The;force, is"\tlarge', "=1+1"],
        ["", "", ""],
        ["R2", "two\nlines", '"quoted"'],
    ]
    stream = io.StringIO(newline="")
    csv.writer(stream, delimiter=separator, lineterminator=end).writerows(rows)
    content = (mark + stream.getvalue()).encode()
    table = CsvTable(FILE, content)
    assert [list(each.values.values()) for each in table.entries] == [rows[1], rows[3]]
    assert [each.line for each in table.entries] == [2, 4]

    written = table.with_results({1: RESULT})
    assert written.startswith(mark.encode())
    assert (b"\r\n" in written) == (end == "\r\n")
    found = cells_of(written, separator)
    assert [row[:3] for row in found] == rows
    assert found[0][3:] == list(RESULT_ATTRIBUTES)
    assert found[1][3:] == [""] * len(RESULT_ATTRIBUTES)
    assert found[3][3] == "missed"

    again = CsvTable(FILE, written)
    assert [each.values for each in again.entries] == [each.values for each in table.entries]
    assert again.with_results({1: RESULT}) == written
    assert table.with_results({0: RESULT}) == again.with_results({0: RESULT})


def test_no_result_is_a_formula() -> None:
    (_, row) = cells_of(CsvTable(FILE, b"id,text\nR,=1+1\n").with_results({0: RESULT}), ",")
    assert row[1] == "=1+1"  # a cell of the user's
    assert [cell[:1] for cell in row[2:]] == ["m", "b", "'", "'", "'", "'", "2"]
    assert row[4] == f"'{RESULT.evidence}"


def test_a_long_result_fits_in_a_cell() -> None:
    long = Result(*["x" * 40_000] * 7)
    assert {len(text) for text in long.by_attribute().values()} == {LONGEST}


def test_random_tables_return_cell_by_cell() -> None:
    choose = random.Random(2)
    alphabet = "ab;,\t\"\n\r'= ä\u2028"
    for _ in range(200):
        separator = choose.choice(";,\t")
        width = choose.randrange(2, 5)
        rows = [["id", "text", "x", "y"][:width]]
        for k in range(choose.randrange(1, 5)):
            texts = ["".join(choose.choices(alphabet, k=choose.randrange(6))) for _ in range(3)]
            rows.append([f"R{k}", *texts][: choose.randrange(1, width + 1)])  # short rows as well
        stream = io.StringIO(newline="")
        csv.writer(stream, delimiter=separator).writerows(rows)
        table = CsvTable(FILE, stream.getvalue().encode())
        assert [list(each.values.values()) for each in table.entries] == rows[1:]
        results = {k: RESULT for k in range(len(table.entries)) if choose.random() < 0.7}
        written = table.with_results(results)
        found = cells_of(written, separator)
        assert [len(row) for row in found] == [width + len(RESULT_ATTRIBUTES)] * len(rows)
        assert [row[: len(cells)] for row, cells in zip(found, rows, strict=True)] == rows
        assert CsvTable(FILE, written).with_results(results) == written


def test_german_excel_and_other_names_of_columns(tmp_path: Path) -> None:
    file = tmp_path / "brake.CSV"
    text = (
        "sep=;\r\nNr;Anforderung;SOURCE;assumes;Art\r\nR1;Die Kraft ist groß.;§ 3;A1, A2;Info\r\n"
    )
    file.write_text(f"{text}R2;Kurz.;;;anforderung\r\n", encoding="utf-8", newline="")
    names = AttributeNames(id="nr", text="Anforderung")
    first, second = imported_from(file, names, {}).statements
    assert (first.id, first.text, first.source) == ("R1", "Die Kraft ist groß.", "§ 3")
    assert first.assumes == ("A1", "A2")
    assert second.place.line == 4
    (only,) = imported_from(file, names, {"art": ["Anforderung"]}).statements
    assert only == second


@pytest.mark.parametrize(
    ("content", "kind", "name", "line"),
    [
        (b"", FileError, "brake.csv", 1),
        (b"\n\n", FileError, "brake.csv", 1),
        (b"id;text\nR1;'x\xfc'", FileError, "brake.csv", 2),
        ("id;text".encode("utf-16"), FileError, "brake.csv", 1),
        (b"id;text\nR1;\0", FileError, "brake.csv", 2),
        (b'id;text\nR1;"a\nb"\nR2;"open\n\n', FileError, "brake.csv", 4),
        (b'id;text\nR1;"a\nb"c\n', FileError, "brake.csv", 3),
        (b"id;text\nR1;a;b\n", FileError, "brake.csv", 2),
        (b"id;text;ID\nR1;a;b\n", ParameterError, "column", 1),
        (b"id;text" + b";" * 1000, FileError, "brake.csv", 1),
        (b"\nname;text\nR1;a\n", UnknownNameError, "column", 2),
        (b"id,titel\nR1,a\n", UnknownNameError, "column", 1),
        (b"id;text\nR1;a\n;b\n", ParameterError, "id", 3),
        (b"id;text\nR1;a\nR2; \n", ParameterError, "text", 3),
        (b'id;text\n"R\n1";a\n', ParameterError, "id", 2),
        (b"id;text\n", ParameterError, "requirements", 0),
    ],
)
def test_a_wrong_table_gets_one_message_with_its_line(
    tmp_path: Path, content: bytes, kind: type[InputError], name: str, line: int
) -> None:
    file = tmp_path / "brake.csv"
    file.write_bytes(content)
    with pytest.raises(kind) as caught:
        imported_from(file, AttributeNames(), {})
    assert name in caught.value.name
    assert str(file) in str(caught.value)
    assert not line or f"brake.csv, line {line}" in str(caught.value)


def test_names_and_values_that_the_table_does_not_have(tmp_path: Path) -> None:
    file = tmp_path / "brake.csv"
    file.write_text("id;text\nR1;a\n")
    with raises(UnknownNameError, name="[attributes] text", value="Txt", valid="id, text"):
        imported_from(file, AttributeNames(text="Txt"), {})
    with raises(UnknownNameError, name="[only]", value="kind"):
        imported_from(file, AttributeNames(), {"kind": "requirement"})
    with raises(ParameterError, name="[only] id", value="3"):
        imported_from(file, AttributeNames(), {"id": 3})


def test_other_kinds_of_files(tmp_path: Path) -> None:
    for name, advice in (("a.reqifz", "Extract"), ("a.xlsx", "UTF-8"), ("a", ".csv")):
        with raises(FileError, name="requirements") as caught:
            imported_from(tmp_path / name, AttributeNames(), {})
        assert advice in str(caught.value)
    with raises(FileError, name="missing.csv"):
        imported_from(tmp_path / "missing.csv", AttributeNames(), {})
