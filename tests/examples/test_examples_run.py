"""Every example runs as its reader would run it, and writes only where it is told to."""

from __future__ import annotations

import ast
import re
import runpy
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = [ROOT / "examples" / "servo_axis.py", *sorted((ROOT / "examples/gallery").glob("*.py"))]
SERVO = SCRIPTS[0]
QUICK = ROOT / "examples" / "gallery" / "seal_friction.py"  # no simulation
WRITES = re.compile(r"savefig|save_\w+|mkdir|open|write\w*|to_\w+|print_png|dump|tofile")


def execute(script: Path, monkeypatch: pytest.MonkeyPatch, *arguments: str) -> None:
    monkeypatch.setattr("sys.argv", [str(script), *arguments])
    runpy.run_path(str(script), run_name="__main__")


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_claims_hold_and_the_figure_goes_where_it_is_told(
    script: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    elsewhere, folder = tmp_path / "elsewhere", tmp_path / "figures"
    elsewhere.mkdir()
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.chdir(elsewhere)
    option = ["--plot", str(tmp_path / "axis.png")] if script == SERVO else ["--out", str(folder)]
    execute(script, monkeypatch, *option)
    assert list(elsewhere.iterdir()) == []
    if script == SERVO:
        assert (tmp_path / "axis.png").stat().st_size > 0
    else:
        assert [file.name for file in folder.iterdir()] == [f"{script.stem}.png"]


@pytest.mark.parametrize("script", [SERVO, QUICK], ids=lambda script: script.stem)
def test_nothing_is_written_unasked(
    script: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    execute(script, monkeypatch)
    assert list(tmp_path.iterdir()) == []


def written_unasked(text: str) -> list[str]:
    """Return the calls of a script that leave files, but those after ``if`` it was asked to."""

    def calls(node: ast.AST) -> Iterator[str]:
        if isinstance(node, ast.If) and re.fullmatch(r"(arguments\.)?(out|file)", _said(node.test)):
            node = ast.Module(node.orelse, [])
        elif isinstance(node, ast.Call) and WRITES.fullmatch(_said(node.func).split(".")[-1]):
            yield _said(node.func)
        for child in ast.iter_child_nodes(node):
            yield from calls(child)

    return list(calls(ast.parse(text)))


def _said(node: ast.AST) -> str:
    return ast.unparse(node)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_every_script_asks_before_it_writes(script: Path) -> None:
    """The script runs once with an option."""
    text = script.read_text()
    assert written_unasked(text) == []
    assert re.search(r"\.savefig\(|\.print_png\(|save_figure\(", text)


def test_the_gate_of_unasked_files_can_fail() -> None:
    assert written_unasked("if out:\n    f.savefig(out)\nelse:\n    f.savefig('x.png')")
    assert written_unasked("Path('x').mkdir()\nif out and more:\n    open('y')") == [
        "Path('x').mkdir",
        "open",
    ]


def test_a_false_claim_is_noticed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    wrong = tmp_path / "servo_axis.py"
    text = SERVO.read_text()
    assert "PAR.T_backward * band" in text
    wrong.write_text(text.replace("PAR.T_backward * band", "0.9 * PAR.T_backward * band"))
    with pytest.raises(AssertionError):
        execute(wrong, monkeypatch)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_examples_end_with_their_claims(script: Path) -> None:
    lines = script.read_text().splitlines()
    assert any(line.lstrip().startswith("assert ") for line in lines[-8:])
    assert len(lines) < 180 if script == SERVO else 40 <= len(lines) <= 90
