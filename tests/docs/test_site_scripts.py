"""The site's own scripts in a browser: tables that filter and sort, and blocks that copy."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

STATIC = Path(__file__).parents[2] / "docs" / "static"
SHOWN = "() => [...document.querySelectorAll('tbody tr')].filter((r) => r.checkVisibility()).length"
FIRST = "() => document.querySelector('tbody td').textContent"


def document(rows: int) -> str:
    cells = "".join(f"<tr><td>name{k}</td><td>{(k * 7) % 10} mm</td></tr>" for k in range(rows))
    table = (
        f"<table><thead><tr><th>name</th><th>size</th></tr></thead><tbody>{cells}</tbody></table>"
    )
    other = (
        "<table><thead><tr><th>a</th></tr></thead><tbody><tr><td>other</td></tr></tbody></table>"
    )
    code = '<div class="highlight"><pre>bywire list\n</pre></div>'
    output = f'<div class="terminal">{code}</div>'
    return (
        '<!doctype html><article class="bd-article"><section><h1>T</h1>'
        f"<section><h2>A</h2>{table}</section><section><h2>B</h2>{other}</section>"
        f"{code}{output}</section></article>"
    )


@pytest.fixture
def page(chromium: Any) -> Iterator[Any]:
    context = chromium.new_context()
    yield context.new_page()
    context.close()


def load(page: Any, rows: int) -> None:
    scripts = "".join(f"<script>{path.read_text()}</script>" for path in STATIC.glob("*.js"))
    page.set_content(document(rows) + scripts)


def test_a_long_table_is_filtered_by_all_words(page: Any) -> None:
    load(page, 40)
    field = page.locator("input[type=search]")
    field.fill("NAME31 7")
    assert page.evaluate(SHOWN) == 1
    assert page.locator("output").text_content() == "1 of 41 rows"
    assert not page.locator("h2", has_text="B").is_visible()
    field.fill("")
    assert page.evaluate(SHOWN) == 41
    assert page.locator("h2", has_text="B").is_visible()


def test_a_short_table_has_no_field(page: Any) -> None:
    load(page, 10)
    assert page.locator("input").count() == 0


def test_headings_sort_by_numbers_and_back(page: Any) -> None:
    load(page, 40)
    name, size = page.locator("th", has_text="name"), page.locator("th", has_text="size")
    size.click()
    assert page.evaluate(FIRST) == "name0"
    size.press("Enter")
    assert page.evaluate(FIRST) == "name7"  # 9 mm
    name.click()
    name.click()
    assert page.evaluate(FIRST) == "name39"


def test_code_is_copied_and_output_is_not(page: Any) -> None:
    load(page, 1)
    page.evaluate("() => (navigator.clipboard ??= {}).writeText = (text) => (window.copied = text)")
    assert page.locator("button").count() == 1
    page.locator("button").click()
    assert page.evaluate("() => copied") == "bywire list"
