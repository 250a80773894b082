"""The truck's brake, loaded once for all tests of this folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from systems.loading import loaded

FOLDER = Path(__file__).parents[3] / "examples" / "truck_ebs"


@pytest.fixture(scope="package", autouse=True)
def brake():
    with loaded(FOLDER):
        yield
