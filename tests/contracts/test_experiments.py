"""Checks of the names in experiments before a run, in our brakes and in users' brakes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from bywire.bench.experiment import EXPERIMENTS
from bywire.contracts.subjects import demands_on_experiment
from bywire.core.brake import load_system
from bywire.report.bench_figures import FIGURES
from systems.loading import SPRING_AXIS, forgotten

PUSH = """
import numpy as np
from bywire.authoring import Case, Experiment, Kpi, ParameterSet, zeros


class Options(ParameterSet):
    pass


def cases(par, options, _=None):
    return (Case("run", SpringAxis(), par, zeros(State), zeros(Memory),
                 lambda t: {"F_set": np.full(t.shape, 10.0)}, 0.01),)


def judge(recordings, options):
    return (Kpi("farthest", float(recordings["run"]["x"].max()), "m", "maximum travel"),)


PUSH = Experiment("push", "spring-axis", "a push", Options, Options(), cases, judge,
                  {"farthest": "m"}, ("time-traces",))
"""


@pytest.fixture(autouse=True)
def _forgotten() -> Iterator[None]:
    """Remove the modules that a test loads."""
    with forgotten():
        yield


@pytest.mark.parametrize("name", sorted(EXPERIMENTS.all()))
def test_experiments_of_ours_name_what_there_is(name: str) -> None:
    findings = [
        demand.settle() for demand in demands_on_experiment(EXPERIMENTS.find(name), FIGURES.all())
    ]
    assert [str(finding) for finding in findings if finding.outcome != "holds"] == []
    assert all(Path(finding.place.file).name.endswith(".py") for finding in findings)
    assert all(finding.place.line for finding in findings)


@pytest.mark.parametrize(
    ("contract", "right", "wrong", "text", "line_of"),
    [
        ("", "", "", "", ""),
        ("figures", "time-traces", "time-trace", "unknown figure 'time-trace'", "PUSH = "),
        ("assembly", '"spring-axis", "a', '"spring-axes", "a', "did you mean 'spring-axis'", ""),
        ("assembly", 's",))', 's",), variants=("spring-axes",))', "did you mean 'spring-axis'", ""),
        ("stimuli", 'F_set": np', 'F_sett": np', "'F_sett': did you mean 'F_set'?", "PUSH = "),
        ("key figures", '["x"]', '["xx"]', "xx", "    return (Kpi("),
        (
            "key figures",
            '{"farthest": "m"}',
            '{"fartest": "m"}',
            "key figures fartest",
            "PUSH = ",
        ),
        ("key figures", '"m", "maximum', '"mm", "maximum', "farthest in mm", "PUSH = "),
    ],
)
def test_what_an_experiment_names_and_nobody_has(
    tmp_path: Path, contract: str, right: str, wrong: str, text: str, line_of: str
) -> None:
    assert right in PUSH
    source = SPRING_AXIS.read_text() + PUSH.replace(right, wrong)
    path = tmp_path / f"pushed_{abs(hash((contract, wrong)))}.py"
    path.write_text(source)
    load_system(path)
    findings = [
        demand.settle() for demand in demands_on_experiment(EXPERIMENTS.find("push"), FIGURES.all())
    ]
    broken = {finding.contract: finding for finding in findings if finding.outcome == "broken"}
    assert set(broken) == ({contract} if contract else set())
    if contract:
        assert text in broken[contract].text
        place = broken[contract].place
        assert place.file == str(path)
        assert source.splitlines()[place.line - 1].startswith(line_of)
