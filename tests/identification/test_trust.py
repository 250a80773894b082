"""The study of trust: a sound method passes, bias and false intervals are found out."""

from __future__ import annotations

import os
import pickle
import signal
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from bywire.core.errors import ParameterError, RunError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Force
from bywire.identification.least_squares import Problem, estimate
from bywire.identification.method import METHODS, Effort, Identified, Method
from bywire.identification.trust import trust
from bywire.identification.unknown import Unknown


class Options(ParameterSet):
    """One number."""

    F: Force


def level(
    seen: xr.Dataset,
    par: None,
    options: Options,
    effort: Effort,
    *,
    off: float = 0.0,
    overlap: int = 1,
) -> Identified:
    """Estimate a level; off adds a bias, overlap counts every sample several times."""
    y = np.repeat(seen["F"].values, overlap)
    unknown = Unknown("F", 1.0, scale=1.0, unit="N")
    found = estimate(Problem((unknown,), lambda v: (v[0] - y, np.ones((y.size, 1)))))
    return Identified({"level": replace(found, values=found.values + off)}, {})


def made(par: None, options: Options, seed: int) -> xr.Dataset:
    if seed == 13:
        raise ParameterError("no luck")
    noise = np.random.default_rng(seed).standard_normal(40)
    t = np.arange(40.0)
    return xr.Dataset({"F": ("time", options.F + noise)}, {"time": t})


def put_in(par: None, options: Options) -> dict[str, float]:
    return {"F": options.F}


METHOD = Method(
    name="level",
    assembly="",
    summary="a level",
    experiment="",
    signals={"F": "N"},
    options=Options,
    defaults=Options(F=5.0),
    identify=level,
    synthetic=made,
    truth=put_in,
)
SEEDS = range(100, 180)


def test_a_sound_method_is_trusted() -> None:
    found = trust(METHOD, None, METHOD.defaults, SEEDS)
    (one,) = found.recovered
    assert found.holds
    assert one.unit == "N"
    assert one.count == 80
    assert one.claimed == pytest.approx(one.scatter, rel=0.25)
    # The mean of 40 values of unit variance.
    assert one.claimed == pytest.approx(40**-0.5, rel=0.05)


def test_bias_and_false_intervals_are_found_out() -> None:
    biased = replace(METHOD, identify=partial(level, off=0.1))
    found = trust(biased, None, METHOD.defaults, SEEDS)
    assert not found.holds
    assert found.recovered[0].bias_in_errors > 3.0
    # Every sample counted four times: one standard deviation is claimed to be half of it. The
    # autocovariance of the residuals would tell, were the repeats next to each other.
    shuffled = replace(METHOD, identify=_four_times)
    found = trust(shuffled, None, METHOD.defaults, SEEDS)
    assert not found.holds
    assert found.recovered[0].coverage < 0.85


def _four_times(seen: xr.Dataset, par: None, options: Options, effort: Effort) -> Identified:
    one = level(seen, par, options, effort).estimates["level"]
    return Identified({"level": replace(one, covariance=one.covariance / 4.0)}, {})


def test_failures_are_told() -> None:
    found = trust(METHOD, None, METHOD.defaults, range(11, 15))
    assert [o.seed for o in found.failed] == [13]
    assert "no luck" in found.failed[0].error
    assert not found.holds


def test_a_study_goes_on_from_its_store(tmp_path: Path) -> None:
    store, stopped, seen = tmp_path / "experiments.jsonl", tmp_path / "stopped", []

    def counted(par: None, options: Options, seed: int) -> xr.Dataset:
        seen.append(seed)
        if seed == 103 and not stopped.exists():
            stopped.touch()
            raise KeyboardInterrupt
        return made(par, options, seed)

    watched = replace(METHOD, synthetic=counted)
    with pytest.raises(KeyboardInterrupt):
        trust(watched, None, METHOD.defaults, range(100, 106), store=store)
    store.write_text(store.read_text() + '{"key": "cut o')
    seen.clear()
    found = trust(watched, None, METHOD.defaults, range(100, 106), store=store)
    assert seen == [103, 104, 105]
    assert found.recovered == trust(METHOD, None, METHOD.defaults, range(100, 106)).recovered
    other = trust(watched, None, Options(F=7.0), range(100, 102), store=store)
    assert other.recovered[0].truth == 7.0
    assert seen[3:] == [100, 101]
    seen.clear()
    louder = replace(watched, identify=lambda d, p, o, e: METHOD.identify(2.0 * d, p, o, e))
    trust(louder, None, METHOD.defaults, range(100, 102), store=store)
    assert seen == [100, 101]  # what another method has found is not taken for its own


def fatal_once(mark: Path, par: None, options: Options, seed: int) -> xr.Dataset:
    """Be killed by the fifth experiment, the first time."""
    if seed == 5 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return made(par, options, seed)


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no such signal")
def test_a_killed_process_ends_a_study_that_then_goes_on(tmp_path: Path) -> None:
    """A pool that waits for what was lost would wait forever."""
    method = replace(METHOD, synthetic=partial(fatal_once, tmp_path / "mark"))
    asked = (method, None, METHOD.defaults, range(12), Effort())
    store = tmp_path / "experiments.jsonl"
    with pytest.raises(RunError, match=r"a process of the study was killed.*continues"):
        trust(*asked, processes=2, store=store)
    found = trust(*asked, processes=2, store=store)
    assert [each.seed for each in found.outcomes] == list(range(12))
    assert found.outcomes == trust(METHOD, None, METHOD.defaults, range(12)).outcomes


def test_every_method_can_be_given_to_the_processes_of_a_study():
    for name, method in METHODS.all().items():
        assert pickle.loads(pickle.dumps(method)).name == name
