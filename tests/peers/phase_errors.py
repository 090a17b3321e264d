"""Errors of phase images against the true phase of a simulated x."""

from dataclasses import dataclass

import numpy as np

REFERENCE_FRAMES = 5  # the phase refers to their mean
RIM = 5
"""Pixels off the edge of the x, into which the aperture mixes light from the other side."""


def inside(mask, border):
    """Pixels at least RIM inside the x and `border` inside the image."""
    padded = np.pad(mask, RIM)
    around = np.lib.stride_tricks.sliding_window_view(padded, (2 * RIM + 1, 2 * RIM + 1))
    deep = around.all(axis=(2, 3))
    deep[:border] = deep[-border:] = False
    deep[:, :border] = deep[:, -border:] = False
    if not deep.any():
        raise SystemExit("no pixel of the x to compare; take a larger --crop")
    return deep


def checked_frames(frames):
    """A quarter of the way, half of it, the last frame."""
    return [(frames - 1) * quarters // 4 for quarters in (1, 2, 4)]


@dataclass(frozen=True)
class Errors:
    """Rms over pixels, in radians."""

    modulo: list[float]
    """At the checked frames, modulo 2 pi: at most pi; pi / sqrt(3) = 1.81 by chance."""
    last: float
    """At the last frame, whole turns counted."""


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def errors(phases, truth, wrapped):
    """Of phases (time, pixel). Wrapped ones are unwrapped from frame to frame for `last`."""
    phases = phases.astype(np.float64)
    truth = truth - truth[:REFERENCE_FRAMES].mean()
    phasors = np.exp(1j * phases)
    reference = np.angle(phasors[:REFERENCE_FRAMES].mean(axis=0))
    off = np.angle(phasors * np.exp(-1j * (truth[:, None] + reference)))
    whole = np.unwrap(phases, axis=0) if wrapped else phases
    whole = whole - whole[:REFERENCE_FRAMES].mean(axis=0)
    modulo = [rms(off[frame]) for frame in checked_frames(len(phases))]
    return Errors(modulo, rms(whole[-1] - truth[-1]))
