"""Access control, in which each rejection has its status and one message."""

from __future__ import annotations

import errno
import re
import socket
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest

from bywire.core.errors import FileError, ParameterError, UnknownNameError
from bywire.server import service
from bywire.server.address import HERE, NAMES
from bywire.server.place import safe_name
from bywire.server.routes import addresses
from bywire.server.serving import Handler, opened
from raising import raises


def test_the_link_gives_a_cookie_and_leads_on_without_the_token(visit):
    link = visit.server.link.partition("/?")[2]
    welcome = visit("GET", f"/bench?of=curve.toml&{link}", token="")
    assert welcome.status == 303
    assert welcome.headers["Location"] == "/bench?of=curve.toml"
    cookie = welcome.headers["Set-Cookie"]
    assert cookie.endswith("; Path=/; HttpOnly; SameSite=Strict")
    page = visit("GET", "/", token="", Cookie=cookie.partition(";")[0])
    assert page.status == 200
    assert b"curve.toml" in page.body
    assert visit("GET", f"//evil.example/?{link}", token="").headers["Location"][:2] != "//"


@pytest.mark.parametrize(("method", "path"), sorted(addresses()))
def test_nothing_is_answered_without_the_token(visit, method, path):
    for token, word in (
        ("", "missing"),
        ("x" * 43, "each start"),
        ("\xe4", "token"),
    ):
        answer = visit(method, path, token=token)
        assert answer.status == 401
        assert word.encode() in answer.body
        assert b"curve" not in answer.body


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Host": "evil.example"}, 421),
        ({"Host": f"{HERE}:1"}, 421),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Origin": f"http://{NAMES[1]}:1"}, 403),
        ({"Sec_Fetch_Site": "same-site", "Sec_Fetch_Mode": "no-cors"}, 403),
        ({"Sec_Fetch_Site": "cross-site", "Sec_Fetch_Mode": "cors"}, 403),
        ({"Sec_Fetch_Site": "cross-site", "Sec_Fetch_Mode": "navigate"}, 200),
        ({"Sec_Fetch_Site": "same-origin", "Sec_Fetch_Mode": "cors"}, 200),
    ],
)
def test_pages_of_other_sites_are_refused(visit, headers, status):
    assert visit("GET", "/api/jobs", **headers).status == status
    here = f"{HERE}:{visit.server.port}"
    assert visit("GET", "/api/jobs", Host=here, Origin=f"http://{here}").status == 200


def test_every_answer_has_a_policy(visit):
    for path, last in {
        "/": "none",
        "/nowhere": "self",
        "/api/jobs": "none",
        "/assets/serve.js": "none",
    }.items():
        headers = visit("GET", path).headers
        policy = headers["Content-Security-Policy"]
        assert policy.startswith("default-src 'none'; ")
        assert policy.endswith(f"; form-action 'none'; frame-ancestors '{last}'")
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Cache-Control"] == "no-store"
    page = visit("GET", "/").body
    assert b"<style" not in page
    assert b"<script>" not in page
    assert b"http" not in page.replace(b"xhttp", b"")
    # Files in the folder may run scripts, but without an origin, cookies or network.
    policy = visit("GET", "/file/page.html").headers["Content-Security-Policy"]
    assert policy.startswith("sandbox allow-scripts allow-downloads; default-src 'none'")
    assert "allow-same-origin" not in policy


@pytest.mark.parametrize(
    "path",
    [
        "../outside/secret.csv",
        "%2e%2e/%2e%2e/etc/passwd",
        "/etc/passwd",
        "out.csv",
        "way/secret.csv",
        ".hidden.toml",
        "results/../../x",
        "..%5cx",
        "curve.toml%00",
        "",
        "none.html",
        "way",
    ],
)
def test_no_path_leads_out_of_the_folder(visit, path):
    answer = visit("GET", f"/file/{path}")
    assert answer.status == 404
    assert b"secret" not in answer.body.replace(b"secret.csv", b"")
    assert visit.begin("replay", bench="curve.toml", measurement=path or "x").status == 404
    changed = visit.begin("run", bench="curve.toml", set=f"options.trace={path or 'x'}")
    assert changed.status == 404
    assert visit("GET", "/file/curve.toml").status == 200


def test_what_is_not_there_and_what_is_not_taken(visit):
    assert visit("GET", "/nowhere").status == 404
    assert visit("GET", "/assets/../serving.py").status == 404
    assert visit("DELETE", "/file/curve.toml").status == 405
    assert visit("POST", "/").status == 405
    assert visit("GET", "/bench?of=bad.toml").status == 400
    assert b"sett" in visit("GET", "/bench?of=bad.toml").body
    assert visit("GET", "/bench?of=hard-brakin").status == 400
    assert b"hard-braking" in visit("GET", "/bench?of=hard-brakin").body
    assert visit("GET", "/bench").status == 400
    assert visit("POST", "/api/jobs", "{}", Content_Type="text/plain").status == 415
    assert visit("POST", "/api/jobs", {"x": "y" * 200_000}).status == 413
    assert visit("POST", "/api/jobs", "[", Content_Type="application/json").status == 400
    assert visit.begin("page", bench="curve.toml").status == 400
    assert visit.begin("run", bench="curve.toml", shell="x").status == 400
    missing = visit.begin("run", bench="")
    assert (missing.status, missing.object["field"]) == (422, "bench")
    assert visit("GET", "/api/jobs/99").status == 404
    assert visit("POST", "/api/jobs/99/cancel", {}).status == 404


def test_files_that_are_dropped(visit):
    large = visit("PUT", "/api/measurements/a.csv", b"", Content_Length=str(2_000_000_000))
    assert large.status == 413
    assert "2,000.0 MB is too large (at most 3.0 MB)" in large.object["error"]
    assert visit("PUT", "/api/measurements/a.toml", b"x").status == 415
    assert visit("PUT", "/api/measurements/a.csv", b"").status == 400
    assert visit("PUT", "/api/measurements/a.csv", iter([b"x"])).status == 411
    first = visit("PUT", "/api/measurements/..%2f..%2fa%20b.csv", b"first")
    assert (first.status, first.object) == (201, {"file": "measurements/a-b.csv"})
    second = visit("PUT", "/api/measurements/a%20b.csv", b"second")
    assert second.object == {"file": "measurements/a-b-2.csv"}
    kept = visit.folder / "measurements"
    assert (kept / "a-b.csv").read_bytes() == b"first"
    assert sorted(path.name for path in kept.iterdir()) == ["a-b-2.csv", "a-b.csv"]


def test_who_still_sends_what_is_refused_can_read_why(visit):
    port, token = visit.server.port, visit.server.service.token
    head = (
        f"PUT /api/measurements/large.csv HTTP/1.1\r\nHost: {HERE}:{port}\r\n"
        f"Cookie: bywire-{port}={token}\r\nContent-Length: 2000000000\r\n\r\n"
    )
    with socket.create_connection((HERE, port)) as sending:
        sending.sendall(head.encode())
        while sending.recv(10_000):
            pass  # until the message is complete
        for _ in range(
            3
        ):  # the client notices a closed connection only with the next piece but one
            sending.sendall(b"x" * 1000)
            time.sleep(0.05)


def test_a_file_that_does_not_come_to_its_end_is_not_kept(visit):
    port, token = visit.server.port, visit.server.service.token
    head = (
        f"PUT /api/measurements/torn.csv HTTP/1.1\r\nHost: {HERE}:{port}\r\n"
        f"Cookie: bywire-{port}={token}\r\nContent-Length: 9\r\n\r\n"
    )
    with socket.create_connection((HERE, port)) as torn:
        torn.sendall(head.encode() + b"half")
        torn.shutdown(socket.SHUT_WR)
        said = torn.recv(10_000)
    assert b"400" in said.splitlines()[0]
    kept = visit.folder / "measurements"
    assert not [path for path in kept.iterdir() if "torn" in path.name or path.name[0] == "."]


def test_a_body_that_nobody_reads_is_no_further_request(visit):
    port, token = visit.server.port, visit.server.service.token
    first = f"Host: {HERE}:{port}\r\nCookie: bywire-{port}={token}\r\n"
    second = f"GET /api/jobs HTTP/1.1\r\n{first}\r\n"
    with socket.create_connection((HERE, port)) as asking:
        asking.sendall(
            f"GET /assets/serve.css HTTP/1.1\r\n{first}Content-Length: {len(second)}\r\n\r\n"
            f"{second}".encode()
        )
        said = b"".join(iter(lambda: asking.recv(100_000), b""))
    assert said.count(b"HTTP/1.1") == 1


def test_two_who_ask_at_once_are_both_answered(visit):
    """A client that sends its body slowly does not delay others."""
    port, token = visit.server.port, visit.server.service.token
    with socket.create_connection((HERE, port)) as slow, ThreadPoolExecutor(4) as pool:
        slow.sendall(
            f"PUT /api/measurements/s.csv HTTP/1.1\r\nHost: {HERE}:{port}\r\n"
            f"Cookie: bywire-{port}={token}\r\nContent-Length: 2\r\n\r\nx".encode()
        )
        paths = ["/", "/api/jobs", "/task/design", "/"]
        assert [a.status for a in pool.map(lambda p: visit("GET", p), paths)] == [200] * 4
        slow.sendall(b"y")
        assert b"201" in slow.recv(10_000).splitlines()[0]


def test_names_are_harmless():
    assert safe_name("C:\\data\\..\\run 07.mf4") == "run-07.mf4"
    assert safe_name("-rf.csv") == "rf.csv"
    assert safe_name("a\0b\n.csv") == "a-b.csv"
    assert len(safe_name("x" * 999 + ".csv")) < 120


def test_a_port_and_a_folder_that_do_not_do(visit, tmp_path):
    cases = [
        ({"port": visit.server.port}, ParameterError, "--port 0|port=0|port 0"),
        ({"port": 65536}, ParameterError, "0 to 65535"),
        ({"folder": tmp_path / "none"}, FileError, "is not a folder"),
        ({"subject": "none.toml"}, FileError, "does not exist"),
        ({"subject": "hard-brakin"}, UnknownNameError, "hard-braking"),
        ({"subject": visit.folder / "curve.toml"}, FileError, "is not in"),
        (
            {"subject": visit.folder},
            ParameterError,
            f"'bywire serve {re.escape(str(tmp_path))}'$",
        ),
    ]
    for given, error, text in cases:
        with pytest.raises(error, match=text), opened(**{"folder": tmp_path, "port": 0, **given}):
            pass
    assert list(Path(tmp_path).iterdir()) == []


def test_a_client_that_is_gone_before_the_end_of_an_answer_is_no_error():
    """The system's error ENOTCONN is not a ConnectionError in Python."""

    class Gone:
        def shutdown(self, how):
            raise OSError(errno.ENOTCONN, "Transport endpoint is not connected")

    Handler._linger(SimpleNamespace(connection=Gone()))


def test_a_folder_on_a_read_only_disk_is_named(tmp_path, monkeypatch):
    def refused(_):
        raise OSError(errno.EROFS, "Read-only file system", str(tmp_path / ".bywire-x"))

    monkeypatch.setattr(service, "scratch_folder", refused)
    with raises(FileError, name="folder", value=str(tmp_path)), opened(folder=tmp_path, port=0):
        pass
