"""The truck's brake, loaded for the tests of this folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from systems.loading import loaded

FOLDER = Path(__file__).parents[3] / "examples" / "truck_ebs"


@pytest.fixture(scope="module", autouse=True)
def brake():
    with loaded(FOLDER):
        yield
