"""Routes of the server: the functions that answer requests.

Measurement files are opened only in the restricted process of `bywire.data.limited_source`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib.resources import files
from pathlib import Path
from typing import Final

from bywire.core.errors import FileError, ParameterError, quoted, unknown_name
from bywire.core.scratch import scratch_folder
from bywire.server.columns import meanings_for, shown_columns
from bywire.server.contents import REPORT, contents, endings
from bywire.server.exchange import LIVE, SANDBOX, RefusedError, Reply, Request, page, plain
from bywire.server.field import is_file_name
from bywire.server.live_pages import experiments, shown_bench
from bywire.server.pages import bench_page, index_page, report_page, study_page, task_page
from bywire.server.place import RESULTS, Place, folder_name, safe_name
from bywire.server.service import Service
from bywire.server.task import tasks
from bywire.studies.plan import CHUNK
from bywire.studies.store import StudyStore

_PIECE = 2**20


def uploaded(place: Place, request: Request, name: str, largest: int) -> Path:
    """Store an uploaded file under a free name. If the upload fails, store nothing.

    Raises
    ------
    RefusedError
        With status 415 for an unknown format, 411 or 413 for an invalid length, and 400 for an
        incomplete upload.
    OSError
        If the disk is full.
    """
    if Path(safe_name(name)).suffix.lower() not in endings():
        raise _unknown_format(name)
    request.require_length(largest, "a measurement")
    if request.length == 0:
        raise RefusedError(400, f"{name[:100]!r} is empty. Check the recording")
    with scratch_folder(place.measurements()) as scratch:
        fresh = scratch / "measurement"
        with fresh.open("wb") as stream:
            left = request.length
            while left:
                piece = request.body.read(min(left, _PIECE))
                if not piece:
                    what = f"{name[:100]!r} arrived incomplete. Send it again"
                    raise RefusedError(400, what)
                stream.write(piece)
                left -= len(piece)
        return place.kept(fresh, name)


def _unknown_format(name: str) -> RefusedError:
    return RefusedError(
        415,
        f"{name[:100]!r} does not have the extension of a measurement file. Valid extensions are "
        f"{', '.join(endings())}",
    )


# --- Progress of a study


def how_far(folder: Path) -> str:
    """Return the progress of a study as a sentence."""
    store = StudyStore(folder)
    try:
        record = store.record()
    except FileError:
        return "No case is computed yet."
    done = min(len(store.finished()) * CHUNK, int(record["cases"]))
    return f"{done:,} of {record['cases']:,} cases are computed."


# --- Routes

Route = Callable[[Service, Request, str], Reply]

_KINDS: Final = {
    ".html": "text/html; charset=utf-8",
    ".png": "image/png",
    ".json": "application/json",
    ".toml": "text/plain; charset=utf-8",
}
_ASSETS: Final = {
    "page.css": ("bywire.report", "page.css", "text/css; charset=utf-8"),
    "serve.css": ("bywire.server", "assets/serve.css", "text/css; charset=utf-8"),
    "columns.js": ("bywire.server", "assets/columns.js", "text/javascript; charset=utf-8"),
    "serve.js": ("bywire.server", "assets/serve.js", "text/javascript; charset=utf-8"),
}


def answer(service: Service, request: Request) -> Reply:
    """Return the reply to an authorized request.

    Raises
    ------
    RefusedError
        With status 404 for an unknown path, 405 for a method that the path does not support, and
        if the route rejects the request.
    InputError
        If a value is invalid.
    """
    method = "GET" if request.method == "HEAD" else request.method
    for first, route in _ROUTES.items():
        if request.path == first or (first.endswith("/") and request.path.startswith(first)):
            if method not in route:
                raise RefusedError(
                    405, f"{request.method} is not supported here. Use {', '.join(route)}"
                )
            if first == "/" and request.path != "/":
                continue
            return route[method](service, request, request.path.removeprefix(first))
    raise RefusedError(404, f"page {quoted(request.path)} does not exist. Use the start page")


def _index(service: Service, request: Request, rest: str) -> Reply:
    del request, rest
    place = service.place
    with service.reading:
        known = experiments()
    text = index_page(place.root.name or str(place.root), contents(place), known, service.largest)
    return page(text)


def _bench(service: Service, request: Request, rest: str) -> Reply:
    del rest
    name = _subject(request)
    with service.reading:
        shown = shown_bench(_path_of(service.place, name), name)
    return page(bench_page(shown, contents(service.place), service.largest))


def _live(service: Service, request: Request, rest: str) -> Reply:
    del rest
    name = _subject(request)
    with service.reading:
        _path_of(service.place, name)
    return Reply(service.live_pages.file(name, request.query.get("case", "")), policy=LIVE)


def _task(service: Service, request: Request, rest: str) -> Reply:
    known = [each.name for each in tasks().values() if each.form.is_listed]
    if rest not in known:
        text = f"task {quoted(rest)} does not exist. Valid names are {', '.join(known)}"
        raise RefusedError(404, text)
    with service.reading:
        there = contents(service.place)
        return page(task_page(tasks()[rest], there, request.query, service.largest))


def _study(service: Service, request: Request, rest: str) -> Reply:
    del rest
    name, there = _subject(request), contents(service.place)
    service.place.file(name)
    if name not in there.studies:
        raise ParameterError(
            f"{name} is not a study file, because it has no bench and no [vary] section", name=name
        )
    folder = f"{RESULTS}/{folder_name(name)}"
    progress = how_far(service.place.root / folder)
    text = study_page(
        name, there.studies[name], f"{folder}/report.html", progress, there, service.largest
    )
    return page(text)


def _file(service: Service, request: Request, rest: str) -> Reply:
    path = service.place.file(rest)
    kind = _KINDS.get(path.suffix.lower())
    if path.suffix.lower() == REPORT and request.headers.get("Sec-Fetch-Dest") == "document":
        # Directly in a tab, a page could navigate to another site and send data in the address.
        return page(report_page(service.place.named(path)))
    if kind is None:
        saved = {"Content-Disposition": "attachment"}
        return Reply(path, "application/octet-stream", policy=SANDBOX, headers=saved)
    return Reply(path, kind, policy=SANDBOX)


def _asset(service: Service, request: Request, rest: str) -> Reply:
    del service, request
    if rest not in _ASSETS:
        raise RefusedError(404, f"{quoted(rest)} does not exist")
    package, name, kind = _ASSETS[rest]
    return Reply(files(package).joinpath(name).read_bytes(), kind)


def _all_jobs(service: Service, request: Request, rest: str) -> Reply:
    del request, rest
    return plain({"jobs": [job.shown(service.place) for job in service.jobs.all()]})


def _begin(service: Service, request: Request, rest: str) -> Reply:
    del rest
    content = request.form()
    name, form = content.get("task"), content.get("form")
    known = [each.name for each in tasks().values() if not each.form.is_file]
    if not isinstance(name, str) or name not in known:
        raise unknown_name("task", str(name), known)
    if not isinstance(form, dict):
        raise ParameterError("the form has no fields. Use the page's button", name="fields")
    task = tasks()[name]
    with service.reading:
        asked = task.read(form, service.place)
        begun = service.jobs.begun(task, asked)
    return plain(service.jobs.start(task, asked, begun).shown(service.place), 201)


def _job(service: Service, request: Request, rest: str) -> Reply:
    del request
    return plain(service.jobs.find(rest).shown(service.place))


def _cancel(service: Service, request: Request, rest: str) -> Reply:
    number, slash, word = rest.partition("/")
    if not slash or word != "cancel":
        raise RefusedError(404, f"{quoted(request.path)} does not exist. Jobs support only /cancel")
    job = service.jobs.find(number)
    service.jobs.cancel(job)
    return plain(job.shown(service.place))


def _upload(service: Service, request: Request, rest: str) -> Reply:
    path = uploaded(service.place, request, rest, service.largest)
    return plain({"file": service.place.named(path)}, 201)


def _columns(service: Service, request: Request, rest: str) -> Reply:
    """Return a measurement's columns, and the signals that they may contain."""
    del rest
    path = service.place.file(request.query.get("file", ""))
    if path.suffix.lower() not in endings():
        raise _unknown_format(path.name)
    bench = request.query.get("bench", "")
    with service.reading:
        file = _path_of(service.place, bench) if bench else None
        known = meanings_for(file, request.query.get("method", ""))
    with service.plotting:
        return plain({**shown_columns(service.place, path), **known})


def _subject(request: Request) -> str:
    name = request.query.get("of", "")
    if not name:
        raise ParameterError(
            "the address contains no bench. Follow the links on the start page", name="of"
        )
    return name


def _path_of(place: Place, bench: str) -> Path:
    """Return a bench's path for `bench_file.read`: a file of the folder, or an experiment."""
    if is_file_name(bench):
        return place.file(bench)
    known = experiments()
    if bench not in known:
        raise unknown_name("experiment", bench, known)
    return Path(bench)


_ROUTES: Final[dict[str, dict[str, Route]]] = {
    "/bench": {"GET": _bench},
    "/live": {"GET": _live},
    "/study": {"GET": _study},
    "/task/": {"GET": _task},
    "/file/": {"GET": _file},
    "/assets/": {"GET": _asset},
    "/api/columns": {"GET": _columns},
    "/api/jobs": {"GET": _all_jobs, "POST": _begin},
    "/api/jobs/": {"GET": _job, "POST": _cancel},
    "/api/measurements/": {"PUT": _upload},
    "/": {"GET": _index},
}


def addresses() -> Iterator[tuple[str, str]]:
    """Yield the method and path of every route."""
    for path, methods in _ROUTES.items():
        yield from ((method, path) for method in methods)
