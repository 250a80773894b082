"""Exit statuses and streams of the installed program."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import BRAKING, OPEN_LOOP, QUICK, SCRIPT, refused

from bywire import __version__
from bywire.bench.experiment import EXPERIMENTS
from bywire.usecases import use_cases

CURVE = 'experiment = "seal-stribeck"\nparameters = "dardanelli2010"\n'  # the fastest result
MISSED = CURVE + '[requirements]\nbreakaway_apply = "<= 1 mN*m"\n'
STRICT = QUICK + '\n[requirements]\npeak_current = "<= 1 A"\nenergy = ">= 1 kJ"\n'


def shell(command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a shell line with the installed program in place of ``bywire``."""
    line = command.replace("bywire ", f"{shlex.quote(str(SCRIPT))} ")
    return subprocess.run(
        ["bash", "-o", "pipefail", "-c", line],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env={**os.environ, **environment},
    )


def test_requirement_not_met_is_1(bywire, bench):
    outcome = bywire("run", bench(BRAKING + STRICT), "--json")
    assert outcome.status == 1
    assert outcome.object["status"] == "failed"
    assert [r["met"] for r in outcome.object["requirements"]] == [False, False]
    assert [line.split()[4] for line in outcome.lines] == ["peak_current", "energy"]


def test_bad_input_is_2(bywire, bench):
    refused(bywire("run", bench(BRAKING + '[set]\nmotor.R_m = "-1 ohm"\n')), "must be > 0 ohm")


def test_benchmarks_are_those_of_a_clone(bywire, process, tmp_path, monkeypatch):
    refused(process("benchmark", "comands"), "part of the benchmark 'comands'", "did you mean")
    monkeypatch.setattr("bywire.cli.app.__file__", str(tmp_path / "a/b/c/d.py"))
    refused(bywire("benchmark"), "clone of its repository", "tasks.py")


def test_failed_run_is_3(bywire, bench):
    stimulus = '[stimulus]\nkind = "step"\nstart = 0\nend = "1e300 A"\nt_step = "5 ms"\n'
    outcome = bywire("run", bench(OPEN_LOOP + stimulus), "--json")
    refused(outcome, "diverged", "smaller step", status=3)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["run"], "missing argument"),
        (["run", "a", "b"], "unexpected extra argument"),
        (["run", "a", "--set", "motor.R_m=0.5", "ohm"], 'in quotation marks, as in "0.5 ohm"'),
        (["run", "hard_braking"], "did you mean hard-braking?"),
        (["run", "a", "--require", "b"], 'Use --set "requirements.NAME=<= LIMIT"'),
        (["run", "a", "--sett", "b"], "--set"),
        (["run", "a", "--set"], "requires an argument"),
        (["lst"], "Did you mean 'list'?"),
        (["list", "--yaml"], "no such option: --yaml. For help"),
        (["reproduce"], "missing argument"),
    ],
)
def test_wrong_usage_is_2(bywire, arguments, text):
    refused(bywire(*arguments), text)


def test_a_defect_is_3_and_never_a_verdict(bywire, bench, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("seeded")

    monkeypatch.setitem(vars(use_cases()["run"]), "function", broken)
    status, out, err = bywire("run", bench(), "--json")
    assert (status, out) == (3, "")
    assert "seeded" in err
    assert "Please report it" in err


@pytest.mark.parametrize("flag", ["--help", "-h", "--version"])
def test_help_and_version(bywire, flag):
    status, out, err = bywire(flag)
    assert (status, err) == (0, "")
    assert ("Usage" if "h" in flag else __version__) in out or out.strip() == __version__


def test_list_is_complete(bywire):
    status, out, err = bywire("list", "--json")
    assert (status, err) == (0, "")
    found = json.loads(out)
    titles = {
        "brakes",
        "assemblies",
        "parameter_sets",
        "experiments",
        "generic_experiments",
        "loops",
        "plants",
        "elements",
        "studies",
        "lives",
        "methods",
        "stimuli",
        "faults",
        "campaigns",
        "residuals",
        "kpis",
    }
    assert set(found) == titles | {"kpis_of_experiments"}
    for topic, content in found.items():
        assert content
        text = bywire("list", topic.replace("_", "-")).out
        assert all(name in text for name in content)
    for name, kpis in found["kpis_of_experiments"].items():
        assert kpis == dict(EXPERIMENTS.find(name).kpis)
        assert all(kpi in text for kpi in kpis)


@pytest.mark.parametrize(("buffered", "reader"), [("", "true"), ("1", "head -1")])
def test_reader_that_leaves_is_no_error(buffered, reader):
    done = shell(f"(sleep 0.3; bywire list) | {reader}", PYTHONUNBUFFERED=buffered)
    assert (done.returncode, done.stderr) == (0, "")


def test_status_survives_a_closed_pipe(bench):
    done = shell(f"bywire run {bench(MISSED)} --json | true")
    assert done.returncode == 1
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="Linux only")
def test_full_disk_behind_standard_output():
    done = shell("bywire list > /dev/full")
    assert done.returncode == 2
    assert done.stderr.startswith("bywire: error: cannot write to standard output: No space")


def test_closed_standard_error_keeps_results_clean(bench):
    done = shell(f"bywire run {bench(MISSED)} --json 2>&-")
    assert done.returncode == 1
    assert json.loads(done.stdout)["status"] == "failed"


def test_done_is_0_even_on_a_terminal_without_unicode(bench):
    done = shell(f"bywire list && bywire run {bench(CURVE)}", PYTHONIOENCODING="ascii")
    assert (done.returncode, done.stderr) == (0, "")
    assert "breakaway_apply" in done.stdout


@pytest.mark.skipif(sys.platform == "win32", reason="terminals of POSIX")
def test_progress_of_a_terminal_stays_off_standard_output(bench):
    import pty

    master, slave = pty.openpty()
    with subprocess.Popen(
        [str(SCRIPT), "run", str(bench()), "--json"], stdout=subprocess.PIPE, stderr=slave
    ) as running:
        out, _ = running.communicate(timeout=60)
    os.close(slave)
    shown = os.read(master, 100_000)
    os.close(master)
    assert json.loads(out)["status"] == "done"
    assert b"%" in shown
    assert b"Traceback" not in shown
