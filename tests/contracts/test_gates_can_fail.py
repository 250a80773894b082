"""Every contract of an element rejects a seeded mistake."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import pytest

import bywire
from bywire.contracts import element_contracts
from bywire.contracts.elements import functions, parameter_classes
from bywire.contracts.evidence import Contract, Evidence, examine

Gate = Callable[[ModuleType], Evidence]


def on(contract: Contract, name: str) -> Gate:
    """Return the gate of one function of an element."""
    return lambda module: examine(contract, functions(module)[name])


def whole(contract: Contract) -> Gate:
    """Return the gate of a whole element."""
    return lambda module: examine(contract, module)


def parameters(contract: Contract) -> Gate:
    """Return the gate of an element's parameters."""
    return lambda module: examine(contract, parameter_classes(module)[0])


check_energy, check_loss = (
    whole(element_contracts.keeps_energy),
    whole(element_contracts.loses_what_it_says),
)
check_rate_units = whole(element_contracts.has_rates_of_its_states)
check_units, check_SI = element_contracts.has_annotated_units, element_contracts.is_in_SI
check_back_ends, check_jacobian = (
    element_contracts.has_agreeing_back_ends,
    element_contracts.has_its_slopes,
)
check_warnings = whole(element_contracts.warns_at_extremes)
round_trip = parameters(element_contracts.survives_json)
ranges = parameters(element_contracts.keeps_its_ranges)


class Mistake(NamedTuple):
    """A change of an element, and the gate that must detect it."""

    element: str
    right: str
    wrong: str
    gate: Gate
    said: str = ""


CODES = "Field(ge=2, allow_inf_nan=False)"

MISTAKES = {
    "sign of the back EMF": Mistake(
        "plant/dc_motor", "- par.K_e * u.omega)", "+ par.K_e * u.omega)", check_energy
    ),
    "sign of the outflow": Mistake(
        "plant/master_cylinder", "par.A_mc * u.v - u.q", "par.A_mc * u.v + u.q", check_energy
    ),
    "moving input kept quiet": Mistake(
        "plant/master_cylinder", "def input_rate", "def _input_rate", check_energy
    ),
    "no power_in": Mistake("plant/caliper", "def power_in", "def _power_in", check_energy),
    "coefficient of a series": Mistake("plant/caliper", "3.0 * z / 8.0", "z / 8.0", check_energy),
    "sign of the gear loss": Mistake(
        "plant/ball_screw_gear", "(torque - par.J_mot", "(torque + par.J_mot", check_energy
    ),
    "warning between limits": Mistake(
        "plant/pressure_sensor",
        "outside(u.p, par.p_low, par.p_high)",
        "~outside(u.p, par.p_low, par.p_high)",
        check_warnings,
        "row_by_row",
    ),
    "warning about a difference": Mistake(
        "plant/motor_heat",
        "x.T_winding > par.T_most",
        "x.T_winding - x.T_housing > par.T_most",
        check_warnings,
        "row_by_row",
    ),
    "missing half": Mistake("plant/end_stop", "0.5 * par.k_stop", "par.k_stop", check_energy),
    "slip of one spring lost": Mistake(
        "plant/pad_hysteresis", "W_3 * ops.fabs(slip.z_3)", "0.0 * W_3 * slip.z_3", check_energy
    ),
    "width without its stiffness": Mistake(
        "plant/pad_hysteresis", "W_2 / par.k_2, W_3", "W_2 / par.k_1, W_3", check_energy
    ),
    "spring that does not follow": Mistake(
        "plant/pad_hysteresis",
        "Speeds(u.v, u.v, u.v, u.v)",
        "Speeds(u.v, u.v, u.v, -u.v)",
        check_energy,
    ),
    "no width": Mistake(
        "plant/pad_hysteresis", "def slip_width", "def _slip_width", check_energy, "balance, mass"
    ),
    "loss that gives": Mistake("plant/dc_motor", "return par.R_m", "return -par.R_m", check_loss),
    "claim left out": Mistake("plant/dc_motor", "copper loss, >= 0", "copper loss", check_loss),
    "stop that pulls": Mistake(
        "plant/end_stop", "ops.fmax(d.far / c, 0.0)", "d.far / c", check_loss
    ),
    "missing factor": Mistake(
        "plant/pipeline", "/ (A_pl * A_pl)", "/ A_pl", on(check_units, "resistance")
    ),
    "sum of unlike terms": Mistake(
        "plant/dc_motor",
        "par.K_e * u.omega)",
        "par.K_e)",
        on(check_units, "balance"),
        "DimensionError",
    ),
    "unlike branches": Mistake(
        "plant/caliper",
        "(p > p0, s, slope)",
        "(p > p0, s, 1.0)",
        on(check_units, "mass"),
        "DimensionError",
    ),
    "wrong unit of one choice": Mistake(
        "plant/reservoir_port", "G=0.0 * par.G_port", "G=par.x_port", on(check_units, "output")
    ),
    "if on a value": Mistake(
        "plant/seal_friction",
        "ops.where(u.omega > 0, friction.T_p, friction.T_n)",
        "(friction.T_p if u.omega > 0 else friction.T_n)",
        on(check_units, "power_loss"),
        "TypeError",
    ),
    "no unit": Mistake(
        "control/low_pass_2",
        'y: Annotated[float, Signal("A", "filtered current demand", 5.0)])',
        "y: float)",
        on(check_units, "at_rest"),
        "TypeError",
    ),
    "not SI": Mistake("plant/dc_motor", '"A", "motor', '"mA", "motor', on(check_SI, "output")),
    "no rate of the state": Mistake(
        "plant/dc_motor", "Factors(i=par.L_m)", "Factors(i=par.L_m / par.R_m)", check_rate_units
    ),
    "depends on the type": Mistake(
        "control/pressure_pid",
        "i = ops.clip(unlimited",
        "i = unlimited if isinstance(unlimited, float) else ops.clip(unlimited",
        on(check_back_ends, "output"),
    ),
    "floats only": Mistake(
        "plant/seal_friction",
        "ops.fmax(u.p",
        "max(u.p",
        on(check_back_ends, "output"),
        "ValueError",
    ),
    "infinite slope": Mistake(
        "plant/pedal",
        "x = ops.clip((u.force - par.F_preload) / par.k_spring, 0.0, par.x_max)",
        "x = ops.sqrt(ops.fmax(u.force / par.k_spring * par.x_max, 0.0))",
        on(check_jacobian, "output"),
    ),
    "slope of a fine staircase": Mistake(
        "plant/adc",
        "ops.clip(ops.floor(reading * par.codes + 0.5), 0.0, par.codes - 1.0) / par.codes",
        "ops.floor(reading * par.codes * 1e6) / (par.codes * 1e6)",
        on(check_jacobian, "sample"),
    ),
    "infinity taken": Mistake("plant/adc", CODES, "Field(ge=2)", ranges),
    "number without unit": Mistake(
        "plant/dc_motor", "R_m: Resistance", "R_m: float", round_trip, "TypeError"
    ),
    "lost in JSON": Mistake(
        "plant/adc", CODES, "Field(ge=2, exclude=True)", round_trip, "ValidationError"
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_gate_refuses(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mistake = MISTAKES[name]
    source = (Path(bywire.__path__[0]) / f"{mistake.element}.py").read_text(encoding="utf-8")
    assert source.count(mistake.right) == 1, "the place of the mistake has moved"
    right = mistake.gate(_loaded("right", source, tmp_path, monkeypatch))
    assert right.holds, right.text
    wrong = _loaded("wrong", source.replace(mistake.right, mistake.wrong), tmp_path, monkeypatch)
    refused = mistake.gate(wrong)
    assert not refused.holds
    assert mistake.said in refused.text
    assert "; {" not in refused.text  # choices and values are said in words


def _loaded(name: str, source: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return a module from an element's source code."""
    path = folder / f"{name}.py"
    path.write_text(source, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(f"element_{name}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    spec.loader.exec_module(module)
    return module
