"""What users see of the whole product, as text: help, JSON, forms, reports, signatures.

Each subject is a function that returns one text; its name is the file in ``stored/``.
"""

from __future__ import annotations

import contextlib
import html
import http.client
import inspect
import io
import json
import os
import re
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import bywire
from bywire.cli.app import program
from bywire.cli.main import main
from bywire.server.address import HERE
from bywire.server.guard import cookie_name
from bywire.server.serving import opened
from undrawn import undrawn

ROOT = Path(__file__).parents[2]
BENCHES = [
    "friction_ramp",
    "hard_braking",
    "moment_pulses",
    "open_loop_chirp",
    "pedal_tracking",
    "pressure_step",
    "release",
    "repeated_stops",
    "rider_trace",
    "stuck_sensor",
    "wet_stop",
    "wet_stop_by_rules",
]
"""of which the report is kept"""
STUDY = """
bench = "benches/hard_braking.toml"
[vary]
"motor.R_m" = "+-10 %"
"seal.T_pr" = { kind = "log-normal", sd = "20 %" }
[design]
cases = 16
[requirements]
overshoot = "<= 15 % with 90 %"
"""
CAMPAIGN = """
bench = "hard-braking"
[set]
"options.p_from" = "36 bar"
"options.p_to" = "37 bar"
"options.settle" = "0.1 s"
"options.duration" = "0.5 s"
[campaign]
only = ["battery.lost", "motor.hot"]
onset = "0.4 s"
healthy = 4
[[criteria]]
name = "loss"
signal = "p_pd"
below_share = "80 %"
lasting = "20 ms"
"""
UNMET = """
experiment = "hard-braking"
parameters = "dardanelli2010"
[requirements]
overshoot = "<= 1 %"
"""
FILES = {"study.toml": STUDY, "unmet.toml": UNMET, "campaign.toml": CAMPAIGN}
"""written where commands run, beside the shipped benches"""
CALLS = {
    "list-all": "list",
    "list-experiments": "list experiments",
    "list-parameters": "list parameters",
    "list-motor": "list plant.dc_motor",
    "list-bench": "list hard-braking",
    "run-bench": "run benches/hard_braking.toml",
    "run-set": "run benches/pressure_step.toml --set motor.R_m=0.5ohm --no-error-estimate",
    "run-experiment": "run seal-stribeck --set parameters=dardanelli2010",
    "run-wedge": "run benches/moment_pulses.toml --no-error-estimate",
    "run-vehicle": "run benches/wet_stop.toml --no-error-estimate",
    "run-fault": "run benches/stuck_sensor.toml --no-error-estimate",
    "run-chirp": "run benches/open_loop_chirp.toml --no-error-estimate",
    "run-over": "run benches/release.toml --over motor.R_m=0.3ohm:0.5ohm:3 --no-error-estimate",
    "run-unmet": "run unmet.toml --no-error-estimate",
    "compare": "compare benches/hard_braking.toml benches/hard_braking.toml --set motor.R_m=0.5ohm",
    "convert": "convert benches/pedal_ride.csv converted.tsv",
    "run-out": "run benches/pedal_tracking.toml --no-error-estimate --out recorded",
    "replay": "replay recorded/run.nc --bench benches/pedal_tracking.toml --input p_set=p_ref",
    "linearize": "linearize pressure --at 20bar",
    "linearize-plant": "linearize motorcycle-plant --at 20bar",
    "margins": "margins pressure",
    "margins-over": "margins pressure --over at=5bar:35bar:3",
    "margins-wedge": "margins moment",
    "frequency-response": "frequency-response pressure --frequencies 2Hz,8Hz --amplitudes 1bar",
    "agreement": "agreement pressure",
    "design": "design pressure --require phase_margin>=60deg --require bandwidth>=5Hz "
    "--linear-only",
    "design-wedge": "design moment --require phase_margin>=60deg --linear-only",
    "life": "life wedge-pads",
    "faults": "faults campaign.toml --out campaign",
    "faults-again": "faults campaign.toml --out campaign",
    "study-run": "study run study.toml --out study --workers 1",
    "study-status": "study status study",
    "study-resume": "study resume study --workers 1",
    "study-surrogate": "study surrogate study",
    "study-report": "study report study",
    "study-extend": "study extend study --cases 96 --workers 1",
    "study-size": "study size actuator-sizing",
    "identify-screw": "identify screw-efficiency --synthetic 1",
    "identify-friction": "identify seal-friction --synthetic 1",
    "identify-winding": "identify motor-winding --synthetic 1",
    "check-element": "check dc_motor",
    "new": "new demo",
    "page": "page benches/hard_braking.toml --out page.html",
    "export-fmu": "export fmu benches/hard_braking.toml --out unit",
    "export-controller": "export controller benches/hard_braking.toml --out ecu --vectors 4",
    "refused-name": "run benches/hard_breaking.toml",
    "refused-value": "run hard-braking --set motor.R_m=5V",
}
"""name -> what is asked; the commands run one after another in one folder"""


def captured(*arguments: str) -> str:
    """Return the exit status, standard output and standard error of a command, called here."""
    out, err = io.StringIO(), io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["bywire", *arguments]),
        mock.patch.object(sys.modules["__main__"], "__package__", None),  # as if installed
        mock.patch.dict(os.environ, {"COLUMNS": "100", "TERMINAL_WIDTH": "100"}),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
        except SystemExit as ended:
            status = ended.code or 0
    return f"exit status {status}\n{out.getvalue()}{err.getvalue()}"


def help_texts() -> str:
    """Return the help of every command."""

    def below(command: Any, words: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
        yield words
        for name, inner in getattr(command, "commands", {}).items():
            yield from below(inner, (*words, name))

    text = "\n".join(
        f"$ bywire {' '.join(words)} --help\n{captured(*words, '--help')}"
        for words in below(program(), ())
    )
    return re.sub(r" +$", "", text, flags=re.MULTILINE)


def signatures() -> str:
    """Return the signature of every public function and class."""
    lines = []
    for name in sorted(dir(bywire)):
        thing = getattr(bywire, name)
        if callable(thing):
            with contextlib.suppress(ValueError):  # of an exception, for one
                lines.append(f"{name}{inspect.signature(thing)}")
                continue
        lines.append(name)
    return re.sub(r" at 0x[0-9a-f]+", "", "\n".join(lines)) + "\n"


@contextlib.contextmanager
def working_folder() -> Iterator[Path]:
    """Yield a new folder, the current one, with the shipped benches and what calls ask for."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve()
        (folder / "benches").symlink_to(ROOT / "benches")
        for file, text in FILES.items():
            (folder / file).write_text(text)
        os.chdir(folder)
        try:
            yield folder
        finally:
            os.chdir(before)


def json_calls() -> Iterator[tuple[str, str]]:
    """Yield the name and the object, or the refusal, of each call."""
    with working_folder() as folder:
        for name, words in CALLS.items():
            text = captured(*words.split(" "), "--json")
            first, _, rest = text.partition("\n")
            begin = rest.find("{")
            if begin >= 0:
                found, end = json.JSONDecoder().raw_decode(rest[begin:])
                whole = json.dumps(shortened(found), indent=1, ensure_ascii=False)
                rest = whole + rest[begin + end :]
            yield name, f"$ bywire {words} --json\n{first}\n{plain(rest, folder)}"


def shortened(found: Any) -> Any:
    """Return an object whose long lists are their length, first and last entries."""
    if isinstance(found, dict):
        return {key: shortened(value) for key, value in found.items()}
    if isinstance(found, list):
        if len(found) > 12:
            return [f"{len(found)} entries", shortened(found[0]), shortened(found[-1])]
        return [shortened(value) for value in found]
    return found


def plain(text: str, folder: Path) -> str:
    """Return a text without what differs from one run to the next."""
    text = text.replace(str(folder), "FOLDER").replace(folder.name, "FOLDER")
    text = text.replace(str(ROOT), "ROOT")
    text = re.sub(r"\bcc \([^)]*\) [\d.]+(, quick)?", "COMPILER", text)
    text = re.sub(r"(?<![.\w])(?=\d*[a-f])[0-9a-f]{12,64}\b", "HASH", text)  # and no decimals
    return re.sub(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?(\.\d+)?(Z|[+-]\d\d:\d\d)?", "TIME", text)


def words_of(page: str) -> str:
    """Return what a page says, one line for each element, without its scripts and pictures."""
    for tag in ("script", "style", "svg", "head"):
        page = re.sub(rf"<{tag}\b.*?</{tag}>", "", page, flags=re.DOTALL)
    words = html.unescape(re.sub(r"<[^>]+>", "\n", page))
    return "\n".join(line.strip() for line in words.splitlines() if line.strip()) + "\n"


def reports() -> Iterator[tuple[str, str]]:
    """Yield the name of each bench and what its report says."""
    with working_folder() as folder, undrawn():
        for name in BENCHES:
            said = captured("run", f"benches/{name}.toml", "--no-error-estimate", "--out", name)
            page = (folder / name / "report.html").read_text()
            yield name, f"{plain(said, folder)}\n{plain(words_of(page), folder)}"


def forms() -> Iterator[tuple[str, str]]:
    """Yield each page of a server that has a form, with its fields and what they say."""
    with working_folder() as folder, opened(folder, port=0) as server:
        thread = threading.Thread(target=server.server.serve_forever, args=(0.02,))
        thread.start()
        try:
            index = asked(server, "/")
            pages = sorted({*re.findall(r'href="(/task/[a-z-]+)"', index)})
            for path in ["/", "/bench?of=hard-braking", "/study?of=study.toml", *pages]:
                name = path.strip("/").replace("/", "-").partition("?")[0] or "index"
                yield name, plain(outline(asked(server, path)), folder)
        finally:
            server.server.shutdown()
            thread.join()


def asked(server: Any, path: str) -> str:
    """Return the page at a path of a server."""
    connection = http.client.HTTPConnection(HERE, server.port, timeout=30)
    cookie = f"{cookie_name(server.port)}={server.service.token}"
    connection.request("GET", path, headers={"Cookie": cookie})
    text = connection.getresponse().read().decode()
    connection.close()
    return text


def outline(page: str) -> str:
    """Return the elements of a page's body, a line each."""
    body = re.sub(r"<(script|style|svg|head)\b.*?</\1>", "", page, flags=re.DOTALL)
    return re.sub(r"(?<=>)\s*(?=<)", "\n", body).replace(">", ">\n").replace("\n\n", "\n")


GROUPS: dict[str, Callable[[], Iterator[tuple[str, str]]]] = {
    "text": lambda: iter([("help", help_texts()), ("signatures", signatures())]),
    "json": json_calls,
    "reports": reports,
    "forms": forms,
}
"""folder of ``stored`` -> its texts by name"""
