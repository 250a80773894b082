"""What 12 bits mean, and a square wave that is high as long as it is low."""

from __future__ import annotations

import numpy as np
import pytest

from bywire.control import dither
from bywire.core.catalog import PARAMETER_SETS
from bywire.plant import adc


def test_twelve_bits_are_4096_distinct_codes() -> None:
    par = adc.Parameters(law="quantized", codes=4096.0, noise=0.0)
    shown = {adc.sample(float(r), 0.0, par) for r in np.linspace(-0.1, 1.1, 100_001)}
    assert sorted(shown) == [code / 4096.0 for code in range(4096)]
    assert adc.sample(0.5, 0.0, par) == 0.5  # no current is a whole code
    assert adc.sample(1.0, 0.0, par) == 1.0 - 1.0 / 4096.0


def square(f: float, T: float, count: int) -> np.ndarray:
    par = dither.Parameters(waveform="square", f_dit=f, gain=1.0)
    believed = PARAMETER_SETS.find("dardanelli2010").parameters().ecu.est_par  # type: ignore[attr-defined]
    x, wave = dither.State(phase=0.0), []
    for _ in range(count):
        x, out = dither.output(x, 20e5, T, par, believed)
        wave.append(np.sign(out.i))
    return np.array(wave)


@pytest.mark.parametrize(("f", "period"), [(50.0, 20), (100.0, 10), (250.0, 4), (62.5, 16)])
def test_every_period_of_the_square_wave_is_balanced(f: float, period: int) -> None:
    wave = square(f, 1e-3, 1000 * period).reshape(1000, period)
    assert np.all(wave[:, : period // 2] == 1.0)
    assert np.all(wave[:, period // 2 :] == -1.0)
