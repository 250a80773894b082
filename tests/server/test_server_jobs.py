"""Jobs return the same results as the functions, and report each way to end."""

from __future__ import annotations

import http.client
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import bywire
from bywire.core.errors import ParameterError
from bywire.server import job_process, jobs
from bywire.server.address import HERE
from bywire.server.guard import cookie_name
from bywire.server.task import tasks
from undrawn import drawn, undrawn_unless_asked

__all__ = ["drawn", "undrawn_unless_asked"]
posix = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")


def test_a_run_is_computed_in_a_process_of_its_own(visit):
    begun = visit.begin("run", bench="curve.toml")
    assert begun.status == 201
    job = visit.ended(begun.object["number"])
    assert (job["state"], job["holds"]) == ("done", True), job["message"]
    assert job["folder"] == "results/run-curve-1"
    report = visit("GET", f"/file/{job['report']}")
    assert report.status == 200
    assert b"<h1>curve</h1>" in report.body
    assert b"results/run-curve-1/report.html" in visit("GET", "/").body


def test_a_dropped_file_is_replayed_as_by_the_function(visit, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    time_ = np.linspace(0.0, 0.06, 61)
    signals = {
        "M_set": ("time", 20.0 * (time_ > 0.01), {"units": "N*m"}),
        "y_M": ("time", 10.0 * (time_ > 0.02), {"units": "N*m"}),
    }
    data = xr.Dataset(signals, {"time": ("time", time_, {"units": "s"})})
    file = bywire.write_measurement(data, tmp_path / "stop.csv")
    kept = visit("PUT", "/api/measurements/stop.csv", file.read_bytes()).object["file"]
    form = {"bench": "moment-pulses", "measurement": kept, "tolerance": "nrmse <= 5 %"}
    asked = tasks()["replay"].read(form, visit.server.service.place)
    told = []
    monkeypatch.setattr(job_process, "tell", lambda **said: told.append(said))
    folder = str(visit.folder)
    job_process._compute(
        {"task": "replay", "asked": asked, "folder": folder, "out": "result", "systems": []}
    )
    record = json.loads((visit.folder / "result" / "replay.json").read_text())
    expected = bywire.replay(file, "moment-pulses", tolerances=["nrmse <= 5 %"]).as_object()
    assert record["segments"] == expected["segments"]
    assert told[-1]["done"]["holds"] is False
    assert told[-1]["done"]["page"] == "report.html"
    assert any("progress" in each for each in told)


def running(visit, number: int) -> jobs.Job:
    """Return a job once its process computes."""
    job = visit.server.service.jobs.find(str(number))
    give_up = time.monotonic() + 30.0
    while not job.progress[0] and time.monotonic() < give_up:
        time.sleep(0.005)
    assert job.state == "running"
    return job


@posix
@pytest.mark.usefixtures("standin")
def test_canceled_and_killed_jobs_leave_nothing(visit):
    """The server continues whatever happens to a job's process."""
    before = set((visit.folder / "results").glob("*"))
    numbers = [visit.begin("run", bench="curve.toml").object["number"] for _ in range(3)]
    running(visit, numbers[0])
    killed = running(visit, numbers[1])
    waiting = visit("GET", f"/api/jobs/{numbers[2]}").object
    assert waiting["state"] == "waiting"
    page = visit.server.service.jobs.start(
        tasks()["page"], {"bench": "curve.toml", "set": "x"}, visit.folder / "page-1.html"
    )
    assert page.ended.wait(30)  # it does not wait in the queue
    assert page.state == "done"
    for number in numbers[2], numbers[0]:
        assert visit("POST", f"/api/jobs/{number}/cancel", {}).status == 200
    assert visit.ended(numbers[0])["state"] == "canceled"
    os.killpg(killed.process.pid, signal.SIGKILL)
    ended = visit.ended(numbers[1])
    assert ended["state"] == "failed"
    assert "SIGKILL" in ended["message"]
    assert visit.ended(numbers[2])["state"] == "canceled"
    assert set((visit.folder / "results").glob("*")) == before
    done = visit.begin("run", bench="curve.toml", set="motor.R_m=0.4 ohm").object
    done = visit.ended(done["number"])
    assert (done["state"], done["share"], done["holds"]) == ("done", 0.5, True)


@posix
@pytest.mark.usefixtures("standin")
def test_a_study_is_computed_once_at_a_time(visit):
    (visit.folder / "some.toml").write_text('bench = "curve.toml"\n[vary]\n"motor.R_m" = "+-5 %"\n')
    assert b"No case is computed yet" in visit("GET", "/study?of=some.toml").body
    assert visit("GET", "/study?of=curve.toml").status == 400
    begun = visit.begin("study", study="some.toml")
    assert begun.object["folder"] == "results/some"
    second = visit.begin("study", study="some.toml")
    assert second.status == 409
    assert "already computing" in second.object["error"]
    visit("POST", f"/api/jobs/{begun.object['number']}/cancel", {})
    assert visit.ended(begun.object["number"])["state"] == "canceled"


def test_what_does_not_fit_is_told_in_one_message(capsys):
    assert job_process._explained(ParameterError("R_m must be > 0 ohm")) == "R_m must be > 0 ohm"
    missing = job_process._explained(FileNotFoundError(2, "No such file", "a.csv"))
    assert missing.startswith("a.csv: No such file. Check")
    assert "bug in bywire" in job_process._explained(ZeroDivisionError("seeded"))
    assert "seeded" in capsys.readouterr().err


@posix
def test_ctrl_c_ends_it_with_its_jobs(tmp_path):
    text = 'experiment = "seal-stribeck"\nparameters = "dardanelli2010"\n'
    (tmp_path / "curve.toml").write_text(text)
    with subprocess.Popen(
        [sys.executable, "-m", "bywire", "serve", "--port", "0"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as server:
        assert server.stdout is not None
        address, _, token = server.stdout.readline().strip().partition("/?token=")
        port = int(address.rpartition(":")[2])
        asking = http.client.HTTPConnection(HERE, port, timeout=30)
        order = json.dumps({"task": "run", "form": {"bench": "curve.toml"}})
        asking.request(
            "POST",
            "/api/jobs",
            order,
            {
                "Cookie": f"{cookie_name(port)}={token}",
                "Content-Type": "application/json",
            },
        )
        assert asking.getresponse().status == 201
        asking.close()
        server.send_signal(signal.SIGINT)
        out, err = server.communicate(timeout=30)
    assert (server.returncode, out) == (130, "")
    assert err.splitlines()[-1] == "bywire: interrupted"
    left = sorted(path.relative_to(tmp_path).as_posix() for path in Path(tmp_path).rglob("*"))
    assert left == ["curve.toml", "results"]
