"""Generated studies and lives: a few short cases, of which a third have a defect."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

from bywire.studies.designs import SAMPLED, SENSITIVITY, SOUGHT, SPANNED
from fuzz import inputs

_HEAD = 'bench = "hard-braking"\n[set]\n"options.duration" = "30 ms"\n"options.settle" = "10 ms"\n'
_NAMES = (
    "motor.R_m",
    "motor.K_e",
    "seal.T_pr",
    "caliper.K_pd",
    "supply.V_bat",
    "options.p_to",
    "pipeline.k_lf",
)
_LIFE_NAMES = ("options.v_0", "stop.pause", "wedge.mu_B")


def _width(rng: Random) -> str:
    return f"{rng.choice((1, 2, 5, 10, 30))} %"


def _distribution(rng: Random) -> str:
    """Return what a parameter's section holds."""
    return rng.choice(
        (
            f'"+-{_width(rng)}"',
            f'{{ kind = "normal", sd = "{_width(rng)}" }}',
            f'{{ kind = "log-normal", sd = "{_width(rng)}" }}',
            f'{{ kind = "uniform", low = "-{_width(rng)}", high = "+{_width(rng)}" }}',
            f'{{ kind = "triangular", low = "-{_width(rng)}", high = "+{_width(rng)}" }}',
            f'{{ kind = "tolerance", tolerance = "{_width(rng)}", shape = "normal" }}',
            '{ kind = "discrete", values = ["+1 %", "-2 %"], '
            f"weights = [{rng.random():.3g}, 1e3] }}",
        )
    )


def _varied(rng: Random, names: Sequence[str]) -> list[str]:
    chosen = rng.sample(names, rng.choice((1, 2, 2)))
    return [f'"{name}" = {_distribution(rng)}' for name in chosen]


def _broken(rng: Random, text: str) -> str:
    """Return a file of which one value, or what is called so, is another."""
    lines = text.splitlines()
    k = rng.choice([k for k, line in enumerate(lines) if "=" in line])
    name, _, value = lines[k].partition("=")
    quoted = '"' + inputs.value(rng).replace('"', "") + '"'
    parts = value.split(",")
    part = rng.randrange(len(parts))
    other = rng.choice((quoted, inputs.number(rng), "9" * 400, "[]", "true", "-" + value.strip()))
    head, sign, _ = parts[part].rpartition("=")
    closing = "".join(c for c in parts[part][-3:] if c in "]}")
    parts[part] = f"{head}{sign} {other} {closing}"
    lines[k] = rng.choice(
        (
            f"{name}= {other}",
            f"{name}={','.join(parts)}",
            f"{name.strip()[:-1]} ={value}",
            f"{name}={value}\n{name}={value}",
            value,
            f"{name}={value[: len(value) // 2]}",
        )
    )
    return "\n".join(lines) + "\n"


def study_text(rng: Random) -> tuple[str, bool]:
    """Return a study file, and whether it is one without a defect on purpose."""
    lines = [_HEAD + "[vary]"]
    lines += _varied(rng, _NAMES)
    design = rng.choice((*SAMPLED, *SAMPLED, *SPANNED, *SENSITIVITY, *SOUGHT))
    lines += ["[design]", f'kind = "{design}"']
    if design in (*SAMPLED, *SOUGHT):
        lines += [f"cases = {rng.choice((2, 4, 8)) if design in SAMPLED else 64}"]
    lines += [f"seed = {rng.randrange(99)}"] if rng.random() < 0.5 else []
    lines += ["levels = 2"] if design in ("grid", "one-at-a-time") else []
    if design in SOUGHT or rng.random() < 0.6:
        is_shared = design != "worst-case" and (design in SOUGHT or rng.random() < 0.5)
        share = f" with {rng.choice((50, 90, 99))} %" if is_shared else ""
        limit = rng.choice(('overshoot = "<= 15 %', 'rise_time = "<= 9 ms'))
        lines += ["[requirements]", f'{limit}{share}"']
    text = "\n".join(lines) + "\n"
    return (_broken(rng, text), False) if rng.random() < inputs.DEFECTS else (text, True)


def life_text(rng: Random) -> tuple[str, bool]:
    """Return a life file of a few stops, and whether it is one without a defect on purpose."""
    lines = [f'life = "{rng.choice(("wedge-pads",) * 9 + ("pads",))}"', "[vary]"]
    lines += _varied(rng, _LIFE_NAMES)
    lines += ["[projection]", "stops = 2", f"longest = {rng.choice((10, 100, 1000))}"]
    lines += [f'share = "{_width(rng)}"'] if rng.random() < 0.3 else []
    lines += [f"seed = {rng.randrange(9)}"] if rng.random() < 0.5 else []
    text = "\n".join(lines) + "\n"
    return (_broken(rng, text), False) if rng.random() < inputs.DEFECTS else (text, True)
