"""Set up and run bywire with Python alone: ``python3 tasks.py demo`` or ``python3 tasks.py test``.

Everything goes into the folder .venv beside this file; the system's Python is left alone. The
recipes of ``test`` are exactly those of continuous integration. The last of them, ``newest``, runs
a few tests of every room on the newest tested Python, in the folder .venv-newest. ``trust`` takes
hours: it repeats the statistical tests, and the studies of docs/trust.md, which it writes anew.
``docs`` makes the site, docs/_build/index.html, in minutes the first time and seconds from then on.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent
VENV = ROOT / ".venv"
NEWEST_VENV = ROOT / ".venv-newest"
PYTHON = "python.exe" if os.name == "nt" else "python"
LOCKS = {"demo": ["requirements.lock"], "test": ["requirements-dev.lock"]}
LOCKS["trust"] = LOCKS["newest"] = LOCKS["test"]
LOCKS["docs"] = ["requirements-docs.lock"]

PYTEST = ["pytest", "-n", "auto", "-q"]  # one process more takes a tenth longer
# A file's tests share runs and kernels, so one process has them all; the longest files come first.
BY_FILE = ["--dist", "loadfile", "--no-loadscope-reorder"]
# Rewritten assertions, which tell their values, cost as much as a hundred tests: what fails is run
# once more with them.
CHECKS = {
    "format": ["ruff", "format", "--check", "."],
    "lint": ["ruff", "check", "."],
    "layers": ["lint-imports"],
    "tests": [*PYTEST, *BY_FILE, "--assert=plain", "-m", "not trust"],
}
LAST = ["--last-failed", "--last-failed-no-failures", "none"]
AGAIN = {"tests": ["pytest", "-q", *LAST, "-m", "not trust"]}
TYPES = ["mypy"]  # on one core alone, for most of a minute: beside the others
TRUST = {"trust": [*PYTEST, "--dist", "worksteal", "-m", "trust"]}

# What another Python changes, and one quick test of each room: imports and warnings, processes and
# their ends, interrupts, comparisons of results, identities that are kept, text of the system.
# Its recipe takes less than two minutes with the installation; all tests take five.
NEWEST_TESTS = [
    f"tests/{name}"
    for name in (
        "repository/test_imports.py",
        "core/test_core_arguments.py",
        "core/test_core_copies.py",
        "core/test_core_scratch.py",
        "core/test_heard_warnings.py",
        "core/test_undefined.py",
        "cli/test_cli_interrupt.py",
        "cli/test_cli_study_runs.py",
        "studies/test_who_computes.py",
        "studies/test_running.py",
        "server/test_server_jobs.py",
        "data/test_measurement_formats.py",
        "bench/test_computation.py",
        "bench/kpis/test_kpis_of_cases.py",
        "identification/test_trust.py",
        "report/test_report_side_by_side.py",
        "campaigns/test_campaign_runs.py",
        "synthesis/test_design_floors.py",
        "contracts/test_gates_can_fail.py",
        "benchmarks/test_suite.py",
        "cases",
        "simulation/test_run_outcomes.py",
        "analysis/test_margins.py",
        "life/test_life_file.py",
        "procedures/test_formula.py",
        "plant/test_adhesion.py",
        "vehicle",
        "reproduction/test_item.py",
        "api/test_api_run_report.py",
        "signoff/test_verdicts.py",
        "usecases/test_declared.py",
    )
]
NEWEST = {"a few tests on the newest Python": [*PYTEST, *BY_FILE, "--assert=plain", *NEWEST_TESTS]}

HARD_BRAKING = (
    "output-error --bench hard-braking --parameters dardanelli2010 --output p_mc --output i "
    "--unknown motor.R_m --unknown motor.K_e --unknown caliper.K_pd --starts 4"
)
HYDRAULIC = (
    "output-error --system examples/hydraulic_brake.py --parameters hydraulic-1 "
    "--set options.input=p_set "
    "--set options.output=p_mc --set options.end=30bar --output p_mc=0.02bar "
)
STUDIES = {  # row of docs/trust.md -> what ``bywire identify`` is asked
    **{
        name: [name]
        for name in (
            "cogging",
            "current-loop",
            "drive-current-loop",
            "force-calibration",
            "friction-model",
            "friction-ramp",
            "motor-winding",
            "run-down",
            "screw-efficiency",
            "seal-friction",
            "stiffness",
        )
    },
    "braking-dynamics": ["braking-dynamics", "--option", "plant=eq-22", "--option", "model=eq-22"],
    "emb-friction-strokes": ["friction-strokes", "--system", "examples/emb_caliper"],
    "hydraulic-ramp": [
        *HYDRAULIC.split(),
        "--bench",
        "ramp",
        "--set",
        "options.slope=60bar/s",
        "--unknown",
        "seal.f_n",
        "--unknown",
        "seal.F_pr",
    ],
    "hydraulic-step": [
        *HYDRAULIC.split(),
        "--bench",
        "step",
        "--unknown",
        "seal.f_p",
        "--unknown",
        "seal.F_pr",
    ],
    "output-error": HARD_BRAKING.split(),
    "output-error-ideal": [*HARD_BRAKING.split(), "--set", "adc.law=ideal"],
}


def main() -> int:
    """Run one recipe and return its exit status."""
    if sys.version_info < (3, 11):  # noqa: UP036  this file runs on whatever is there
        print(f"bywire needs Python 3.11 or newer, this is {sys.version.split()[0]}")
        return 2
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recipe", choices=["demo", "test", "newest", "trust", "docs", "lock"])
    recipe = parser.parse_args().recipe
    if recipe == "lock":
        return lock()
    if recipe == "newest":
        return newest()
    install(recipe)
    return {"demo": demo, "test": test, "trust": trust, "docs": docs}[recipe]()


def demo() -> int:
    """Run the hard-braking bench and leave its report in results/hard_braking."""
    out = Path("results") / "hard_braking"
    return run("bywire", "run", "benches/hard_braking.toml", "--out", str(out))


def test() -> int:
    """Run all checks, the quick ones first and types beside them; stop at the first that fails."""
    os.environ.setdefault("BYWIRE_CC_QUICK", "1")  # hundreds of kernels, each for short runs
    with tempfile.TemporaryFile("w+") as said:
        types = subprocess.Popen(**command(*TYPES), stdout=said, stderr=subprocess.STDOUT)
        try:
            status = every(CHECKS) or types.wait()
        finally:
            ended = types.poll() is not None
            types.kill()
            types.wait()
        if ended:
            said.seek(0)
            print("== types", said.read(), sep="\n", end="", flush=True)
    return status or newest()


def newest() -> int:
    """Run a few tests on the newest Python that pyproject.toml names, where it is installed."""
    os.environ.setdefault("BYWIRE_CC_QUICK", "1")
    found = newest_python()
    if found is None:
        print(
            f"== no Python newer than {sys.version.split()[0]} that is tested is installed: "
            "its tests are skipped",
            flush=True,
        )
        return 0
    version, python = found
    print(f"== Python {version}", flush=True)
    install("newest", NEWEST_VENV, python)
    return every(NEWEST, NEWEST_VENV)


def newest_python() -> tuple[str, str] | None:
    """Return version and path of the newest Python that is tested and newer than this one.

    A command of that name may be there and not work, as one that pyenv puts in its place.
    """
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    tested = [int(minor) for minor in re.findall(r"Python :: 3\.(\d+)", text)]
    for minor in sorted(tested, reverse=True):
        if minor <= sys.version_info[1]:
            break
        installed = sorted(Path.home().glob(f".pyenv/versions/3.{minor}.*/bin/python"))
        for candidate in (shutil.which(f"python3.{minor}"), *map(str, reversed(installed))):
            if candidate and (version := version_of(candidate)).startswith(f"3.{minor}."):
                return version, candidate
    return None


def version_of(python: str) -> str:
    """Return the version of an interpreter that can make environments; nothing of another."""
    lines = "import ensurepip, sys, venv; print(sys.version.split()[0])"
    try:
        done = subprocess.run(
            [python, "-c", lines], capture_output=True, text=True, timeout=20, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return "" if done.returncode else done.stdout.strip()


def trust() -> int:
    """Run the long statistical tests, then the studies, and write docs/trust.md."""
    status = every(TRUST)
    if status:
        return status
    folder = Path("results") / "trust"
    for label, arguments in STUDIES.items():
        print(f"== {label}", flush=True)
        out = str(folder / label)  # an interrupted study goes on from what lies there
        status = run("bywire", "identify", *arguments, "--study", "200", "--out", out)
        if status not in (0, 1):  # 1: something does not come back, which the page says
            return status
    return run(PYTHON, "docs/make_trust.py", str(folder))


def docs() -> int:
    """Make the site; whatever Sphinx warns of is an error."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("BYWIRE_CC_QUICK", "1")  # kernels of commands that pages show, each once
    return run(PYTHON, "-m", "sphinx", "-q", "-W", "-n", "-b", "html", "docs", "docs/_build")


def every(checks: dict[str, list[str]], place: Path = VENV) -> int:
    """Run commands until one fails, and return its status."""
    # One process per core already: more threads of the libraries would wait for each other.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    for title, check in checks.items():
        print(f"== {title}", flush=True)
        status = run(*check, place=place)
        if status == 1 and title in AGAIN:
            print(f"== {title} that failed, with their values", flush=True)
            run(*AGAIN[title])
        if status:
            return status
    return 0


def lock() -> int:
    """Write the lock files anew from pyproject.toml."""
    install("test")
    common = [
        "uv",
        "pip",
        "compile",
        "pyproject.toml",
        "--universal",
        "--python-version",
        "3.11",
        "--generate-hashes",
        "--no-header",
        "--quiet",
        "--no-emit-index-url",
        "--no-annotate",
        "--extra",
        "compiler",
        "--extra",
        "build",
        "--extra",
        "studies",
    ]
    return (
        run(*common, "-o", "requirements.lock")
        or run(*common, "--extra", "dev", "--extra", "benchmark", "-o", "requirements-dev.lock")
        or run(
            *common,
            "--extra",
            "docs",
            "-c",
            "requirements-dev.lock",
            "-o",
            "requirements-docs.lock",
        )
    )


def install(recipe: str, place: Path = VENV, python: str = sys.executable) -> None:
    """Make a virtual environment, unless it holds just what the lock files say."""
    its_own = binaries(place) / PYTHON
    if place != VENV and its_own.exists() and version_of(str(its_own)) != version_of(python):
        shutil.rmtree(place)
    if not its_own.exists():
        print(f"making {place.name}", flush=True)
        if subprocess.run([python, "-m", "venv", "--clear", str(place)], check=False).returncode:
            raise SystemExit(
                "this Python cannot make virtual environments: install its venv module "
                "(on Debian and Ubuntu the package python3-venv)"
            )
    stamp = place / "installed"
    done = stamp.read_text().split() if stamp.exists() else []
    for name in LOCKS[recipe]:
        # Of pyproject.toml as well: it names the entry points by which brakes are found.
        content = (ROOT / name).read_bytes() + (ROOT / "pyproject.toml").read_bytes()
        digest = hashlib.sha256(content).hexdigest()
        if digest in done:
            continue
        print(f"installing {name}", flush=True)
        # Python compiles what is imported; all that is installed would take half a minute.
        pip(its_own, "install", "--no-compile", "--require-hashes", "-r", name)
        pip(its_own, "install", "--no-deps", "--no-build-isolation", "-e", ".")
        done.append(digest)
        stamp.write_text("\n".join(done))


def binaries(place: Path) -> Path:
    """Return the folder of a virtual environment's programs."""
    return place / ("Scripts" if os.name == "nt" else "bin")


def pip(python: Path, *arguments: str) -> None:
    """Run pip in a virtual environment, quietly."""
    command = [str(python), "-m", "pip", "--quiet", "--disable-pip-version-check", *arguments]
    if subprocess.run(command, cwd=ROOT, check=False).returncode:
        raise SystemExit("pip failed, see above; the network or a package mirror may be down")


def run(program: str, *arguments: str, place: Path = VENV) -> int:
    """Run a program of a virtual environment and return its exit status."""
    try:
        call = command(program, *arguments, place=place)
        return subprocess.run(**call, check=False).returncode
    except KeyboardInterrupt:
        return 130


def command(program: str, *arguments: str, place: Path = VENV) -> dict[str, Any]:
    """Return how a program of a virtual environment is called."""
    folder = binaries(place)
    environment = {**os.environ, "PATH": f"{folder}{os.pathsep}{os.environ.get('PATH', '')}"}
    # Tests start a hundred processes: without byte code each compiles all that it imports.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    return {"args": [str(folder / program), *arguments], "cwd": ROOT, "env": environment}


if __name__ == "__main__":
    sys.exit(main())
