"""Built packages: wheel and sdist work where no clone of the repository is."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = {
    "list": ["list", "experiments"],
    "run": ["run", "hard-braking", "--set", "options.duration=40 ms", "--out", "run"],
    "page": ["page", "hard-braking", "--vary", "motor.R_m", "--out", "page.html"],
    "controller": ["export", "controller", "hard-braking", "--out", "ecu"],
    "reproduce": ["list", "roberts2003"],
    "new": ["new", "my-brake"],
}


def build(kind: str, source: Path, target: Path) -> Path:
    """Return a wheel or an sdist that Hatchling built of a folder."""
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(target)],
        cwd=source,
        check=True,
        capture_output=True,
    )
    (made,) = target.iterdir()
    return made


@pytest.fixture(scope="module", params=["wheel", "sdist"])
def installed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the package of a wheel: of the clone, or of the sdist's own files."""
    folder = tmp_path_factory.mktemp(request.param)
    source = ROOT
    if request.param == "sdist":
        with tarfile.open(build("sdist", ROOT, folder / "sdist")) as archive:
            archive.extractall(folder / "source", filter="data")
        (source,) = (folder / "source").iterdir()
    with zipfile.ZipFile(build("wheel", source, folder / "wheel")) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


@pytest.mark.parametrize("name", COMMANDS)
def test_commands_work_without_the_repository(installed: Path, name: str, tmp_path: Path) -> None:
    # Without the site module no clone is on the path, only the libraries and the built package.
    code = (
        f"import sys; sys.path[:0] = {[str(installed), sysconfig.get_path('purelib')]!r}; "
        "import bywire; "
        f"assert bywire.__file__.startswith({str(installed)!r}), bywire.__file__; "
        "from bywire.cli.main import main; main()"
    )
    environment = {**os.environ, "BYWIRE_CACHE": str(installed.parent / "cache")}
    environment.pop("PYTHONPATH", None)
    done = subprocess.run(
        [sys.executable, "-S", "-P", "-c", code, *COMMANDS[name]],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr


def test_a_wheel_without_its_data_is_noticed(installed: Path, tmp_path: Path) -> None:
    """That this test can fail: a file that is no Python is missing."""
    page = installed / "bywire" / "report" / "page.css"
    text = page.read_bytes()
    page.unlink()
    try:
        with pytest.raises(AssertionError):
            test_commands_work_without_the_repository(installed, "run", tmp_path)
    finally:
        page.write_bytes(text)
