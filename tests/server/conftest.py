"""Server for a small folder, in this process."""

from __future__ import annotations

import http.client
import json
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from bywire.server import jobs
from bywire.server.address import HERE
from bywire.server.guard import cookie_name
from bywire.server.serving import Opened, opened

LARGEST = 3_000_000
CURVE = 'experiment = "seal-stribeck"\nparameters = "dardanelli2010"\n'

STANDIN = """
import json, sys, time
order = json.loads(sys.stdin.readline())
print(json.dumps({"progress": ["halfway", 0.5]}), flush=True)
if order["asked"]["set"]:
    print(json.dumps({"done": {"page": "report.html", "holds": True}}), flush=True)
else:
    time.sleep(60)
"""


class Answer(NamedTuple):
    """Reply of a server."""

    status: int
    headers: Any
    body: bytes

    @property
    def object(self) -> Any:
        return json.loads(self.body)


class Visitor:
    """Client of a server, by default with the token of the server's link."""

    def __init__(self, server: Opened, folder: Path) -> None:
        self.server, self.folder = server, folder

    def __call__(
        self, method: str, path: str, body: Any = None, token: str | None = None, **headers: str
    ) -> Answer:
        kept = self.server.service.token if token is None else token
        sent = {"Cookie": f"{cookie_name(self.server.port)}={kept}"} if kept else {}
        sent |= {name.replace("_", "-"): value for name, value in headers.items()}
        connection = http.client.HTTPConnection(HERE, self.server.port, timeout=30)
        if isinstance(body, dict):
            body, sent = json.dumps(body), {"Content-Type": "application/json", **sent}
        connection.request(method, path, body, sent)
        response = connection.getresponse()
        answer = Answer(response.status, response.headers, response.read())
        connection.close()
        return answer

    def begin(self, task: str, **form: Any) -> Answer:
        return self("POST", "/api/jobs", {"task": task, "form": form})

    def ended(self, number: int) -> dict[str, Any]:
        """Return the state of a job that has ended."""
        job = self.server.service.jobs.find(str(number))
        assert job.ended.wait(60)
        return dict(self("GET", f"/api/jobs/{number}").object)


@pytest.fixture(scope="module")
def visit(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Visitor]:
    """Yield a client of a server that ends with the module."""
    outside = tmp_path_factory.mktemp("outside")
    (outside / "secret.csv").write_text("secret")
    folder = tmp_path_factory.mktemp("served")
    (folder / "curve.toml").write_text(CURVE)
    (folder / ".hidden.toml").write_text(CURVE)
    (folder / "bad.toml").write_text(CURVE + "[sett]\n")
    (folder / "page.html").write_text("<script>alert(1)</script>")
    (folder / "out.csv").symlink_to(outside / "secret.csv")
    (folder / "way").symlink_to(outside)
    with opened(folder, port=0, largest=LARGEST) as server:
        thread = threading.Thread(target=server.server.serve_forever, args=(0.02,))
        thread.start()
        yield Visitor(server, folder)
        server.server.shutdown()
        thread.join()
    assert not [path.name for path in folder.iterdir() if path.name.startswith(".bywire-")]


@pytest.fixture
def standin(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace jobs by processes that only send a job's messages, because they start fast."""

    def started(_: Path) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-S", "-E", "-c", STANDIN],
            start_new_session=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )

    monkeypatch.setattr(jobs, "started", started)
