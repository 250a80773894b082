"""Docstrings: what is public has one, says ruff; none explains a parameter that is not there."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sysconfig
from collections.abc import Callable, Iterator
from pathlib import Path

from repository_sources import BENCHMARKS, MODULES, ROOT, label, offenders

import bywire

CHECKED = [*MODULES, *BENCHMARKS]
RUFF = Path(sysconfig.get_path("scripts")) / "ruff"
BARE = "class A:\n    def f(self): ...\n    def _g(self): ...\ndef h(): ...\n"

Documented = ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def public(node: ast.AST, prefix: str = "") -> Iterator[tuple[str, Documented]]:
    """Yield the public classes and functions of a module, and the methods of its classes."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, Documented) and not child.name.startswith("_"):
            yield f"{prefix}{child.name}", child
            if isinstance(child, ast.ClassDef):
                yield from public(child, f"{child.name}.")


def undocumented(module: ast.Module) -> list[str]:
    """Return what has no docstring."""
    found = [] if ast.get_docstring(module) else ["module"]
    return found + [name for name, node in public(module) if not ast.get_docstring(node)]


def misnamed_parameters(module: ast.Module) -> list[str]:
    """Return the names that a docstring explains and the function does not take."""
    found = []
    for name, node in public(module):
        if isinstance(node, ast.ClassDef):
            continue
        arguments = {a.arg for a in [*node.args.posonlyargs, *node.args.args]}
        arguments |= {a.arg for a in node.args.kwonlyargs}
        arguments |= {a.arg for a in (node.args.vararg, node.args.kwarg) if a}
        found += [f"{name}: {p}" for p in explained(node) if p not in arguments]
    return found


def explained(node: Documented) -> list[str]:
    """Return the parameters that a numpydoc docstring explains."""
    lines = (ast.get_docstring(node) or "").splitlines()
    if "Parameters" not in lines:
        return []
    names: list[str] = []
    for line in lines[lines.index("Parameters") + 2 :]:
        if line.startswith("---"):
            names.pop()  # the title of the next section
            break
        if line and not line.startswith(" "):
            names += [name.strip().lstrip("*") for name in line.split(":")[0].split(",")]
    return names


def rules_broken(name: str, text: str) -> set[str]:
    """Return the rules by which ruff would refuse a file of the repository with some text."""
    done = subprocess.run(
        [RUFF, "check", "--no-cache", "--output-format=concise", "--stdin-filename", name, "-"],
        input=text,
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
    )
    return set(re.findall(r": ([A-Z]+\d+) ", done.stdout))


def test_ruff_refuses_what_is_public_without_a_docstring():
    """A seeded module, class, method and function, in every folder: none is excepted."""
    missing = {"D100", "D101", "D102", "D103"}
    for folder in sorted({label(path.parent) for path in CHECKED}):
        assert missing <= rules_broken(f"{folder}/seeded.py", BARE), folder
        assert "D104" in rules_broken(f"{folder}/__init__.py", ""), folder


def test_no_file_excuses_itself_from_docstrings():
    """Nor what ruff takes for private: modules with an underscore, names outside ``__all__``."""
    excuse = re.compile(r"#\s*(?:ruff: noqa|noqa:? .*\bD\d)")
    texts = {path: path.read_text(encoding="utf-8") for path in CHECKED}
    assert [label(path) for path in CHECKED if excuse.search(texts[path])] == []
    unseen = [p for p in CHECKED if "__all__" in texts[p] or re.match(r"_[^_]", p.name)]
    assert offenders(undocumented, unseen) == {}


def test_docstrings_explain_parameters_that_exist():
    assert offenders(misnamed_parameters, CHECKED) == {}


def test_the_gates_can_fail():
    bare = ast.parse(BARE)
    assert undocumented(bare) == ["module", "A", "A.f", "h"]
    lines = ["def f(x):", '    """F.', "", "    Parameters", "    ----------", "    y", '    """']
    assert misnamed_parameters(ast.parse("\n".join(lines))) == ["f: y"]
    known = next(path for path in MODULES if path.name == "dc_motor.py")
    assert offenders(lambda module: ["x"], [known]) == {"src/bywire/plant/dc_motor.py": ["x"]}


def unexplained(function: Callable[..., object]) -> list[str]:
    """Return the sections that numpydoc wants and a public function of the package lacks."""
    text = inspect.getdoc(function) or ""
    explains = set(re.findall(r"^([A-Z]\w+)\n-+$", text, re.MULTILINE))
    listed = re.findall(r"^([\w*, ]+)\n    ", text, re.MULTILINE)
    names = {name.strip() for line in listed for name in line.split(",")}
    missing = {"Parameters", "Returns", "Raises"} - explains
    return sorted(missing) + sorted(set(inspect.signature(function).parameters) - names)


def test_public_functions_say_what_they_take_return_and_raise() -> None:
    functions = {name: getattr(bywire, name) for name in bywire.__all__}
    functions = {name: one for name, one in functions.items() if inspect.isfunction(one)}
    assert len(functions) > 20
    assert {name: gaps for name, one in functions.items() if (gaps := unexplained(one))} == {}


def test_the_gate_of_explained_functions_can_fail() -> None:
    def bare(x: float, y: float) -> float:
        """Return the sum.

        Parameters
        ----------
        x
            One of them.
        """
        return x + y

    assert unexplained(bare) == ["Raises", "Returns", "y"]
