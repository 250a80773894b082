"""No process of bywire loads code from the working folder or from a served folder."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import sysconfig
import threading
from importlib.metadata import packages_distributions
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import bywire
from bywire.core import child_process
from bywire.core.child_process import (
    environment,
    find_program,
    import_path,
    leave_out_working_folder,
    python_command,
    run_program,
    safe_start,
    start_python,
)
from bywire.core.errors import CompilerError
from bywire.core.scratch import process_folder
from bywire.server.serving import opened
from bywire.simulation.compiler import find_compiler, usable_folder

SOURCES = Path(bywire.__file__).parent
COMMAND = str(Path(sysconfig.get_path("scripts")) / "bywire")
PROGRAMS = ("cc", "gcc", "clang", "zig", "as", "ld", "uname", "ldconfig", "python", "python3")
posix = pytest.mark.skipif(sys.platform == "win32", reason="executable shell scripts")

ASKED_FOR = """
import json, sys
names = set()
sys.addaudithook(lambda event, given: names.add(given[0]) if event == "import" else None)
import bywire.server.job_process, bywire.data.reading_child
from bywire.server.task import tasks
from bywire.data.format_registry import FORMATS
from bywire.api.overview import overview
for kind in FORMATS.all().values():
    for library in kind.libraries:
        try:
            __import__(library)
        except ImportError:
            pass
import multiprocessing.spawn, multiprocessing.forkserver, multiprocessing.resource_tracker
tasks(), overview()
print(json.dumps(sorted({name.partition(".")[0] for name in names | {*sys.modules}})))
"""


@pytest.fixture(scope="module")
def names() -> set[str]:
    """Return every top name that a child imports or asks for, and every one that is installed."""
    asked = subprocess.run(
        python_command("-c", ASKED_FOR), env=environment(), capture_output=True, check=True
    )
    found = {*json.loads(asked.stdout), *sys.stdlib_module_names, *packages_distributions()}
    assert {"ziglang", "numpy", "casadi", "encodings", "dask"} <= found
    return {name for name in found | {"sitecustomize", "usercustomize"} if name.isidentifier()}


@pytest.fixture
def planted(tmp_path: Path, names: set[str], monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder, the working one, in which every module and program would leave a mark.

    Lists of folders begin with an empty entry, as ``PATH=$MINE:$PATH`` without ``MINE`` has it.
    """
    folder, mark = tmp_path / "downloaded", tmp_path / "mark"
    folder.mkdir()
    for name in names:
        (folder / f"{name}.py").write_text(f"open({str(mark)!r}, 'a').write(__name__ + ' ')\n")
    for name in PROGRAMS:
        (folder / name).write_text(f"#!/bin/sh\necho program {name} >> {mark}\n")
        (folder / name).chmod(0o755)
    brake = folder / "evil-1.0.dist-info"
    brake.mkdir()
    (brake / "METADATA").write_text("Metadata-Version: 2.1\nName: evil\nVersion: 1.0\n")
    (brake / "entry_points.txt").write_text("[bywire.brakes]\nevil = antigravity\n")
    (folder / "matplotlibrc").write_text("text.usetex: True\n")
    (folder / "step.toml").write_text(
        'experiment = "hard-braking"\nparameters = "dardanelli2010"\n'
        '[options]\nduration = "40 ms"\nsettle = "10 ms"\n'
    )
    (folder / "study.toml").write_text('bench = "step.toml"\n[vary]\n"motor.R_m" = "+-5 %"\n')
    monkeypatch.chdir(folder)
    for name in ("PATH", "LD_LIBRARY_PATH", "C_INCLUDE_PATH"):
        monkeypatch.setenv(name, os.pathsep.join(["", str(folder), os.environ.get(name, "/lib")]))
    return folder


def marks(folder: Path) -> str:
    """Return the files of a folder that were executed."""
    mark = folder.parent / "mark"
    return mark.read_text() if mark.exists() else ""


def test_marks_are_left_by_what_is_run(planted: Path, names: set[str]) -> None:
    subprocess.run([sys.executable, "-c", "import ziglang"], capture_output=True, check=False)
    subprocess.run(["cc"], check=False)
    *modules, program, cc = marks(planted).split()
    # From Python 3.13 on, -c loads modules of its own first, which are planted as well.
    assert modules
    assert set(modules) <= names
    assert sys.version_info >= (3, 13) or modules == ["ziglang"]
    assert (program, cc) == ("program", "cc")


@posix
@pytest.mark.parametrize(
    "words",
    ["page step.toml --out page.html", "study run study.toml --cases 9", "convert run.mat a.csv"],
    ids=lambda words: words.partition(" ")[0],
)
def test_no_command_runs_what_lies_in_the_working_folder(planted: Path, words: str) -> None:
    if words.startswith("convert"):
        data = xr.Dataset(
            {"p": ("time", np.ones(9), {"units": "Pa"})},
            {"time": ("time", np.arange(9.0), {"units": "s"})},
        )
        bywire.write_measurement(data, planted / "run.mat")
    done = subprocess.run([COMMAND, *words.split()], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert marks(planted) == ""


@posix
def test_a_served_folder_runs_nothing(planted: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither where it is looked at, which compiles, nor where it was put on the path."""
    monkeypatch.chdir(planted.parent)
    monkeypatch.syspath_prepend(str(planted.parent / "none"))
    with opened(planted, port=0) as server:
        monkeypatch.setattr(sys, "path", [*sys.path, str(planted)])
        monkeypatch.setenv("PYTHONPATH", str(planted))
        serving = threading.Thread(target=server.server.serve_forever, args=(0.02,))
        serving.start()
        try:
            assert b"<html" in server.service.live_pages.file("step.toml", "").read_bytes()
        finally:
            server.server.shutdown()
            serving.join()
    assert marks(planted) == ""


@posix
def test_children_of_a_notebook_run_nothing(planted: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A console and a notebook have the working folder on their path, as an empty entry."""
    monkeypatch.setattr(sys, "path", ["", *sys.path, str(planted)])
    monkeypatch.setenv("PYTHONPATH", "")
    find_compiler.cache_clear()
    assert find_compiler() is not None
    find_compiler.cache_clear()
    child = start_python("bywire.data.reading_child", "bywire.data.formats.csv", "alone")
    child.communicate(timeout=60)
    assert child.returncode == 0
    for tool in ("cc", "ziglang"):
        command = find_program("cc") if tool == "cc" else child_process.module_command(tool, "cc")
        if command is not None:
            run = run_program([command] if tool == "cc" else [*command], 60.0)
            assert "no input files" in run.stderr
    monkeypatch.setattr(sys, "path", import_path())
    with safe_start():
        process = get_context("spawn").Process(target=os.getcwd)
        process.start()
    process.join(60)
    assert process.exitcode == 0
    assert marks(planted) == ""


def test_lists_of_folders_are_absolute_and_not_the_working_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "link").symlink_to(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"::.:bin:{tmp_path}:{tmp_path}/link:/usr/bin:/bin:")
    monkeypatch.setenv("CPATH", ":")
    (tmp_path / "served").mkdir()
    monkeypatch.setenv("LIBRARY_PATH", f"{tmp_path}/served:/lib")
    made = environment([tmp_path / "served"])
    assert (made["PATH"], made["LIBRARY_PATH"]) == ("/usr/bin:/bin", "/lib")
    assert "CPATH" not in made  # an empty one is the working folder to compilers
    (tmp_path / "own-cc").write_text("#!/bin/sh\n")
    (tmp_path / "own-cc").chmod(0o755)
    assert find_program("own-cc") is None
    assert find_program("./own-cc") == str(tmp_path / "own-cc")


def test_a_command_leaves_the_working_folder_but_keeps_bywire(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    root = str(SOURCES.parent)
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", ["", "src", str(tmp_path), root, "/usr/lib"])
    leave_out_working_folder()
    assert sys.path == [root, "/usr/lib"]
    assert os.environ["PYTHONSAFEPATH"] == "1"
    monkeypatch.chdir(root)  # a clone that was never installed
    assert import_path() == [root, "/usr/lib"]


def test_kernels_are_not_taken_from_the_working_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("BYWIRE_CACHE", "cache")
    with pytest.raises(CompilerError, match=f"cache is relative.*{tmp_path}/cache, or unset it"):
        usable_folder()
    monkeypatch.delenv("BYWIRE_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "cache")
    assert usable_folder().is_absolute()
    assert not usable_folder().is_relative_to(tmp_path)


@posix
def test_a_compiler_writes_elsewhere_where_home_takes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It keeps what it makes there, and else ends: a file in its place stands for such a disk."""
    asked = python_command("-c", "import os; print(os.environ.get('ZIG_GLOBAL_CACHE_DIR', ''))")
    for name in ("ZIG_GLOBAL_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    assert run_program(asked, 60.0).stdout.strip() == ""
    for home in (os.devnull, "", "relative"):
        monkeypatch.setenv("HOME", home)
        assert run_program(asked, 60.0).stdout.strip() == str(process_folder() / "zig")


def test_processes_are_started_in_one_place() -> None:
    starting = re.compile(
        r"subprocess\.(run|Popen|call|check_)|sys\.executable|shutil\.which|os\.(system|exec|spawn)"
    )
    places = {
        path.relative_to(SOURCES).as_posix()
        for path in SOURCES.rglob("*.py")
        if starting.search(path.read_text(encoding="utf-8").replace("subprocess.Popen[", ""))
    }
    assert places == {"core/child_process.py"}
