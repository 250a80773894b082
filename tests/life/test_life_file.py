"""Life files: what they say, and what is refused of them in a sentence."""

import pytest

from bywire.core.errors import FileError, InputError
from bywire.life.life_file import read_life

GOOD = """
life = "wedge-pads"
[set]
options.M_brake = "800 N*m"
wear.h_new = "9 mm"
stop.T_air = "280 K"
[vary]
"options.v_0" = { kind = "uniform", low = "50 km/h", high = "90 km/h" }
"stop.pause" = { kind = "log-normal", median = "120 s", sd = "80 %" }
[projection]
stops = 12
seed = 3
share = "10 %"
"""


@pytest.fixture
def plan_of(tmp_path):
    """Return a function that reads a life file of some text."""

    def read(text, overrides=()):
        file = tmp_path / "some_life.toml"
        file.write_text(text)
        return read_life(file, dict(overrides))

    return read


def test_a_file_says_what_wears_and_how_stops_differ(plan_of):
    plan = plan_of(GOOD, {"wear.h_min": "3 mm"}.items())
    assert (plan.name, plan.stops, plan.share, plan.longest) == ("some_life", 12, 0.1, 200_000)
    assert plan.bench.chosen_options.M_brake == 800.0
    assert (plan.wear.h_new, plan.wear.h_min) == (9e-3, 3e-3)
    assert plan.conditions.T_air == 280.0
    assert [each.name for each in plan.varied] == ["options.v_0", "stop.pause"]
    speeds = plan.population["options.v_0"]
    assert speeds.shape == (12,)
    assert speeds.min() >= 50 / 3.6
    assert (plan_of(GOOD).population["stop.pause"] == plan.population["stop.pause"]).all()


def test_stops_that_differ_in_pauses_alone_are_simulated_once(plan_of):
    plan = plan_of(GOOD.replace('"options.v_0" =', '# "options.v_0" ='))
    assert plan.different[0] == [0]
    assert (plan.different[1] == 0).all()
    assert len(plan_of(GOOD).different[0]) == 12


@pytest.mark.parametrize(
    ("text", "name", "valid"),
    [
        ('lfe = "wedge-pads"', "", "life"),
        ("[set]", "life", ""),
        ('life = "wedge-pad"', "life", "wedge-pads"),
        ("life = 3", "life", ""),
        ('life = "wedge-pads"\nset = 1', "set", ""),
        ('life = "wedge-pads"\n[set]\nwear.h_ne = "1 mm"', "name after 'wear.'", "h_new"),
        ('life = "wedge-pads"\n[set]\nwear.h_new = 9', "wear.h_new", "a string with its unit"),
        ('life = "wedge-pads"\n[set]\nwear.h_new = "9"', "h_new", ""),
        ('life = "wedge-pads"\n[set]\nwear.h_new = "-9 mm"', "h_new", "> 0 m"),
        ('life = "wedge-pads"\n[set]\nstop.pauses = "9 s"', "name after 'stop.'", "pause"),
        ('life = "wedge-pads"\n[set]\ncaliper.K = "9 N/m"', "parameter", ""),
        ('life = "wedge-pads"\n[vary]\n"stop.paus" = "+-5 %"', "", "stop.pause"),
        ('life = "wedge-pads"\n[vary]\n"caliper.clearance" = "+-5 %"', "caliper.clearance", ""),
        (
            'life = "wedge-pads"\n[vary]\n"caliper.law".kind = "discrete"\n'
            '"caliper.law".values = ["linear", "table"]',
            "caliper.law",
            "",
        ),
        ('life = "wedge-pads"\n[projection]\nstop = 3', "", "stops"),
        ('life = "wedge-pads"\n[projection]\nstops = 1', "stops", "2 to 4096"),
        ('life = "wedge-pads"\n[projection]\nstops = 2.5', "stops", "whole number"),
        ('life = "wedge-pads"\n[projection]\nshare = "90 %"', "share", ">= 0.1 % and <= 50 %"),
        ('life = "wedge-pads"\n[projection]\nshare = "5 mm"', "share", ""),
    ],
)
def test_what_does_not_fit_is_refused_with_the_files_name(plan_of, text, name, valid):
    with pytest.raises(InputError) as refusal:
        plan_of(text)
    assert all(part in str(refusal.value) for part in ("some_life.toml: ", name, valid))


def test_a_file_that_is_not_there_or_no_toml(plan_of, tmp_path):
    with pytest.raises(FileError, match="cannot read life file"):
        read_life(tmp_path / "none.toml")
    with pytest.raises(FileError, match="not valid TOML"):
        plan_of("life = ")
