"""The files of the repository: paths that exist, nothing of anybody's machine."""

from __future__ import annotations

import configparser
import re
from pathlib import Path

import pytest
from repository_sources import PACKAGE, PROJECT, ROOT, label, tracked

# Home folders, temporary folders, hosts that serve packages.
FOREIGN = re.compile(
    r"(?<![\w.])/(?:root|home/\w|Users/\w|work/|mnt/|opt/\w|tmp/\w)[\w/.-]*"
    r"|[A-Z]:\\\\?Users|https?://[^\s\"')>]*(?:/simple|pypi|artifactory|nexus|devpi|mirror)"
    r"|--(?:extra-)?index-url|\b(?:localhost|127\.0\.0\.1|10\.\d+\.\d+\.\d+)\b"
)
LOOPBACK = {  # where this machine is meant, whichever it is
    "src/bywire/server/address.py": {"local" + "host", "127.0" + ".0.1"},
}
BINARY = {".png", ".nc", ".mat", ".parquet", ".pdf", ".ico"}


def foreign(text: str) -> list[str]:
    """Return what belongs to a machine and not to the project."""
    return [match[0] for match in FOREIGN.finditer(text)]


def names_in(requirements: list[str]) -> set[str]:
    """Return the names of requirements, as package indexes compare them."""
    names = (re.match(r"[A-Za-z0-9._-]+", text) for text in requirements)
    return {re.sub(r"[-_.]+", "-", match[0]).lower() for match in names if match}


def locked(name: str) -> set[str]:
    """Return the names in a lock file."""
    lines = (ROOT / name).read_text(encoding="utf-8").splitlines()
    return names_in([line for line in lines if line[:1].isalnum()])


def test_nothing_names_a_machine_or_a_package_host():
    own = Path(__file__).name  # holds the patterns and their examples
    found = {}
    for path in tracked():
        if path.suffix in BINARY or path.name == own:
            continue
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
        meant = LOOPBACK.get(label(path), set())
        hits = [
            f"line {k}: {hit}"
            for k, line in enumerate(lines, 1)
            for hit in foreign(line)
            if hit not in meant
        ]
        if hits:
            found[label(path)] = hits[:3]
    assert found == {}


@pytest.mark.parametrize(
    "text",
    [  # put together here, so that none of them stands in this file
        *(f"/{folder}/x" for folder in ("root", "home", "tmp")),
        "C:" + r"\Users\me",
        "https://" + "py" + "pi.org/simple",
        "--index" + "-url",
    ],
)
def test_the_gate_of_machine_names_can_fail(text):
    assert foreign(f"see {text} there")


@pytest.mark.parametrize(
    "text", ["/dev/null", "a/home/b", "src/work/x", "https://doi.org/10.3182/x"]
)
def test_the_gate_of_machine_names_lets_the_rest_pass(text):
    assert foreign(f"see {text} there") == []


def configured_paths() -> list[str]:
    """Return the paths that tools are pointed at."""
    tools = PROJECT["tool"]
    paths = [PROJECT["project"]["readme"], *PROJECT["project"]["license-files"]]
    paths += tools["hatch"]["build"]["targets"]["wheel"]["packages"]
    paths += tools["ruff"]["src"] + tools["mypy"]["files"]
    paths += tools["pytest"]["ini_options"]["testpaths"]
    paths += tools["pytest"]["ini_options"]["pythonpath"]
    paths += [p.split("*")[0] for p in tools["ruff"]["lint"].get("per-file-ignores", {})]
    return [path for path in paths if path]


@pytest.mark.parametrize("path", configured_paths())
def test_every_configured_path_exists(path):
    assert (ROOT / path).exists()


def test_every_program_exists():
    for target in PROJECT["project"]["scripts"].values():
        module, function = target.split(":")
        path = ROOT / "src" / f"{module.replace('.', '/')}.py"
        assert f"def {function}(" in path.read_text(encoding="utf-8")


def test_contract_of_layers_names_the_package():
    contract = configparser.ConfigParser()
    contract.read(ROOT / ".importlinter", encoding="utf-8")
    assert (ROOT / "src" / contract["importlinter"]["root_package"]).samefile(PACKAGE)


def test_every_path_of_the_texts_exists():
    """A file that README and CONTRIBUTING name is there."""
    for name in ("README.md", "CONTRIBUTING.md"):
        text = (ROOT / name).read_text(encoding="utf-8")
        linked = re.findall(r"\]\((?!https?:)([^)#]+)", text)
        missing = [path for path in linked if not (ROOT / path).exists()]
        assert missing == [], name


@pytest.mark.parametrize("lock", ["requirements.lock", "requirements-dev.lock"])
def test_every_dependency_is_locked(lock):
    project = PROJECT["project"]
    wanted = names_in(project["dependencies"])
    if lock == "requirements-dev.lock":
        wanted |= names_in(project["optional-dependencies"]["dev"])
    assert wanted - locked(lock) == set()


def test_peers_of_the_benchmark_have_the_locked_versions():
    lines = (ROOT / "benchmarks" / "requirements.txt").read_text(encoding="utf-8").splitlines()
    pinned = {line.partition(" ")[0] for line in lines if not line.startswith("#")}
    locked_too = re.findall(
        r"^\S+==\S+", (ROOT / "requirements-dev.lock").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert len(pinned) > 3
    assert pinned <= set(locked_too)


def test_every_locked_package_has_hashes():
    for lock in ("requirements.lock", "requirements-dev.lock"):
        blocks = re.split(r"\n(?=[A-Za-z0-9])", (ROOT / lock).read_text(encoding="utf-8"))
        pinned = [block for block in blocks if block[:1].isalnum()]
        assert pinned
        assert [block.split()[0] for block in pinned if "--hash=sha256:" not in block] == []


def test_version_is_one():
    text = (PACKAGE / "core" / "version.py").read_text(encoding="utf-8")
    assert f'__version__ = "{PROJECT["project"]["version"]}"' in text
