"""Every contract of this folder refuses an element with a seeded mistake."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import pint
import pydantic
import pytest

import bywire
from contracts.elements import PACKAGES, functions, modules, parameter_classes
from contracts.test_back_ends import check_back_ends
from contracts.test_energy import check_energy, check_loss
from contracts.test_jacobian import check_jacobian
from contracts.test_parameters import check_range, check_round_trip
from contracts.test_units import check_rate_units, check_SI, check_units

Gate = Callable[[ModuleType], None]
UnitError = pint.DimensionalityError


def on(check: Callable[[Any], None], name: str) -> Gate:
    """Return the gate of one function of an element."""
    return lambda module: check(functions(module)[name])


def round_trip(module: ModuleType) -> None:
    """Check the JSON of an element's parameters."""
    check_round_trip(parameter_classes(module)[0])


def codes_range(module: ModuleType) -> None:
    """Check the range of the converter's number of codes."""
    check_range(parameter_classes(module)[0], "codes")


class Mistake(NamedTuple):
    """What is changed in an element, and the gate that must notice."""

    element: str
    right: str
    wrong: str
    gate: Gate
    error: type[Exception] = AssertionError


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
    "missing half": Mistake("plant/end_stop", "0.5 * par.k_stop", "par.k_stop", check_energy),
    "loss that gives": Mistake("plant/dc_motor", "return par.R_m", "return -par.R_m", check_loss),
    "claim left out": Mistake("plant/dc_motor", "copper loss, >= 0", "copper loss", check_loss),
    "stop that pulls": Mistake(
        "plant/end_stop", "ops.fmax(d.far / c, 0.0)", "d.far / c", check_loss
    ),
    "missing factor": Mistake(
        "plant/pipeline", "/ (A_pl * A_pl)", "/ A_pl", on(check_units, "resistance")
    ),
    "sum of unlike terms": Mistake(
        "plant/dc_motor", "par.K_e * u.omega)", "par.K_e)", on(check_units, "balance"), UnitError
    ),
    "unlike branches": Mistake(
        "plant/caliper",
        "(p > p0, s, slope)",
        "(p > p0, s, 1.0)",
        on(check_units, "mass"),
        UnitError,
    ),
    "wrong unit of one choice": Mistake(
        "plant/reservoir_port", "G=0.0 * par.G_port", "G=par.x_port", on(check_units, "output")
    ),
    "if on a value": Mistake(
        "plant/seal_friction",
        "ops.where(u.omega > 0, friction.T_p, friction.T_n)",
        "(friction.T_p if u.omega > 0 else friction.T_n)",
        on(check_units, "power_loss"),
        TypeError,
    ),
    "no unit": Mistake(
        "control/low_pass_2",
        'y: Annotated[float, Signal("A", "filtered current demand", 5.0)])',
        "y: float)",
        on(check_units, "at_rest"),
        TypeError,
    ),
    "not SI": Mistake("plant/dc_motor", '"A", "motor', '"mA", "motor', on(check_SI, "output")),
    "no rate of the state": Mistake(
        "plant/dc_motor", "Factors(i=par.L_m)", "Factors(i=par.L_m / par.R_m)", check_rate_units
    ),
    "depends on the type": Mistake(
        "control/pressure_pid",
        "i = ops.clip(wanted",
        "i = wanted if isinstance(wanted, float) else ops.clip(wanted",
        on(check_back_ends, "output"),
    ),
    "floats only": Mistake(
        "plant/seal_friction", "ops.fmax(u.p", "max(u.p", on(check_back_ends, "output"), ValueError
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
    "infinity taken": Mistake("plant/adc", CODES, "Field(ge=2)", codes_range),
    "number without unit": Mistake(
        "plant/dc_motor", "R_m: Resistance", "R_m: float", round_trip, TypeError
    ),
    "lost in JSON": Mistake(
        "plant/adc", CODES, "Field(ge=2, exclude=True)", round_trip, pydantic.ValidationError
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_gate_refuses(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mistake = MISTAKES[name]
    source = (Path(bywire.__path__[0]) / f"{mistake.element}.py").read_text(encoding="utf-8")
    assert source.count(mistake.right) == 1, "the place of the mistake has moved"
    mistake.gate(_loaded("right", source, tmp_path, monkeypatch))
    wrong = _loaded("wrong", source.replace(mistake.right, mistake.wrong), tmp_path, monkeypatch)
    with pytest.raises(mistake.error):
        mistake.gate(wrong)


def test_no_element_is_overlooked() -> None:
    files = {p.stem for package in PACKAGES for p in Path(package.__path__[0]).glob("*.py")}
    assert {m.__name__.rsplit(".", 1)[1] for m in modules()} == files - {"__init__"}


def test_new_file_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = ModuleType("some_elements")
    package.__path__ = [str(tmp_path)]
    (tmp_path / "new_element.py").write_text("def output(x):\n    return x\n", encoding="utf-8")
    monkeypatch.setitem(sys.modules, package.__name__, package)
    monkeypatch.delitem(sys.modules, "some_elements.new_element", raising=False)
    (found,) = modules([package])
    assert list(functions(found)) == ["output"]


def _loaded(name: str, source: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return a module made of the source of an element."""
    path = folder / f"{name}.py"
    path.write_text(source, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(f"element_{name}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    spec.loader.exec_module(module)
    return module
