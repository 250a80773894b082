"""Kernels that a command keeps for the next one: never stale, never damaged, the same bits."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bywire
from bywire.core import sources
from bywire.core.errors import ModelError
from bywire.simulation import engine, program
from bywire.simulation.compiler import Compiler, find_compiler
from bywire.simulation.ensemble import Ensemble, simulate_ensemble
from bywire.simulation.run import Run, Trajectory, simulate
from systems.nonlinear_drive import PARAMETERS, Memory, NonlinearDrive, State
from systems.two_mass import rig

PACKAGE = Path(bywire.__file__).parent


class Kept:
    """Runs as of one new process after the other, and how many programs they built."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder, self.builds, self._monkeypatch = folder, 0, monkeypatch
        self.state = "first"
        build = program.build_program

        def counted(*arguments: object) -> object:
            self.builds += 1
            return build(*arguments)  # type: ignore[arg-type]

        monkeypatch.setenv("BYWIRE_CACHE", str(folder))
        monkeypatch.setattr(program, "build_program", counted)
        monkeypatch.setattr(engine, "_is_ours", lambda kind: True)
        monkeypatch.setattr(engine, "_running_state", lambda: self.state)

    def run(self, run: Run, kind: str = "auto") -> Trajectory:
        """Run in what counts as a new process."""
        self._monkeypatch.setattr(engine, "_PREPARED", {})
        return simulate(run, engine=kind)

    def entries(self) -> list[Path]:
        """Return the files of kept kernels."""
        return sorted(self.folder.glob("kernel-*.json"))


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Kept:
    return Kept(tmp_path / "kernels", monkeypatch)


def require_equal(a: Trajectory, b: Trajectory) -> None:
    np.testing.assert_array_equal(a.values, b.values)
    np.testing.assert_array_equal(a.vector, b.vector)
    assert (a.names, a.status, a.engine, a.doubt) == (b.names, b.status, b.engine, b.doubt)


# The contact is too stiff for the step: the doubt of it must be told by kept Jacobians too.
CONTACT = rig(0.02, k_wall=5e9, tau_wall=1e-8)


def drive(model: NonlinearDrive) -> Run:
    return Run(
        model,
        PARAMETERS,
        State(0.0, 0.0, 0.0),
        Memory(6.0),
        lambda t: np.full((t.size, 1), 6.0),
        0.02,
    )


SMALL = drive(NonlinearDrive())  # for what any kernel shows: it is built soonest


def test_a_kept_kernel_needs_no_program_and_gives_the_same_bits(kept: Kept) -> None:
    plain = simulate(CONTACT)
    assert "rebounds may be wrong" in plain.doubt
    require_equal(kept.run(CONTACT), plain)
    assert (kept.builds, len(kept.entries())) == (1, 1)
    require_equal(kept.run(CONTACT), plain)
    require_equal(
        kept.run(replace(CONTACT, par=CONTACT.par.replace({"m_1": 1.1}))),
        simulate(replace(CONTACT, par=CONTACT.par.replace({"m_1": 1.1}))),
    )
    assert kept.builds == 1


def test_what_else_is_asked_of_it_is_built_then(kept: Kept) -> None:
    kept.run(CONTACT)
    machine = kept.run(CONTACT, "virtual-machine")
    assert kept.builds == 2
    require_equal(machine, simulate(CONTACT, engine="virtual-machine"))
    assert len(engine.prepare(CONTACT.model, CONTACT.par).program.ticks) == 1
    assert kept.builds == 2


def test_kernels_in_lanes_are_kept_by_what_they_record(
    kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    masses = {"m_1": [1.0, 1.1, 1.2]}
    plain = simulate_ensemble(CONTACT, masses, ("x_1", "v_1"))

    def again(*signals: str) -> Ensemble:
        monkeypatch.setattr(engine, "_PREPARED", {})
        return simulate_ensemble(CONTACT, masses, signals)

    for _ in range(2):
        np.testing.assert_array_equal(again("x_1", "v_1").values, plain.values)
        assert kept.builds == 1
    np.testing.assert_array_equal(again("v_1").values, plain.values[:, :, 1:])
    assert kept.builds == 2
    monkeypatch.setattr(engine, "processor", lambda: "another one")
    again("v_1")
    assert kept.builds == 3
    # A single run needs a kernel of its own; what was kept of the model says nothing wrong.
    for _ in range(2):
        require_equal(kept.run(CONTACT), simulate(CONTACT))
        assert kept.builds == 4
    monkeypatch.setattr(engine, "processor", lambda: "a third one")
    kept.run(CONTACT)
    assert kept.builds == 5


def halved(path: Path) -> None:
    content = path.read_bytes()
    path.unlink()  # the old one may be mapped
    path.write_bytes(content[: len(content) // 2])


def flipped(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.unlink()
    path.write_bytes(bytes(content))


def emptied(path: Path) -> None:
    path.unlink()
    path.write_bytes(b"")


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> tuple[Trajectory, Path]:
    """Return a run and the folder in which its kernel was kept."""
    with pytest.MonkeyPatch.context() as patch:
        made = Kept(tmp_path_factory.mktemp("sound") / "kernels", patch)
        return made.run(SMALL), made.folder


@pytest.mark.parametrize("damage", [halved, flipped, emptied, Path.unlink])
@pytest.mark.parametrize("ending", ["json", "so", "sha256"])
def test_what_is_damaged_is_built_anew(
    kept: Kept, sound: tuple[Trajectory, Path], damage: Callable[[Path], None], ending: str
) -> None:
    first, folder = sound
    shutil.copytree(folder, kept.folder)
    damage(next(kept.folder.glob(f"*.{ending}")))
    require_equal(kept.run(SMALL), first)
    assert kept.builds == 1
    require_equal(kept.run(SMALL), first)
    assert kept.builds == 1


def test_an_entry_of_another_shape_is_built_anew(kept: Kept) -> None:
    """Its digest holds, its contents do not."""
    first = kept.run(SMALL)
    for text in ("{}", "[]", '{"library": 3}'):
        kept.entries()[0].write_text(f"{engine._digest(text)}\n{text}")
        require_equal(kept.run(SMALL), first)
    assert kept.builds == 4


def test_other_sources_or_another_compiler_build_anew(
    kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = kept.run(SMALL)
    kept.state = "second"
    require_equal(kept.run(SMALL), first)
    assert kept.builds == 2
    found = find_compiler()
    assert found is not None
    monkeypatch.setattr(engine, "find_compiler", lambda: Compiler(found.command, "another 1.0"))
    other = kept.run(SMALL)
    assert (other.engine, kept.builds) == ("compiled C, another 1.0", 3)
    kept.run(SMALL)
    assert (kept.builds, len(kept.entries())) == (3, 1)


def test_nothing_is_kept_when_a_file_changed_meanwhile(
    kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    states = iter(["before", "after"])
    monkeypatch.setattr(engine, "_running_state", lambda: next(states))
    kept.run(SMALL)
    assert kept.entries() == []


class Geared(NonlinearDrive):
    """A drive with a value and an object of its own."""

    def __init__(self, factor: float, other: object = None) -> None:
        self.factor, self.other = factor, other

    def balance(self, x, xe, m, par, contact):
        plain = super().balance(x, xe, m, par, contact)
        return plain._replace(omega=plain.omega - self.factor * x.omega)


class Broken(NonlinearDrive):
    """A drive with a balance that is one short."""

    def balance(self, x, xe, m, par, contact):
        return super().balance(x, xe, m, par, contact)[:-1]


def test_models_are_kept_apart(kept: Kept) -> None:
    runs = [
        drive(NonlinearDrive()),
        drive(Geared(0.0)),
        drive(Geared(0.1)),
        CONTACT,
        rig(0.02, rare=True),
    ]
    plain = [simulate(run) for run in runs]
    for _ in range(2):
        for run, expected in zip(runs, plain, strict=True):
            require_equal(kept.run(run), expected)
    assert (kept.builds, len(kept.entries())) == (5, 5)


def test_a_model_that_holds_an_object_is_not_kept(kept: Kept) -> None:
    for _ in range(2):
        kept.run(drive(Geared(0.1, other=object())))
    assert (kept.builds, kept.entries()) == (2, [])


def test_a_model_that_fails_fails_again(kept: Kept) -> None:
    for _ in range(2):
        with pytest.raises(ModelError, match="one right-hand side per state"):
            kept.run(drive(Broken()))
    assert kept.entries() == []


def test_a_folder_that_takes_nothing(kept: Kept, monkeypatch: pytest.MonkeyPatch) -> None:
    first = kept.run(SMALL)
    file = kept.folder / "file"
    file.write_text("")
    monkeypatch.setenv("BYWIRE_CACHE", str(file / "kernels"))
    require_equal(kept.run(SMALL), first)
    assert kept.builds == 2
    monkeypatch.setattr(engine, "keep_text", lambda path, text: None)
    monkeypatch.setenv("BYWIRE_CACHE", str(kept.folder / "below"))
    require_equal(kept.run(SMALL), first)
    assert kept.builds == 3


def test_only_our_own_models_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of another's model nobody knows what it is made of."""
    monkeypatch.setenv("BYWIRE_CACHE", str(tmp_path))
    monkeypatch.setattr(engine, "_running_state", lambda: "state")
    case = bywire.Bench("hard-braking", "dardanelli2010").cases()[0]
    ours = engine.structure_of(case.model, case.par)
    other_choice = engine.structure_of(case.model, case.par.replace({"gear.law": "directional"}))
    assert engine.place_of(case.model, ours) is not None
    assert engine.place_of(case.model, ours) != engine.place_of(case.model, other_choice)
    theirs = engine.structure_of(CONTACT.model, CONTACT.par)
    assert engine.place_of(CONTACT.model, theirs) is None

    class Changed(type(case.model)):  # type: ignore[misc]
        """One of ours with somebody's changes."""

    changed = Changed()
    assert engine.place_of(changed, engine.structure_of(changed, case.par)) is None
    monkeypatch.setattr(engine, "_running_state", lambda: "")
    assert engine.place_of(case.model, ours) is None


def test_a_program_that_uses_bywire_is_no_command() -> None:
    """It may have put functions of its own in the place of ours."""
    assert not sources.source_state().is_running
    with sources.command():
        assert not sources.source_state().is_running


STARTED = """
import bywire.cli.main
from bywire.core import sources
{before}
with sources.command():
    print(bool(sources._started))
"""


@pytest.mark.parametrize(
    ("before", "is_command"),
    [
        ("", True),  # what the start itself loads shapes no model
        ("import bywire.core.ops", False),
        ("import bywire.core.parameters", False),
        ("import bywire.simulation.compiler", False),
    ],
)
def test_the_start_loads_nothing_that_shapes_models(before: str, is_command: bool) -> None:
    code = STARTED.format(before=before)
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == str(is_command), out.stderr


RUN = """
import sys
from bywire.core import sources
if len(sys.argv) > 1:
    sources.TICK = int(sys.argv[1])
sys.argv = ["bywire", "run", "hard-braking", "--json", "--no-error-estimate"]
sys.argv += ["--set", "options.duration=40 ms"]
from bywire.cli.main import {start} as start
try:
    start()
finally:
    print("built" if "bywire.simulation.program" in sys.modules else "kept", file=sys.stderr)
"""


def start(home: Path, cache: Path, *tick: str, function: str = "process") -> subprocess.Popen[str]:
    """Start a command of the package in a folder, with a tick of the clock [ns] if one is given."""
    paths = os.pathsep.join([str(home), *sys.path])
    changes = {"PYTHONPATH": paths, "BYWIRE_CACHE": str(cache)}
    return subprocess.Popen(
        [sys.executable, "-c", RUN.format(start=function), *tick],
        env=os.environ | changes,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def answer(process: subprocess.Popen[str]) -> tuple[dict[str, object], str]:
    """Return a command's key figures, and whether it built a program or took a kept kernel."""
    out, told = process.communicate(timeout=100)
    assert process.returncode == 0, told
    return json.loads(out)["kpis"], told.split()[-1]


def test_commands_at_once_and_then_a_changed_equation(tmp_path: Path) -> None:
    """It counts at once, even one of the same length in a file that says it is as old as before."""
    home, cache = tmp_path / "home", tmp_path / "kernels"
    shutil.copytree(PACKAGE, home / "bywire")
    waited = "0"  # instead of a wait until the clock's tick is over
    both = [answer(process) for process in [start(home, cache, waited) for _ in range(2)]]
    first = both[0][0]
    assert first == both[1][0]
    assert sorted(p.suffix for p in cache.iterdir()) == [".json", ".sha256", ".so"]
    assert answer(start(home, cache, waited)) == (first, "kept")
    assert answer(start(home, cache, waited, function="main")) == (first, "built")  # a program
    (entry,) = cache.glob("kernel-*.json")
    kept = entry.read_bytes()

    element = home / "bywire" / "plant" / "dc_motor.py"
    before, text = element.stat(), element.read_text()
    changed = text.replace("u.v - par.R_m * x.i", "u.v - par.R_m*2*x.i", 1)
    assert len(changed) == len(text)
    assert changed != text
    element.write_text(changed)
    os.utime(element, ns=(before.st_atime_ns, before.st_mtime_ns))
    shutil.rmtree(element.parent / "__pycache__", ignore_errors=True)  # else Python is deceived
    young = answer(start(home, cache))
    assert young[1] == "built"  # it may change again within the clock's tick: nothing is kept
    assert young[0] != first
    assert entry.read_bytes() == kept
    assert answer(start(home, cache, waited)) == young
    assert entry.read_bytes() != kept
