"""Faults of a bench: the possible faults of every brake are known, and others are rejected."""

from __future__ import annotations

import re

import numpy as np
import pytest

import bywire
from bywire.api.things import faults
from bywire.bench.bench import Bench
from bywire.bench.bench_file import bench_text, load, read
from bywire.bench.faults.fault_section import AT_ZERO
from bywire.bench.faults.modes import modes_of
from bywire.bench.running import run
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import InputError
from bywire.core.model import ASSEMBLIES
from raising import raises
from run_once import run_once

SHORT = {"duration": "60 ms", "settle": "0 s"}
FILE = """
experiment = "hard-braking"
parameters = "dardanelli2010"
[options]
duration = "60 ms"
settle = "0 s"
[[faults]]
fault = "pressure.stuck"
value = "20 bar"
onset = "20 ms"
lasts = "10 ms"
[[faults]]
fault = "motor.hot"
value = 1.5
[[faults]]
set."motor.K_e" = "-30%"
onset = "30 ms"
"""


def bench(*sections, **options):
    return Bench("hard-braking", "dardanelli2010", options={**SHORT, **options}, faults=sections)


@pytest.fixture(scope="module")
def recording():
    """Return a run with a pressure sensor that is stuck for a while."""
    section = {"fault": "pressure.stuck", "value": "20 bar", "onset": "20 ms", "lasts": "10 ms"}
    return run(bench(section)).recording


def test_a_stuck_sensor_is_stuck_while_it_is_and_recorded(recording):
    at = recording["time"].values
    there = (at >= 0.02 - 1e-9) & (at < 0.03 - 1e-9)
    np.testing.assert_array_equal(recording["faults"].values, there)
    healthy = run(bench()).recording
    # Half a code of the converter.
    assert np.all(np.abs(recording["p_meas"].values[there] - 20e5) < 50e5 / 4096)
    np.testing.assert_array_equal(
        recording["p_meas"].values[at < 0.02], healthy["p_meas"].values[at < 0.02]
    )
    assert "faults" not in healthy


def test_a_bench_file_with_faults_is_read_and_written_and_read_again(tmp_path):
    (tmp_path / "first.toml").write_text(FILE)
    first = load(tmp_path / "first.toml")
    (tmp_path / "second.toml").write_text(bench_text(first))
    second = load(tmp_path / "second.toml")
    assert second.injections == first.injections != ()
    in_numbers = bench(
        {"fault": "pressure.stuck", "value": 20e5, "onset": 0.02, "lasts": 0.01},
        {"fault": "motor.hot", "value": 1.5},
        {"set": {"motor.K_e": 0.7 * 30.4e-3}, "onset": 0.03},
    )
    (tmp_path / "third.toml").write_text(bench_text(in_numbers))
    third = load(tmp_path / "third.toml")
    for own, other in zip(third.injections, first.injections, strict=True):
        assert (own.mode.name, own.value, own.course) == (
            other.mode.name,
            pytest.approx(other.value),
            other.course,
        )
    values = [run(each).recording["p_pd"].values for each in (first, second)]
    np.testing.assert_array_equal(*values)
    answer = bywire.run(in_numbers, faults=["ecu.frozen@50 ms"], estimate_error=False)
    said = answer.document().data["remarks"]
    assert said[3].startswith("fault ecu.frozen, from 50 ms on: task ecu misses every tick")


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ({"fault": "motor.hot", "value": "2 bar"}, "wrong unit"),
        ({"fault": "motor.hot", "value": -1}, "fault motor.hot: motor"),
        ({"fault": "motor.hot", "ramp": "1 ms", "every": "1 ms"}, "faults\\[1\\]: ramp and every"),
        ({"fault": "motor.hot", "share": "50 %"}, "faults\\[1\\]: share needs the period"),
        ({"set": {"ecu.T_s": "2 ms"}, "onset": "20 ms"}, "alters a sample time"),
        ({"fault": "fluid.air", "value": "9 ml"}, "fluid.V_air"),
    ],
)
def test_what_does_not_fit_is_refused(section, message):
    with pytest.raises(InputError, match=message):
        run(bench(section))


HOT = {"fault": "motor.hot"}


@pytest.mark.parametrize(
    ("section", "name", "value", "valid"),
    [
        ({"fault": "pressure.stick"}, "fault", "pressure.stick", "pressure.stuck"),
        ({"fault": "battery.lost", "value": 3}, "faults[1].value", "3", ""),
        ({"fault": "pressure.dropout", "value": 1.5}, "faults[1].value", "1.5", ">= 0 and <= 1"),
        ({"fault": "bridge.late", "value": 2.5}, "faults[1].value", "2.5", "a whole number >= 1"),
        (
            {"fault": "pressure.noise", "value": "-1 bar"},
            "faults[1].value",
            "-1 bar",
            ">= 0 bar",
        ),
        ({**HOT, "onset": "1 s"}, "onset", "1 s", ""),
        ({**HOT, "onzet": "1 s"}, "key of faults[1]", "onzet", "onset"),
        ({**HOT, "seed": -1}, "faults[1].seed", "-1", "a whole number >= 0"),
        ({"value": 3}, "faults[1].fault", "", ""),
        ({**HOT, "onset": "-2 s", "lasts": "1 s"}, "lasts", "1 s", ""),
        ({**HOT, "every": "1 us"}, "every", "1e-06 s", ""),
        ({**HOT, "onset": "-1e300 s"}, "onset", "-1e+300 s", ">= -1e+06 s"),
        ({**HOT, "set": {"motor.R_m": "+1%"}}, "faults[1].set", "", '{"motor.R_m" = "+50%"}'),
        ({"set": {"motor.R": 3}}, "parameter of faults[1]", "motor.R", "motor.R_m"),
    ],
)
def test_the_error_for_a_section_names_key_value_and_valid_values(section, name, value, valid):
    with raises(InputError, name=name, value=value, valid=valid):
        run(bench(section))


def test_faults_that_contradict_each_other_are_refused_unless_they_follow_each_other():
    stuck = {"fault": "pressure.stuck", "onset": "10 ms"}
    other = {"fault": "pressure.offset", "onset": "30 ms"}
    with pytest.raises(InputError, match="contradict each other: both change the signal pressure"):
        bench(stuck, other)
    bench({**stuck, "lasts": "20 ms"}, other)
    with pytest.raises(InputError, match="both change motor"):
        bench({"fault": "motor.demagnetized"}, {"set": {"motor.K_e": "-10%"}, "onset": "30 ms"})


def test_a_drive_comes_late_by_one_number_of_ticks_in_a_run():
    late = {"fault": "bridge.late", "value": 5, "lasts": "20 ms"}
    again = {"fault": "bridge.late", "value": 2, "onset": "30 ms"}
    with raises(InputError, name="bridge.late", value="2", valid="5"):
        run(bench(late, again))
    bench(late, {**again, "value": 5}).cases()


def test_a_fault_that_no_row_meets_is_told():
    section = {"fault": "pressure.stuck", "onset": "10.3 ms", "lasts": "1 us"}
    said = bywire.run(bench(section), estimate_error=False).document().data["remarks"]
    assert "not active in any recorded sample" in said[0]


def test_a_fault_that_came_and_went_for_long_before_the_run_still_does():
    course = AT_ZERO.replace({"onset": -1e3, "every": 0.01, "share": 0.5})
    inside = [t for t in course.instants(0.0, 0.03) if 0.001 < t < 0.03]
    assert inside == pytest.approx([0.005, 0.01, 0.015, 0.02, 0.025, 0.03][: len(inside)])
    assert len(inside) >= 5
    shortest = AT_ZERO.replace({"ramp": 5e-324})
    with np.errstate(all="raise", under="ignore"):
        np.testing.assert_array_equal(shortest.size(np.array([-1.0, 0.5])), [0.0, 1.0])


def test_text_and_files_want_units(tmp_path):
    for line in ("onset = 1", 'value = 20\nfault = "pressure.stuck"'):
        name = "" if "fault" in line else 'fault = "pressure.stuck"\n'
        text = FILE.partition("[[")[0] + f"[[faults]]\n{name}{line}\n"
        (tmp_path / "bad.toml").write_text(text)
        with pytest.raises(InputError, match="or example, write"):
            load(tmp_path / "bad.toml")
    for text in ("@1 s", "motor.hot@", "motor.hot=@1 s"):
        with raises(InputError, name="fault", value=text, valid="NAME=VALUE@ONSET"):
            run_once("hard-braking", faults=[text])
    with pytest.raises(InputError, match="NAME=VALUE@ONSET"):
        read("hard-braking", {"faults.onset": "1 s"})


def test_a_course_comes_and_goes_as_it_says():
    t = np.linspace(0.0, 1.0, 1001)
    course = AT_ZERO.replace({"onset": 0.1, "lasts": 0.5, "ramp": 0.1})
    assert course.size(np.array([0.05, 0.15, 0.4, 0.65, 0.8])) == pytest.approx([0, 0.5, 1, 0.5, 0])
    assert course.is_there(t).mean() == pytest.approx(0.6, abs=0.002)
    again = AT_ZERO.replace({"onset": 0.1, "every": 0.2, "share": 0.25})
    assert again.is_there(t).mean() == pytest.approx(0.25, abs=0.002)
    assert again.instants(0.0, 0.35) == pytest.approx([0.1, 0.15, 0.3, 0.35])


def test_noise_and_dropouts_are_drawn_anew_by_their_seed_alone():
    def measured(seed, *others):
        section = {"fault": "pressure.noise", "value": "1 bar", "seed": seed}
        return run(bench(section, *others)).recording["p_meas"].values

    first = measured(1)
    np.testing.assert_array_equal(first, measured(1, {"fault": "p_set.lost", "onset": "50 ms"}))
    assert not np.array_equal(first, measured(2))
    held = run(bench({"fault": "pressure.dropout", "value": 0.5})).recording["p_meas"].values
    assert 20 < np.sum(np.diff(held) == 0) < 45


def test_every_assembly_with_numbers_has_modes_with_values_that_they_take():
    """The value of each mode is admissible: its parameters can be constructed."""
    known = {cited.assembly: cited.name for cited in PARAMETER_SETS.all().values()}
    assert {name for places in faults().values() for name, _ in places} >= set(known)
    for assembly, cited in known.items():
        par = PARAMETER_SETS.find(cited).parameters()
        for mode in modes_of(ASSEMBLIES.find(assembly)(), par).values():
            assert re.fullmatch(r"[\w.-]+\.[a-z-]+", mode.name)
            if mode.changes is not None:
                changed = mode.changes(par, mode.value)
                assert changed
                par.replace(changed)
