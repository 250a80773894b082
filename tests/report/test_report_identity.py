"""Identity of a report: date, person, version, commit, command, inputs with digests."""

from __future__ import annotations

import hashlib
import subprocess
from pathlib import Path

import pytest

from bywire.core.callers import command_line
from bywire.report import identity
from bywire.report.page import page_html

COMMIT = "0123456789abcdef0123456789abcdef01234567"


def test_a_command_states_its_words_and_its_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a bench.toml").write_bytes(b"x = 1\n")
    monkeypatch.setattr("sys.argv", ["bywire", "run", "a bench.toml", "--set", "x=<b>", "\0"])
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    with command_line():
        made = identity.identity()
    rows = dict(made)
    assert rows["date"] == "1970-01-02 00:00 UTC"
    assert rows["command"].startswith("bywire run 'a bench.toml' --set 'x=<b>'")
    digest = hashlib.sha256(b"x = 1\n").hexdigest()[:12]
    assert rows["input"] == f"a bench.toml (SHA-256 {digest})"
    page = page_html("t", "s", [], made=made)
    assert "<dt>input</dt><dd>a bench.toml (SHA-256" in page
    assert "<b>" not in page


@pytest.mark.parametrize("kind", ["loose", "packed", "detached", "linked"])
def test_the_commit_is_read_without_starting_git(tmp_path: Path, kind: str) -> None:
    git = tmp_path / ".git"
    git.mkdir()
    (git / "HEAD").write_text(COMMIT if kind == "detached" else "ref: refs/heads/main\n")
    if kind in ("loose", "linked"):
        (git / "refs/heads").mkdir(parents=True)
        (git / "refs/heads/main").write_text(COMMIT + "\n")
    (git / "packed-refs").write_text(f"# pack-refs\n{COMMIT} refs/heads/main\n")
    folder = tmp_path / "benches"
    folder.mkdir()
    if kind == "linked":
        (git / "worktrees/b").mkdir(parents=True)
        (git / "worktrees/b/HEAD").write_text("ref: refs/heads/main\n")
        (git / "worktrees/b/commondir").write_text("../..\n")
        (folder / ".git").write_text("gitdir: ../.git/worktrees/b\n")
    assert identity.commit(folder) == COMMIT[:12]


@pytest.mark.parametrize(
    "head", ["ref: ../../../../etc/passwd", "ref: /etc/passwd", "nonsense", "", "\xff"]
)
def test_a_damaged_repository_has_no_commit(tmp_path: Path, head: str) -> None:
    (tmp_path / ".git").mkdir()
    (tmp_path / ".git/HEAD").write_text(head, encoding="latin-1")
    assert identity.commit(tmp_path) == ""


def test_the_commit_is_that_of_git() -> None:
    root = Path(__file__).resolve().parents[2]
    git = subprocess.run(
        ["git", "-C", str(root), "rev-parse", "HEAD"], capture_output=True, text=True, check=False
    )
    if git.returncode:
        pytest.skip("not a clone")
    assert identity.commit(root) == git.stdout[:12]
