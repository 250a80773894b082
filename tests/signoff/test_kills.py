"""A sign-off that was killed many times ends in the same document as one that was not."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = Path(__file__).with_name("killed.py")


def files_of(folder: Path) -> dict[str, bytes]:
    """Return the files of a folder by their paths in it."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.mark.skipif(sys.platform == "win32", reason="needs fork and SIGKILL")
def test_a_hundred_kills_leave_the_same_document(tmp_path: Path) -> None:
    file = tmp_path / "list.toml"
    file.write_text(
        "\n".join(
            f'[[requirement]]\nid = "R{k}"\ntext = "F."\n[[evidence]]\nshows = "R{k}"\n'
            f'spring = "s{k}"\nk = [{90e3 + 1e3 * k}]\nlimit = "force >= 100 N"\n'
            for k in range(20)
        )
    )
    for name, kills in (("killed", 100), ("whole", 0)):
        folder = tmp_path / name
        folder.mkdir()
        environment = {
            **os.environ,
            "SOURCE_DATE_EPOCH": "0",
            "PYTHONPATH": str(PROGRAM.parents[1]),
        }
        subprocess.run(
            [sys.executable, str(PROGRAM), str(file), "out", str(kills)],
            cwd=folder,
            env=environment,
            check=True,
        )
    killed, whole = (files_of(tmp_path / name / "out") for name in ("killed", "whole"))
    assert len(whole) == 23  # the document, its two records, and 20 pieces of evidence
    assert killed == whole
