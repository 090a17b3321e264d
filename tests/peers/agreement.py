"""How well two stacks of phase images agree."""

from dataclasses import dataclass

import numpy as np

TOLERANCE_RAD = 1e-3
# Single precision decides near-ties of the unwrapping (a turn more or less) either way.
SHARE_ALLOWED = 1e-4


@dataclass(frozen=True)
class Agreement:
    """Differences over the pixels that both have, in radians."""

    median: float
    largest: float
    share_off: float
    """Share of pixels with a difference above the tolerance in any frame."""
    same_nan: bool

    @property
    def good(self):
        return self.same_nan and self.share_off <= SHARE_ALLOWED

    def __str__(self):
        nan = "" if self.same_nan else "; NaN at different pixels"
        return (
            f"difference: median {self.median:.1e} rad, largest {self.largest:.1e} rad, "
            f"above {TOLERANCE_RAD:g} rad on {self.share_off:.1e} of the pixels{nan}"
        )


def compare(ours, theirs):
    """Compare two arrays (time, y, x)."""
    if ours.shape != theirs.shape:
        raise SystemExit(f"shapes differ: {ours.shape} and {theirs.shape}")
    known = ~(np.isnan(ours) | np.isnan(theirs)).any(axis=0)
    if not known.any():
        raise SystemExit("no pixel to compare: all are NaN")
    difference = np.abs(ours[:, known].astype(np.float64) - theirs[:, known])
    return Agreement(
        median=float(np.median(difference)),
        largest=float(difference.max()),
        share_off=float((difference.max(axis=0) > TOLERANCE_RAD).mean()),
        same_nan=bool((np.isnan(ours) == np.isnan(theirs)).all()),
    )
