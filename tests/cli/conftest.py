"""Command line, called in this process, or in a separate process where the test needs one."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import BRAKING, QUICK, SCRIPT, Outcome

from bywire.cli.main import main
from undrawn import drawn, undrawn_unless_asked

__all__ = ["drawn", "undrawn_unless_asked"]


@pytest.fixture
def bywire(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Callable[..., Outcome]:
    """Return a function that calls ``bywire`` in this process."""

    def call(*arguments: str | Path) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["bywire", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        code = ended.value.code
        return Outcome(code if isinstance(code, int) else 0, *capsys.readouterr())

    return call


@pytest.fixture
def process() -> Callable[..., Outcome]:
    """Return a function that runs the installed program ``bywire`` until it exits."""

    def call(*arguments: str | Path, **environment: str) -> Outcome:
        done = subprocess.run(
            [str(SCRIPT), *map(str, arguments)],
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
            env={**os.environ, **environment},
        )
        return Outcome(done.returncode, done.stdout, done.stderr)

    return call


@pytest.fixture
def bench(tmp_path: Path) -> Callable[..., Path]:
    """Return a function that writes a bench file. Default: a short brake application."""

    def write(text: str | bytes = BRAKING + QUICK, name: str = "bench.toml") -> Path:
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write
