"""Closed list of units that users and measurement programs write, and products of these units.

bywire rejects all other units. An open dictionary silently interprets ``Nm`` as a yarn count,
``ma`` as a thousandth of a year and ``U/min`` as an enzyme activity.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from fractions import Fraction
from functools import cache, lru_cache

from bywire.core.errors import UnitError, quoted

BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
"""base units, including the radian, which distinguishes angular speed from frequency"""

_LONGEST = 100  # characters of a unit
_NEAR = 0.75  # minimum similarity of a suggested spelling
_MOST = 99  # maximum exponent of a base unit

# Number, SI unit, prefixes, spellings that accept the prefixes, and words, which accept a plural s,
# a capital letter and the prefixes as words. A "~" represents a blank.
_ROWS = (
    ("1", "m", "n u m c d k", "m", "meter metre"),
    ("0.0254", "m", "", "in inch Inch inches", ""),
    ("0.3048", "m", "", "ft foot feet", ""),
    ("0.9144", "m", "", "yd", "yard"),
    ("1609.344", "m", "", "mi", "mile"),
    ("1e-6", "m", "", "micron microns", ""),
    ("1", "s", "n u m", "s sec Sec", "second"),
    ("1", "s", "", "Sekunde Sekunden Sek sek", ""),
    ("60", "s", "", "min Min mins Minuten", "minute"),
    ("3600", "s", "", "h hr hrs Std Stunde Stunden", "hour"),
    ("86400", "s", "", "d", "day"),
    ("1", "A", "n u m k", "A Amp amp Amps amps Adc", "ampere"),
    ("1", "V", "n u m k M", "V Vdc VDC", "volt"),
    ("1", "ohm", "u m k M G", "ohm Ohm OHM ohms Ohms Ω", ""),
    ("1", "S", "u m", "S", "siemens"),
    ("1", "W", "n u m k M G", "W VA", "watt"),
    ("735.49875", "W", "", "PS", ""),
    ("745.69987158227022", "W", "", "hp HP", "horsepower"),
    ("1", "J", "n u m k M G", "J Ws", "joule"),
    ("3600", "J", "m k M", "Wh", ""),
    ("4.184", "J", "k", "cal", ""),
    ("1", "N", "n u m c da k M G", "N", "newton"),
    ("9.80665", "N", "", "kgf kp kilopond", ""),
    ("4.4482216152605", "N", "k", "lbf", ""),
    ("1", "N*m", "u m c k M", "Nm N-m", ""),
    ("0.01", "N*m", "", "Ncm N-cm", ""),
    ("0.001", "N*m", "", "Nmm N-mm", ""),
    ("9.80665", "N*m", "", "kgfm kpm kgf-m", ""),
    (
        "1.3558179483314004",
        "N*m",
        "",
        "ft-lb ft-lbs ft-lbf lb-ft lbf-ft ftlb lbft ftlbf lbfft lb_ft ft_lb",
        "",
    ),
    (
        "0.1129848290276167",
        "N*m",
        "",
        "in-lb in-lbs in-lbf lb-in lbf-in inlb lbin inlbf lbfin lb_in in_lb",
        "",
    ),
    ("1", "N*s", "u m k", "Ns", ""),
    ("1", "N*m*s", "u m k", "Nms", ""),
    ("1", "Pa", "n u m h k M G", "Pa", "pascal"),
    ("1", "Pa*s", "u m", "Pas", ""),
    ("1e5", "Pa", "u m k", "bar Bar BAR", ""),
    ("6894.757293168361", "Pa", "k", "psi PSI Psi", ""),
    ("6894757.293168361", "Pa", "", "ksi", ""),
    ("101325", "Pa", "", "atm", ""),
    ("101325/760", "Pa", "m", "Torr torr", ""),
    ("133.322387415", "Pa", "", "mmHg", ""),
    ("3386.388640341", "Pa", "", "inHg", ""),
    ("9806.65", "Pa", "m c", "mH2O mWS", ""),
    ("249.08891", "Pa", "", "inH2O", ""),
    ("1", "kg", "", "kg Kg KG", "kilogram"),
    ("0.001", "kg", "u m", "", "gram gramm"),
    ("1000", "kg", "", "", "tonne"),
    ("0.45359237", "kg", "", "lb lbs lbm", "pound"),
    ("0.028349523125", "kg", "", "oz", "ounce"),
    ("1", "K", "m", "K degK °K", "kelvin"),
    ("1", "delta_degC", "", "delta_degC", ""),
    ("5/9", "delta_degC", "", "delta_degF", ""),
    ("1", "Hz", "m k M G", "Hz hz HZ", "hertz"),
    ("1", "rad", "u m", "rad Rad", "radian"),
    ("pi/180", "rad", "", "deg Deg DEG ° Grad", "degree"),
    ("pi/10800", "rad", "", "arcmin", ""),
    ("pi/648000", "rad", "", "arcsec", ""),
    ("pi/200", "rad", "", "gon", ""),
    ("2*pi", "rad", "", "rev revs Umdr Umdrehung Umdrehungen", "turn revolution"),
    ("pi/30", "rad/s", "k", "rpm RPM Rpm Upm UPM", ""),
    ("2*pi", "rad/s", "", "rps", ""),
    ("1/3.6", "m/s", "", "kph KPH kmh kmph Kmh", ""),
    ("0.44704", "m/s", "", "mph MPH", ""),
    ("1852/3600", "m/s", "", "kt kts", "knot"),
    ("9.80665", "m/s**2", "m", "g_n g0", ""),
    ("0.001", "m**3", "u m c d", "l L ltr", "liter litre"),
    ("1e-6", "m**3", "", "cc ccm", ""),
    ("0.001/60", "m**3/s", "", "lpm LPM", ""),
    ("0.003785411784", "m**3", "", "gal", "gallon"),
    ("0.003785411784/60", "m**3/s", "", "gpm GPM", ""),
    ("1e-6", "m**2/s", "", "cSt", ""),
    ("0.0001", "m**2/s", "", "St", ""),
    ("0.001", "Pa*s", "", "cP cPs", ""),
    ("0.1", "Pa*s", "", "Poise poise", ""),
    ("1", "A*s", "u m", "As", "coulomb"),
    ("3600", "A*s", "m k", "Ah", ""),
    ("1", "farad", "p n u m", "", "farad"),
    ("1", "H", "n u m", "H", "henry"),
    ("1", "Wb", "u m", "Wb Vs", "weber"),
    ("1", "T", "n u m", "T", "tesla"),
    ("0.0001", "T", "m", "Gauss gauss", ""),
    ("1", "mol", "m", "mol", ""),
    ("1", "cd", "", "cd", "candela"),
    ("1", "1", "", "1 unitless dimensionless bool Bool boolean count counts Counts strain", ""),
    ("0.01", "1", "", "% percent Percent pct Prozent", ""),
    ("0.001", "1", "", "‰", ""),
    ("1e-6", "1", "", "ppm ustrain µstrain microstrain µε", ""),
)
_PREFIXES = {
    "p": -12,
    "n": -9,
    "u": -6,
    "m": -3,
    "c": -2,
    "d": -1,
    "da": 1,
    "h": 2,
    "k": 3,
    "M": 6,
    "G": 9,
}
_PREFIX_WORDS = {
    "": "",
    "p": "pico",
    "n": "nano",
    "u": "micro",
    "m": "milli",
    "c": "centi",
    "d": "deci",
    "da": "deca",
    "h": "hecto",
    "k": "kilo",
    "M": "mega",
    "G": "giga",
}
_SI = {
    "m": "m",
    "s": "s",
    "A": "A",
    "kg": "kg",
    "K": "K",
    "delta_degC": "K",
    "mol": "mol",
    "cd": "cd",
    "rad": "rad",
    "Hz": "1/s",
    "N": "kg*m/s/s",
    "Pa": "N/m/m",
    "J": "N*m",
    "W": "J/s",
    "V": "W/A",
    "ohm": "V/A",
    "S": "A/V",
    "farad": "A*s/V",
    "Wb": "V*s",
    "H": "Wb/A",
    "T": "Wb/m/m",
}
_TEMPERATURES = (
    ("1", 273.15, "degC DegC deg_C deg~C °C °~C ℃ Grad~C Celsius celsius"),
    ("5/9", 459.67 * 5.0 / 9.0, "degF DegF deg_F deg~F °F °~F ℉ Fahrenheit fahrenheit"),
)
_PRESSURES = ("bar", "mbar", "Pa", "hPa", "kPa", "MPa", "psi")
_REFERENCES = {
    "gauge": ("(g)", "~g", "g", "_g", "~rel", "(rel)", "_rel", "~gauge", "(ü)", "ü", "~ü"),
    "absolute": ("(a)", "~a", "a", "_a", "~abs", "(abs)", "_abs", "~absolute"),
}
# These letters have two meanings, which only the requested quantity can distinguish. Declared units
# use the first meaning.
_TWO_MEANINGS = {
    "g": ("gram", "g_n"),
    "mg": ("milligram", "mg_n"),
    "C": ("coulomb", "degC"),
    "F": ("farad", "degF"),
}
_FARADS = {"mF": 1_000, "uF": 1_000_000, "µF": 1_000_000, "nF": 10**9, "pF": 10**12}
_LOGARITHMIC = frozenset(
    ["dB", "dBA", "dB(A)", "dBm", "dBV", "dBu", "dBW", "dBFS", "dBc", "Np", "pH", "oct", "dec"]
)
_IN_QUOTIENTS = {"U": "rev", "r": "rev"}
"""as in U/min and mm/r; on their own, they are not units"""

_PLAIN = str.maketrans(
    {  # characters that look the same or mean the same
        "\u03bc": "µ",
        "\u2126": "Ω",
        "º": "°",
        "\u02da": "°",
        "⋅": "·",
        "•": "·",
        "\u00d7": "·",
        "∙": "·",
        "\u2212": "-",
        "\u00a0": " ",
        "\u202f": " ",
    }
)
_RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹"
_RAISED_POWER = re.compile(rf"(⁻?)([{_RAISED}])")
_BRACKETED_POWER = re.compile(r"(?:\*\*|\^)\((-?[0-9])\)")
_LETTERS = r"A-Za-zµεΩ°℃℉%‰äöüÄÖÜß"
_NAME = rf"[{_LETTERS}]+(?:_[A-Za-z]+)*(?:2O)?(?:\([A-Za-zü]{{1,4}}\))?"
_EXPONENT = r"-?[0-9](?:\.[0-9])?(?![0-9.])"
_TOKEN = re.compile(rf"( *)(?:({_NAME})(?:(?:\*\*|\^)?({_EXPONENT}))?|([*/·()]))")
_NUMERATOR = re.compile(r" *1(?= *[/)])")
_POWER = re.compile(rf"(?:\*\*|\^)({_EXPONENT})")


class UnknownUnitError(UnitError):
    """String that is neither a listed unit nor a product of listed units."""


class UnreadableUnitError(UnknownUnitError):
    """String that does not have the form of a unit."""


@dataclass(frozen=True)
class Scale:
    """A unit's scale in SI: value = factor * number + zero.

    Parameters
    ----------
    ratio, turns
        The factor is ``ratio * pi**turns``.
    powers
        Exponents of the base units; see `BASES`.
    terms
        SI units of the product, with their exponents.
    zero
        The unit's zero in SI: 273.15 K for degC.
    reference
        ``"gauge"`` or ``"absolute"``, if a unit of pressure defines it.
    """

    ratio: Fraction
    turns: float
    powers: tuple[float, ...]
    terms: tuple[tuple[str, float], ...]
    zero: float = 0.0
    reference: str = ""

    @property
    def factor(self) -> float:
        """Size of one unit in SI, as a difference."""
        return float(self.ratio) * math.pow(math.pi, self.turns)

    @property
    def symbol(self) -> str:
        """SI unit of the same quantity, for example ``V/(N*m)``."""
        above = "*".join(_raised(name, power) for name, power in self.terms if power > 0)
        below = [_raised(name, -power) for name, power in self.terms if power < 0]
        under = below[0] if len(below) == 1 else f"({'*'.join(below)})"
        return (above or "1") + (f"/{under}" if below else "")

    def times(self, other: Scale, power: float = 1) -> Scale:
        """Return the product with a power of another scale; a product ignores the units' zeros."""
        powers = tuple(a + power * b for a, b in zip(self.powers, other.powers, strict=True))
        if max(map(abs, powers)) > _MOST or abs(power) > _MOST:
            raise UnreadableUnitError("the unit has too large an exponent")
        terms = dict(self.terms)
        for name, exponent in other.terms:
            terms[name] = terms.get(name, 0) + power * exponent
        kept = tuple((name, exponent) for name, exponent in terms.items() if exponent)
        ratio = self.ratio * Fraction(other.ratio**power)  # a root is a float
        return Scale(ratio, self.turns + power * other.turns, powers, kept)


def _raised(name: str, power: float) -> str:
    return name if power == 1 else f"{name}**{power:g}"


_ONE = Scale(Fraction(1), 0, (0,) * len(BASES), ())


def scale_of(text: str) -> Scale:
    """Return a unit's scale in SI.

    Raises
    ------
    UnknownUnitError
        When the string is neither a listed unit nor a product of listed units, when it has two
        meanings, and when the unit is logarithmic.

    Examples
    --------
    >>> scale_of("mV/Nm").symbol, float(scale_of("mV/Nm").ratio), scale_of("°C").zero
    ('V/(N*m)', 0.001, 273.15)
    """
    meanings = meanings_of(text)
    if len(meanings) > 1:
        plain = _plain(text)
        two = next(names for key, names in _TWO_MEANINGS.items() if key in _names(plain))
        raise UnknownUnitError(
            f"the unit {quoted(text)} is ambiguous. Use {two[0]!r} or {two[1]!r} instead",
            value=quoted(text),
            valid=f"{two[0]!r} or {two[1]!r}",
        )
    return meanings[0]


@lru_cache(4096)
def meanings_of(text: str) -> tuple[Scale, ...]:
    """Return a unit's scales in SI: two for ``g``, ``C`` and ``F``, the SI meaning first.

    Raises
    ------
    UnknownUnitError
        When the string is neither a listed unit nor a product of listed units, or when the unit is
        logarithmic.
    """
    if len(text) > _LONGEST:
        raise UnreadableUnitError(f"{quoted(text)} is longer than any unit", value=quoted(text))
    plain = _plain(text)
    if plain in _spellings():
        return (_spellings()[plain],)
    has_two = any(name in _TWO_MEANINGS for name in _names(plain))
    return tuple(_Reader(text, plain, meaning).unit() for meaning in range(1 + has_two))


def spellings() -> Iterator[str]:
    """Yield all spellings of the listed units, without products."""
    yield from _spellings()
    yield from _TWO_MEANINGS


def units_by_symbol() -> dict[str, list[str]]:
    """Return one spelling of each listed unit for selection lists, by SI unit."""
    found: dict[str, list[str]] = {}
    rows = {(number, symbol): row for number, symbol, *row in reversed(_ROWS)}  # one a size
    for (_, symbol), (prefixes, names, words) in reversed(rows.items()):
        first = (names or words).split()[0]
        spelled = ["", *prefixes.split()] if names else [""]
        found.setdefault(symbol, []).extend(f"{prefix}{first}" for prefix in spelled)
    found["K"] += [names.split()[0] for _, _, names in _TEMPERATURES]
    return found


def _plain(text: str) -> str:
    """Return a unit in which each meaning has only one character."""
    plain = re.sub(" +", " ", text.translate(_PLAIN)).strip(" ")
    raised = _RAISED_POWER.sub(lambda m: f"^{'-' * len(m[1])}{_RAISED.index(m[2])}", plain)
    squeezed = _BRACKETED_POWER.sub(r"^\1", raised)
    if squeezed in _spellings() or not ("-" in squeezed or " " in squeezed):
        return squeezed
    return _with_hyphens_and_blanks().sub(lambda m: _squeezed(m[0]), squeezed)


def _names(plain: str) -> list[str]:
    return [match[2] for match in _TOKEN.finditer(plain) if match[2]]


def _squeezed(name: str) -> str:
    return re.sub("[ -]", "", name)


@cache
def _with_hyphens_and_blanks() -> re.Pattern[str]:
    """Return a pattern for spellings that contain a blank or a hyphen, for use in a product."""
    names = [name for name in _spellings() if " " in name or "-" in name]
    every = "|".join(re.escape(name) for name in sorted(names, key=len, reverse=True))
    return re.compile(rf"(?<![{_LETTERS}_])(?:{every})(?![{_LETTERS}_0-9])")


class _Reader:
    """Parser that reads a product of units from left to right."""

    def __init__(self, text: str, plain: str, meaning: int) -> None:
        self._text, self._plain, self._meaning, self._at = text, plain, meaning, 0
        self._unknown = ""

    def unit(self) -> Scale:
        if self._plain in _TWO_MEANINGS:
            return _spellings()[_TWO_MEANINGS[self._plain][self._meaning]]
        scale = self._product()
        if self._at != len(self._plain):
            raise self._unreadable()
        if self._unknown:
            raise UnknownUnitError(self._why_not(self._unknown), value=quoted(self._unknown))
        return scale

    def _product(self) -> Scale:
        """Read factors up to a closing bracket or the end."""
        scale, power, is_divided = _ONE, 1, False
        is_first, has_sign = True, False
        if one := _NUMERATOR.match(self._plain, self._at):  # in 1/s and (1)/s
            self._at, is_first = one.end(), self._plain.startswith(("/", " /"), one.end())
        while self._at < len(self._plain):
            match = _TOKEN.match(self._plain, self._at)
            if match is None:
                break
            blank, name, exponent, sign = match.groups()
            if sign == ")":
                break
            self._at = match.end()
            if sign in ("*", "·", "/"):
                if has_sign or (is_first and sign != "/"):
                    raise self._unreadable()
                power, has_sign = (-1 if sign == "/" else 1), True
            elif has_sign or is_first or blank or sign == "(" or self._plain[self._at - 1] == ")":
                if is_divided and power == 1:
                    raise self._ambiguous()
                is_divided = is_divided or power == -1
                factor = self._bracket() if sign == "(" else self._listed(name, exponent)
                scale = scale.times(factor, power)
                power, has_sign = 1, False
            else:
                raise self._unreadable()
            is_first = False
        if has_sign or is_first:
            raise self._unreadable()
        return scale

    def _bracket(self) -> Scale:
        scale = self._product()
        if not self._plain.startswith(")", self._at):
            raise self._unreadable()
        self._at += 1
        if match := _POWER.match(self._plain, self._at):
            self._at = match.end()
            return _ONE.times(scale, _exponent(match[1]))
        return scale

    def _listed(self, name: str, exponent: str | None) -> Scale:
        listed = _spellings()
        if exponent and name + exponent in listed:
            return listed[name + exponent]
        if name in _TWO_MEANINGS:
            name = _TWO_MEANINGS[name][self._meaning]
        elif name in _IN_QUOTIENTS and "/" in self._plain:
            name = _IN_QUOTIENTS[name]
        if name not in listed:
            self._unknown = self._unknown or name
            return _ONE
        return _ONE.times(listed[name], _exponent(exponent or "1"))

    def _why_not(self, name: str) -> str:
        whole = quoted(self._text)
        inside = "" if name == self._plain else f" in {whole}"
        if name in _LOGARITHMIC:
            return (
                f"the unit {quoted(name)}{inside} is logarithmic, so no factor can convert it. "
                "Convert the values to a linear unit first"
            )
        whole_word = _squeezed(self._plain)
        near = [whole_word] if whole_word in _spellings() else _nearest(name)
        hint = f" (the nearest is {' or '.join(map(repr, near))})" if near else ""
        return f"the unit {quoted(name)}{inside} is not known{hint}"

    def _ambiguous(self) -> UnknownUnitError:
        return UnknownUnitError(
            f"the unit {quoted(self._text)} is ambiguous. Put the divisor in parentheses, as in "
            "J/(kg*K), or write it last",
            value=quoted(self._text),
        )

    def _unreadable(self) -> UnreadableUnitError:
        return UnreadableUnitError(
            f"{quoted(self._text)} does not have the form of a unit such as N*m/rad or m**3/s",
            value=quoted(self._text),
        )


def _exponent(text: str) -> float:
    return float(text) if "." in text else int(text)


def _nearest(name: str) -> list[str]:
    """Return similar spellings, starting with those that differ only in capital letters."""
    folded = [each for each in _spellings() if each.casefold() == name.casefold()]
    return folded[:3] or get_close_matches(name, _spellings(), n=2, cutoff=_NEAR)


@cache
def _spellings() -> dict[str, Scale]:
    """Return all spellings of all listed units."""
    listed: dict[str, Scale] = {}

    def add(name: str, scale: Scale) -> None:
        if listed.setdefault(name, scale) != scale:
            raise AssertionError(f"two units have the spelling {name!r}")

    for number, symbol, prefixes, names, words in _ROWS:
        scale = _scaled(number, _si(symbol))
        for prefix in ("", *prefixes.split()):
            larger = scale if not prefix else _larger(scale, _PREFIXES[prefix])
            for sign in ("u", "µ") if prefix == "u" else (prefix,):
                for name in names.split():
                    add(f"{sign}{name}", larger)
            for word in words.split():
                for spelling in _inflected(_PREFIX_WORDS[prefix] + word):
                    add(spelling, larger)
    for name, denominator in _FARADS.items():
        add(name, _scaled(f"1/{denominator}", _si("farad")))
    add("mg_n", _larger(listed["g_n"], -3))
    for number, zero, names in _TEMPERATURES:
        kelvin = _si("K")
        scale = Scale(Fraction(number), 0, kelvin.powers, kelvin.terms, zero)
        for name in names.split():
            add(name.replace("~", " "), scale)
    for name in _PRESSURES:
        for reference, endings in _REFERENCES.items():
            plain = listed[name]
            scale = Scale(plain.ratio, 0, plain.powers, plain.terms, 0.0, reference)
            for ending in endings:
                add(name + ending.replace("~", " "), scale)
    for name in [name for name in listed if name != _squeezed(name)]:
        add(_squeezed(name), listed[name])
    return listed


def _inflected(word: str) -> Iterator[str]:
    for spelling in (word, word.capitalize()):
        yield spelling
        if not word.endswith(("s", "z")):
            yield f"{spelling}s"


def _scaled(number: str, scale: Scale) -> Scale:
    """Return a number times another unit; the number's text may start or end with ``pi``."""
    turns = number.count("pi")
    plain = number.replace("2*pi", "2").replace("pi", "1")
    above, _, below = plain.partition("/")
    ratio = Fraction(above) / Fraction(below or "1")
    return Scale(scale.ratio * ratio, turns, scale.powers, scale.terms)


def _larger(scale: Scale, power: int) -> Scale:
    return Scale(scale.ratio * Fraction(10) ** power, scale.turns, scale.powers, scale.terms)


@cache
def _si(symbol: str) -> Scale:
    """Return an SI unit, or a product of SI units such as ``m**3/s``."""
    scale = _ONE
    above, _, below = symbol.partition("/")
    for product, sign in ((above, 1), (below, -1)):
        for term in filter(None, product.split("*") if "**" not in product else [product]):
            name, _, power = term.partition("**")
            if name != "1":
                unit = Scale(Fraction(1), 0, _powers(name), ((name, 1),))
                scale = scale.times(unit, sign * int(power or 1))
    return scale


@cache
def _powers(name: str) -> tuple[float, ...]:
    """Return the exponents of the base units in a named SI unit."""
    if name in BASES:
        return tuple(int(base == name) for base in BASES)
    scale = _ONE
    above, *below = _SI[name].split("/")
    for product, sign in ((above, 1), *((each, -1) for each in below)):
        for term in product.split("*"):
            if term != "1":
                scale = scale.times(Scale(Fraction(1), 0, _powers(term), ()), sign)
    return scale.powers
