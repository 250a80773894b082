"""The friction law that a record was made with is chosen, and its parameters come back."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from bywire.core.errors import ParameterError
from bywire.identification.measured import split
from bywire.identification.method import Effort
from bywire.identification.methods.friction_model import LAWS, METHOD, Options
from bywire.identification.model_choice import choose
from bywire.identification.trust import trust

MADE: Mapping[str, Mapping[str, float]] = {
    "coulomb": {"f": 0.0, "d": 0.0, "k": 1.0},
    "viscous": {"f": 0.0, "k": 1.0},
    "asymmetric": {"F_n": 24.0, "f": 0.0, "k": 1.0},
    "pressure": {"k": 1.0},
    "stribeck": {"f": 0.0},
    "stribeck-asymmetric": {"F_n": 24.0, "f": 0.0},
    "stribeck-pressure": {},
}
SEEDS = (1, 2, 3)
SHORT = METHOD.defaults.replace({"duration": 4.0, "interval": 0.02})


def options_for(law: str) -> Options:
    return SHORT.replace({f"truth.{name}": v for name, v in MADE[law].items()})


def chosen(options: Options, seed: int) -> str:
    data = METHOD.synthetic(None, options, seed)
    return next(iter(METHOD.identify(data, None, options, Effort()).estimates))


@pytest.mark.parametrize(("law", "seed"), [("asymmetric", 1), ("pressure", 2), ("stribeck", 1)])
def test_the_law_that_made_the_record_is_chosen(law: str, seed: int) -> None:
    assert chosen(options_for(law), seed) == law


@pytest.mark.trust
@pytest.mark.parametrize("law", MADE)
def test_laws_are_chosen_from_noise_to_noise(law: str) -> None:
    """Never a simpler one; now and then the noise makes a richer one look better."""
    names = [one.name for one in LAWS]
    found = [chosen(options_for(law), seed) for seed in SEEDS]
    assert sum(name == law for name in found) >= 2
    assert all(names.index(name) >= names.index(law) for name in found)


def test_training_error_alone_would_take_the_richest() -> None:
    options = options_for("coulomb").replace({"pressures": (5e5,), "interval": 0.01})
    data = split(METHOD.synthetic(None, options, 1))
    plain = [law.candidate() for law in LAWS if not law.pressure]
    one = next(iter(data.values())).isel(time=slice(3, None))
    found = choose(plain, {"one": one}, "friction")
    training = [j.training_error for j in found.judged]
    assert np.argmin(training) == len(plain) - 1
    assert found.chosen.candidate.name == "coulomb"
    assert found.chosen.bic == min(j.bic for j in found.judged)
    assert found.held_out == "blocks of 1 record, a fifth at a time"


def test_parameters_come_back() -> None:
    found = trust(METHOD, None, SHORT.replace({"law": "stribeck-pressure"}), range(50, 60))
    assert {r.label for r in found.recovered} == {"F_c", "f", "d", "k", "v_s"}
    assert found.holds, found.recovered


def test_a_wrong_law_is_found_out() -> None:
    data = METHOD.synthetic(None, METHOD.defaults, 1)
    wrong = METHOD.defaults.replace({"law": "viscous"})
    checks = {c.name: c for c in METHOD.identify(data, None, wrong, Effort()).checks}
    assert not checks["misfit_over_friction"].holds
    right = {c.name: c for c in METHOD.identify(data, None, METHOD.defaults, Effort()).checks}
    assert all(c.holds for c in right.values())


def test_too_little_is_refused() -> None:
    data = METHOD.synthetic(None, METHOD.defaults, 1)
    one_way = data.assign(speed=np.abs(data["speed"]), friction=np.abs(data["friction"]))
    with pytest.raises(ParameterError, match="sliding backward"):
        METHOD.identify(one_way, None, METHOD.defaults, Effort())
    with_pressure = METHOD.defaults.replace({"law": "pressure"})
    with pytest.raises(ParameterError, match="needs a measured pressure"):
        METHOD.identify(data.drop_vars("pressure"), None, with_pressure, Effort())


def test_motion_one_way_is_refused_with_its_count() -> None:
    data = METHOD.synthetic(None, SHORT, 1)
    back = np.flatnonzero(data["speed"].values < 0.0)
    one_way = data.isel(time=np.setdiff1d(np.arange(data.sizes["time"]), back[7:]))
    with pytest.raises(
        ParameterError, match=r"backward \(\d{3} forward, 7 back.* in both directions"
    ):
        METHOD.identify(one_way, None, SHORT, Effort())
    lost = data.assign(friction=data["friction"] * np.nan)
    with pytest.raises(ParameterError, match="sliding forward and backward"):
        METHOD.identify(lost, None, SHORT, Effort())
