"""The published studies of trust are what today's code gives: their first experiments, anew."""

from __future__ import annotations

import json
import runpy
from pathlib import Path
from typing import Any

import pytest

from bywire.cli.main import main

ROOT = Path(__file__).parents[2]
STUDIES = runpy.run_path(str(ROOT / "tasks.py"))["STUDIES"]


@pytest.mark.trust
@pytest.mark.parametrize("label", STUDIES)
def test_first_experiments_are_those_published(
    label: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the last published digit but one: other processors round otherwise."""
    monkeypatch.setattr(
        "sys.argv", ["bywire", "identify", *STUDIES[label], "--study", "2", "--out", str(tmp_path)]
    )
    with pytest.raises(SystemExit):
        main()
    made: dict[str, Any] = json.loads((tmp_path / "study.json").read_text())
    published = json.loads((ROOT / "docs" / "trust" / f"{label}.json").read_text())
    assert made["options"] == published["options"]
    for row, experiment in zip(published["experiments"][:2], made["experiments"], strict=True):
        assert row[0] == experiment["seed"]
        expected = dict(zip(published["columns"][1:], map(float, row[1:]), strict=True))
        values = {label: experiment["values"][label] for label in expected}
        assert values == pytest.approx(expected, rel=1e-5)
