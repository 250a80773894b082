"""C text: names, numbers, comments, and lines of a readable length."""

from __future__ import annotations

import math
import re
from collections.abc import Container
from dataclasses import dataclass

import numpy as np

from bywire.core.errors import ModelError, ParameterError, quoted

WIDTH = 96
_WORDS = """auto bool break case char const continue default do double else enum extern false float
for goto if inline int long register restrict return short signed sizeof static struct switch true
typedef union unsigned void volatile while main NULL INFINITY NAN larger smaller
whole sine cosine exponential logarithm power_of turned near_angle log_parts upper_part bits memcpy
is_usual magnitude within
exp log sqrt sin cos tan fabs floor ceil fmax fmin pow round trunc hypot gamma signgam
expf logf sqrtf sinf cosf fabsf floorf powf"""
_CXX_WORDS = """alignas alignof and and_eq asm bitand bitor catch char8_t char16_t char32_t class
compl concept consteval constexpr constinit const_cast co_await co_return co_yield decltype delete
dynamic_cast explicit export friend mutable namespace new noexcept not not_eq nullptr operator or
or_eq private protected public reinterpret_cast requires static_assert static_cast template this
thread_local throw try typeid typename using virtual wchar_t xor xor_eq"""
_RESERVED = frozenset(_WORDS.split()) | frozenset(_CXX_WORDS.split())
_LONGEST_NAME = 60
BEGIN_C = '#ifdef __cplusplus\nextern "C" {\n#endif'
END_C = "#ifdef __cplusplus\n}\n#endif"
"""start and end of the declarations in a header, for linking with C++ programs"""


@dataclass(frozen=True)
class Precision:
    """Number type in C.

    Parameters
    ----------
    name
        Name for the user.
    real
        C type.
    suffix
        Suffix of library functions and literals.
    """

    name: str
    real: str
    suffix: str

    def literal(self, value: float) -> str:
        """Return the shortest literal with exactly this value.

        Raises
        ------
        ModelError
            If the type cannot represent the value.
        """
        number = float(value)
        if self.suffix and number != 0.0 and not 2.0**-126 <= abs(number) < 2.0**128:
            raise ModelError(
                f"{number!r} exceeds the range of single precision. Use precision = 'double'",
                name="precision",
                value=repr(number),
                valid="precision = 'double'",
            )
        if not math.isfinite(number):
            raise ModelError(f"the laws contain {number!r}, but C has no literal for it")
        text = str(np.float32(number)) if self.suffix else repr(number)
        return text + self.suffix


PRECISIONS = {
    "double": Precision("double", "double", ""),
    "single": Precision("single", "float", "f"),
}


def c_name(text: str) -> str:
    """Return a C identifier for a name; characters that C does not allow become underscores."""
    name = re.sub(r"\W", "_", text, flags=re.ASCII).lstrip("_") or "value"
    if name[0].isdigit():
        name = f"n{name}"
    return f"{name}_" if name in _RESERVED else name


def checked_name(name: str) -> str:
    """Return the user's name for an export.

    Raises
    ------
    ParameterError
        If the name is not a valid identifier in C and C++.

    Examples
    --------
    >>> checked_name("front_left")
    'front_left'
    """
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        fault = "is not a valid C identifier"
    elif name in _RESERVED:
        fault = "is reserved by C, C++ or the exported code"
    elif len(name) > _LONGEST_NAME:
        fault = f"has {len(name)} characters, more than {_LONGEST_NAME}"
    else:
        return name
    valid = "a letter, then letters, digits and underscores, for example front_brake"
    raise ParameterError(
        f"name = {quoted(name)} {fault}. Use {valid}", name="name", value=quoted(name), valid=valid
    )


def unique(name: str, taken: Container[str]) -> str:
    """Return the name, with a number appended if it is taken."""
    candidate, number = name, 2
    while candidate in taken:
        candidate, number = f"{name}_{number}", number + 1
    return candidate


def in_comment(text: str) -> str:
    """Return a text that is safe in a C comment."""
    return text.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?").rstrip("\\")


def comment(lines: list[str], indent: str = "") -> str:
    """Return a block comment that contains these lines."""
    kept = [in_comment(line) for line in lines]
    if len(kept) == 1 and len(indent) + len(kept[0]) + 6 <= WIDTH:
        return f"{indent}/* {kept[0]} */"
    body = "\n".join(f"{indent} * {line}".rstrip() for line in kept)
    return f"{indent}/*\n{body}\n{indent} */"


def wrapped(line: str, indent: str = "") -> str:
    """Return a statement wrapped to a readable length, preferably after commas."""
    lines, rest, lead = [], line, indent
    while len(lead) + len(rest) > WIDTH:
        room = WIDTH - len(lead)
        spaces = [at for at in range(1, room + 1) if rest[at] == " " and _may_end(rest, at)]
        if not spaces:
            break
        commas = [at for at in spaces if rest[at - 1] == "," and 3 * at > room]
        at = (commas or spaces)[-1]
        lines.append(lead + rest[:at])
        rest, lead = rest[at + 1 :], indent + "        "
    return "\n".join([*lines, lead + rest])


def _may_end(line: str, at: int) -> bool:
    """Return whether a line may end at a space: not in a declaration or next to an equals sign."""
    return not line[:at].endswith(("const", "=", "static", "inline")) and (
        line[at + 1 : at + 2] != "="
    )
