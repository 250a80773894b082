"""The same brake twice in one vehicle: each gives exactly the numbers of a single brake."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import bywire
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.assembly import Assembly
from bywire.core.parameters import ParameterSet
from bywire.core.parts import Sub
from bywire.simulation.program import check_model


class BothParameters(ParameterSet):
    """Two brakes."""

    front: MotorcycleParameters
    rear: MotorcycleParameters


class Both(Assembly[BothParameters, Any]):
    """Front and rear of the same type, without a connection."""

    name = "both"
    front = Sub(MotorcycleBrake, prefix="front_")
    rear = Sub(MotorcycleBrake, prefix="rear_", feeds={"p_set": "front_p_meas"})


@pytest.mark.parametrize("mode", ["pressure", "current-source"])
def test_equations_frictions_limits_contacts_and_ticks_are_those_of_one(mode):
    alone, model = MotorcycleBrake(), Both()
    front = bywire.parameters("dardanelli2010").replace({"drive.mode": mode})
    rear = bywire.parameters("dardanelli2010-retuned").replace({"piston.law": "sticking"})
    par = BothParameters(front=front, rear=rear)
    check_model(model, par)
    assert Both.frictions == ("front_omega", "rear_omega")
    assert Both.limits == ("front_p_mc", "rear_p_mc")
    rng = np.random.default_rng(2)
    x, xe, rate, m, u, flow = (
        kind._make((1.0 + rng.random(len(kind._fields))).tolist())
        for kind in (Both.State, Both.State, Both.State, Both.Memory, Both.Stimulus, Both.Flow)
    )
    contact, reaction = (3.0, 0.0, 0.0, 5.0, 1e-6, 0.0), (0.1, -0.2, 1e-7, 2e-7)
    tasks = model.tasks(par)
    assert len(tasks) == 2
    rows = {
        "State": [model.mass(xe, par), model.balance(x, xe, m, par, contact)],
        "Flow": [model.powers(x, xe, rate, m, par, contact, reaction)],
        "Output": [model.output(x, m, par, contact, reaction, flow)],
    }
    bounds, gaps = model.bounds(x, xe, m, par, contact), model.gap(x, xe, par)
    groups = {"front": slice(0, 4), "rear": slice(4, 8)}
    of_contact = {"front": slice(0, 2), "rear": slice(2, 6)}
    for k, (sub, its) in enumerate(((Both.front, front), (Both.rear, rear))):
        own = {"State": x, "Memory": m, "Flow": flow}
        own = {kind: sub.inside(kind, values) for kind, values in own.items()}
        own_e, own_rate = (sub.inside("State", each) for each in (xe, rate))
        pressed = contact[of_contact[sub.name]]
        reacting = (reaction[k], reaction[2 + k])
        wanted = {
            "State": [
                alone.mass(own_e, its),
                alone.balance(own["State"], own_e, own["Memory"], its, pressed),
            ],
            "Flow": [
                alone.powers(own["State"], own_e, own_rate, own["Memory"], its, pressed, reacting)
            ],
            "Output": [
                alone.output(own["State"], own["Memory"], its, pressed, reacting, own["Flow"])
            ],
        }
        for kind, each in rows.items():
            assert [sub.inside(kind, row) for row in each] == wanted[kind]
        assert bounds[k] == alone.bounds(own["State"], own_e, own["Memory"], its, pressed)[0]
        assert gaps[groups[sub.name]] == alone.gap(own["State"], own_e, its)
        (task,) = alone.tasks(its)
        names = MotorcycleBrake.Stimulus._fields
        given = MotorcycleBrake.Stimulus(
            *(
                m.front_p_meas if name in sub.feeds else getattr(u, sub.named(name))
                for name in names
            )
        )
        after = tasks[k].tick(x, m, u, par)
        assert sub.inside("Memory", after) == task.tick(own["State"], own["Memory"], given, its)
        other = Both.rear if sub is Both.front else Both.front
        assert other.inside("Memory", after) == other.inside("Memory", m)
