"""Any content of a bench file gives a bench or one error for the user."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from bywire.bench.bench import Bench
from bywire.bench.bench_file import from_mapping, read
from bywire.core.errors import InputError

SCALARS = st.one_of(
    st.booleans(),
    st.integers(),
    st.integers(min_value=10**300, max_value=10**310),
    st.floats(),
    st.text(max_size=8),
    st.sampled_from(["1 mm", "0.4 ohm", "20 bar", "5 %", "-3 Nm", "nan", "1e400 s", "9**9"]),
    st.just(datetime.date(2010, 5, 27)),
    st.just(datetime.time(12)),
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=4), inner, max_size=2)
    ),
    max_leaves=4,
)
NAMES = st.sampled_from(
    [
        "motor.R_m",
        "motor",
        "caliper.p_table",
        "gear.law",
        "drive.mode",
        "p_to",
        "trace",
        "kind",
        "times",
        "values",
        "start",
        "end",
        "t_step",
        "source",
        "step",
        "record",
        "seed",
        "overshoot",
        "energy",
        "ecu.pedal_map.V_nodes",
        "",
        ".",
        "..",
        "motor.",
        "__class__",
    ]
)
SECTION = st.one_of(st.dictionaries(NAMES, VALUES, max_size=3), VALUES)
CONTENT = st.fixed_dictionaries(
    {
        "experiment": st.one_of(
            st.sampled_from(["hard-braking", "motor-open-loop", "seal-stribeck", "pedal-tracking"]),
            VALUES,
        ),
        "parameters": st.one_of(st.just("dardanelli2010"), VALUES),
    },
    optional={
        **dict.fromkeys(("options", "stimulus", "set", "simulation", "requirements"), SECTION),
        **dict.fromkeys(("name", "assembly", "nonsense"), VALUES),
    },
)


def outcome(make: Callable[[], Any]) -> Any:
    """Return the result or the message for the user; any other exception is a defect."""
    try:
        return make()
    except InputError as error:
        return str(error)


def cases(content: dict[str, Any]) -> tuple[Any, ...]:
    """Return the runs of a bench with some content."""
    return from_mapping(content, Path("nowhere"), "fuzz").cases()


@settings(max_examples=80, deadline=None)
@given(content=CONTENT)
def test_any_content_is_a_bench_or_an_error_for_the_user(content):
    found = outcome(lambda: cases(content))
    assert isinstance(found, tuple) or 0 < len(found) < 5000


@settings(max_examples=200, deadline=None)
@given(data=st.binary(max_size=60))
def test_any_bytes_are_a_bench_or_an_error_for_the_user(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "any.toml"
    path.write_bytes(data)
    found = outcome(lambda: read(path, {}))
    assert isinstance(found, Bench) or str(path) in found


@settings(max_examples=200, deadline=None)
@given(changes=st.dictionaries(st.one_of(NAMES, st.text(max_size=6)), st.text(max_size=8)))
def test_any_change_is_a_bench_or_an_error_for_the_user(tmp_path_factory, changes):
    path = tmp_path_factory.getbasetemp() / "change.toml"
    path.write_text('experiment = "hard-braking"\nparameters = "dardanelli2010"\n')
    prefixed = {
        f"{section}{name}": value
        for name, value in changes.items()
        for section in ("", "options.", "simulation.", "requirements.")
    }
    found = outcome(lambda: read(path, prefixed))
    assert isinstance(found, Bench) or found
