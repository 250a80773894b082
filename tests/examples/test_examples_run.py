"""Every example runs as its reader would run it, and writes only where it is told to."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = [ROOT / "examples" / "servo_axis.py", *sorted((ROOT / "examples/gallery").glob("*.py"))]
SERVO = SCRIPTS[0]


def execute(script: Path, monkeypatch: pytest.MonkeyPatch, *arguments: str) -> None:
    monkeypatch.setattr("sys.argv", [str(script), *arguments])
    runpy.run_path(str(script), run_name="__main__")


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_claims_hold_and_nothing_is_written_unasked(
    script: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.chdir(tmp_path)
    execute(script, monkeypatch)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("script", SCRIPTS[1:], ids=lambda script: script.stem)
def test_figure_goes_where_it_is_told(
    script: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    execute(script, monkeypatch, "--out", str(tmp_path / "figures"))
    assert [file.name for file in (tmp_path / "figures").iterdir()] == [f"{script.stem}.png"]


def test_servo_axis_draws_when_asked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    execute(SERVO, monkeypatch, "--plot", str(tmp_path / "axis.png"))
    assert (tmp_path / "axis.png").stat().st_size > 0


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
