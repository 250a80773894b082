"""Friction ramp: figures of a ramp without a loop."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

import bywire
from bywire.bench.kpis.families import evaluate
from bywire.bench.kpis.kpi import Kpi
from bywire.brakes.motorcycle.experiments import friction_ramp


def test_a_loop_without_area_has_no_ratio(monkeypatch: pytest.MonkeyPatch) -> None:
    """If the current is not recorded, the area is exactly zero or a rounding error."""

    def flat(family: str, *given: object) -> dict[str, Kpi]:
        kpis = evaluate(family, *given)
        return {
            name: replace(kpi, value=0.0, note="") if name == "loop_area" else kpi
            for name, kpi in kpis.items()
        }

    monkeypatch.setattr(friction_ramp, "evaluate", flat)
    short = {"options.i_max": "1 A", "options.slope": "20 A/s"}
    ratio = bywire.run("friction-ramp", short, estimate_error=False).kpi("loop_area_ratio")
    assert math.isnan(ratio.value)
    assert "zero" in ratio.note
