"""Tests of the brake starter, which passes every contract and reaches its clamp force."""

from __future__ import annotations

from pathlib import Path

import pytest
import xarray as xr

import bywire
from bywire import load_system
from bywire.core import brake

PACKAGE = Path(__file__).parents[1] / "src" / "bywire.template.starter"


@pytest.fixture(autouse=True, scope="module")
def known() -> None:
    """Register the brake, even if it is not installed."""
    if "starter" not in brake.brakes():
        load_system(PACKAGE)


@pytest.fixture(scope="module")
def recording() -> xr.Dataset:
    """Return the recording of a brake application."""
    return bywire.run("starter-clamp").recordings["run"]


def test_every_contract_holds() -> None:
    """Pass all checks of ``bywire check``."""
    check = bywire.check("starter")
    assert check.holds, "\n".join(map(str, check.broken))


def test_demanded_force_is_reached(recording: xr.Dataset) -> None:
    """Reach the demanded clamp force within 1 %."""
    assert float(recording["F"].sel(time=0.59, method="nearest")) == pytest.approx(15e3, rel=0.01)


def test_release_opens(recording: xr.Dataset) -> None:
    """Release the disc."""
    assert float(recording["F"][-1]) < 100.0


def test_loop_has_margins() -> None:
    """Have a phase margin of at least 45 degrees at every usual operating point."""
    assert bywire.margins("starter-force").holds
