"""Seal friction per unit pressure: simulated strokes, and a measured O-ring."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from bywire.core.errors import ParameterError
from bywire.identification.confidence import uncertainty
from bywire.identification.measured import joined, measured, split
from bywire.identification.method import Effort
from bywire.identification.methods.seal_friction import METHOD, velocity
from bywire.identification.trust import trust
from raising import raises

MEASURED = Path(__file__).parents[4] / "shared" / "data" / "seal_friction"
MAP = """time = { column = "1", unit = "ms" }
[signals.x]
column = "5"
unit = "mm"
[signals.p]
column = "6"
unit = "bar"
[signals.F]
column = "7"
unit = "N"
"""


def test_what_is_put_in_comes_back() -> None:
    found = trust(METHOD, None, METHOD.defaults, range(20, 45))
    assert {r.label for r in found.recovered} == {"A", "F_0", "f"}
    assert found.holds, found.recovered


def test_friction_that_grows_otherwise_is_found_out() -> None:
    """A friction with a step in the pressure is no line, and the check says so."""
    data = METHOD.synthetic(None, METHOD.defaults, 1)
    sign = (data["x"].diff("time") > 0).reindex(time=data["time"], fill_value=True) * 2.0 - 1.0
    middle = (data["p"] > 4e5) & (data["p"] < 6e5)
    bent = data.assign(F=data["F"] + 4.0 * sign * middle)
    checks = {c.name: c for c in METHOD.identify(bent, None, METHOD.defaults, Effort()).checks}
    assert not checks["misfit_over_friction"].holds


def test_a_zero_of_the_sensor_is_found() -> None:
    data = METHOD.synthetic(None, METHOD.defaults, 3)
    shifted = data.assign(F=data["F"] + 25.0)
    free = METHOD.defaults.replace({"zero": "free"})
    found = METHOD.identify(shifted, None, free, Effort()).estimates["seal friction"]
    k = found.names.index("F_off")
    low, high = found.intervals(0.999)[k]
    assert low < 25.0 < high


def notes(data: xr.Dataset, **options: object) -> str:
    chosen = METHOD.defaults.replace(options)
    return "\n".join(METHOD.identify(data, None, chosen, Effort()).notes)


def test_the_record_that_does_not_fit_and_a_drift_are_named() -> None:
    data = METHOD.synthetic(None, METHOD.defaults, 1)
    assert "from the fit to all other" not in notes(data)
    assert "drifts" not in notes(data)
    third = data["record"] == 2.0
    said = notes(data.assign(F=data["F"] + 8.0 * third))
    assert "level_2 deviates by" in said
    assert said.count("from the fit to all other") == 1
    slow = (data["time"] - data["time"].where(third).min()) / 40.0
    drift = data.assign(F=data["F"] + 5.0 * third * slow)
    assert "level_2 outward: the force drifts by" in notes(drift)


def test_a_value_that_may_be_nothing_is_marked() -> None:
    flat = METHOD.defaults.replace({"truth.f": 1e-7})
    assert "f is " in notes(METHOD.synthetic(None, flat, 1))
    assert "it may be zero" not in notes(METHOD.synthetic(None, METHOD.defaults, 1))


@pytest.mark.parametrize(("signal", "factor"), [("p", 0.0689476), ("F", 1000.0)])
def test_a_known_bore_shows_a_wrong_unit(signal: str, factor: float) -> None:
    """Psi taken for bar, kN taken for N."""
    data = METHOD.synthetic(None, METHOD.defaults, 1)
    chosen = METHOD.defaults.replace({"bore": 2.0 * (4.9e-4 / np.pi) ** 0.5})
    wrong = data.assign({signal: data[signal] / factor})
    for record, holds in ((data, True), (wrong, False)):
        result = METHOD.identify(record, None, chosen, Effort())
        (check,) = (c for c in result.checks if c.name == "area_off_bore")
        assert check.holds is holds
    assert "cannot check the units of pressure and force" in notes(data)
    assert "not checked" not in notes(data, bore=chosen.bore)


def test_force_is_shown_over_travel() -> None:
    result = METHOD.identify(
        METHOD.synthetic(None, METHOD.defaults, 1), None, METHOD.defaults, Effort()
    )
    loops = next(curve for curve in result.curves if curve.name == "loops")
    there = np.isfinite(loops.data["measured"].values)
    x = loops.data["x"].values[there]
    assert METHOD.defaults.x_low < x.min() < x.max() < METHOD.defaults.x_high
    off = loops.data["measured"].values[there] - loops.data["modeled"].values[there]
    assert np.sqrt(np.mean(off**2)) < 1.0


def test_one_pressure_or_no_stroke_is_refused() -> None:
    parts = split(METHOD.synthetic(None, METHOD.defaults, 1))
    alone = joined({"a": parts["level_0"], "b": parts["level_0"]})
    with raises(ParameterError, name="f"):
        METHOD.identify(alone, None, METHOD.defaults, Effort())
    still = METHOD.defaults.replace({"x_low": 0.1, "x_high": 0.2})
    with pytest.raises(ParameterError, match="no stroke covers the range"):
        METHOD.identify(parts["level_0"], None, still, Effort())


@pytest.mark.skipif(not MEASURED.is_dir(), reason="the measured data lies elsewhere")
def test_measured_o_ring(tmp_path: Path) -> None:
    """The loop's half width is 4.8 N + 0.87 N/bar; friction is less by what the pressure adds."""
    mapping = tmp_path / "map.toml"
    mapping.write_text(MAP)
    data = measured(sorted(MEASURED.glob("*.csv")), mapping, METHOD.signals, gaps=True).data
    result = METHOD.identify(data, None, METHOD.defaults, Effort())
    figures = {name: value for name, (value, _) in result.figures.items()}
    assert figures["loop_half_width_at_0"] == pytest.approx(4.8, abs=0.1)
    assert figures["loop_half_width_over_pressure"] * 1e5 == pytest.approx(0.87, abs=0.01)
    assert 49.1 < figures["force_over_pressure"] * 1e5 < 49.7
    found = result.estimates["seal friction"]
    # F_over_p times half of the difference in pressure is what the loop shows too much.
    between = 0.5 * figures["pressure_between_directions"] * figures["force_over_pressure"]
    assert found["F_0"] + found["f"] * 4e5 == pytest.approx(4.8 + 0.87 * 4.0 - between, abs=0.15)
    low, high = found.intervals()[found.names.index("f")] * 1e5
    assert 0.3 < low < high < 1.0


@pytest.mark.skipif(not MEASURED.is_dir(), reason="the measured data lies elsewhere")
@pytest.mark.parametrize("pressure", [1, 3, 5, 7])
def test_intervals_hold_for_blocks_of_measured_friction(pressure: int, tmp_path: Path) -> None:
    """What is claimed of a whole record is how far it moves without one of its blocks.

    Of short and long blocks, those that move it most count. White residuals would claim a tenth.
    """
    mapping = tmp_path / "map.toml"
    mapping.write_text(MAP)
    file = MEASURED / f"O-ring_{pressure}bar.csv"
    record = measured([file], mapping, METHOD.signals, gaps=True).data
    x, p, F = (record[name].values for name in ("x", "p", "F"))
    v = velocity(x, 0.01, 5.0)
    slides = np.isfinite(F) & np.isfinite(p) & (np.abs(v) > 5e-3) & (x > 5e-3) & (x < 30e-3)
    W, y = np.column_stack((p / 1e5, np.sign(v)))[slides], F[slides]

    def scatter(blocks: int) -> float:
        """Return the standard error by the jackknife over blocks of the record."""
        all_rows = np.arange(y.size)
        kept = [np.delete(all_rows, block) for block in np.array_split(all_rows, blocks)]
        found = [np.linalg.lstsq(W[rows], y[rows], rcond=None)[0][1] for rows in kept]
        return float(np.sqrt(blocks - 1) * np.std(found))

    values = np.linalg.lstsq(W, y, rcond=None)[0]
    claimed = float(np.sqrt(uncertainty(W, W @ values - y).covariance[1, 1]))
    assert 0.6 < claimed / max(map(scatter, (8, 12, 16, 24, 32, 48))) < 1.4
