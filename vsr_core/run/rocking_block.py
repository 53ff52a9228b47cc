"""Housner's rocking block: a reference for the overturning of boxes, free of any physics engine.

A rigid block on a rigid table turns about one lower corner or the other, never slides or bounces,
and loses energy only when it passes the upright position. The tilt theta [rad] is about +y, so a
block that leans towards +x has theta > 0, and a table accelerating towards +x tilts it below 0.

References
----------
Housner (1963), Bull. Seismol. Soc. Am. 53(2), 403-417: rocking and free decay.
Zhang & Makris (2001), J. Eng. Mech. 127(5): blocks under one-cycle cycloidal pulses.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from scipy.integrate import solve_ivp

from vsr_core import GRAVITY
from vsr_core.errors import InvalidInput
from vsr_core.run.boundary_search import Topples, halved

MOST_HALVINGS = 100
"""More than any tolerance asks for."""


@dataclass(frozen=True)
class Block:
    """A symmetric block that rocks in a plane.

    Attributes
    ----------
    half_width, half_height : float [m]
        Of the base along the shaking, and of the centre of mass above it.
    gravity : float [m/s^2]
    inertia_ratio : float
        I_O / (m R^2), I_O about a lower corner; 4/3 for a uniform box.
    """

    half_width: float
    half_height: float
    gravity: float = GRAVITY
    inertia_ratio: float = 4.0 / 3.0

    def __post_init__(self) -> None:
        sizes = (self.half_width, self.half_height, self.gravity)
        if not all(0.0 < value < math.inf for value in sizes):
            given = f"a block with half-width, half-height and gravity {sizes}"
            rule = "all three must be positive and finite"
            raise InvalidInput(given, rule, "give half-sizes in m and gravity in m/s^2")
        if not (self.inertia_ratio >= 1.0 and self.impact_ratio > 0.0):
            raise InvalidInput(
                f"a block with I_O/(m R^2) = {self.inertia_ratio:g} and tan(alpha) = "
                f"{self.half_width / self.half_height:g}",
                "it must be at least 1, and more than 1 - cos(2 alpha) for rocking to go on "
                "after an impact",
                "give a slenderer block (a uniform box: width below 1.41 heights)",
            )

    @property
    def radius(self) -> float:
        """Distance R of the centre of mass from a lower corner [m]."""
        return math.hypot(self.half_width, self.half_height)

    @property
    def alpha(self) -> float:
        """Slenderness angle [rad]: at rest with theta = alpha the block balances on a corner."""
        return math.atan2(self.half_width, self.half_height)

    @property
    def p(self) -> float:
        """Frequency parameter sqrt(m g R / I_O) [1/s]; sqrt(3 g / (4 R)) for a uniform box."""
        return math.sqrt(self.gravity / (self.radius * self.inertia_ratio))

    @property
    def impact_ratio(self) -> float:
        """Ratio of angular velocities after and before an impact (angular momentum is kept).

        1 - (m R^2 / I_O) (1 - cos 2 alpha); 1 - 1.5 sin(alpha)^2 for a uniform box.
        """
        return 1.0 - (1.0 - math.cos(2.0 * self.alpha)) / self.inertia_ratio

    @property
    def uplift(self) -> float:
        """Acceleration g tan(alpha) [m/s^2] up to which a block at rest does not move."""
        return self.gravity * self.half_width / self.half_height


@dataclass(frozen=True)
class RockingResponse:
    """What a pulse did to a block.

    Attributes
    ----------
    impacts : int
        During the pulse, not counting the infinitely many small ones of a block coming to rest.
    time : float [s]
        When the integration ended: at the end of the pulse, or earlier at |theta| = pi/2.
    theta, theta_dot : float [rad, rad/s]
        At ``time``.
    peak_angle : float [rad]
        Largest |theta|, the free rocking after the pulse included; pi/2 if it overturned.
    """

    overturned: bool
    impacts: int
    time: float
    theta: float
    theta_dot: float
    peak_angle: float


def rocking_response(
    block: Block,
    pga: float,
    pgv_pga: float,
    start: tuple[float, float] = (0.0, 0.0),
    rtol: float = 1e-9,
) -> RockingResponse:
    """Response to the cosine pulse a(t) = pga cos(t / pgv_pga), 0 <= t <= 2 pi pgv_pga.

    Integrates Housner's equation without linearising it,
    theta'' = -p^2 [sin(alpha sgn(theta) - theta) + (a/g) cos(alpha sgn(theta) - theta)],
    between located impacts, where theta'(+) = rho theta'(-). The pulse's end is decided by energy
    (`free_peak`). A block at rest starts to rock when |a| exceeds g tan(alpha).

    Parameters
    ----------
    pga : float [m/s^2]
        Negative for the mirrored pulse, 0 for free rocking.
    pgv_pga : float [s]
    start : (float, float) [rad, rad/s]
        Tilt and its rate at t = 0.
    rtol : float
        Relative tolerance of the integration; the absolute one is a hundredth of it, in units of
        alpha and p alpha.
    """
    if not (math.isfinite(pga) and 0.0 < pgv_pga < math.inf and abs(start[0]) < math.pi / 2):
        given = f"a pulse of {pga:g} m/s^2 and {pgv_pga:g} s from a tilt of {start[0]:g} rad"
        rule = "PGA must be finite, PGV/PGA positive and finite, the tilt below pi/2"
        raise InvalidInput(given, rule, "give PGA in m/s^2, PGV/PGA in s, angles in rad")
    # Time in 1/p, angle in alpha; x >= 0 is the tilt on the current side.
    alpha, rate = block.alpha, 1.0 / (block.p * pgv_pga)
    amplitude, end, lying = pga / block.gravity, 2.0 * math.pi / rate, math.pi / (2.0 * alpha)
    theta, theta_dot = start
    side = math.copysign(1.0, theta or theta_dot)
    time, x, v = 0.0, abs(theta) / alpha, side * theta_dot / (alpha * block.p)
    impacts, peak = 0, x
    while time < end:
        if x == 0.0 and v == 0.0:
            time = _next_uplift(block, amplitude, rate, time)
            if time >= end:
                time = end
                break
            side = -math.copysign(1.0, amplitude * math.cos(rate * time))
        t, x, v, top, landed = _swing(
            alpha, side * amplitude, rate, (time, x, v), (end, lying), rtol
        )
        time, peak = t, max(peak, top)
        if not landed:
            break
        impacts, side, x, v = impacts + 1, -side, 0.0, max(-block.impact_ratio * v, 0.0)
        if _comes_to_rest(block, amplitude, rate, time, v * alpha):
            v = 0.0
    theta, theta_dot = side * x * alpha, side * v * alpha * block.p
    later = free_peak(block, theta, theta_dot)
    return RockingResponse(
        later == math.pi / 2, impacts, time / block.p, theta, theta_dot, max(peak * alpha, later)
    )


def _swing(
    alpha: float,
    amplitude: float,
    rate: float,
    begin: tuple[float, float, float],
    limits: tuple[float, float],
    rtol: float,
) -> tuple[float, float, float, float, bool]:
    """Integrate on one side from (time, x, v) to x = 0 or to ``limits`` of (time, x).

    Returns time, x and v there, the largest x on the way, and whether x came back to 0.
    ``amplitude`` is the pulse's in g, positive towards the current side.
    """
    t0, x0, v0 = begin
    end, lying = limits
    # From rest the push starts at zero: its rounding must not land the block at once.
    slack = 1e-12 if x0 == v0 == 0.0 else 0.0

    def motion(t: float, y: list[float]) -> tuple[float, float]:
        x, v = y
        lean = alpha * (1.0 - x)
        push = amplitude * math.cos(rate * t) * math.cos(lean)
        return v, -(math.sin(lean) + push) / alpha

    def lands(t: float, y: list[float]) -> float:
        # After an impact SciPy's first step is at most v / |x''|, half a swing: none is missed.
        return float(y[0]) + slack

    def lies(t: float, y: list[float]) -> float:
        return float(y[0]) - lying

    def turns(t: float, y: list[float]) -> float:
        return float(y[1])

    for event, terminal, direction in ((lands, 1, -1), (lies, 1, 1), (turns, 0, -1)):
        event.terminal, event.direction = terminal, direction  # type: ignore[attr-defined]
    swing = solve_ivp(
        motion, (t0, end), (x0, v0), "DOP853", events=(lands, lies, turns), rtol=rtol,
        atol=0.01 * rtol,
    )  # fmt: skip
    if not swing.success:
        raise ArithmeticError(f"integration of the rocking block failed: {swing.message}")
    t, x, v = float(swing.t[-1]), float(swing.y[0, -1]), float(swing.y[1, -1])
    landed, lay = swing.t_events[0].size > 0, swing.t_events[1].size > 0
    top = max([x0, x, *(float(y[0]) for y in swing.y_events[2])])
    return t, lying if lay else x, v, top, landed


def _next_uplift(block: Block, amplitude: float, rate: float, time: float) -> float:
    """First time from ``time`` on at which a block at rest starts to rock; inf if none is left."""
    still = block.uplift / block.gravity
    if abs(amplitude) <= still:
        return math.inf
    strong = math.acos(still / abs(amplitude)) / rate
    for peak in (0.0, math.pi / rate, 2.0 * math.pi / rate):
        if time < peak + strong:
            return max(time, peak - strong)
    return math.inf


def _comes_to_rest(block: Block, amplitude: float, rate: float, time: float, v: float) -> bool:
    """Whether the impacts after one at ``time`` provably end before the next uplift.

    Rocking that is too weak for the ground motion makes infinitely many impacts in finite time.
    With k > 0 the least angular acceleration towards theta = 0 until halfway to that uplift and
    0.9 k that at a small tilt, theta <= v^2 / (1.8 k); its change with tilt is at most
    theta / cos(alpha), hence the condition on v. A changing k(t) speeds v up by less than
    max(k) / k, and the n-th swing lasts at most 2 rho^n v / (0.9 k). Units: time 1/p, v p rad.
    """
    alpha, end = block.alpha, 2.0 * math.pi / rate
    until = min(_next_uplift(block, amplitude, rate, time), end)
    half = 0.5 * (until - time)
    # Between two uplifts |a| falls and rises again: its largest value is at one of the ends.
    cosines = (1.0,) if until == end else (math.cos(rate * time), math.cos(rate * (time + half)))
    strongest = abs(amplitude) * max(abs(c) for c in cosines)
    k = math.sin(alpha) - strongest * math.cos(alpha)
    if k <= 0.0:
        return False
    v_max = v * 2.0 * math.sin(alpha) / k
    if v_max**2 > 0.18 * k**2 * math.cos(alpha):
        return False
    return 2.0 * v_max / (0.9 * k * (1.0 - block.impact_ratio)) <= half


def free_peak(block: Block, theta: float, theta_dot: float) -> float:
    """Largest tilt of free rocking from a state.

    By energy: theta'^2 / 2 + p^2 cos(alpha - |theta|) is constant between impacts, and its excess
    over p^2 cos(alpha) is multiplied by rho^2 in each. Moving outwards the block overturns when
    theta'^2 / 2 > p^2 (1 - cos(alpha - |theta|)); beyond alpha always, unless it moves inwards
    fast enough to stand up again. Standing up, it may still overturn on the other side.

    Parameters
    ----------
    theta, theta_dot : float [rad, rad/s]

    Returns
    -------
    float [rad]
        |theta|; pi/2 if the block overturns.
    """
    alpha, tilt = block.alpha, abs(theta)
    outwards = theta_dot * (theta or theta_dot) >= 0.0
    level = 0.5 * (theta_dot / block.p) ** 2 + math.cos(alpha - tilt)
    if tilt < alpha and outwards:
        return turning_point(block, level)
    if tilt >= alpha and (outwards or level <= 1.0):
        return math.pi / 2
    floor = math.cos(alpha)
    return max(tilt, turning_point(block, floor + block.impact_ratio**2 * (level - floor)))


def turning_point(block: Block, level: float) -> float:
    """Tilt [rad] at which a block with cos(alpha - tilt) = ``level`` turns; pi/2 if none."""
    return block.alpha - math.acos(level) if level <= 1.0 else math.pi / 2


def first_overturning_pga(
    block: Block, pgv_pga: float, pga_max: float, step: float, tolerance: float = 1e-4
) -> float:
    """Lowest PGA found to overturn the block.

    The overturning PGAs of one ``pgv_pga`` need not be one interval, so the PGAs from g tan(alpha)
    on are tried every ``step`` and only the first change of outcome is bisected. An overturned
    interval that lies between two of the PGAs tried is missed: where four or more impacts decide,
    halve the step until the result stays.

    Parameters
    ----------
    pgv_pga : float [s]
    pga_max, step : float [m/s^2]
    tolerance : float
        Relative width of the bracket; its upper end, which did overturn, is returned.

    Returns
    -------
    float [m/s^2]
        Infinite if there is none up to ``pga_max``.
    """
    return next(_switches(block, pgv_pga, pga_max, step, tolerance), math.inf)


def overturning_intervals(
    block: Block, pgv_pga: float, pga_max: float, step: float, tolerance: float = 1e-4
) -> list[tuple[float, float]]:
    """All intervals of PGA found to overturn the block.

    Each runs from its first overturning PGA to the first safe one behind it, or to ``pga_max``;
    between two of them lies a safe island.

    Returns
    -------
    list of tuple of float [m/s^2], lowest first
    """
    edges = [*_switches(block, pgv_pga, pga_max, step, tolerance)]
    if len(edges) % 2:
        edges.append(pga_max)
    return list(zip(edges[::2], edges[1::2], strict=True))


def _switches(
    block: Block, pgv_pga: float, pga_max: float, step: float, tolerance: float
) -> Iterator[float]:
    """PGAs [m/s^2] at which the outcome is the other one than just below; starts balanced."""
    if not (step > 0.0 and 0.0 < tolerance < 1.0 and pga_max < math.inf):
        given = f"step {step:g} m/s^2, tolerance {tolerance:g}, largest PGA {pga_max:g} m/s^2"
        rule = "the step must be positive, the tolerance between 0 and 1, the PGA finite"
        raise InvalidInput(given, rule, "give a step as fine as the islands that matter")

    def overturns(pga: float) -> bool:
        return rocking_response(block, pga, pgv_pga).overturned

    def leaves(outcome: bool) -> Topples:
        return lambda pga: overturns(pga) != outcome

    known, outcome = block.uplift, False
    for i in range(1, math.ceil((pga_max - block.uplift) / step) + 1):
        tried = min(block.uplift + i * step, pga_max)
        if overturns(tried) != outcome:
            yield halved(leaves(outcome), known, tried, MOST_HALVINGS, tolerance).topples
            outcome = not outcome
        known = tried
