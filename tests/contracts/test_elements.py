"""All elements and control laws meet all contracts, and none is overlooked."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import pytest

import bywire
from bywire.contracts.element_contracts import demands_on
from bywire.contracts.elements import LAWS, every_element
from bywire.core import registry
from bywire.core.registry import Kind

ELEMENTS = every_element()


@pytest.mark.parametrize("name", ELEMENTS)
def test_element_keeps_its_contracts(name: str) -> None:
    findings = [demand.settle() for demand in demands_on(ELEMENTS[name])]
    assert findings
    assert [str(f) for f in findings if f.outcome != "holds"] == []


def test_a_name_may_have_hyphens() -> None:
    assert bywire.check("pressure-sensor").findings == bywire.check("pressure_sensor").findings


def test_no_element_is_overlooked() -> None:
    package = Path(bywire.__path__[0])
    folders = [package / "plant", package / "control"]
    folders += [f for kind in ("elements", "laws") for f in package.glob(f"brakes/*/{kind}")]
    files = {path for folder in folders for path in folder.glob("*.py")}
    files = {path for path in files if path.stem != "__init__"}
    assert len(folders) >= 4
    assert {Path(e.module.__file__ or "") for e in ELEMENTS.values()} == files


def test_new_file_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = ModuleType("some_elements")
    package.__path__ = [str(tmp_path)]
    (tmp_path / "new_element.py").write_text("def output(x):\n    return x\n", encoding="utf-8")
    monkeypatch.setitem(sys.modules, package.__name__, package)
    monkeypatch.delitem(sys.modules, "some_elements.new_element", raising=False)
    monkeypatch.setattr(registry, "_KINDS", [*registry._KINDS])  # the new kind is forgotten
    (element,) = Kind("element", (), LAWS.read, "some_elements").all().values()
    assert list(element.functions) == ["output"]
    refused = [demand.settle() for demand in demands_on(element)]
    assert {f.outcome for f in refused} == {"broken"}
    assert all("['x', 'return']" in f.text for f in refused)
