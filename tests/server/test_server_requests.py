"""Every request gets a reply with an HTTP status and a message, and never an internal error."""

from __future__ import annotations

import os
import random
import signal
import socket
import subprocess
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from email.message import Message
from pathlib import Path
from urllib.parse import quote

import pytest

from bywire.core import scratch
from bywire.core.child_process import environment, python_command
from bywire.server import serving
from bywire.server.address import HERE, NAMES
from bywire.server.exchange import RefusedError
from bywire.server.guard import require_place
from bywire.server.place import Place, folder_name, safe_name
from bywire.server.routes import addresses

PIECES = [
    *("/", "//", "[", "]", "http://", "http://[", "http://[::1", "http://[x]/", "://", ":", "@"),
    *("#", "?", "%", "%00", "%0d%0a", "%2e%2e/", "%5c", "%zz", "%ff", "..", ".hidden.toml", "~1"),
    *(
        "&",
        "=",
        "of=",
        "of=curve.toml",
        "token=",
        "case=",
        "99999999999999999999",
        "-1",
        "1/cancel",
    ),
    *("curve.toml", "results", "measurements", "*", ";", "'", '"', "<b>", "{}", "nul.csv"),
    *("page.html", "serve.js", "http://h:port/", *NAMES, f"{HERE}:x"),
    *("\xe9", "\xbc", "\t", "\x01", "\x7f", "a" * 300, "x/" * 3000),
]
BODIES = [
    *(b"", b"{}", b"[", b"\xff\xfe", b"1" * 5000, b'{"task": "run"}', b'{"task": "\\ud800"}'),
    b'{"task": ["run"], "form": 1}',
    b'{"task": "run", "form": {"bench": "\\ud800"}}',
    b'{"task": "run", "form": {"bench": "curve.toml", "set": "\\ud800=1"}}',
    b'{"task": "run", "form": {"\\ud800": "1"}}',
    b'{"task": "run", "form": {"bench": "%s.toml"}}' % (b"d" * 252),
    b'{"task": "study", "form": {"study": "%s"}}' % (b"a" * 300),
    b'{"task": "compare", "form": {"results": "%s\\n%s"}}' % (b"b" * 300, b"c/" * 3000),
]


def said_to(port: int, sent: bytes) -> bytes:
    """Send bytes, and return the complete reply."""
    with socket.create_connection((HERE, port), timeout=20) as asking:
        asking.sendall(sent)
        asking.shutdown(socket.SHUT_WR)
        try:
            return b"".join(iter(lambda: asking.recv(100_000), b""))
        except ConnectionResetError:  # the server dropped bytes sent after a reply
            return b""


def random_request(chance: random.Random, port: int, token: str) -> bytes:
    """Return a request that is invalid in some places."""

    def pick(usual: str, *others: str) -> str:
        return usual if chance.random() < 0.8 else chance.choice(others)

    method, path = chance.choice([*addresses(), ("GET", ""), ("DELETE", "/")])
    path = "" if chance.random() < 0.3 else path
    path += "".join(chance.choice(PIECES) for _ in range(chance.randrange(4)))
    method = pick(method, "GET", "get", "POST", "PUT", "HEAD", "\xe9", "G" * 70_000, "", "PATCH")
    version = pick(
        "HTTP/1.1", "HTTP/1.0", "HTTP/9.9", "HTTP/", "HTTP/1.x", "", "HTTP/0.9", "HTTP/1.1 x"
    )
    body = chance.choice(BODIES) if method in ("POST", "PUT") else b""
    headers = [
        ("Host", pick(f"{HERE}:{port}", "", "[", "\xe9", "x" * 300)),
        ("Cookie", pick(f"bywire-{port}={token}", "=", "bywire", '"', "\x01", "a=b;" * 100)),
        ("Content-Type", pick("application/json", "", ";", "text/plain")),
        ("Content-Length", pick(str(len(body)), "-1", "x", "9" * 30, "\xb2", "")),
        ("Origin", pick("", "null", f"http://{HERE}:{port}", "[")),
        ("Sec-Fetch-Dest", pick("empty", "document", "\xe9")),
    ]
    lines = [f"{name}: {value}" for name, value in headers if value or chance.random() < 0.1]
    if chance.random() < 0.05:
        lines.append(
            chance.choice([":", "x", " y", "Transfer-Encoding: chunked", "x: " + "y" * 70_000])
        )
    head = f"{method} {path} {version}".rstrip() + "\r\n" + "\r\n".join(lines) + "\r\n\r\n"
    return head.encode("latin-1") + body


@pytest.mark.usefixtures("standin")
def test_random_requests_are_answered_without_a_defect(visit, monkeypatch):
    """Invalid parts occur in every place of a request and in every order."""
    defects = []
    monkeypatch.setattr(serving.traceback, "print_exception", lambda *a: defects.append(a))
    monkeypatch.setattr(serving, "_LINGER", 0.01)
    chance = random.Random(7)
    requests = [
        random_request(chance, visit.server.port, visit.server.service.token) for _ in range(2000)
    ]
    with ThreadPoolExecutor(8) as pool:
        for sent, said in zip(
            requests, pool.map(lambda r: said_to(visit.server.port, r), requests), strict=True
        ):
            assert not defects, (sent[:500], defects)
            status = said.partition(b"\r\n")[0].split(b" ")
            assert status[:1] != [b"HTTP/1.1"] or int(status[1]) not in (500, 507), sent[:500]
    for job in visit.server.service.jobs.all():
        visit.server.service.jobs.cancel(job)


@pytest.mark.parametrize(
    "address", ["http://[", "//[", "http://[::1", "/bench?of=x#[", "http://[zz]/", "/[", "http://]"]
)
def test_an_address_that_is_none_is_refused(visit, address):
    head = f"GET {address} HTTP/1.1\r\nHost: {HERE}:{visit.server.port}\r\n"
    cookie = f"Cookie: bywire-{visit.server.port}={visit.server.service.token}\r\n\r\n"
    said = said_to(visit.server.port, (head + cookie).encode())
    assert said.partition(b"\r\n")[0].split()[1] in (b"400", b"404")
    assert b"defect" not in said


@pytest.mark.parametrize(
    ("line", "status"),
    [
        *((line, 400) for line in ("GET", "GET /", "POST /", "GET / HTTP/a.b", "GET / / HTTP/1.1")),
        *((f"GET / HTTP/{version}", 400) for version in ("0.9", "2.0", "-1.1", "9" * 5000)),
        *((f"{method} / HTTP/1.1", 405) for method in ("get", "G\0T", "_reply", "GET:")),
    ],
)
def test_a_first_line_that_is_none_is_refused_with_a_status(visit, line, status):
    """Old versions of HTTP, whose replies have no status, are included."""
    said = said_to(visit.server.port, f"{line}\r\nHost: {HERE}\r\n\r\n".encode())
    assert said.startswith(b"HTTP/1.1 %d " % status)


@pytest.mark.parametrize("path", ["a" * 256, "a" * 252 + ".toml", "\xe4" * 200, "a/" * 4000])
def test_a_name_that_no_system_takes_is_not_there(visit, path):
    assert (
        visit("GET", f"/file/{path.encode().hex() if not path.isascii() else path}").status == 404
    )
    answer = visit.begin("run", bench=f"{path}.toml")
    assert (answer.status, answer.object["field"]) == (404, "bench")
    assert visit("PUT", f"/api/measurements/{'a' * 9000}.csv", b"x").status == 201


def test_a_link_to_a_hidden_file_leads_nowhere(visit):
    (visit.folder / ".secrets").mkdir()
    (visit.folder / ".secrets" / "deep.csv").write_text("secret")
    for name, target in ("seen.toml", ".hidden.toml"), ("seen", ".secrets"):
        (visit.folder / name).symlink_to(visit.folder / target)
    for path in "seen.toml", "seen/deep.csv":
        answer = visit("GET", f"/file/{path}")
        assert answer.status == 404
        assert b"secret\n" not in answer.body
    (visit.folder / "shown.toml").symlink_to(visit.folder / "curve.toml")
    assert visit("GET", "/file/shown.toml").status == 200


def test_of_files_that_arrive_at_once_none_is_lost(visit):
    names = [
        f"{name}.csv" for name in ("at once", "at-once", "At Once", "AT..ONCE", "x/at?once")
    ] * 4
    sent = [f"{k}".encode() for k in range(len(names))]
    with ThreadPoolExecutor(len(names)) as pool:
        answers = pool.map(
            lambda name, body: visit("PUT", f"/api/measurements/{quote(name)}", body), names, sent
        )
        kept = [answer.object.get("file", answer) for answer in answers]
    assert len({each.casefold() for each in kept}) == len(names)
    assert [(visit.folder / each).read_bytes() for each in kept] == sent
    assert not [path for path in (visit.folder / "measurements").iterdir() if path.name[0] == "."]


def test_names_are_claimed_where_a_file_system_has_no_links(tmp_path, monkeypatch):
    def no_link(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", no_link)
    start = threading.Barrier(8)

    def claimed(k: int) -> Path | None:
        fresh = tmp_path / f"fresh{k}"
        fresh.write_text(str(k))
        start.wait()
        return scratch.claim(fresh, (tmp_path / f"a-{n}.csv" for n in range(8)))

    with ThreadPoolExecutor(8) as pool:
        kept = list(pool.map(claimed, range(8)))
    assert sorted(path.read_text() for path in tmp_path.iterdir()) == sorted(map(str, range(8)))
    assert [path.read_text() for path in kept if path] == list(map(str, range(8)))
    assert scratch.claim(tmp_path / "a-1.csv", [tmp_path / "a-0.csv"]) is None


def test_the_port_of_http_is_left_out_by_browsers():
    for host, port, is_known in [
        (HERE, 80, True),
        (f"{HERE}:80", 80, True),
        (NAMES[1].upper(), 80, True),
        (HERE, 81, False),
        (f"{HERE}:81", 80, False),
        ("evil.example", 80, False),
        (f"{HERE}:81", 81, True),
    ]:
        headers = Message()
        headers["Host"], headers["Origin"] = host, f"http://{host.lower().removesuffix(':80')}"
        with nullcontext() if is_known else pytest.raises(RefusedError, match="answers only as"):
            require_place("POST", headers, port)


def test_each_study_has_a_folder_of_its_own(tmp_path):
    names = [
        "tol.toml",
        "a/tol.toml",
        "b/tol.toml",
        "a~1tol.toml",
        "a~/tol.toml",
        "a/b/tol.toml",
        "a/b~1tol.toml",
        f"{'x' * 240}1.toml",
        f"{'x' * 240}2.toml",
        "\xfc" * 120 + ".toml",
    ]
    place = Place(tmp_path.resolve())
    folders = {place.same_folder(name) for name in names}
    assert len(folders) == len(names)
    for folder in folders:
        folder.mkdir()
    assert folder_name("tol.toml") == "tol"
    assert safe_name("tol.toml") == "tol.toml"


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("sign", [signal.SIGTERM, signal.SIGHUP])
def test_a_terminated_server_leaves_no_temporary_names(tmp_path, sign):
    (tmp_path / "curve.toml").write_text('experiment = "stribeck"\n')
    command = python_command("-m", "bywire", "serve", str(tmp_path), "--port", "0")
    with subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE) as serving:
        assert serving.stdout is not None
        assert b"token=" in serving.stdout.readline()
        assert [path for path in tmp_path.iterdir() if path.name[0] == "."]
        serving.send_signal(sign)
        assert serving.wait(30) == 130
    assert [path.name for path in tmp_path.iterdir()] == ["curve.toml"]
