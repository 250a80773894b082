"""Verdicts of a sign-off: from known figures, from assumptions, and from missing evidence."""

from __future__ import annotations

import json
import random
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import pytest

from bywire.api.signoff import Affected, SignOff
from bywire.core.errors import FileError, InputError, ParameterError, UnitError, UnknownNameError
from bywire.core.typing import silent
from bywire.signoff.earlier import earlier_signoff
from bywire.signoff.running import completed
from bywire.signoff.signoff_file import read_signoff
from bywire.signoff.store import EvidenceStore
from raising import raises
from signoff.closed_form import COMPUTED, READERS


def requirement(id: str, *, assumes: Sequence[str] = (), kind: str = "requirement") -> str:
    more = f"\nassumes = {json.dumps(list(assumes))}" if assumes else ""
    return f'[[{kind}]]\nid = {json.dumps(id)}\ntext = "The force is large."{more}\n'


def spring(
    shows: str,
    k: Sequence[float],
    limit: str = "force >= 100 N",
    error: float = 0.0,
    name: str = "",
) -> str:
    return (
        f'[[evidence]]\nshows = {json.dumps(shows)}\nspring = "{name or shows}"\nk = {list(k)}\n'
        f'error = {error}\nlimit = "{limit}"\n'
    )


def signed(folder: Path, *entries: str, is_written: bool = True) -> SignOff:
    """Return the sign-off of a file in a folder, computed in this process."""
    file = folder / "list.toml"
    file.write_text("\n".join(entries), encoding="utf-8")
    plan, store = read_signoff(file, READERS), EvidenceStore(folder / "out")
    for task in plan.tasks.values():
        if store.kept(task) is None:
            store.keep(task, task.compute(store.place(task), silent))
    kept, failures = completed(plan, store, silent)
    previous, where = earlier_signoff(store.folder, None)
    made = SignOff(plan, store.folder, kept, failures, previous, where)
    if is_written:
        made.write(store.folder)
    return made


@pytest.mark.parametrize(
    ("stiffness", "error", "outcome"),
    [
        ([101e3], 0.5, "met"),
        ([99e3], 0.5, "missed"),  # by 1 %
        ([100.4e3], 0.5, "undecided"),  # 0.4 N from the limit, with an error of 0.5 N
        ([120e3, 100.4e3, 130e3], 0.5, "undecided"),  # of a range, the worst value counts
        ([120e3, 99e3, 100.4e3], 0.5, "missed"),
        ([float("nan")], 0.0, "missed"),
    ],
)
def test_a_closed_form_has_the_known_verdict(
    tmp_path: Path, stiffness: list[float], error: float, outcome: str
) -> None:
    if stiffness != stiffness or stiffness[0] != stiffness[0]:
        entry = spring("R", [0.0], error=error).replace("[0.0]", "[nan]")
    else:
        entry = spring("R", stiffness, error=error)
    made = signed(tmp_path, requirement("R"), entry)
    assert made.verdicts["R"].outcome == outcome
    assert made.holds == (outcome == "met")


def test_the_margin_and_its_place_are_those_of_the_worst_value(tmp_path: Path) -> None:
    made = signed(tmp_path, requirement("R"), spring("R", [130e3, 104e3, 120e3]))
    ((judged,),) = [one.judged for one in made.verdicts["R"].shown]
    assert judged.value == pytest.approx(104.0)
    assert judged.room == pytest.approx(4.0)
    assert judged.at == "k = 104000"


def test_a_requirement_without_evidence_is_never_met(tmp_path: Path) -> None:
    made = signed(tmp_path, requirement("bare"), requirement("R"), spring("R", [200e3]))
    assert made.verdicts["bare"].outcome == "not shown"
    assert not made.holds
    assert "bare" in str(made.document().remarks)


def test_a_requirement_is_undecided_while_an_assumption_is_not_met(tmp_path: Path) -> None:
    entries = [
        requirement("R", assumes=["A"]),
        requirement("A", assumes=["B"], kind="assumption"),
        requirement("B", kind="assumption"),
        spring("R", [200e3]),
        spring("A", [201e3]),
    ]
    below = signed(tmp_path, *entries)
    assert [below.verdicts[name].outcome for name in "RAB"] == [
        "undecided",
        "undecided",
        "not shown",
    ]
    assert "assumption A" in str(below.verdicts["R"].reasons)
    whole = signed(tmp_path, *entries, spring("B", [202e3]))
    assert whole.holds


def test_evidence_without_requirement_is_listed(tmp_path: Path) -> None:
    loose = spring("R", [300e3], name="loose").replace('shows = "R"', "shows = []")
    made = signed(tmp_path, requirement("R"), spring("R", [200e3]), loose)
    assert made.holds
    assert any("loose" in text for text in made.warnings)


def test_exactly_the_evidence_that_depends_on_an_edit_is_computed_again(tmp_path: Path) -> None:
    """200 random edits: of stiffness (computed again), of limits and texts (judged again)."""
    choose = random.Random(1)
    count = 5
    stiffness = [[150e3 + k] for k in range(count)]
    limits = [100.0] * count
    texts = ["The force is large."] * count

    def entries() -> list[str]:
        return [
            requirement(f"R{k}").replace("The force is large.", texts[k])
            + spring(f"R{k}", stiffness[k], f"force >= {limits[k]} N")
            for k in range(count)
        ]

    signed(tmp_path, *entries(), is_written=False)
    for edit in range(200):
        k, kind = choose.randrange(count), choose.choice(("stiffness", "limit", "text"))
        if kind == "stiffness":
            stiffness[k] = [90e3 + 100.0 * edit + k]
        elif kind == "limit":
            limits[k] = 80.0 + edit
        else:
            texts[k] = f"The force is large in edition {edit}."
        (tmp_path / "list.toml").write_text("\n".join(entries()), encoding="utf-8")
        plan = read_signoff(tmp_path / "list.toml", READERS)
        expected = [f"R{k}"] if kind == "stiffness" else []
        affected = Affected(plan, EvidenceStore(tmp_path / "out")).affected
        assert [ids for ids in affected.values()] == ([expected] if expected else [])
        COMPUTED.clear()
        made = signed(tmp_path, *entries(), is_written=False)
        assert expected == COMPUTED
        for n in range(count):
            is_met = stiffness[n][0] * 1e-3 >= limits[n]
            assert made.verdicts[f"R{n}"].outcome == ("met" if is_met else "missed")


def test_damaged_evidence_is_computed_again(tmp_path: Path) -> None:
    entries = [requirement("R"), spring("R", [200e3])]
    signed(tmp_path, *entries)
    (record,) = (tmp_path / "out").rglob("evidence.json")
    record.write_text(record.read_text().replace("200.0", "900.0"))
    COMPUTED.clear()
    signed(tmp_path, *entries)
    assert COMPUTED == ["R"]


def test_a_damaged_earlier_sign_off_is_not_silent(tmp_path: Path) -> None:
    entries = [requirement("R"), spring("R", [200e3])]
    signed(tmp_path, *entries)
    (tmp_path / "out" / "signoff.json").write_text("{}")
    with pytest.warns(UserWarning, match="damaged"):
        signed(tmp_path, *entries)


def test_changes_since_the_last_sign_off_are_listed(tmp_path: Path) -> None:
    signed(tmp_path, requirement("R"), spring("R", [200e3]), requirement("old"))
    made = signed(tmp_path, requirement("R"), spring("R", [50e3]), requirement("new"))
    texts = "\n".join(made.changes)
    assert "R is missed; it was met" in texts
    assert "new is new" in texts
    assert "old was removed" in texts


def test_a_loosened_limit_and_a_removed_assumption_are_changes(tmp_path: Path) -> None:
    assumed = [requirement("A", kind="assumption"), spring("A", [300e3])]
    before = [requirement("R", assumes=["A"]), spring("R", [200e3]), *assumed]
    assert signed(tmp_path, *before).holds
    after = [requirement("R"), spring("R", [200e3], "force >= 1 N"), *assumed]
    made = signed(tmp_path, *after)
    assert made.holds
    texts = "\n".join(made.changes)
    assert "force >= 1 N" in texts
    assert "force >= 100 N" in texts
    assert "assumptions: none. Before: A" in texts


def test_a_value_below_its_error_is_not_shown_as_zero(tmp_path: Path) -> None:
    made = signed(tmp_path, requirement("R"), spring("R", [4.7e3], "force <= 20 N", error=5.2))
    assert made.holds
    assert "4.7 N" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_hostile_texts_stay_text(tmp_path: Path) -> None:
    hostile = "<script>alert(1)</script>"
    entry = f'[[requirement]]\nid = "{hostile}"\ntext = "{hostile} \\u0000 ]]>"\n'
    made = signed(tmp_path, entry, spring(hostile, [50e3], name="x"))
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert hostile not in page
    suites = ElementTree.parse(tmp_path / "out" / "junit.xml").getroot()
    (case,) = suites.iter("testcase")
    assert case.get("name") == hostile
    assert case.find("failure") is not None
    assert json.loads((tmp_path / "out" / "signoff.json").read_text())["verdict"] == made.outcome


@pytest.mark.parametrize(
    ("entries", "kind", "name", "line"),
    [
        ([requirement("R"), requirement("R")], ParameterError, "id", 5),
        ([requirement("R", assumes=["A"])], ParameterError, "assumes", 1),
        (
            [
                requirement("R", assumes=["A"]),
                requirement("A", assumes=["B"], kind="assumption"),
                requirement("B", assumes=["A"], kind="assumption"),
            ],
            ParameterError,
            "assumes",
            6,
        ),
        ([requirement("R"), spring("X", [1.0])], UnknownNameError, "shows", 5),
        ([requirement("R"), spring("R", [1.0], "speed >= 1 N")], UnknownNameError, "limit", 5),
        ([requirement("R"), spring("R", [1.0], "force >= 1 bar")], UnitError, "force", 5),
        ([requirement("R"), spring("R", [1.0], "force")], ParameterError, "limit", 5),
        ([requirement("R"), '[[evidence]]\nshows = "R"\n'], ParameterError, "evidence", 5),
        ([requirement("R"), '[[evidence]]\nfea = "x"\n'], UnknownNameError, "evidence", 5),
        ([requirement("a" * 201)], ParameterError, "id", 1),
        (["[[requirement]]\nid = 3\ntext = 'x'"], ParameterError, "id", 1),
    ],
)
def test_a_wrong_entry_gets_one_message_with_its_line(
    tmp_path: Path, entries: list[str], kind: type[InputError], name: str, line: int
) -> None:
    file = tmp_path / "list.toml"
    file.write_text("\n".join(entries), encoding="utf-8")
    with raises(kind, name=name) as caught:
        read_signoff(file, READERS)
    assert f"list.toml, line {line}: " in str(caught.value)


def test_an_earlier_sign_off_must_be_one(tmp_path: Path) -> None:
    (tmp_path / "other.json").write_text("[]")
    for since in (tmp_path / "other.json", tmp_path / "missing.json"):
        with raises(FileError, name=str(since)):
            earlier_signoff(tmp_path, since)
