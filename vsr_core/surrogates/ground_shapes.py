"""Shapes of ground as functions of place: waves, steps and transitions, the same every time."""

from __future__ import annotations

import math

import numpy as np

from vsr_core.arrays import Array

_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
_WAVES = 16
_PLASTIC = 1.32471795724474602596  # its powers spread points over a square most evenly


def waves(place: Array, length: float, seed: int) -> Array:
    """Smooth noise of root mean square 1: plane waves spread in direction, length and phase.

    Parameters
    ----------
    place : ndarray, shape (..., 2) [m]
    length : float [m], of the longest wave; the shortest is half as long
    seed : int, another one gives other phases and directions

    Returns
    -------
    ndarray, shape (...)

    Examples
    --------
    >>> waves(np.zeros((5, 2)), 3.0, 0).shape
    (5,)
    """
    value = np.zeros(place.shape[:-1])
    for j in range(_WAVES):
        turn = (j + 0.37 * seed) * _GOLDEN_ANGLE
        number = 2.0 * math.pi / length * (1.0 + j / (_WAVES - 1))
        phase = (1.0 + j * j) * (1.7 + seed)
        along = math.cos(turn) * place[..., 0] + math.sin(turn) * place[..., 1]
        value += np.cos(number * along + phase)
    return value * math.sqrt(2.0 / _WAVES)


def rough(place: Array, longest: float, octaves: int, seed: int) -> Array:
    """Noise like that of broken rock, each octave half as long and half as high as the last.

    Parameters
    ----------
    place : ndarray, shape (..., 2) [m]
    longest : float [m], of the longest wave of the first octave, whose root mean square is 1

    Returns
    -------
    ndarray, shape (...)
    """
    value = np.zeros(place.shape[:-1])
    for k in range(octaves):
        value += 0.5**k * waves(place, longest / 2.0**k, seed + 7 * k)
    return value


def scattered(count: int) -> Array:
    """Points of the unit square, evenly spread without a pattern.

    Returns
    -------
    ndarray, shape (count, 2)

    References
    ----------
    Roberts (2018), The unreasonable effectiveness of quasirandom sequences.

    Examples
    --------
    >>> scattered(2).round(2).tolist()
    [[0.25, 0.07], [0.01, 0.64]]
    """
    number = np.arange(1, count + 1)[:, None]
    return (0.5 + number * np.array([1.0 / _PLASTIC, 1.0 / _PLASTIC**2])) % 1.0


def rise(t: Array) -> Array:
    """0 below t = 0, 1 above t = 1, smooth between.

    Parameters
    ----------
    t : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (n,)

    Examples
    --------
    >>> rise(np.array([-1.0, 0.5, 2.0])).tolist()
    [0.0, 0.5, 1.0]
    """
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def ramp(t: Array, width: float) -> Array:
    """Zero, then ``t``, with a smooth bend at t = 0.

    Parameters
    ----------
    t : ndarray, shape (n,) [m]
    width : float [m], of the bend

    Returns
    -------
    ndarray, shape (n,) [m]

    Examples
    --------
    >>> ramp(np.array([-9.0, 9.0]), 0.1).round(6).tolist()
    [0.0, 9.0]
    """
    return width * np.logaddexp(0.0, t / width)


def stepped(height: Array, shift: Array, step: float, share: float) -> Array:
    """Ground broken into steps.

    Parameters
    ----------
    height : ndarray, shape (n,) [m]
    shift : ndarray, shape (n,) [m], by which the steps lie lower
    step : float [m], height of a step
    share : float, 0 for no steps to 1 for level treads

    Returns
    -------
    ndarray, shape (n,) [m]

    Examples
    --------
    >>> stepped(np.array([0.0, 0.25, 1.0]), np.zeros(3), 1.0, 1.0).round(3).tolist()
    [0.0, 0.091, 1.0]
    """
    turn = 2.0 * math.pi / step
    return height - share / turn * np.sin(turn * (height + shift))
