"""Every command that accepts a bench, with every bench file in the repository."""

from __future__ import annotations

from pathlib import Path

import pytest

BENCHES = Path(__file__).parents[2] / "benches"
FILES = sorted(BENCHES.glob("*.toml"))
COMMANDS = {
    "run": ("run", "{bench}", "--no-error-estimate"),
    "page": ("page", "{bench}", "--out", "{out}/page.html"),
    "compare": ("compare", "{bench}", "{bench}", "--set", "parameters={parameters}"),
    "study": ("study", "run", "{out}/study.toml", "--out", "{out}/study", "--workers", "1"),
    "wasm": ("export", "wasm", "{bench}", "--out", "{out}/wasm"),
    "fmu": ("export", "fmu", "{bench}", "--out", "{out}/unit"),
    "controller": ("export", "controller", "{bench}", "--out", "{out}/ecu", "--vectors", "8"),
}
STUDY = """
bench = "{bench}"
[vary]
"motor.R_m" = "+-1 %"
[design]
kind = "grid"
levels = 2
"""
QUICK = {
    *(("page", "pedal_tracking"), ("study", "open_loop_chirp"), ("wasm", "hot_motor")),
    ("controller", "corner_wet_stop"),
}
"""what is tried each time: tables, a collection whose text names it, faults, an ECU of two"""


@pytest.mark.parametrize(
    ("command", "file"),
    [
        pytest.param(
            c, f, marks=() if (c, f.stem) in QUICK else pytest.mark.trust, id=f"{c}-{f.stem}"
        )
        for c in COMMANDS
        for f in FILES
    ],
)
def test_a_command_takes_a_shipped_bench(bywire, tmp_path: Path, command: str, file: Path) -> None:
    """The command succeeds, or states in one line why it does not accept the bench."""
    text = file.read_text(encoding="utf-8")
    chosen = next(line for line in text.splitlines() if line.startswith("parameters"))
    given = {"bench": file, "out": tmp_path, "parameters": chosen.split('"')[1]}
    (tmp_path / "study.toml").write_text(STUDY.format(bench=file))
    outcome = bywire(*(word.format(**given) for word in COMMANDS[command]))
    assert "bug in bywire" not in outcome.err
    if outcome.status == 2:
        assert [line[:15] for line in outcome.lines if "error" in line] == ["bywire: error: "]
        assert not [path for path in tmp_path.iterdir() if path.suffix == ".html"]
    else:
        assert outcome.status == 0, outcome.err
