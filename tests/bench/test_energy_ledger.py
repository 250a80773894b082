"""The energy balance of a run: it closes, and nothing is counted twice."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from bywire.api.run_sections import energy_table
from bywire.bench.bench import Bench
from bywire.bench.energy_ledger import (
    actuator_ledger,
    deliveries,
    further_ledgers,
    role_attributes,
)
from bywire.bench.ensemble import key_figures_of, simulate_ensemble
from bywire.bench.running import run as run_bench
from bywire.core.signals import Role
from bywire.usecases.run import run
from systems.loading import SPRING_AXIS, loaded

T = np.linspace(0.0, 1.0, 5)


def recording(**energies: float) -> xr.Dataset:
    """Return a recording in which every energy increases linearly from zero."""
    rows = {name: ("time", value * T, {"units": "J"}) for name, value in energies.items()}
    return xr.Dataset(rows, coords={"time": T})


def by_name(postings):
    return {one.name: one.energy for one in postings}


@pytest.fixture(scope="module")
def braking():
    options = {"t_hold": 0.15, "t_low": 0.05, "t_high": 0.05, "pulses": 1}
    return run(Bench("moment-pulses", "roberts2003", options=options))


def test_books_of_both_brakes_close(braking):
    hydraulic = run(Bench("hard-braking", "dardanelli2010", options={"duration": 0.2}))
    for result in (braking, hydraulic):
        for label, books in result.as_object()["energy"].items():
            given, taken = (sum(books[side].values()) for side in ("sources", "sinks"))
            assert given - taken == pytest.approx(books["closing_error"], abs=1e-12)
            assert abs(books["closing_error"]) < 1e-6 * given, label
            assert given > 1.0


def test_disc_gives_what_the_pads_turn_into_heat(braking):
    """Heat is the friction force times the slip: of both pads, one of them moving."""
    one = braking.recordings["run"].sel(time=slice(-1e-9, None))
    books = further_ledgers(one)["with disc"]
    sinks = by_name(books.sinks)
    par = braking.bench.par.flat()
    slip = 2.0 * par["caliper.r_B"] * one["Omega"].values - one["v"].values
    heat = np.trapezoid(par["wedge.mu_B"] * one["F_N"].values * slip, one["time"].values)
    assert sinks["E_pads"] == pytest.approx(heat, rel=1e-3)
    assert sinks["E_pads"] > 100.0 * sinks["E_copper_moving"]


def test_standby_and_both_kinds_of_copper_stand_for_the_whole(braking):
    one = braking.recordings["run"].sel(time=slice(-1e-9, None))
    sinks = by_name(actuator_ledger(one).sinks)
    length = float(one["time"].values[-1] - one["time"].values[0])
    assert sinks["E_standby"] == pytest.approx(
        braking.bench.par.flat()["supply.P_standby"] * length
    )
    copper = float(one["E_copper"].values[-1] - one["E_copper"].values[0])
    assert sinks["E_copper_moving"] + sinks["E_copper_holding"] == pytest.approx(copper)
    assert 0.0 < sinks["E_copper_holding"] < copper
    assert "E_copper" not in sinks


def test_copper_counts_as_holding_while_all_stuck():
    one = recording(E_source=5.0, E_copper=4.0, E_stored=1.0, t_stuck=0.25)
    one["E_copper"].attrs |= role_attributes(Role("sink", "copper", split=True))
    one["t_stuck"].attrs |= role_attributes(Role("standstill"))
    books = actuator_ledger(one)
    sinks = by_name(books.sinks)
    assert sinks["E_copper_holding"] == pytest.approx(1.0)
    assert books.closing_error == pytest.approx(0.0, abs=1e-12)


def test_what_is_missing_and_what_others_call_their_losses():
    one = recording(E_source=5.0, E_clutch=3.0, E_stored=1.0)
    one["E_clutch"].attrs["long_name"] = "slip of the clutch"
    books = actuator_ledger(one)
    assert books.closing_error == pytest.approx(1.0)
    assert [p.label for p in books.sinks] == ["stored", "slip of the clutch"]
    assert further_ledgers(one) == {}
    texts = [[cell.text for cell in row] for row in energy_table(books).rows]
    assert texts[-1] == ["", "closing error", "1 J", "20 %"]


def test_energy_given_back_is_turned_over():
    books = actuator_ledger(recording(E_source=-1.0, E_gear=-0.5, E_stored=-0.5))
    assert books.turnover == pytest.approx(1.0)
    assert books.closing_error == pytest.approx(0.0, abs=1e-12)


def test_a_loss_gives_what_it_loses_of_its_largest_value():
    rows = {
        "E_source": [0.0, 5.0, 5.0],
        "E_friction": [0.0, 3.0, 2.5],
        "E_tyre": [0.0, 2.0, -0.5],
        "E_air": [0.0, -1.0, 1.0],
        "E_stored": [0.0, -4.0, 2.0],
        "W_load": [0.0, -3.0, 0.0],
        "E_alone": [1.0, 1.5, 2.0],
    }
    roles = {
        "E_tyre": Role("sink", "tyre", book="vehicle", returns="taken"),
        "E_air": Role("sink", "air", returns="any"),
        "W_load": Role("sink", "load"),
    }
    made = xr.Dataset(
        {n: ("time", v, role_attributes(roles.get(n))) for n, v in rows.items()},
        {"time": [0.0, 1.0, 2.0]},
    )
    given = {each.name: each.energy for each in deliveries(made)}
    assert given == {"E_friction": 0.5, "E_tyre": 0.5, "E_alone": 0.0}


_ENERGIES = """
    E_source: Annotated[float, Signal("J", "work of the forces")]
    E_friction: Annotated[float, Signal("J", "dry friction")]
    E_damping: Annotated[float, Signal("J", "viscous damping")]
"""
_RECORDED = """
    E_stored: Annotated[float, Signal("J", "stored")]
"""


@pytest.fixture
def axis(tmp_path: Path) -> Iterator[Callable[[str], Bench]]:
    """Return a step of a user's axis with a closed balance, damped or driven by its damping."""
    with ExitStack() as stack:

        def made(sign: str) -> Bench:
            text = SPRING_AXIS.read_text()
            for old, new in {
                "- par.d * x.v)": f"{sign} par.d * x.v)",
                'impulse: Annotated[float, Signal("N*s", "impulse")]': _ENERGIES.strip(),
                'F: Annotated[float, Signal("N", "force", 100.0)]\n\n\ndef': (
                    f'F: Annotated[float, Signal("N", "force", 100.0)]{_ENERGIES}{_RECORDED}\n\ndef'
                ),
                "return Flow(m.F)": "return Flow((m.F - m.F_load) * x.v, -reaction[0] * x.v, "
                f"{'' if sign == '-' else '-'}par.d * x.v * x.v)",
                "return Output(x.x, x.v, m.F)": "return Output(x.x, x.v, m.F, *flow, "
                "0.5 * par.m * x.v * x.v + 0.5 * par.k * x.x * x.x)",
            }.items():
                assert text.count(old) == 1, old
                text = text.replace(old, new)
            name = "damped" if sign == "-" else "driven"
            path = tmp_path / f"{name}.py"
            path.write_text(text.replace("spring-axis", name))
            stack.enter_context(loaded(path))
            options = {"input": "F_set", "output": "x", "duration": 0.05}
            return Bench("step", f"{name}-one", options=options)

        yield made


def of_study(bench: Bench) -> Sequence[str]:
    return key_figures_of([bench] * 5).warnings[4]


def of_ensemble(bench: Bench) -> Sequence[str]:
    return simulate_ensemble(bench, {"F_c": np.full(3, 1.0)}).results[2].warnings


@pytest.mark.parametrize(
    "warned",
    [lambda bench: run_bench(bench).warnings, of_study, of_ensemble],
    ids=["run", "study", "ensemble"],
)
def test_every_run_tells_of_a_loss_that_gives_energy(
    axis: Callable[[str], Bench], warned: Callable[[Bench], Sequence[str]]
) -> None:
    (told,) = warned(axis("+"))
    assert told.startswith("the loss 'viscous damping' (E_damping) delivers ")


def test_no_run_tells_of_a_loss_that_loses(axis: Callable[[str], Bench]) -> None:
    assert run_bench(axis("-")).warnings == []
