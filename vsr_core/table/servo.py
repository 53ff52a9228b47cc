"""The servo that drives a table: its sampled loop, and whether that loop is stable.

The pedestal is a rigid mass M on a frictionless slide. At the start of each control period h the
servo measures the velocity v, takes the error e = v_desired - v, and holds until the next period

    F = kp e + ki s + kd (e - e_before) / h,    s = s_before + h e,

cut at the force limit: the integral includes the present error, the derivative is the backward
difference, both start from zero. Under a constant force a free mass obeys v+ = v + F h / M exactly.
A rock that sticks to the table adds mass, which only widens the range of stable periods.

Commands v_desired may come more rarely than the loop runs; each is then held for several periods
(Chen et al. 2024, Eqs 8-12: 100-200 Hz). What is commanded has no part in whether a loop is stable.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput


@dataclass(frozen=True)
class Servo:
    """A pedestal on a slide under PID control of its velocity.

    Attributes
    ----------
    mass : float [kg], of the pedestal
    kp : float [N s/m], above 0
    ki : float [N/m], not below 0
    kd : float [N s^2/m], not below 0
    period : float [s], time for which a force is held
    force_limit : float [N], largest absolute force; the integral goes on growing behind it
    hold : int, control periods for which a command is held
    """

    mass: float
    kp: float
    ki: float
    kd: float
    period: float
    force_limit: float = math.inf
    hold: int = 1

    @property
    def command_period(self) -> float:
        """Time for which a command is held [s]."""
        return self.hold * self.period

    @property
    def stiffness(self) -> float:
        """Kp h / M: share of an error that one period takes away [1]."""
        return self.kp * self.period / self.mass


PUBLISHED = Servo(mass=5e4, kp=5e7, ki=5e7, kd=0.0, period=1e-3)
"""The public Double Rock model of Chen et al. (2024), Seismica 3(1), at the step of its physics,
with a command for each. Theirs came at 200 Hz (``hold`` of 5); a force held as long as that makes
the loop unstable."""


def loop(servo: Servo, commands: Array) -> Array:
    """Velocity of a free rigid mass at the end of each period, by the sampled law, exactly.

    Parameters
    ----------
    servo : Servo, with the mass of all that moves
    commands : ndarray, shape (n,) [m/s], one a control period

    Returns
    -------
    ndarray, shape (n,) [m/s]
    """
    speed = total = before = 0.0
    speeds = []
    for command in commands.tolist():
        error = command - speed
        total += servo.period * error
        force = servo.kp * error + servo.ki * total + servo.kd * (error - before) / servo.period
        force = max(-servo.force_limit, min(servo.force_limit, force))
        speed += force * servo.period / servo.mass
        before = error
        speeds.append(speed)
    return np.array(speeds)


def spectral_radius(servo: Servo) -> float:
    """Factor by which the slowest error shrinks, or the fastest grows, in a control period.

    Returns
    -------
    float [1]

    Examples
    --------
    >>> spectral_radius(Servo(mass=50.0, kp=1000.0, ki=0.0, kd=0.0, period=0.01))
    0.8
    """
    return float(np.abs(np.linalg.eigvals(_closed_loop(servo))).max())


def largest_stable_period(servo: Servo) -> float:
    """Period from which on the sampled loop is unstable; 0 if it is at every period.

    With p = kp h / M, i = ki h^2 / M and d = kd / M the characteristic polynomial is

        z^3 + (p + i + d - 2) z^2 + (1 - p - 2 d) z + d,

    and Jury's conditions for kp > 0, ki, kd >= 0 come down to 2 p + i + 4 d < 4. Without ki and kd
    that is h < 2 M / kp.

    Returns
    -------
    float [s]

    References
    ----------
    Jury, E. I. (1964). Theory and Application of the z-Transform Method. Wiley.

    Examples
    --------
    >>> largest_stable_period(Servo(mass=50.0, kp=1000.0, ki=0.0, kd=0.0, period=0.01))
    0.1
    """
    spare = servo.mass - servo.kd
    if spare <= 0.0:
        return 0.0
    return 4.0 * spare / (servo.kp + math.sqrt(servo.kp**2 + 4.0 * servo.ki * spare))


def check(servo: Servo) -> None:
    """Refuse a servo whose sampled loop is unstable.

    Raises
    ------
    InvalidInput
        With Kp h / M, the spectral radius, the largest stable period and what to change.
    """
    longest = largest_stable_period(servo)
    if servo.period < longest:
        return
    given = (
        f"a servo with Kp h / M = {servo.stiffness:.4g} and a spectral radius of "
        f"{spectral_radius(servo):.4g}"
    )
    if longest == 0.0:
        raise InvalidInput(
            given,
            f"no period is stable with kd = {servo.kd:g} at or above the mass of {servo.mass:g} kg",
            "lower kd",
        )
    raise InvalidInput(
        given,
        f"its sampled loop is stable for periods below {1e3 * longest:.4g} ms",
        f"shorten the period from {1e3 * servo.period:.4g} ms, lower the gains or raise the mass",
    )


def _closed_loop(servo: Servo) -> Array:
    """Matrix that takes the state over one control period when the table is to stand still.

    The state is (v, s_before / h, v_before) [m/s], of which the second is left out without
    integral gain and the third without derivative gain: what no force depends on cannot make the
    velocity grow. The integral alone would add an eigenvalue of 1.
    """
    h, mass = servo.period, servo.mass
    p, i, d = servo.kp * h / mass, servo.ki * h * h / mass, servo.kd / mass
    full = np.array([[1.0 - p - i - d, i, d], [-1.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    kept = [0, *([1] if i else []), *([2] if d else [])]
    return full[np.ix_(kept, kept)]
