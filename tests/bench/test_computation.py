"""Studies are distinguished by their computation, not by comments, file names or line numbers."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from bywire.bench.bench import Bench
from bywire.bench.computation import computation
from bywire.core.errors import FileError
from bywire.core.typing import silent
from bywire.studies.running import complete
from bywire.studies.store import Origin, StudyStore
from bywire.studies.study_file import read_study
from systems.loading import SPRING_AXIS, loaded

FILES = {
    "__init__.py": """
from bywire.core.brake import Brake

BRAKE = Brake("sprung", "s", __name__)
""",
    "laws.py": '''
"""The law."""


def held(demand):
    """Return the demand."""
    return 1.0 * demand
''',
    "figures.py": '''
"""A key figure."""

import numpy as np

SHARE = 0.5  # of the run


def _last(values):
    return values[round(SHARE * len(values)):]


def swing(values):
    """Return how far the end swings."""
    return float(np.ptp(_last(values)))
''',
    "experiments.py": '''
"""A push."""

import numpy as np

from bywire.bench.experiment import Case, Experiment
from bywire.bench.kpis.kpi import Figures
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Force

from . import figures
from .models import Memory, SpringAxis, State

FIGURES = Figures(swing=("m", "Swing of the end."))


class Options(ParameterSet):
    """The push."""

    F: Force
    """its force"""


def started(par):
    """Return where it starts."""
    return State(0.0, 0.0)


def cases(par, options, _=None):
    """Return the run."""
    def stimulus(t):
        return {"F_set": np.where(t > 0.0, options.F, 0.0)}
    return (Case("push", SpringAxis(), par, started(par), Memory(0.0, 0.0), stimulus, 0.05),)


def judge(recordings, options):
    """Return the figure."""
    return FIGURES(swing=figures.swing(recordings["push"]["x"].to_numpy()))


PUSH = Experiment("push", "spring-axis", "a push", Options, Options(F=20.0), cases, judge,
                  FIGURES.units, ())
''',
}


@pytest.fixture
def sprung(tmp_path: Path) -> Iterator[Callable[..., Path]]:
    """Return a function that writes a brake, a folder of files, with some of its texts changed."""
    text = SPRING_AXIS.read_text(encoding="utf-8")
    text = text[: text.index("BRAKE =")].replace("Memory(u.F_set,", "Memory(held(u.F_set),")
    models, sets = text.split("VALUES = ")
    files = FILES | {
        "models.py": models.replace("\n\n\nclass", "\n\nfrom .laws import held\n\n\nclass", 1),
        "sets.py": "from bywire.core.catalog import CitedSet\n\n"
        f"from .models import Parameters\n\nVALUES = {sets}",
    }

    def write(*changes: tuple[str, str, str], renamed: tuple[str, str] = ("", "")) -> Path:
        folder = tmp_path / "sprung"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        changed = dict(files)
        for name, old, new in changes:
            assert changed[name].count(old) == 1
            changed[name] = changed[name].replace(old, new)
        for name, each in changed.items():
            stem = name.removesuffix(".py")
            name = f"{renamed[1]}.py" if stem == renamed[0] else name
            if renamed[0]:
                each = each.replace(f"from .{renamed[0]} ", f"from .{renamed[1]} ")
                each = each.replace(
                    f"from . import {renamed[0]}", f"from . import {renamed[1]} as {renamed[0]}"
                )
            (folder / name).write_text(each, encoding="utf-8")
        return folder

    return write


def computed(folder: Path) -> dict[str, object]:
    with loaded(folder):
        return computation(Bench("push", "spring-axis-one"))


LAST = "def _last(values):\n    return values[round(SHARE * len(values)):]\n"
SWING = "    return float(np.ptp(_last(values)))\n"
BOUNDS = "        F = par.F_c + par.k_c * xe.x\n        return ((-F, F),)"
SAME = {
    "comment": [
        ("figures.py", "\n\ndef swing", "\n\n# how far\ndef swing"),
        ("models.py", "        return State(x.v", "        # Newton\n        return State(x.v"),
    ],
    "docstring": [
        ("figures.py", '"""Return how far the end swings."""', '"""The swing."""'),
        ("models.py", '"""Return velocity and force."""', '"""The rates."""'),
    ],
    "annotation": [("figures.py", "def _last(values)", "def _last(values: list) -> list")],
    "import moved": [
        ("figures.py", "import numpy as np\n", ""),
        ("figures.py", SWING, f"    import numpy as np\n\n{SWING}"),
    ],
    "definition moved": [("figures.py", LAST, ""), ("figures.py", SWING, f"{SWING}\n\n{LAST}")],
    "function that judges nothing": [
        ("figures.py", "def swing", "def least(values):\n    return min(values)\n\n\ndef swing"),
    ],
    "equation written otherwise": [
        ("models.py", BOUNDS, BOUNDS.replace(" F ", " bound ").replace("-F, F", "-bound, bound")),
    ],
}
OTHER = {
    "equation": [("models.py", "par.k * x.x - par.d", "par.k * x.x - 2.0 * par.d")],
    "friction": [("models.py", "F = par.F_c + par.k_c * xe.x", "F = par.F_c - par.k_c * xe.x")],
    "law": [("laws.py", "1.0 * demand", "0.9 * demand")],
    "sample time": [("models.py", 'Task("control", par.T_s', 'Task("control", 2.0 * par.T_s')],
    "key figure": [("figures.py", "np.ptp", "np.max")],
    "what a key figure calls": [("figures.py", "values[round(", "values[2 * round(")],
    "constant of a key figure": [("figures.py", "SHARE = 0.5", "SHARE = 0.4")],
    "start": [("experiments.py", "State(0.0, 0.0)", "State(0.0, 0.1)")],
    "stimulus": [("experiments.py", "t > 0.0", "t > 0.01")],
}


@pytest.mark.parametrize("changes", SAME.values(), ids=SAME.keys())
def test_how_the_source_is_written_does_not_matter(sprung, changes):
    assert computed(sprung(*changes)) == computed(sprung())


@pytest.mark.parametrize("stem", ["figures", "laws", "models"])
def test_names_of_files_do_not_matter(sprung, stem):
    new = {"figures": "key_figures", "laws": "law", "models": "model"}[stem]
    assert computed(sprung(renamed=(stem, new))) == computed(sprung())


@pytest.mark.parametrize("changes", OTHER.values(), ids=OTHER.keys())
def test_what_is_computed_matters(sprung, changes):
    assert computed(sprung(*changes)) != computed(sprung())


BENCH = 'experiment = "push"\nparameters = "spring-axis-one"\n'
STUDY = """
bench = "bench.toml"
[vary]
m = "+-5 %"
[design]
cases = 64
"""


def test_a_study_goes_on_after_a_comment_and_is_refused_after_an_equation(sprung, tmp_path):
    pytest.importorskip("pyarrow")
    path, store = tmp_path / "study.toml", StudyStore(tmp_path / "out")
    path.write_text(STUDY)
    (tmp_path / "bench.toml").write_text(BENCH)

    @contextmanager
    def plan_of(folder: Path):
        with loaded(folder):
            yield read_study(path)

    with plan_of(sprung()) as plan:
        complete(plan, store, Origin(path), progress=silent)
    with plan_of(sprung(*SAME["comment"], *SAME["definition moved"])) as plan:
        assert store.asked_and_computed(plan) == (64, 64)
    for kind, said in {"law": "the equations of the model", "key figure": "key figures"}.items():
        with plan_of(sprung(*OTHER[kind])) as plan, pytest.raises(FileError, match=said):
            store.open(plan, Origin(path))
    with plan_of(sprung()) as plan:
        record = store.folder / "study.json"
        kept = json.loads(record.read_text())
        kept["study"]["brake"] = kept["study"].pop("computed")["figures"]
        record.write_text(json.dumps(kept | {"digest": "0"}))
        with pytest.raises(FileError, match=r"another study \(an older version of bywire has"):
            store.open(plan, Origin(path))
