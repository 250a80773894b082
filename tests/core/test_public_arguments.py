"""Every public function and declaration rejects arguments of the wrong type in one sentence."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterator
from typing import Any

import pytest

import bywire
from bywire import authoring
from bywire.core import arguments
from bywire.core.errors import BywireError, ModelError, ParameterError
from raising import raises

WRONG = ("garbage", None, 3, math.nan, ["a"], {"a": 1}, object(), True)
UNCHECKED = {"evaluate", "fixed", "measure", "units_of"}  # they take names, or what is like data


def public() -> Iterator[tuple[str, Any]]:
    """Yield every public function, and what makes each public class that checks its arguments."""
    for module in (bywire, authoring):
        for name in module.__all__:
            thing = getattr(module, name)
            made = thing.__init__ if inspect.isclass(thing) else thing
            if inspect.isfunction(made) and hasattr(made, "__wrapped__"):
                yield f"{module.__name__}.{name}", made


PUBLIC = dict(public())


def test_every_public_function_checks_its_arguments() -> None:
    for module in (bywire, authoring):
        functions = {n for n in module.__all__ if inspect.isfunction(getattr(module, n))}
        assert {n for n in functions if f"{module.__name__}.{n}" not in PUBLIC} <= UNCHECKED


@pytest.mark.parametrize("name", PUBLIC)
def test_each_argument_of_another_kind_is_refused_with_its_name(name: str) -> None:
    function = PUBLIC[name]
    _, wanted = arguments._signature(inspect.unwrap(function))
    for parameter, kinds in wanted.items():
        for value in WRONG:
            if not any(fits(value) for _, fits in kinds):
                with pytest.raises(ParameterError, match=f"{parameter} = .* must be "):
                    function(**{parameter: value})


def test_runs_and_benches_are_not_taken_for_each_other() -> None:
    bench = bywire.Bench("hard-braking")
    with raises(ParameterError, name="run", value="'step.toml'", valid="a Run or a Bench"):
        bywire.simulate_ensemble("step.toml", {"motor.R_m": [0.3, 0.4]})
    with raises(ParameterError, name="run", value="Bench", valid="a Run"):
        bywire.simulate_with_sensitivities(bench, ["motor.R_m"], ["p_mc"])
    with raises(ParameterError, name="run", value="Bench", valid="a Run"):
        bywire.simulate(bench)
    (run,) = bench.runs().values()
    with raises(ParameterError, name="bench", value="Run", valid="a Bench or a string or a path"):
        bywire.run(run)


@pytest.mark.parametrize(
    ("declared", "fields"),
    [
        ('frictions = ("vel",)', {"name": "state", "value": "vel", "valid": "v"}),
        ('frictions = "v"', {"name": "frictions", "value": "'v'", "valid": "a tuple of states"}),
        ('frictions = ("v",)\n    limits = ("y",)', {"name": "state", "value": "y"}),
    ],
)
def test_frictions_and_limits_name_states(
    declared: str, fields: dict[str, str], tmp_path: Any
) -> None:
    from systems.loading import SPRING_AXIS, loaded

    name = f"axis_{abs(hash(declared))}"
    path = tmp_path / f"{name}.py"
    path.write_text(SPRING_AXIS.read_text().replace('frictions = ("v",)', declared))
    with loaded(path), raises(ModelError, **fields) as refused:
        bywire.Bench("step", options={"input": "F_set", "output": "x"})
    assert f"{name}.py, line" in str(refused.value)


def test_a_misspelled_attribute_is_named_with_the_nearest() -> None:
    from bywire.core.brake import error_with_line

    with pytest.raises(AttributeError) as raised:
        bywire.Bench("hard-braking").par.motor.R_n  # noqa: B018 - it is misspelled
    assert error_with_line(raised.value).endswith("did you mean 'R_m'?")


def test_declarations_of_another_kind_are_refused() -> None:
    with pytest.raises(BywireError, match="inputs = 'p_set' must be a tuple"):
        authoring.Loop(name="pressure", inputs="p_set")
    with pytest.raises(BywireError, match="parameter_class = 'Parameters' must be a class"):
        authoring.CitedSet("one", "axis", "", "", "Parameters", {})
