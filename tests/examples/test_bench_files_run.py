"""Every bench file of the repository runs and meets its own requirements."""

from __future__ import annotations

from pathlib import Path

import pytest

import bywire
from bywire.core.errors import FileError

BENCHES = Path(__file__).parents[2] / "benches"
FILES = sorted(BENCHES.glob("*.toml"))
ELSEWHERE = {"rider_trace", "wet_stop", "wet_stop_mixed"}
"""run and judged by the tests of the two-wheeler as well"""
LONG = {"repeated_stops"}
"""twenty stops, of which those tests make a few"""


TRUE = {"corner_wet_stop": "the current limit of 20 A was reached at t = 3.7"}
"""warnings that are right: there, motors push against a wheel that stands, after the stop"""


@pytest.mark.trust
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_requirements_hold_whatever_the_step(file: Path) -> None:
    assert all(verdict.met for verdict in bywire.run(bywire.load(file)).verdicts)


@pytest.mark.parametrize(
    "file",
    [pytest.param(f, marks=pytest.mark.trust) if f.stem in ELSEWHERE | LONG else f for f in FILES],
    ids=lambda file: file.stem,
)
def test_requirements_hold(file: Path) -> None:
    """Of runs in half and double steps, which say the errors of figures, those of two benches."""
    with_errors = file.stem in ("hard_braking", "moment_pulses")
    result = bywire.run(bywire.load(file), estimate_error=with_errors)
    missed = [f"{v.kpi} = {v.value:g} {v.unit}" for v in result.verdicts if not v.met]
    assert not missed
    assert result.verdicts
    expected = ("retracted stop", TRUE.get(file.stem, "retracted stop"))
    unexpected = [text for text in result.warnings if not any(each in text for each in expected)]
    assert not unexpected


def test_the_ride_lies_beside_its_bench(tmp_path: Path) -> None:
    alone = tmp_path / "pedal_tracking.toml"
    alone.write_text((BENCHES / "pedal_tracking.toml").read_text())
    with pytest.raises(FileError, match=r"pedal_ride\.csv"):
        bywire.run(bywire.load(alone))
