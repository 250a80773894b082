"""Life of the wedge brake's pads, by stops of the whole brake."""

import numpy as np
import pytest

import bywire
from bywire.bench.ensemble import changed, key_figures_of
from bywire.brakes.wedge.life import WEDGE_PADS
from bywire.life.life_file import read_life
from bywire.life.projection import one_by_one, projected

ALIKE = {"wear.mechanism": "none", "stop.pause": "1 h"}
MIX = """
life = "wedge-pads"
[set]
options.t_hold = "8 s"
options.M_brake = "800 N*m"
[vary]
"options.v_0".kind = "discrete"
"options.v_0".values = ["50 km/h", "100 km/h", "150 km/h"]
"options.v_0".weights = [70, 25, 5]
"stop.pause" = { kind = "log-normal", median = "120 s", sd = "80 %" }
[projection]
stops = 8
"""


@pytest.fixture(scope="module")
def life():
    return bywire.project_life("wedge-pads", ALIKE)


def test_without_an_adjuster_the_travel_ends_after_280_stops(life):
    made, par = life.projection, bywire.parameters("roberts2003-corner")
    wear = WEDGE_PADS.defaults()
    # The closed form: 0.348 mm of wear for both pads, 1.25 um a stop, 278 stops.
    assert made.left["travel"][0] == pytest.approx(0.348021e-3, rel=1e-5)
    energy = 0.5 * par.corner.body.m * (100.0 / 3.6) ** 2
    each = 2.0 * energy * wear.pads.kappa_0 / (2.0 * wear.pads.A_pad)
    assert int(made.left["travel"][0] / each) == 278
    # The wheel's energy, tires that slip, and a caliper that gets stiffer change it by 1 %.
    assert (made.ended_by, made.error) == ("travel", 0.0)
    assert made.stops == pytest.approx(278, abs=3)
    assert made.states["work"][-1] / made.stops == pytest.approx(energy, rel=0.02)


def test_the_wedge_stands_on_its_end_stop_where_the_travel_ends(life):
    made = life.projection
    plan, z = made.plan, {name: float(path[-1]) for name, path in made.states.items()}
    bench = bywire.Bench(
        "corner-stop",
        "roberts2003-corner",
        options={"M_brake": 950.0, "v_0": 100 / 3.6, "t_hold": 1.0, "t_end": 0.01},
    )
    pushed = []
    for more in (-30e-6, 30e-6):
        worn = {**z, "clearance": z["clearance"] + more}
        made = changed(bench, plan.life.follows(worn, plan.bench.par, plan.wear))
        pushed.append(float(bywire.run(made, estimate_error=False).recording["F_end"].max()))
    assert pushed[0] == 0.0
    assert pushed[1] > 500.0


def test_the_way_to_contact_is_the_clearance(life):
    plan = life.projection.plan
    benches = [changed(plan.bench, {"caliper.clearance": c}) for c in (0.2e-3, 0.35e-3)]
    angles = {k.name: k.values for k in key_figures_of(benches).figures}["contact_angle"]
    seen = np.diff(angles)[0] * plan.bench.par.screw.lead / (2 * np.pi)
    assert seen * np.tan(plan.bench.par.wedge.alpha) == pytest.approx(0.15e-3, abs=6e-6)


@pytest.mark.parametrize(
    ("lining", "wanted"),
    [
        ("2.1 mm", 2),
        *(
            pytest.param(f"{mm} mm", clicks, marks=pytest.mark.trust)
            for mm, clicks in ((2.5, 12), (3.25, 31), (4.5, 62))
        ),
    ],
)
def test_the_adjuster_clicks_for_every_tooth_of_wear(lining, wanted):
    made = bywire.project_life("wedge-pads", {"wear.h_new": lining, "stop.pause": "1 h"})
    clicks = made.projection.states["clicks"]
    assert made.projection.ended_by == "lining"
    assert clicks[-1] == pytest.approx(wanted, abs=1)
    assert set(np.diff(clicks)) == {0.0, 1.0}
    clearance = made.projection.states["clearance"]
    assert clearance.max() < 0.31e-3
    assert clearance.min() >= 0.2e-3 - 8e-6  # as well as the moment control knows its contact


@pytest.mark.trust
@pytest.mark.parametrize(("mechanism", "clearance"), [("none", "0.2 mm"), ("teeth", "0.285 mm")])
def test_two_hundred_stops_one_by_one_confirm_the_projection(tmp_path, mechanism, clearance):
    file = tmp_path / "mix.toml"
    file.write_text(MIX)
    plan = read_life(file, {"wear.mechanism": mechanism, "caliper.clearance": clearance})
    made, truth = projected(plan), one_by_one(plan, 200)
    for name in ("h_pad", "clearance", "work"):
        change = made.states[name][200] - made.states[name][0]
        assert change == pytest.approx(truth[name][200] - truth[name][0], rel=0.01)
    assert made.states["clicks"][200] == truth["clicks"][200]
    assert (truth["clicks"][200] > 0) == (mechanism == "teeth")


def test_some_stops_one_by_one_confirm_the_projection(tmp_path):
    file = tmp_path / "mix.toml"
    file.write_text(
        MIX.replace('t_hold = "8 s"', 't_hold = "3 s"')
        .replace("150 km/h", "60 km/h")
        .replace("100 km/h", "40 km/h")
        + 'share = "50 %"\n'
    )
    made = bywire.project_life(file, {"wear.mechanism": "none"}, check=8)
    assert abs(made.deviation("h_pad")) < 0.01
    assert abs(made.deviation("work")) < 0.01
