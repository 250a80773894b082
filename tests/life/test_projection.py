"""Projection of slow states: Heun's steps against closed forms, and what is between stops."""

from types import SimpleNamespace

import numpy as np
import pytest

from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.life.declaration import Effects, Life, Slow, StopConditions
from bywire.life.life_file import LifePlan
from bywire.life.projection import Rates, projected, standard_error
from bywire.studies.distribution import Distribution
from bywire.studies.plan import Varied
from raising import raises

AIR = StopConditions(pause=60.0, T_air=293.15)
_UNIFORM = Distribution("uniform", "0 to 1", lambda u: u, 0.0, 1.0)


class Nothing(ParameterSet):
    """No parameters of wear."""


def _no_change(z, readings, par, wear):
    return z


def _life(between=_no_change, left=lambda z, par, wear: {"lining": z["h"]}):
    return Life(
        "fake",
        "a pad",
        "none",
        Nothing,
        {},
        {"h": Slow("m", "pad"), "n": Slow("1", "count")},
        {"lining": Slow("m", "lining left")},
        lambda par, wear: {"h": 1.0, "n": 0.0},
        lambda z, par, wear: {},
        lambda *_: Effects({}),
        left,
        (),
        between,
    )


def _plan(life, **changes):
    bench = SimpleNamespace(par=None)
    return LifePlan("fake", life, bench, Nothing(), AIR, **changes)  # type: ignore[arg-type]


@pytest.fixture
def made(monkeypatch):
    """Return a function that sets the wear by a stop, and the slow states it was asked at."""

    def put(wear, readings=lambda z: {}):
        asked = []

        def rates(plan, z):
            asked.append(z)
            return Rates(z, Effects({"h": -np.atleast_1d(wear(z))}, readings(z)))

        monkeypatch.setattr("bywire.life.projection.rates", rates)
        return asked

    return put


def test_constant_wear_ends_where_a_division_says(made):
    made(lambda z: 1.0 / 277.5)
    life = projected(_plan(_life()))
    assert (life.stops, life.ended_by) == (278, "lining")
    assert life.states["h"] == pytest.approx(1.0 - np.arange(279) / 277.5, abs=1e-12)
    assert life.left["lining"][-2] > 0.0 >= life.left["lining"][-1]


def test_wear_that_grows_follows_the_exponential_to_second_order(made):
    rate, b = 1e-4, 2.0  # dh/dN = -a (1 + b (1 - h)): 1 + b (1 - h) = exp(a b N)
    exact = np.log(1.0 + b) / (rate * b)
    errors = []
    for share in (0.4, 0.2, 0.1):
        made(lambda z: rate * (1.0 + b * (1.0 - z["h"])))
        errors.append(abs(projected(_plan(_life(), share=share, tolerance=0.5)).stops - exact))
    assert errors[2] / exact < 5e-3
    assert errors[0] / errors[1] > 3.0
    assert errors[1] / errors[2] > 3.0
    made(lambda z: rate * (1.0 + b * (1.0 - z["h"])))
    assert projected(_plan(_life())).stops == pytest.approx(exact, rel=1e-3)


def test_steps_are_as_short_as_the_change_of_the_rate_wants(made):
    def cliff(z):
        return 1e-3 if z["h"] > 0.5 else 4e-3

    made(cliff)
    exact = 500 + 125
    assert projected(_plan(_life(), share=0.3, tolerance=0.02)).stops == pytest.approx(exact, abs=3)
    asked = made(lambda z: 1e-3)
    assert projected(_plan(_life(), share=0.5)).stops == 1000
    assert len(asked) < 10


def test_a_step_covers_no_more_than_its_share_of_what_remains(made):
    made(lambda z: 1e-3)
    life = projected(_plan(_life()))
    for step in life.steps:
        assert step.count <= max(np.ceil(0.05 * (1000 - step.first)), 20)
    assert sum(step.count for step in life.steps) == life.stops


def test_what_happens_between_stops_is_never_skipped(made):
    def refilled(z, readings, par, wear):
        gone = z["h"] < 0.245
        return {"h": z["h"] + 0.5 * gone, "n": z["n"] + 1.0 * gone}

    def left(z, par, wear):
        return {"lining": 30.0 - z["n"]}

    asked = made(lambda z: 0.01)
    life = projected(_plan(_life(refilled, left), share=0.5, tolerance=0.5))
    # 76 stops to the first, 50 between
    assert np.flatnonzero(np.diff(life.states["n"]))[:3].tolist() == [75, 125, 175]
    assert life.stops == 76 + 29 * 50
    assert len(asked) < 12


def test_readings_go_from_one_end_of_a_step_to_the_other(made):
    def noted(z, readings, par, wear):
        return {**z, "n": readings["h_seen"]}

    made(lambda z: 1e-3, readings=lambda z: {"h_seen": z["h"]})
    life = projected(_plan(_life(noted)))
    assert np.abs(life.states["n"][1:] - life.states["h"][1:]).max() < 1e-9


def test_a_life_without_an_end_is_followed_as_long_as_asked(made):
    made(lambda z: 0.0)
    life = projected(_plan(_life(), longest=500))
    assert (life.stops, life.ended_by) == (500, "")
    assert np.isnan(life.error)


def test_a_brake_at_its_end_is_refused(made):
    made(lambda z: 1e-3)
    with raises(ParameterError, name="lining left", value="0 mm", valid="> 0"):
        projected(_plan(_life(left=lambda z, par, wear: {"lining": 0.0})))


def test_the_interval_is_that_of_the_rate(made):
    varied = (Varied("options.v_0", "m/s", 1.0, _UNIFORM), Varied("other", "1", 1.0, _UNIFORM))
    plan = _plan(_life(), varied=varied, stops=64)
    wear = 1e-3 * (1.0 + plan.population["options.v_0"] * plan.population["other"])
    made(lambda z: wear)
    life = projected(plan)
    relative = standard_error(plan, wear) / np.mean(wear)
    assert life.error == pytest.approx(1.998 * relative * life.stops, rel=0.01)


def test_the_standard_error_covers_the_spread_over_samples():
    varied = (Varied("a", "1", 1.0, _UNIFORM), Varied("b", "1", 1.0, _UNIFORM))
    means, told, plain = [], [], []
    for seed in range(200):
        plan = _plan(_life(), varied=varied, stops=32, seed=seed)
        a, b = plan.population["a"], plan.population["b"]
        wear = a**2 + 0.3 * a * b
        means.append(np.mean(wear))
        told.append(standard_error(plan, wear))
        plain.append(np.std(wear, ddof=1) / 32**0.5)
    assert np.std(means) < np.mean(told) < 0.4 * np.mean(plain)
