"""Phrases that are never good English here: no page, docstring or message may contain one."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from repository_sources import MODULES, PACKAGE, ROOT, label, tree


class Banned(NamedTuple):
    """A pattern of a phrase, a sentence that contains it, and what to write instead."""

    pattern: str
    example: str
    instead: str


_COMPARED = "longer|more|less|fewer|better|worse|larger|smaller|faster|slower|different"
BANNED = (
    Banned(
        rf"(?<!\bthere )(?<!\bThere )\b(?:is|are) no (?!(?:{_COMPARED})\b)[a-z]+",
        "'brake' is no loop",
        "is not a valid ...",
    ),
    Banned(r"(?<!\bthere )(?<!\bThere )\b(?:is|are) none\b(?! of)", "the folder is none", "not a"),
    Banned(r"\bfor want of\b", "it ended for want of memory", "out of"),
    Banned(r"\bby default all\b", "by default all signals", "default: all"),
    Banned(r"\bbit by bit\b", "equal bit by bit", "bit for bit"),
    Banned(r"\bwithout a word\b", "it stops without a word", "silently"),
    Banned(r"\b[Rr]epeat the command\b", "Repeat the command.", "rerun the command"),
    Banned(r", see ['\"]", "Loop, see 'bywire list'.", "(see '...')"),
    Banned(r"\bresp\.", "gain resp. phase", "and, or"),
    Banned(r"\brespectively\b", "5 and 7 bar respectively", "each thing with its value"),
    Banned(r"\b[Bb]esides\b", "It is kept besides.", "also, in addition to"),
    Banned(r"\b(?:there|here|where)by\b", "and thereby stops", "so, therefore"),
    Banned(r"\bherewith\b|\btherewith\b", "herewith closed", "with this"),
    Banned(r"\bso-called\b", "the so-called corner", "no word at all"),
    Banned(r"\bin the house of\b", "in the house of bywire", "in"),
    Banned(r"\bof one's own\b", "a brake of one's own", "your own ..."),
    Banned(r"\b(?:brakes?|models?|files?) of your own\b", "a brake of your own", "your own ..."),
    Banned(r"\bnot admissible\b|\binadmissible\b", "NaN is not admissible", "must be ..."),
    Banned(r"\b[Tt]here is nothing to\b", "there is nothing to draw", "no ... to ..."),
    Banned(r"\bto heed\b|\bHeed\b", "warnings to heed", "warning, observe"),
    Banned(r"\b(?:tell|told) apart\b", "they are told apart", "distinguish"),
    Banned(
        r"\b(?:is|are) (?:said|told)\b(?! (?:to|apart))",
        "the error is told",
        "bywire reports, prints",
    ),
    Banned(r"\b(?:is|are) refused\b", "the file is refused", "bywire rejects"),
    Banned(r"\b(?:is|are) wanted\b|\bwants (?:a|an|the)\b", "a name is wanted", "must be, needs"),
    Banned(r"\bhardly minds\b", "control hardly minds it", "is insensitive to"),
    Banned(r"\bper cents?\b", "five per cent", "percent, %"),
    Banned(r"\bfor good\b(?! reasons?\b)", "it is lost for good", "permanently"),
    Banned(r"\bin (?:the )?case that\b", "in case that it fails", "if"),
    Banned(r"\btake a (?:smaller|larger|finer) ", "take a smaller step", "use a ..."),
    Banned(r"\banew\b", "computes it anew", "again"),
    Banned(r"\ba further\b", "a further run", "another"),
    Banned(r"\bhangs? on\b(?! to)", "it hangs on the step", "depends on"),
    Banned(r"(?:^|[.;] )Who (?:can|may)\b(?!.*\?)", "Who can read it needs none", "Anyone who"),
    Banned(r"\bsays? so\b", "the report says so", "states this"),
    Banned(r"\ball of it is made\b", "all of it is made from code", "generated"),
    Banned(r"\bnot till\b", "not till the end", "not until"),
    Banned(r"\b[Ff]alsif(?:y|ied|ies)\b", "a fault falsifies a signal", "corrupts"),
    Banned(r"\benerg(?:y|ies) turned over\b", "1e-5 of the energy turned over", "transferred"),
    Banned(r"\bagree[sd]? within\b", "they agree within 1 %", "agree to within"),
    Banned(r"\bType for example\b", "Type for example --at 2", "For example, type"),
    Banned(r"\bsooner or later\b", "one tick sooner or later", "earlier or later"),
    Banned(
        r"\b(?:[Ii]ntegral|[Dd]erivative|[Pp]roportional) parts?\b",
        "integral part of the current PI",
        "integral term",
    ),
    Banned(r"\bcounts? as\b", "a slow shaft counts as locked", "is considered, is treated as"),
    Banned(r"\bof the order of \d", "of the order of 65 %", "on the order of"),
    Banned(r"\bturnover of\b", "2 J of a turnover of 9 J", "of 9 J transferred"),
    Banned(r"\bcounts? fully\b", "dither counts fully", "is fully included"),
    Banned(r"\bjudged statements?\b", "3 of 9 judged statements", "judged values"),
    Banned(r"\bfused? products?\b", "without fused products", "fused multiply-add"),
    Banned(
        r"\b(?:agree[sd]?|match(?:es|ed)?) [^.;:|]{1,60}(?<!\bto )\bwithin \d",
        "it agrees with the paper within 1 %",
        "to within",
    ),
    Banned(r"\bmeasuring programs?\b", "spellings of measuring programs", "measurement program"),
    Banned(r"\bfile borders?\b", "names that cross a file border", "file boundary"),
    Banned(r"\b(?:brakes?|brake systems?) on air\b", "a truck's brake on air", "air brake"),
    Banned(r"\bnext to other programs\b", "it ran next to other programs", "while others run"),
    Banned(r"\bget(?:s)? one Newton\b", "terms get one Newton iteration", "bywire performs one"),
)
IN_GUIDES = (
    *BANNED,
    Banned(r"\bfrictions\b", "two frictions and a contact", "friction forces, friction states"),
    Banned(r"\bhealthy runs?\b", "compared with a healthy run", "fault-free run"),
    Banned(r"\bat the (?:[a-z]+ )?instant\b", "at the instant of the slip", "at the time"),
    Banned(r"\b(?:finished|large|small|larger) share\b", "a finished share of 5 %", "fraction"),
    Banned(r"\b(?:all|two|the stated) figures (?:agree|differ)", "all figures agree", "values"),
    Banned(r"\bthe (?:outer|inner|left|slipping) one\b", "follows the left one", "the noun"),
    Banned(r"\bwith file and line\b", "an error with file and line", "with the file and line"),
    Banned(
        r"\bcloser to (?:its|the) (?:limit|tolerance) than\b",
        "it is closer to its limit than its error",
        "the difference from the limit is smaller than",
    ),
)
"""phrases of hand-written pages, which strings of the package may still contain"""
_GENERATED = {"_build", "_generated"}
PAGES = sorted(
    path
    for path in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *ROOT.glob("examples/*/*.md"))
    if not _GENERATED & set(path.parts)
)
GUIDES = [
    path
    for path in PAGES
    if not re.match(r"notation|bench-ref", path.relative_to(ROOT).as_posix().removeprefix("docs/"))
]
TEXTS = sorted(path for ending in ("toml", "html", "js") for path in PACKAGE.rglob(f"*.{ending}"))
Sentences = Iterable[tuple[int, str]]


def in_page(text: str) -> Sentences:
    """Yield the paragraphs of a page with the number of their first line, without code."""
    without = re.sub(r"```.*?```", lambda block: "\n" * block[0].count("\n"), text, flags=re.DOTALL)
    start = 1
    for part in re.split(r"(\n\s*\n)", without):
        yield start, re.sub(r"`[^`]*`", "`...`", part)
        start += part.count("\n")


def in_module(module: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield the strings of a module with their line: docstrings, messages and help texts."""
    inner: set[int] = set()
    for node in ast.walk(module):
        if isinstance(node, ast.JoinedStr):
            inner |= {id(part) for part in ast.walk(node) if part is not node}
            texts = [part.value if isinstance(part, ast.Constant) else "0" for part in node.values]
            yield node.lineno, "".join(map(str, texts))
        elif id(node) not in inner and isinstance(getattr(node, "value", None), str):
            yield node.lineno, node.value


def found(
    sentences: Sentences, path: Path = Path("text"), phrases: tuple[Banned, ...] = BANNED
) -> list[str]:
    """Return each banned phrase with its place and what to write instead."""
    return [
        f"{path}:{line}: {hit[0]!r} (write: {banned.instead})"
        for line, text in sentences
        for text in [" ".join(text.split())]
        for banned in phrases
        for hit in re.finditer(banned.pattern, text)
    ]


@pytest.mark.parametrize("path", PAGES, ids=label)
def test_pages_are_in_plain_english(path):
    phrases = IN_GUIDES if path in GUIDES else BANNED
    assert not found(in_page(path.read_text(encoding="utf-8")), path.relative_to(ROOT), phrases)


def test_strings_of_the_package_are_in_plain_english():
    hits = [hit for path in MODULES for hit in found(in_module(tree(path)), path.relative_to(ROOT))]
    texts = ((path, path.read_text(encoding="utf-8")) for path in TEXTS)
    hits += [hit for path, text in texts for hit in found([(1, text)], path.relative_to(ROOT))]
    assert not hits, "\n".join(hits)


@pytest.mark.parametrize("banned", IN_GUIDES, ids=lambda banned: banned.example)
def test_every_pattern_finds_its_example(banned):
    assert re.search(banned.pattern, banned.example)
    assert banned.instead in found([(1, banned.example)], phrases=IN_GUIDES)[0]


def test_a_planted_phrase_is_found_with_its_line():
    page = "# Title\n\n```sh\nsays so\n```\n\nThe C equals Python bit\nby bit.\n"
    assert found(in_page(page)) == ["text:7: 'bit by bit' (write: bit for bit)"]
    code = 'def f(n):\n    """Stop, see \'list\'."""\n    raise ValueError(f"{n} is no loop")\n'
    lines = [hit.split(":")[1] for hit in found(in_module(ast.parse(code)))]
    assert sorted(lines) == ["2", "3"]


def test_good_english_passes():
    good = "There is no loop. It is no longer open. `bit by bit` is said to be rare. He held on."
    assert not found(in_page(good))
