"""``bywire list NAME``: options, signals and units of everything that has a name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from command_line import Outcome, refused

from bywire.analysis.loop import LOOPS, PLANTS
from bywire.api.describe import described
from bywire.api.overview import overview
from bywire.bench.experiment import EXPERIMENTS
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import FileError, UnknownNameError
from bywire.core.model import ASSEMBLIES
from bywire.identification.method import METHODS
from bywire.simulation import compiler
from bywire.synthesis.study import STUDIES

Bywire = Callable[..., Outcome]


def about(kind: str, name: str) -> dict[str, Any]:
    (one,) = (one for one in described(name) if one["kind"] == kind)
    return one


def only(found: Outcome, kind: str) -> dict[str, object]:
    (one,) = (one for one in found.object["found"] if one["kind"] == kind)
    return one


@pytest.mark.parametrize("name", METHODS.all())
def test_a_method_says_all_that_its_use_takes(bywire: Bywire, name: str) -> None:
    method = METHODS.all()[name]
    one = only(bywire("list", name, "--json"), "method")
    assert [row["name"] for row in one["options"]] == list(method.defaults.flat())
    for row in one["options"]:
        assert row["meaning"], row
        assert row["value"] not in (None, ""), row
        assert row["range"] not in ("", "-"), row
    needed = {row["signal"]: row["unit"] for row in one["signals"] if row["needed"] == "yes"}
    assert needed == {n: unit or "any" for n, unit in method.signals.items()}
    assert set(method.unknowns) <= {row["name"] for row in one["estimates"]}
    text = bywire("list", name).out
    assert f"method {name}: {method.summary}" in text
    for row in (*one["options"], *one["estimates"]):
        assert row["name"] in text


def test_a_key_figure_says_how_it_is_computed(bywire: Bywire) -> None:
    text = " ".join(bywire("list", "ripple").out.split())
    assert "The default window is the last 20 % of the time after the step." in text
    assert "math" not in bywire("list", "loop_area").out
    assert "unit: -" in bywire("list", "share_stuck").out


def test_what_is_found_under_a_name_of_several_kinds(bywire: Bywire) -> None:
    found = bywire("list", "friction-ramp", "--json")
    assert [one["kind"] for one in found.object["found"]] == ["experiment", "method"]
    options = {row["name"]: row for row in only(found, "method")["options"]}
    assert options["least"]["value"] == "0.2 bar"
    assert options["least"]["range"] == "> 0 bar"
    text = bywire("list", "friction-ramp").out
    assert "changed with --option NAME=VALUE" in text
    assert "changed with --set options.NAME=VALUE" in text


def test_experiments_studies_and_sets_list_their_values(bywire: Bywire) -> None:
    cases = (
        ("experiment", "options", {n: e.defaults for n, e in EXPERIMENTS.all().items()}),
        ("study", "options", {n: s.defaults for n, s in STUDIES.all().items()}),
        (
            "parameter set",
            "parameters",
            {n: e.parameters() for n, e in PARAMETER_SETS.all().items()},
        ),
    )
    for kind, key, known in cases:
        for name, values in known.items():
            one = only(bywire("list", name, "--json"), kind)
            assert [row["name"] for row in one[key]] == list(values.flat()), name


def test_choices_and_plain_numbers_say_what_they_may_be(bywire: Bywire) -> None:
    rows = only(bywire("list", "seal-friction", "--json"), "method")["options"]
    by_name = {row["name"]: row for row in rows}
    assert by_name["zero"]["range"] == "known or free"
    assert by_name["x_low"]["range"] == "any finite number in mm"
    assert by_name["pressures"]["value"] == "1 bar, 3 bar, 5 bar, 7 bar"
    (stimulus,) = bywire("list", "sine", "--json").object["found"]
    assert [row["name"] for row in stimulus["parameters"]][:2] == ["mean", "amplitude"]
    assert bywire("list", "moment").out.startswith("loop moment: ")


def test_an_unknown_name_gets_the_nearest(bywire: Bywire) -> None:
    refused(bywire("list", "frction-ramp"), "unknown name 'frction-ramp'", "'friction-ramp'")


@pytest.mark.parametrize("name", ["motorcycle-brake", "wedge-brake", "shaft-rig"])
def test_an_assembly_says_its_signals_and_what_there_is_for_it(bywire: Bywire, name: str) -> None:
    one = only(bywire("list", name, "--json"), "assembly")
    model = ASSEMBLIES.all()[name]
    where = {(row["signal"], place) for row in one["signals"] for place in row["where"].split(", ")}
    for place, fields in (
        ("stimulus", model.Stimulus),
        ("recording", model.Output),
        ("state", model.State),
    ):
        assert {n for n, known in where if known == place} == set(fields._fields)
    known = [e.name for e in EXPERIMENTS.all().values() if e.assembly == name]
    assert one["experiments"] == ", ".join(known)


def test_every_experiment_says_what_it_drives(bywire: Bywire) -> None:
    for name, one in EXPERIMENTS.all().items():
        rows = about("experiment", name)["drives"]
        assert rows or one.static is not None, name
    text = bywire("list", "hard-braking").out
    assert "p_set   bar   pressure demand  motorcycle-brake" in text
    assert "'bywire list motorcycle-brake'" in text


def test_every_loop_and_plant_says_input_output_and_states(bywire: Bywire) -> None:
    for loop in LOOPS.all().values():
        rows = about("loop", loop.name)["signals"]
        told = {
            part: [r["signal"] for r in rows if r["as"] == part]
            for part in ("input", "output", "cut open at", "state")
        }
        assert told["input"] == list(loop.inputs)
        assert told["output"] == [loop.output]
        assert all(r["meaning"] for r in rows), loop.name
        assert told["state"]
    for plant in PLANTS.all().values():
        parts = {row["as"] for row in about("plant", plant.name)["signals"]}
        assert parts == {"input", "output", "state"}
    assert (
        "i_source  A      source current             input"
        in bywire("list", "motorcycle-plant").out
    )


def test_a_parameter_a_group_a_signal_and_a_key_figure(bywire: Bywire) -> None:
    one = only(bywire("list", "motor.R_m", "--json"), "parameter")
    assert one["summary"] == "winding resistance"
    assert {"parameter set": "dardanelli2010", "value": "0.35 Ω"} in one["values"]
    group = only(bywire("list", "seal", "--json"), "parameter group")
    assert "seal.T_pr" in [row["name"] for row in group["parameters"]]
    (row,) = only(bywire("list", "p_mc", "--json"), "signal")["found in"]
    assert (row["system"], row["unit"]) == ("motorcycle-brake", "bar")
    figure = only(bywire("list", "overshoot", "--json"), "KPI")
    assert figure["unit"] == "%"
    assert "hard-braking" in figure["experiments"].split(", ")
    distance = only(bywire("list", "stopping_distance", "--json"), "KPI")
    assert distance["unit"] == "um, mm or m"  # in the unit that reports choose by size
    refused(bywire("list", "motor.R_n"), "unknown name 'motor.R_n'", "'motor.R_m'")


def test_the_method_of_any_bench_says_where_its_signals_are(bywire: Bywire) -> None:
    text = bywire("list", "output-error").out
    assert "--input (stimulus), --output (recording) and --estimate-start (state)" in text


def test_the_index_fits_a_screen_and_a_topic_opens(bywire: Bywire) -> None:
    lines = bywire("list").out.rstrip("\n").split("\n")
    assert len(lines) < 24
    assert max(map(len, lines)) <= 80
    (line,) = (line for line in lines if line.startswith("loops "))
    assert int(line.split()[1]) == len(LOOPS.all())
    every = bywire("list", "--json").object
    for topic in ("Parameter-Sets", "sets"):
        shown = bywire("list", topic, "--json").object
        assert shown == {"parameter_sets": every["parameter_sets"]}
    assert every["loops"]["pressure"] in " ".join(bywire("list", "loops").out.split())


def test_the_overview_gives_tables() -> None:
    tables = overview().tables()
    assert sorted(tables["loops"]["name"]) == sorted(
        LOOPS.all()
    )  # ordered by brake, own ones first
    assert set(tables) >= {"experiments", "parameter sets", "kpis", "kpis of experiments"}
    assert list(overview("loops").tables()) == ["loops"]
    with pytest.raises(UnknownNameError, match="did you mean 'loops'"):
        overview("lops")


@pytest.mark.parametrize(
    ("word", "kind", "name"),
    [
        ("battery", "parameter group", "supply"),
        ("friction", "parameter group", "seal"),
        ("Winding resistance", "parameter", "motor.R_m"),
        ("caliper pressure", "signal", "p_pd"),
        ("bar", "signal", "p_mc"),
        ("phase", "method", "cogging"),
    ],
)
def test_a_word_finds_what_is_declared_to_mean_it(
    bywire: Bywire, word: str, kind: str, name: str
) -> None:
    found = bywire("list", word, "--json").object["found"]
    assert (kind, name) in {(one["kind"], one["name"]) for one in found}
    text = bywire("list", word).out
    assert text.startswith(f"nothing is named {word!r}, but these entries mention it")
    assert len(text.splitlines()) <= 40


def test_a_word_that_nothing_mentions_gets_the_nearest_that_is(bywire: Bywire) -> None:
    refused(bywire("list", "battrey"), "unknown name 'battrey'", "'battery'")


def test_a_stimulus_says_its_defaults(bywire: Bywire) -> None:
    (sine,) = bywire("list", "sine", "--json").object["found"]
    values = {row["name"]: row["value"] for row in sine["parameters"]}
    assert (values["phase"], values["t_start"], values["f"]) == ("0 rad", "0 ms", None)


def test_every_value_of_a_set_says_where_it_comes_from(bywire: Bywire) -> None:
    one = only(bywire("list", "dardanelli2010-measured", "--json"), "parameter set")
    told = {row["name"]: row["provenance"] for row in one["parameters"]}
    assert all(told.values())
    assert told["motor.K_e"] == "paper: Table 1"
    assert told["caliper.K_pd"].startswith("calibrated: estimated, 95 % interval ")
    assert "provenance" in bywire("list", "dardanelli2010-measured").out


def test_a_list_is_made_where_nothing_can_be_kept(monkeypatch):
    def refused():
        raise FileError("a temporary folder cannot be made")

    before = overview()
    monkeypatch.setattr(compiler, "usable_folder", refused)
    assert overview().things == before.things
