"""Figures that are stated of faults, beside those that our benches give."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MAKER = runpy.run_path(str(ROOT / "docs" / "make_fault_rows.py"))
ROWS = [row for rows in MAKER["TABLES"].values() for row in rows]


def wrong_ones(rows):
    """Return rows that agree in spite of a reason why not, or do not, without one."""
    values = [(row, row.computed()) for row in rows]
    return [
        (row.fault, row.what, value)
        for row, value in values
        if row.agrees(value) == bool(row.because)
    ]


def test_the_cheap_rows_agree_or_give_a_reason():
    rows = [row for row in ROWS if row.daily]
    assert len(rows) >= 6
    assert not wrong_ones(rows)


@pytest.mark.trust
def test_all_rows_agree_or_give_a_reason():
    stated = [row for row in ROWS if row.stated is not None]
    assert not wrong_ones(stated)


@pytest.mark.trust
def test_the_page_is_current():
    written = (ROOT / "docs" / "fault-rows.md").read_text(encoding="utf-8")
    assert written == MAKER["page"](), "run: python docs/make_fault_rows.py"


def test_a_row_without_a_reason_is_told():
    row = next(row for row in ROWS if row.what == "maximum force of the other motor, 20 A")
    wrong = type(row)(row.fault, row.what, 0.8 * row.stated, row.unit, row.computed)
    assert wrong_ones([wrong])
    assert wrong_ones([type(row)(row.fault, row.what, row.stated, row.unit, row.computed, "so")])
