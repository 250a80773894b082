"""Set up and run bywire with Python alone: ``python3 tasks.py demo`` or ``python3 tasks.py test``.

Everything goes into the folder .venv beside this file; the system's Python is left alone. The
recipes of ``test`` are exactly those of continuous integration. ``trust`` takes hours: it repeats
the statistical tests, and the studies of docs/trust.md, which it writes anew. ``docs`` makes the
site, docs/_build/index.html, in minutes the first time and seconds from then on.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import subprocess
import sys
import tempfile
import venv
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent
VENV = ROOT / ".venv"
BIN = VENV / ("Scripts" if os.name == "nt" else "bin")
PYTHON = BIN / ("python.exe" if os.name == "nt" else "python")
LOCKS = {"demo": ["requirements.lock"], "test": ["requirements-dev.lock"]}
LOCKS["trust"] = LOCKS["test"]
LOCKS["docs"] = ["requirements-docs.lock"]

PYTEST = ["pytest", "-n", "auto", "-q"]  # one process more takes a tenth longer
# A file's tests share runs and kernels, so one process has them all; the longest files come first.
BY_FILE = ["--dist", "loadfile", "--no-loadscope-reorder"]
# Rewritten assertions, which tell their values, cost as much as a hundred tests: what fails is run
# once more with them.
CHECKS = {
    "format and lint": ["ruff", "check", "."],
    "layers": ["lint-imports"],
    "tests": [*PYTEST, *BY_FILE, "--assert=plain", "-m", "not trust"],
}
LAST = ["--last-failed", "--last-failed-no-failures", "none"]
AGAIN = {"tests": ["pytest", "-q", *LAST, "-m", "not trust"]}
TYPES = ["mypy"]  # on one core alone, for most of a minute: beside the others
TRUST = {"trust": [*PYTEST, "--dist", "worksteal", "-m", "trust"]}

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
            "cogging", "current-loop", "drive-current-loop", "force-calibration", "friction-model",
            "friction-ramp", "motor-winding", "run-down", "screw-efficiency", "seal-friction",
            "stiffness",
        )
    },
    "braking-dynamics": ["braking-dynamics", "--option", "plant=eq-22", "--option", "model=eq-22"],
    "emb-friction-strokes": ["friction-strokes", "--system", "examples/emb_caliper"],
    "hydraulic-ramp": [
        *HYDRAULIC.split(), "--bench", "ramp", "--set", "options.slope=60bar/s", "--unknown",
        "seal.f_n", "--unknown", "seal.F_pr",
    ],
    "hydraulic-step": [
        *HYDRAULIC.split(), "--bench", "step", "--unknown", "seal.f_p", "--unknown", "seal.F_pr",
    ],
    "output-error": HARD_BRAKING.split(),
    "output-error-ideal": [*HARD_BRAKING.split(), "--set", "adc.law=ideal"],
}  # fmt: skip


def main() -> int:
    """Run one recipe and return its exit status."""
    if sys.version_info < (3, 11):  # noqa: UP036  this file runs on whatever is there
        print(f"bywire needs Python 3.11 or newer, this is {sys.version.split()[0]}")
        return 2
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recipe", choices=["demo", "test", "trust", "docs", "lock"])
    recipe = parser.parse_args().recipe
    if recipe == "lock":
        return lock()
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
    return status


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
    return run(PYTHON.name, "docs/make_trust.py", str(folder))


def docs() -> int:
    """Make the site; whatever Sphinx warns of is an error."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    return run(
        PYTHON.name, "-m", "sphinx", "-q", "-W", "-n", "-b", "html", "docs", "docs/_build"
    )


def every(checks: dict[str, list[str]]) -> int:
    """Run commands until one fails, and return its status."""
    # One process per core already: more threads of the libraries would wait for each other.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    for title, check in checks.items():
        print(f"== {title}", flush=True)
        status = run(*check)
        if status == 1 and title in AGAIN:
            print(f"== {title} that failed, with their values", flush=True)
            run(*AGAIN[title])
        if status:
            return status
    return 0


def lock() -> int:
    """Write the lock files anew from pyproject.toml."""
    install("test")
    common = ["uv", "pip", "compile", "pyproject.toml", "--universal", "--python-version", "3.11",
              "--generate-hashes", "--no-header", "--quiet", "--no-emit-index-url",
              "--no-annotate", "--extra", "compiler", "--extra", "build",
              "--extra", "studies"]  # fmt: skip
    return (
        run(*common, "-o", "requirements.lock")
        or run(*common, "--extra", "dev", "-o", "requirements-dev.lock")
        or run(*common, "--extra", "docs", "-c", "requirements-dev.lock",
               "-o", "requirements-docs.lock")
    )  # fmt: skip


def install(recipe: str) -> None:
    """Make the virtual environment, unless it holds just what the lock files say."""
    if not PYTHON.exists():
        print(f"making {VENV.name}", flush=True)
        try:
            venv.create(VENV, with_pip=True)
        except subprocess.CalledProcessError:
            raise SystemExit(
                "this Python cannot make virtual environments: install its venv module "
                "(on Debian and Ubuntu the package python3-venv)"
            ) from None
    stamp = VENV / "installed"
    done = stamp.read_text().split() if stamp.exists() else []
    for name in LOCKS[recipe]:
        # Of pyproject.toml as well: it names the entry points by which brakes are found.
        content = (ROOT / name).read_bytes() + (ROOT / "pyproject.toml").read_bytes()
        digest = hashlib.sha256(content).hexdigest()
        if digest in done:
            continue
        print(f"installing {name}", flush=True)
        # Python compiles what is imported; all that is installed would take half a minute.
        pip("install", "--no-compile", "--require-hashes", "-r", name)
        pip("install", "--no-deps", "--no-build-isolation", "-e", ".")
        done.append(digest)
        stamp.write_text("\n".join(done))


def pip(*arguments: str) -> None:
    """Run pip in the virtual environment, quietly."""
    command = [str(PYTHON), "-m", "pip", "--quiet", "--disable-pip-version-check", *arguments]
    if subprocess.run(command, cwd=ROOT, check=False).returncode:
        raise SystemExit("pip failed, see above; the network or a package mirror may be down")


def run(program: str, *arguments: str) -> int:
    """Run a program of the virtual environment and return its exit status."""
    try:
        return subprocess.run(**command(program, *arguments), check=False).returncode
    except KeyboardInterrupt:
        return 130


def command(program: str, *arguments: str) -> dict[str, Any]:
    """Return how a program of the virtual environment is called."""
    environment = {**os.environ, "PATH": f"{BIN}{os.pathsep}{os.environ.get('PATH', '')}"}
    # Tests start a hundred processes: without byte code each compiles all that it imports.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    return {"args": [str(BIN / program), *arguments], "cwd": ROOT, "env": environment}


if __name__ == "__main__":
    sys.exit(main())
