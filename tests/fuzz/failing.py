"""Generated faults: sections of benches, and campaign files of a short braking."""

from __future__ import annotations

from random import Random

from bywire.bench.faults.modes import Mode, modes_of
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.model import ASSEMBLIES
from fuzz import inputs, sound

_TIMES = ("0 s", "1 us", "300 us", "1 ms", "9 ms", "20 ms", "33.3 ms", "-5 ms", "1e-300 s")
_SHARES = ("10 %", "0.5", "1", "99 %", "0", "1e-9", "2")
_PATTERNS = ("pressure.*", "motor.hot", "bridge.*", "*.stuck", "ecu.*", "fluid.*", "*", "x", "[")
_SETS = ("motor.R_m", "motor.K_e", "caliper.K_pd", "supply.V_bat", "ecu.T_s", "drive.mode", "motor")


def modes(name: str) -> dict[str, Mode]:
    """Return what may fail in the brake of a parameter set."""
    cited = PARAMETER_SETS.find(name)
    return modes_of(ASSEMBLIES.find(cited.assembly)(), cited.parameters())


def _size(rng: Random, mode: Mode) -> str:
    if rng.random() < 0.15:
        return inputs.value(rng)
    scale = rng.choice((0.5, 1.0, 1.0, 1.1, -1.0, 0.0, 1e3))
    return f"{scale * mode.value:.6g} {'' if mode.unit in ('', '1') else mode.unit}".strip()


def _written(text: str) -> str:
    return '"' + text.replace("\\", "/").replace('"', "'") + '"'


def section(rng: Random, name: str) -> str:
    """Return one section of faults, most of whose keys are right."""
    known = modes(name)
    mode = known[rng.choice(sorted(known))]
    lines, is_ramp = ["[[faults]]"], rng.random() < 0.5
    if rng.random() < 0.8:
        lines.append(f'fault = "{mode.name}"')
        if (mode.unit and rng.random() < 0.7) or rng.random() < 0.05:
            lines.append(f"value = {_written(_size(rng, mode))}")
    if len(lines) == 1 or rng.random() < 0.05:
        changed = rng.choice(("+10 %", "-200 %", "x", inputs.value(rng)))
        lines.append(f'set."{rng.choice(_SETS)}" = {_written(changed)}')
    for key in ("onset", "lasts", "ramp", "every"):
        if rng.random() < 0.3 and (key != ("every" if is_ramp else "ramp") or rng.random() < 0.1):
            time = inputs.value(rng) if rng.random() < 0.1 else rng.choice(_TIMES)
            lines.append(f"{key} = {_written(time)}")
    if rng.random() < 0.2:
        lines.append(f'share = "{rng.choice(_SHARES)}"')
    if rng.random() < 0.2:
        lines.append(f"seed = {rng.choice(('0', '7', '-1', '1.5', '1' + 40 * '0', 'true'))}")
    if rng.random() < 0.05:
        lines.append(f"{rng.choice(('onzet', 'Value', 'faults'))} = 1")
    return "\n".join(lines) + "\n"


def bench_text(rng: Random) -> str:
    """Return a bench file with one to three faults."""
    experiment, name, entries = sound.bench(rng)
    count = rng.choice((1, 1, 2, 3))
    return sound.as_toml(rng, experiment, name, entries) + "".join(
        section(rng, name) for _ in range(count)
    )


def _listed(rng: Random) -> str:
    names = rng.sample(_PATTERNS[:6] if rng.random() < 0.8 else _PATTERNS, rng.choice((1, 1, 2)))
    return "[" + ", ".join(f'"{each}"' for each in names) + "]"


def campaign_text(rng: Random) -> str:
    """Return a campaign file, of a braking of 60 ms."""
    mode = rng.choice(sorted(modes("dardanelli2010").values(), key=lambda each: each.name))
    lines = [
        'bench = "hard-braking"',
        "[set]",
        '"options.duration" = "60 ms"',
        '"options.settle" = "10 ms"',
        "[campaign]",
        f"healthy = {rng.choice((4, 4, 4, 6, 6, 3))}",
        f"only = {_listed(rng)}",
    ]
    for key in ("onset", "spread", "false_alarms"):
        if rng.random() < 0.4:
            few = _SHARES if key == "false_alarms" else _TIMES
            text = inputs.value(rng) if rng.random() < 0.1 else rng.choice(few)
            lines.append(f"{key} = {_written(text)}")
    for key in ("leave_out", "present", "latent"):
        if rng.random() < 0.15:
            lines.append(f"{key} = {_listed(rng)}")
    if rng.random() < 0.3:
        lines.append(f"onsets = {rng.choice(('1', '2', '3', '0', '10000000', '1.5'))}")
    if rng.random() < 0.4:
        lines += ["[values]", f'"{mode.name}" = [{_written(_size(rng, mode))}]']
    if rng.random() < 0.3:
        width = rng.choice(("+-5 %", "+-5 %", "+-9 %", "+-300 %", "x"))
        lines += ["[vary]", f'"{rng.choice(_SETS[:4])}" = "{width}"']
    if rng.random() < 0.2:
        lines += ["[rates]", f'"{mode.name}" = {rng.choice(("3", "0", "-1", "nan", "1e308"))}']
    if rng.random() < 0.3:
        lines += ["[reaction]", f'fault = "{rng.choice(("bridge.open-phase", mode.name))}"']
    for k in range(rng.choice((1, 1, 1, 1, 1, 2, 2, 0))):
        sense = rng.choice(("above", "below", "above_healthy", "below_healthy", "below_share"))
        signal = rng.choice(("p_pd",) * 8 + ("i", "x"))
        level = "50 %" if sense == "below_share" else "1 A" if signal == "i" else "1 bar"
        level = inputs.value(rng) if rng.random() < 0.1 else level
        lines += [
            "[[criteria]]",
            f'name = "c{k}"',
            f'signal = "{signal}"',
            f"{sense} = {_written(level)}",
            f'lasting = "{rng.choice(_TIMES)}"',
        ]
    return "\n".join(lines) + "\n"
