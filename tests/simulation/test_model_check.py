"""Errors for mistakes in a user's model use the model's own names."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bywire.core.errors import ModelError
from bywire.simulation.program import check_model
from raising import raises
from systems.nonlinear_drive import PARAMETERS, NonlinearDrive, State
from systems.three_contacts import heart


class IfOnAValue(NonlinearDrive):
    def balance(self, x, xe, m, par, contact):
        return State(m.v, x.omega, 1.0 if x.omega > 0 else -1.0)


class MathOnASymbol(NonlinearDrive):
    def balance(self, x, xe, m, par, contact):
        return State(m.v, x.omega, math.exp(x.omega))


class TooFewRows(NonlinearDrive):
    def balance(self, x, xe, m, par, contact):
        return (m.v, x.omega)


class NoMass(NonlinearDrive):
    def mass(self, xe, par):
        return None


class NoTask(NonlinearDrive):
    def tasks(self, par):
        return ()


class Misspelled(NonlinearDrive):
    frictions = ("omga",)


class BareBounds(NonlinearDrive):
    frictions = ("omega",)

    def bounds(self, x, xe, m, par, contact):
        return (-1.0, 1.0)


class GroupWithoutGap(NonlinearDrive):
    def compliance(self, par):
        return (((1.0,),),)


@pytest.mark.parametrize(
    ("model", "fields"),
    [
        (IfOnAValue, {"name": "balance"}),
        (MathOnASymbol, {"name": "balance"}),
        (TooFewRows, {"name": "balance", "value": "2", "valid": "3"}),
        (NoMass, {"name": "mass", "value": "0", "valid": "3"}),
        (NoTask, {"name": "tasks", "valid": "at least one task"}),
        (Misspelled, {"name": "state", "value": "omga", "valid": "omega"}),
        (BareBounds, {"name": "bounds", "value": "2", "valid": "1"}),
        (GroupWithoutGap, {"name": "gap", "valid": "[1]"}),
    ],
)
def test_mistake_is_named(model: type[NonlinearDrive], fields: dict[str, str]) -> None:
    with raises(ModelError, **fields) as caught:
        check_model(model(), PARAMETERS)
    assert model.name in str(caught.value)


def test_sound_models_pass() -> None:
    check_model(NonlinearDrive(), PARAMETERS)
    run, _ = heart(0.02), None
    check_model(run.model, run.par)
    assert np.isfinite(run.step)
