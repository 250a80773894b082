"""Key figures of a user's brake, as shown in docs/modeling.md, in Python and in C."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import bywire
from bywire.bench.kpis.families import FAMILIES, evaluate, evaluate_cases
from bywire.bench.recording import Rows
from bywire.core.errors import ModelError
from raising import raises
from systems.loading import loaded

PAGE = Path(__file__).parents[3] / "docs" / "modeling.md"
BRAKE = """from bywire.core.brake import Brake

BRAKE = Brake("swung", "a brake", __name__)
"""


def written(folder: Path, family: str, name: str = "swung") -> Path:
    """Return the folder of a brake with key figures; loaded brakes are cached by name."""
    package = folder / name
    (package / "kpis").mkdir(parents=True)
    (package / "__init__.py").write_text(BRAKE)
    (package / "kpis" / "__init__.py").write_text("")
    (package / "kpis" / "swinging.py").write_text(family)
    return package


def example() -> str:
    """Return the file shown on the page."""
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    (text,) = (block for block in blocks if "swing_period" in block)
    return str(text)


def test_the_example_of_the_page_gives_its_figures_of_one_run_and_of_many(tmp_path):
    t = np.linspace(0.0, 1.0, 1001)
    y = np.stack([np.sin(2.0 * np.pi * f * t + 0.1) for f in (5.0, 8.0, 0.2)])
    rows = Rows(t, {"x": y}, {"x": {"units": "m"}})
    with loaded(written(tmp_path, example())):
        setting = FAMILIES.find("swinging").setting_class("x")
        together = evaluate_cases("swinging", rows, [setting] * 3)
        for k in range(3):
            alone = evaluate("swinging", rows.case(k), setting)
            assert {name: each.case(k) for name, each in together.items()} == alone
    assert together["passages"].values.tolist() == [10.0, 16.0, 0.0]
    assert together["swing_period"].values[:2] == pytest.approx([0.2, 0.125], abs=1e-3)
    slow = together["swing_period"].case(2)
    assert (slow.note, slow.unit, slow.is_open) == ("does not pass 0 m upward twice", "s", True)


def test_what_cannot_be_translated_is_refused_when_the_brake_is_loaded(tmp_path):
    wrong = example().replace("count += 1", "count += 2**k")
    line = 1 + wrong[: wrong.index("2**k")].count("\n")
    sentence = f"swinging.py, line {line}, in passages: .*`2 \\*\\* k`"
    with loaded(written(tmp_path, wrong, "swung_wrongly")):
        with pytest.raises(ModelError, match=sentence):
            FAMILIES.find("swinging")
        with pytest.raises(ModelError, match=sentence):  # even if no experiment requests it
            bywire.check("swung")


def test_key_figures_without_setting_are_refused(tmp_path):
    wrong = example().replace("class Setting", "class Other").replace(": Setting", ": object")
    with (
        loaded(written(tmp_path, wrong, "swung_bare")),
        raises(ModelError, name="Setting"),
    ):
        FAMILIES.find("swinging")
