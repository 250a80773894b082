"""Seal friction over pressure: simulated strokes, and a measured O-ring."""

from __future__ import annotations

from pathlib import Path

import pytest

from bywire.core.errors import ParameterError
from bywire.identification.measured import measured
from bywire.identification.method import Effort
from bywire.identification.methods.seal_friction import METHOD
from bywire.identification.records import joined, split
from bywire.identification.trust import trust

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


def test_one_pressure_or_no_stroke_is_refused() -> None:
    parts = split(METHOD.synthetic(None, METHOD.defaults, 1))
    alone = joined({"a": parts["level_0"], "b": parts["level_0"]})
    with pytest.raises(ParameterError, match=r"f cannot be told from F_0: .* bar; give"):
        METHOD.identify(alone, None, METHOD.defaults, Effort())
    still = METHOD.defaults.replace({"x_low": 0.1, "x_high": 0.2})
    with pytest.raises(ParameterError, match="no stroke crosses"):
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
