"""Kinds of evidence: what they read, what identifies them, and what they reject."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from bywire.core.errors import FileError, InputError, ParameterError, UnitError, UnknownNameError
from bywire.signoff.plan import SignOffPlan
from bywire.signoff.signoff_file import read_signoff
from bywire.usecases.evidence.readers import READERS
from raising import raises
from signoff.closed_form import READERS as SPRINGS

REQUIREMENT = '[[requirement]]\nid = "R"\ntext = "T."\n'


def plan_of(folder: Path, evidence: str) -> SignOffPlan:
    """Return the plan of a requirement with one piece of evidence."""
    file = folder / "list.toml"
    file.write_text(f'{REQUIREMENT}\n[[evidence]]\nshows = "R"\n{evidence}\n', encoding="utf-8")
    return read_signoff(file, READERS)


def digest_of(folder: Path, evidence: str) -> str:
    """Return the digest of one piece of evidence."""
    (digest,) = plan_of(folder, evidence).tasks
    return digest


@pytest.mark.parametrize(
    ("evidence", "edited"),
    [
        ('bench = "hard-braking"', 'bench = "hard-braking"\nset."motor.R_m" = "0.4 ohm"'),
        ('bench = "hard-braking"', 'bench = "hard-braking"\nover = "motor.R_m=0.3ohm:0.4ohm:3"'),
        ('bench = "hard-braking"', 'bench = "hard-braking"\nfault = "motor.hot"'),
        ('loop = "pressure"', 'loop = "pressure"\nat = "21 bar"'),
        ('loop = "pressure"\nat = "21 bar"', 'loop = "pressure"\nset."motor.R_m" = "0.4 ohm"'),
        ('campaign = "motorcycle"', 'campaign = "motorcycle"\nset."seal.T_pr" = "+1 %"'),
        ('life = "wedge-pads"', 'life = "wedge-pads"\nset."wedge.mu_B" = "+1 %"'),
        ('contracts = "plant.pedal"', 'contracts = "plant.seal_friction"'),
        ('identification = "friction-ramp"', 'identification = "friction-ramp"\nsynthetic = 1'),
    ],
)
def test_an_edit_of_an_input_changes_the_digest(tmp_path: Path, evidence: str, edited: str) -> None:
    assert digest_of(tmp_path, evidence) == digest_of(tmp_path, evidence)
    assert digest_of(tmp_path, evidence) != digest_of(tmp_path, edited)


def test_a_comment_in_a_bench_file_and_a_limit_do_not_change_the_digest(tmp_path: Path) -> None:
    bench = tmp_path / "bench.toml"
    bench.write_text('experiment = "hard-braking"\nparameters = "dardanelli2010"\n')
    before = digest_of(tmp_path, 'bench = "bench.toml"\nlimit = "overshoot <= 15 %"')
    bench.write_text('# a\nexperiment = "hard-braking"\nparameters = "dardanelli2010"\n')
    assert digest_of(tmp_path, 'bench = "bench.toml"\nlimit = "overshoot <= 9 %"') == before


def test_a_changed_trace_changes_the_digest(tmp_path: Path) -> None:
    (tmp_path / "bench.toml").write_text(
        'experiment = "pedal-tracking"\nparameters = "dardanelli2010"\n[options]\n'
        'trace = "ride.csv"\n'
    )
    ride = tmp_path / "ride.csv"
    rows = "\n".join(f"{k / 100},{min(k / 10, 10.0)}" for k in range(100))
    ride.write_text(f"time [s],pressure [bar]\n{rows}\n")
    before = digest_of(tmp_path, 'bench = "bench.toml"')
    ride.write_text(f"time [s],pressure [bar]\n{rows}\n1.0,10\n")
    assert digest_of(tmp_path, 'bench = "bench.toml"') != before


def test_limits_of_one_study_are_judged_together(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text('bench = "hard-braking"\n[vary]\n"motor.R_m" = "+-5 %"\n')
    entry = '[[evidence]]\nshows = "R"\nstudy = "s.toml"\ncases = 64\nlimit = "{}"\n'
    limits = ["overshoot <= 15 % with 90 %", "settling_time <= 0.6 s"]
    file = tmp_path / "list.toml"
    file.write_text(REQUIREMENT + "".join(map(entry.format, limits)))
    (task,) = read_signoff(file, READERS).tasks.values()
    assert sorted(task.identity["limits"]) == limits
    other = entry.format(limits[0]).replace("cases = 64", "cases = 128")
    file.write_text(REQUIREMENT + entry.format(limits[0]) + other)
    with raises(ParameterError, name="evidence") as caught:
        read_signoff(file, READERS)
    assert "line 9" in str(caught.value)


@pytest.mark.parametrize(
    ("evidence", "kind", "name"),
    [
        ('bench = "hard-brakin"', UnknownNameError, "experiment"),
        ('bench = "hard-braking"\nlimit = "overshot <= 15 %"', UnknownNameError, "limit"),
        ('bench = "hard-braking"\nlimit = "overshoot <= 15 bar"', UnitError, "overshoot"),
        ('bench = "hard-braking"\nlimit = "overshoot <= 15 % with 99 %"', ParameterError, ""),
        ('bench = "hard-braking"\nover = "motor.R=1ohm:2ohm:3"', UnknownNameError, ""),
        ('bench = "hard-braking"\nset."motor.R_m" = 0.4', ParameterError, "motor.R_m"),
        ('bench = "hard-braking"\nanimate = true', UnknownNameError, "evidence"),
        ('bench = "hard-braking"\nloop = "pressure"', ParameterError, "evidence"),
        ('bench = "missing.toml"', FileError, "missing.toml"),
        ('loop = "pressure"\nlimit = "phase margin >= 60"', UnitError, "phase_margin"),
        ('campaign = "motorcycle"\nlimit = "cover >= 9 %"', UnknownNameError, "limit"),
        ('contracts = "plant.nothing"', UnknownNameError, ""),
        ('contracts = "plant.pedal"\nlimit = "x <= 1"', ParameterError, "limit"),
        ('study = "missing.toml"', FileError, "missing.toml"),
        ('record = "missing.csv"\nbench = "hard-braking"', FileError, "missing.csv"),
        ('record = "list.toml"', ParameterError, "bench"),
        ('record = "list.toml"\nbench = "hard-braking"', ParameterError, "tolerance"),
        ('loop = "pressure"\nat = "500 bar"', ParameterError, ""),
        (
            'manual = "seen"\nperson = "A"\ndate = 2026-01-01\nfile = "list.toml"',
            ParameterError,
            "",
        ),
    ],
)
def test_a_wrong_entry_is_rejected_before_anything_is_computed(
    tmp_path: Path, evidence: str, kind: type[InputError], name: str
) -> None:
    with raises(kind, name=name) as caught:
        plan_of(tmp_path, evidence)
    assert "list.toml, line 5: " in str(caught.value)


def test_a_manual_entry_holds_until_its_file_changes(tmp_path: Path) -> None:
    report = tmp_path / "report.pdf"
    report.write_bytes(b"no cracks")
    digest = hashlib.sha256(b"no cracks").hexdigest()
    entry = (
        'manual = "pads seen"\nperson = "A. Example"\ndate = 2026-11-20\nfile = "report.pdf"\n'
        f'sha256 = "{digest}"\nverdict = "met"'
    )
    assert plan_of(tmp_path, entry).tasks
    report.write_bytes(b"cracks")
    with raises(FileError, name="report.pdf", valid=digest):
        plan_of(tmp_path, entry)


def test_files_with_one_name_and_entries_with_one_title_stay_apart(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "rig.csv").write_text("1\n")
    evidence = 'identification = "friction-ramp"\nmeasurements = ["a/rig.csv", "b/rig.csv"]'
    before = digest_of(tmp_path, evidence)
    for folder in ("a", "b"):
        (tmp_path / folder / "rig.csv").write_text("2\n")
        assert digest_of(tmp_path, evidence) != before
        (tmp_path / folder / "rig.csv").write_text("1\n")
    one = 'spring = "s"\nk = [1.0]\nnumber = 1\n'
    other = one.replace("number = 1", "number = 2")  # the title does not contain the arguments
    file = tmp_path / "springs.toml"
    file.write_text(REQUIREMENT + "".join(f'[[evidence]]\nshows = "R"\n{e}' for e in (one, other)))
    assert len(read_signoff(file, SPRINGS).tasks) == 2
