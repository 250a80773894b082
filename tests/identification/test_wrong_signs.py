"""A signal with the wrong sign is refused, or fails a check; never does it pass."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from bywire.core.catalog import PARAMETER_SETS, main_set
from bywire.core.errors import ParameterError
from bywire.identification.method import METHODS, Effort


def negated(data: xr.Dataset, name: str) -> xr.Dataset:
    return data.assign({name: (data[name].dims, -data[name].values, data[name].attrs)})


REFUSED = {
    "seal-friction": {"F": "F moves against p", "p": "F moves against p"},
    "friction-model": {
        "friction": "friction moves against speed",
        "speed": "friction moves against speed",
    },
    "cogging": {"i_1": "i_1 moves against q_1", "q_1": "i_1 moves against q_1"},
    "force-calibration": {"y_F": "i_1 - i_2 of the record moves against y_F"},
    "screw-efficiency": {name: "moves against y_F" for name in ("i_1", "i_2", "q_1", "q_2", "y_F")},
}


@pytest.mark.parametrize("name", REFUSED)
def test_signs_that_do_not_fit_together_are_refused(name: str) -> None:
    method = METHODS.all()[name]
    par = PARAMETER_SETS.find(main_set(method.assembly)).parameters() if method.assembly else None
    data = method.synthetic(par, method.defaults, 1)
    assert all(c.holds for c in method.identify(data, par, method.defaults, Effort()).checks)
    for signal, words in REFUSED[name].items():
        with pytest.raises(ParameterError, match=f"{words} .*sign = -1"):
            method.identify(negated(data, signal), par, method.defaults, Effort())


@pytest.mark.parametrize(
    ("name", "signals"),
    [
        ("run-down", ("i_1", "q_1")),
        ("force-calibration", ("i_1", "i_2")),
    ],
)
def test_signs_that_only_the_misfit_shows_fail(name: str, signals: tuple[str, ...]) -> None:
    method = METHODS.all()[name]
    par = PARAMETER_SETS.find(main_set(method.assembly)).parameters()
    data = method.synthetic(par, method.defaults, 1)
    for signal in signals:
        found = method.identify(negated(data, signal), par, method.defaults, Effort())
        assert not all(c.holds for c in found.checks), signal


def test_a_seal_that_drives_is_refused() -> None:
    """Travel that is measured inward: the area is right, and the friction below zero."""
    method = METHODS.all()["seal-friction"]
    data = method.synthetic(None, method.defaults, 1)
    middle = method.defaults.x_low + method.defaults.x_high  # type: ignore[attr-defined]
    with pytest.raises(ParameterError, match=r"F moves against x \(the mean friction is -\S+ N"):
        method.identify(data.assign(x=middle - data["x"]), None, method.defaults, Effort())


def test_a_part_of_the_friction_that_drives_fails() -> None:
    """Viscous friction below zero beside Coulomb friction: the whole still takes up power."""
    t = np.arange(0.0, 8.0, 0.01)
    v = 0.1 * np.sin(np.pi * t)
    F = 20.0 * np.sign(v) - 60.0 * v + 0.1 * np.random.default_rng(1).standard_normal(t.size)
    data = xr.Dataset(
        {"friction": ("time", F, {"units": "N"}), "speed": ("time", v, {"units": "m/s"})},
        {"time": t},
    )
    method = METHODS.all()["friction-model"]
    viscous = method.defaults.replace({"law": "viscous"})
    checks = {c.name: c for c in method.identify(data, None, viscous, Effort()).checks}
    assert checks["misfit_over_friction"].holds
    assert not checks["terms_that_drive"].holds
    assert "d = -60" in checks["terms_that_drive"].note
