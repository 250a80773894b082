"""Pages show what their commands print and draw, and a page that does not is found."""

from __future__ import annotations

import re
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
sys.path.insert(0, str(DOCS))

from site_pages import results  # noqa: E402  beside what they describe

# Pages whose commands leave no figure.
WITHOUT_RESULT = {
    "measurement-files": "files of the reader",
    "serve": "a server",
    "signoff": "a document with links to the figures of its evidence",
    "speed": "benchmarks of an hour",
    "wasm": "files for a browser; the live benches are a page of the site",
}
PAGES = {page: text for page, text in results.pages().items() if results.steps(text)}


def without_result(texts: dict[str, str]) -> set[str]:
    """Return the pages with blocks of commands that show no figure."""
    return {
        page
        for page, text in texts.items()
        if re.search(r"^```sh[^\n]*\n(?:cp .*\n)?bywire ", text, re.M)
        and not any(step.figures for step in results.steps(text))
    }


def test_pages_with_commands_show_a_figure() -> None:
    assert without_result(results.pages()) == WITHOUT_RESULT.keys()


def test_a_page_without_its_figure_is_found() -> None:
    text = results.pages()["tutorials/design"]
    assert without_result({"design": text}) == set()
    assert without_result({"design": re.sub("sh run .*", "sh run", text)}) == {"design"}
    assert without_result({"design": text.replace("sh run", "sh")}) == {"design"}


def page(commands: str, words: str = "", language: str = "sh") -> str:
    return f"# Title\n\n```{language} run {words}\n{commands}\n```\n\nAfter.\n"


def test_a_page_shows_output_and_figures_below_its_blocks(tmp_path: Path) -> None:
    text = page("bywire run hard-braking --out r\nbywire list loops", "step-response")
    (shown,) = results.play(results.steps(text), tmp_path)
    assert (tmp_path / shown.figures["r/step-response.png"]).stat().st_size > 1e4
    after = results.with_results(text, [shown], "figures")
    parts = [
        "```sh\n",
        "$ bywire run",
        "rise_time",
        "$ bywire list",
        "position control",
        "{figure}",
    ]
    places = [after.index(part) for part in parts]
    assert places == sorted(places)
    assert "bywire: report: r/report.html" in after  # without the folder of the build
    assert "```{figure} figures/1-step-response.png" in after
    assert after.endswith("\n\nAfter.\n")


def test_python_and_files_of_a_page(tmp_path: Path) -> None:
    text = "```{code-block} toml\n:caption: a.txt\n\nx = 1\n```\n\n"
    text += page("print(open('a.txt').read())", language="python")
    shown = results.play(results.steps(text), tmp_path)
    assert [each.text for each in shown] == ["", "x = 1"]
    assert results.with_results(text, shown, "").startswith(text[:40])


@pytest.mark.parametrize(
    ("commands", "words", "message"),
    [
        ("bywire run hard-braking --out r", "bode", "no new figure 'bode'"),
        ("bywire run unheard-of", "", "exit status 2"),
        ("true   # exit status 1", "", "exit status 0"),
    ],
)
def test_a_block_that_fails_stops_the_site(
    commands: str, words: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(results.PageError, match=message):
        results.play(results.steps(page(commands, words)), tmp_path)


def test_a_command_prints_the_same_in_a_copy_of_a_loaded_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for each in ("bywire list loops", "bywire run hard-braking --set motor.R_m=x"):
        copied = results._output("sh", each, tmp_path)
        with monkeypatch.context() as without:
            without.setattr(results.fork_server, "can_fork", lambda: False)
            assert results._output("sh", each, tmp_path) == copied


@pytest.mark.parametrize(
    ("command", "needs"),
    [
        ('bywire design pressure --require "overshoot <= 15 %"', False),
        ("bywire list loops   # a | b", False),
        ("bywire list loops | head", True),
        ("bywire list loops; true", True),
        ("bywire run hard-braking --out $HOME", True),
    ],
)
def test_only_commands_with_operators_need_a_shell(command: str, needs: bool) -> None:
    assert results._needs_shell(command) is needs


def test_results_are_kept_until_page_or_sources_change(tmp_path: Path) -> None:
    counted = "bywire list loops; echo x >> {}".format(tmp_path / "count")

    def make(text: str, sources: str) -> list[results.Shown]:
        with ThreadPoolExecutor(1) as pool:
            return results.start(pool, {"a": text}, tmp_path, sources)["a"].result()

    first = make(page(counted), "1")
    assert make(page(counted) + "Other prose.", "1") == first
    assert (tmp_path / "count").read_text() == "x\n"
    make(page(counted), "2")
    make(page(counted + "\n"), "2")
    assert (tmp_path / "count").read_text() == "x\nx\nx\n"


@pytest.mark.trust
@pytest.mark.parametrize("name", PAGES)
def test_a_page_runs_from_top_to_bottom(name: str, tmp_path: Path) -> None:
    results.play(results.steps(PAGES[name]), tmp_path)
