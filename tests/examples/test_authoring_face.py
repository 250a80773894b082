"""What a brake is written with: one place to import from, and examples need no deeper one."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from bywire import authoring

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples").rglob("*.py"))
DEEP = re.compile(r"^\s*(?:from|import)\s+bywire\.\w+\.\w+", re.MULTILINE)


@pytest.mark.parametrize("name", authoring.__all__)
def test_every_name_is_there(name: str) -> None:
    assert getattr(authoring, name) is not None


def test_unknown_names_are_refused() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'Brke'"):
        authoring.Brke  # noqa: B018


def test_a_name_loads_its_home_alone() -> None:
    code = (
        "import sys\nfrom bywire.authoring import Brake\n"
        "assert not {'numpy', 'casadi', 'matplotlib'} & set(sys.modules), 'loaded'"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_examples_import_two_levels_deep(file: Path) -> None:
    assert DEEP.findall(file.read_text(encoding="utf-8")) == []
