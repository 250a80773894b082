"""Reference of a two-wheeler's stop on a level road, each stick and slide an event of its own.

A wheel rolls or stands, a tire grips or slides: four modes, between which the vehicle is smooth and
is integrated by the explicit pair of Dormand and Prince with control of its error. Each change of
mode is located to round-off, as is each change of sign of the speed. A tire that slides has no
deflection of its own: its force is that of its slip, and it grips again with the deflection that
gives this force. It shares no code with the package.

Symbols: v, x speed and distance, omega a wheel's speed, u a tire's deflection, N a load, p a
pressure. The rear wheel stays on the ground: N_r > 0 is checked.

Pair of orders 5 and 4: E. Hairer, S. Norsett, G. Wanner, "Solving Ordinary Differential Equations
I", table II.5.2. Tire: M. Burckhardt, "Fahrwerktechnik: Radschlupf-Regelsysteme", 1993 (curve);
H. Pacejka, "Tire and Vehicle Dynamics", chapters 7 and 8 (relaxation length, damping at low speed).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from operator import mul
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

STATES = ("x", "v", "omega_f", "omega_r", "u_f", "u_r", "N_r", "p_f", "p_rate_f", "p_r", "p_rate_r")
SCALE = (1.0, 1.0, 1.0, 1.0, 1e-3, 1e-3, 1e2, 1e5, 1e6, 1e5, 1e6)
TOLERANCE = 1e-9  # error of a step, of SCALE
PERIOD = 1e-3  # s, of rows and controllers
# Round-off of a speed [rad/s, m/s], a moment [N m], a deflection [m]: less is no event.
LEAST = 1e-10

_A = (
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
_E = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)

Row = list[float]
Demand = Callable[[int, Row], tuple[float, float]]


class Surface(NamedTuple):
    """Adhesion over slip, mu = c1 (1 - exp(-c2 slip)) - c3 slip."""

    c1: float
    c2: float
    c3: float

    def mu(self, slip: float) -> float:
        return self.c1 * (1.0 - math.exp(-self.c2 * slip)) - self.c3 * slip

    def slope(self, slip: float) -> float:
        return self.c1 * self.c2 * math.exp(-self.c2 * slip) - self.c3

    @property
    def peak(self) -> float:
        """Slip of most adhesion."""
        return math.log(self.c1 * self.c2 / self.c3) / self.c2

    def rising(self, slip: float) -> float:
        """Return the slip before the peak with the adhesion of one beyond it, by Newton's steps."""
        wanted, found = self.mu(slip), 0.0
        for _ in range(60):
            step = (wanted - self.mu(found)) / self.slope(found)
            found += step
            if abs(step) < 1e-15:
                break
        return found


@dataclass(frozen=True)
class Wheel:
    """A wheel with its tire and brake; k: moment over pressure."""

    J: float
    r: float
    k: float
    C_rr: float
    sigma: float
    c_t: float
    v_low: float


@dataclass(frozen=True)
class TwoWheeler:
    """The vehicle, its wheels front and rear, and both pressure loops."""

    wheels: tuple[Wheel, Wheel]
    surface: Surface
    m: float
    g: float
    L: float
    h: float
    h_a: float
    l_f: float
    CdA: float
    rho: float
    tau_N: float
    f_n: float
    zeta: float

    def slip(self, k: int, y: Row, modes: "Modes") -> float:
        """Return the slip of a wheel, of either sign: 1 where it stands, at rest too."""
        if not modes.turns[k]:
            return float(modes.moves)
        v, rolled = y[1], y[2 + k] * self.wheels[k].r
        faster = max(abs(v), abs(rolled))
        return min(max((v - rolled) / faster, -1.0), 1.0) if faster else 0.0

    def limit(self, slip: float) -> float:
        """Return the most that a tire's deflection over its relaxation length reaches."""
        peak = self.surface.peak
        return self.surface.rising(slip) if slip > peak else peak


@dataclass
class Modes:
    """Sign of the motion of each wheel and of the vehicle, sign of the slide of each tire."""

    turns: list[int] = field(default_factory=lambda: [1, 1])
    slides: list[int] = field(default_factory=lambda: [0, 0])
    moves: int = 1


class Stop(NamedTuple):
    """Rows at each period; time and distance of the first standstill; what changed when."""

    t: NDArray[np.float64]
    states: dict[str, NDArray[np.float64]]
    demands: NDArray[np.float64]
    time: float
    distance: float
    changes: list[tuple[float, str]]


def loads(y: Row, bike: TwoWheeler) -> tuple[float, float]:
    return bike.m * bike.g - y[6], y[6]


def force(k: int, y: Row, modes: Modes, bike: TwoWheeler) -> float:
    """Return the force of a tire on its wheel: of the slip if it slides, else of the deflection."""
    N, wheel, sliding = loads(y, bike)[k], bike.wheels[k], modes.slides[k]
    if sliding:
        return sliding * N * bike.surface.mu(abs(bike.slip(k, y, modes)))
    v, give = y[1], y[4 + k] / wheel.sigma
    mu = math.copysign(bike.surface.mu(abs(give)), give)
    if abs(v) < wheel.v_low:
        fade = 0.5 * (1.0 + math.cos(math.pi * v / wheel.v_low))
        mu += wheel.c_t * (v - y[2 + k] * wheel.r) * fade
        # No more than a tire that slides has: damping does not end by a jump of the force.
        most = bike.surface.mu(max(bike.surface.peak, abs(bike.slip(k, y, modes))))
        mu = min(max(mu, -most), most)
    return N * mu


def friction(k: int, y: Row, bike: TwoWheeler) -> float:
    """Return the most that brake and rolling resistance of a wheel hold together [N m]."""
    wheel = bike.wheels[k]
    return wheel.k * max(y[7 + 2 * k], 0.0) + wheel.C_rr * loads(y, bike)[k] * wheel.r


def derivative(y: Row, modes: Modes, demand: tuple[float, float], bike: TwoWheeler) -> Row:
    """Return the derivative of the states in these modes."""
    v, F = y[1], [force(k, y, modes, bike) for k in (0, 1)]
    drag = 0.5 * bike.rho * bike.CdA * v * abs(v)
    N_r = (bike.m * bike.g * bike.l_f - sum(F) * bike.h - drag * (bike.h - bike.h_a)) / bike.L
    turn, give, press = [], [], []
    for k, wheel in enumerate(bike.wheels):
        T = modes.turns[k] * friction(k, y, bike)
        turn.append((wheel.r * F[k] - T) / wheel.J if modes.turns[k] else 0.0)
        free = (v - y[2 + k] * wheel.r) - abs(v) * y[4 + k] / wheel.sigma
        give.append(0.0 if modes.slides[k] else free)
        p, rate, w = y[7 + 2 * k], y[8 + 2 * k], 2.0 * math.pi * bike.f_n
        press += [rate, w * w * (demand[k] - p) - 2.0 * bike.zeta * w * rate]
    return [v, -(sum(F) + drag) / bike.m, *turn, *give, (N_r - y[6]) / bike.tau_N, *press]


def held(k: int, y: Row, dy: Row, modes: Modes, bike: TwoWheeler) -> float:
    """Return how fast a sliding tire would leave its limit [m/s]; it grips below zero.

    The limit itself moves with the slip: d(limit) = sigma mu'(slip)/mu'(rising) d|slip|.
    """
    wheel, slip, v = bike.wheels[k], bike.slip(k, y, modes), y[1]
    rolled = y[2 + k] * wheel.r
    limit, sign, moves = bike.limit(abs(slip)), modes.slides[k], 0.0
    if bike.surface.peak < abs(slip) < 1.0 and modes.turns[k]:
        fast, faster = (v, dy[1]) if abs(v) >= abs(rolled) else (rolled, dy[2 + k] * wheel.r)
        change = dy[1] - dy[2 + k] * wheel.r - slip * math.copysign(1.0, fast) * faster
        change /= abs(fast)
        ratio = bike.surface.slope(abs(slip)) / bike.surface.slope(limit)
        moves = wheel.sigma * ratio * math.copysign(1.0, slip) * change
    return sign * (v - rolled) - abs(v) * limit - moves


def step(y: Row, h: float, slope: Callable[[Row], Row]) -> tuple[Row, float]:
    """Return the states after a step by the pair of Dormand and Prince, and its error of SCALE."""
    slopes = [slope(y)]
    for row in _A:
        new = [
            x + h * sum(map(mul, row, column))
            for x, column in zip(y, zip(*slopes, strict=True), strict=True)
        ]
        slopes.append(slope(new))
    errors = (
        abs(h * sum(map(mul, _E, column))) / scale
        for column, scale in zip(zip(*slopes, strict=True), SCALE, strict=True)
    )
    return new, max(errors)


def crossings(y: Row, dy: Row, modes: Modes, bike: TwoWheeler) -> dict[tuple[str, int], float]:
    """Return what ends the present modes, each above zero."""
    ends = {("moves", 0): -modes.moves * y[1]}
    for k, wheel in enumerate(bike.wheels):
        turns, slides = modes.turns[k], modes.slides[k]
        if turns:
            ends["turns", k] = -turns * y[2 + k]
        else:
            ends["turns", k] = wheel.r * abs(force(k, y, modes, bike)) - friction(k, y, bike)
        if slides:
            ends["slides", k] = -held(k, y, dy, modes, bike)
        else:
            give = abs(y[4 + k]) / wheel.sigma
            ends["slides", k] = wheel.sigma * (give - bike.limit(abs(bike.slip(k, y, modes))))
    return ends


def change(event: tuple[str, int], y: Row, modes: Modes, bike: TwoWheeler) -> str:
    """Change the modes, and set exactly what the event says is reached; return its name."""
    kind, k = event
    name, wheel = ("front", "rear")[k], bike.wheels[k]
    if kind == "moves":
        y[1], modes.moves = 0.0, -modes.moves
        return "standstill"
    if kind == "slides":
        sign = int(math.copysign(1, y[4 + k]))
        if modes.slides[k]:
            y[4 + k] = modes.slides[k] * wheel.sigma * bike.limit(abs(bike.slip(k, y, modes)))
        modes.slides[k] = 0 if modes.slides[k] else sign
        return f"{name} {'slides' if modes.slides[k] else 'grips'}"
    rolled, y[2 + k] = modes.turns[k], 0.0
    F = force(k, y, modes, bike)
    stays = rolled and wheel.r * abs(F) <= friction(k, y, bike)
    modes.turns[k] = 0 if stays else int(math.copysign(1, F))
    return f"{name} {'stands' if stays else 'rolls'}"


def stop(
    bike: TwoWheeler, demand: Demand, v: float, duration: float, tolerance: float = TOLERANCE
) -> Stop:
    """Simulate a stop that begins rolling, with the pressures demanded at the ticks.

    Parameters
    ----------
    demand
        Called each period with its number and the states; returns pressures [Pa] front and rear.
    v, duration
        Speed at the start [m/s] and time [s].
    """
    rolling = [v / wheel.r for wheel in bike.wheels]
    y = [0.0, v, *rolling, 0.0, 0.0, bike.m * bike.g * bike.l_f / bike.L, 0.0, 0.0, 0.0, 0.0]
    modes, rows, demands, changes = Modes(), [], [], list[tuple[float, str]]()
    time = distance = math.nan
    h = PERIOD
    for tick in range(round(duration / PERIOD) + 1):
        p = demand(tick, y)
        rows.append(shown(y, modes, bike))
        demands.append(p)
        t = 0.0
        while t < PERIOD * (1.0 - 1e-9):
            y, taken, h, event = advance(y, min(h, PERIOD - t), modes, p, bike, tolerance)
            t += taken
            if event:
                changes.append((tick * PERIOD + t, change(event, y, modes, bike)))
                if event[0] == "moves" and math.isnan(time):
                    time, distance = tick * PERIOD + t, y[0]
            assert y[6] > 0.0, "the rear wheel would leave the ground"
    states = dict(zip(STATES, np.array(rows).T, strict=True))
    t = PERIOD * np.arange(len(rows))
    return Stop(t, states, np.array(demands), time, distance, changes)


def advance(
    y: Row, h: float, modes: Modes, p: tuple[float, float], bike: TwoWheeler, tolerance: float
) -> tuple[Row, float, float, tuple[str, int] | None]:
    """Take a step at most h long, to the first event in it; return the next step's length too."""

    def slope(y: Row) -> Row:
        return derivative(y, modes, p, bike)

    def ends(y: Row) -> dict[tuple[str, int], float]:
        return crossings(y, slope(y), modes, bike)

    new, error = step(y, h, slope)
    while error > tolerance:
        h *= max(0.2, 0.9 * (tolerance / error) ** 0.2)
        new, error = step(y, h, slope)
    following = h * min(5.0, 0.9 * (tolerance / max(error, 1e-300)) ** 0.2)
    event, whole = None, h
    for name in [name for name, value in ends(new).items() if value > LEAST]:

        def end(part: float, name: tuple[str, int] = name) -> float:
            return ends(step(y, part, slope)[0] if part else y)[name]

        taken = 0.0 if end(0.0) > 0.0 else brentq(end, 0.0, whole)
        if taken <= h:
            h, event = taken, name
    if event:
        new = step(y, h, slope)[0]
    return new, h, following, event


def shown(y: Row, modes: Modes, bike: TwoWheeler) -> Row:
    """Return the states with the deflection that a sliding tire has."""
    row = list(y)
    for k, sign in enumerate(modes.slides):
        if sign:
            row[4 + k] = sign * bike.wheels[k].sigma * bike.limit(abs(bike.slip(k, y, modes)))
    return row


@dataclass(frozen=True)
class SlipControl:
    """PI control of a wheel's slip: p = K_p e + I, K_p = omega_c J v/(r k)."""

    slip: float
    omega_c: float
    T_i: float
    T_t: float
    v_off: float
    v_fall: float

    def advance(
        self, integral: float, wheel: Wheel, v: float, slip: float, ramp: float
    ) -> tuple[float, float]:
        """Return the integral after a sample, and what is demanded of this wheel."""
        K_p = self.omega_c * wheel.J * max(v, self.v_off) / (wheel.r * wheel.k)
        e = self.slip * min(v / self.v_fall, 1.0) - slip
        p = min(max(K_p * e + integral, 0.0), ramp)
        growth = K_p / self.T_i * e + (p - K_p * e - integral) / self.T_t
        return integral + PERIOD * growth, p


def controlled(bike: TwoWheeler, control: SlipControl, rider: float, p_rate: float) -> Demand:
    """Return slip control of both wheels, which knows speed and slip; the rider's demand is a step.

    The ramp [Pa/s] bounds what is demanded and does not wait for the control.
    """
    integral = [rider, rider]

    def demand(tick: int, y: Row) -> tuple[float, float]:
        v, ramp, wanted = y[1], min(rider, p_rate * PERIOD * (tick + 1)), []
        for k, wheel in enumerate(bike.wheels):
            slip = (v - y[2 + k] * wheel.r) / max(v, control.v_off)
            after, p = control.advance(integral[k], wheel, max(v, 0.0), slip, ramp)
            integral[k] = after if tick else rider
            wanted.append(p)
        return wanted[0], wanted[1]

    return demand
