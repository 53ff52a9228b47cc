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
    octaves, seed : int

    Returns
    -------
    ndarray, shape (...)
    """
    value = np.zeros(place.shape[:-1])
    for k in range(octaves):
        value += 0.5**k * waves(place, longest / 2.0**k, seed + 7 * k)
    return value


def scattered(count: int) -> Array:
    """Points of the unit square, evenly spread without a pattern, shape (count, 2).

    References
    ----------
    Roberts (2018), The unreasonable effectiveness of quasirandom sequences.
    """
    number = np.arange(1, count + 1)[:, None]
    return (0.5 + number * np.array([1.0 / _PLASTIC, 1.0 / _PLASTIC**2])) % 1.0


def rise(t: Array) -> Array:
    """0 below t = 0, 1 above t = 1, smooth between."""
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def ramp(t: Array, width: float) -> Array:
    """Zero, then ``t``, with a smooth bend about ``width`` [m] wide at t = 0 [m]."""
    return width * np.logaddexp(0.0, t / width)


def stepped(height: Array, shift: Array, step: float, share: float) -> Array:
    """Ground of this ``height`` [m] broken into steps of height ``step`` [m].

    The steps lie ``shift`` [m] lower; ``share`` is 0 for none and 1 for level treads.
    """
    turn = 2.0 * math.pi / step
    return height - share / turn * np.sin(turn * (height + shift))
