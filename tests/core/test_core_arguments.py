"""Arguments of public functions: a type that the signature does not allow is one clear error."""

from __future__ import annotations

import numpy as np
import pytest

import bywire
from bywire.core.arguments import whole_number
from bywire.core.errors import ParameterError


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: bywire.run_study("a.toml", cases="64"), "cases = '64' must be a whole number"),
        (lambda: bywire.run_study("a.toml", cases=True), "cases = True must be a whole number"),
        (lambda: bywire.resume_study("a", workers=1.5), r"workers = 1\.5 must be a whole number"),
        (lambda: bywire.run_study("a.toml", None, ["x"]), r"overrides = \['x'\] must be a mapping"),
        (lambda: bywire.run_study("a.toml", cluster=None), "cluster = None must be a string"),
        (lambda: bywire.study_report(None), "folder = None must be a string or a path"),
        (lambda: bywire.run_study("a.toml", 5), "out = 5 must be a string or a path"),
        (lambda: bywire.design("pressure", seed=-1), "seed = -1 must be a whole number from 0"),
        (lambda: bywire.run_study("a.toml", progress=True), "progress = True must be a function"),
        (lambda: bywire.design("pressure", require="gain"), "require = .gain. must be a list"),
        (lambda: bywire.trust("friction-ramp", count=2.5), r"count = 2\.5 must be a whole number"),
    ],
)
def test_another_kind_than_the_signature_says_is_refused(call, said):
    with pytest.raises(ParameterError, match=said):
        call()


def test_what_python_says_of_missing_arguments_stays():
    with pytest.raises(TypeError, match=r"resume_study\(\) missing 1 required"):
        bywire.resume_study()


@pytest.mark.parametrize("value", [True, 0, 11, 2.0, "3", None, 10**400])
def test_a_whole_number_is_one_within_its_range(value):
    assert whole_number("cases", np.int64(10), 1, 10) == 10
    with pytest.raises(ParameterError, match=r"cases = .* must be a whole number from 1 to 10"):
        whole_number("cases", value, 1, 10)
