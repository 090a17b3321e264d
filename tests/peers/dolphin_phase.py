"""Phases by dolphin (InSAR phase linking; Staniewicz et al., JOSS 9:6997, 2024) on part of a series.

    dolphin_phase.py F.npy --estimator evd|emi --crop 128 --out P.npy

Saves wrapped phases (time, y, x) of the square in the middle, and prints a line of JSON.

dolphin averages over a rectangle here. The one taken is the square nearest to the 4 pi sigma^2
pixels that a Gaussian counts for: 11 x 11 for sigma = 3. Its error bars are not computed. Its
default estimator, EMI, needs |C| to be positive definite and takes the phases of EVD where it is
not; `emi_share` says how often it was.

dolphin computes with JAX, which compiles at the first call. The second call is what is timed;
`setup_s` is the rest: imports, and how much longer the first call took.
"""

import argparse
import json
import math
import time
from pathlib import Path

import numpy as np

from crop import middle


def half_window(sigma):
    """h of the (2h + 1)^2 pixels nearest to the looks of a Gaussian."""
    return round((math.sqrt(4 * math.pi) * sigma - 1) / 2)


def timed(call):
    """Its result, wall and CPU seconds."""
    wall, cpu = time.perf_counter(), time.process_time()
    result = call()
    return result, time.perf_counter() - wall, time.process_time() - cpu


def load_dolphin():
    import dolphin
    from dolphin.phase_link import run_phase_linking

    return dolphin, run_phase_linking


def arguments():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("field", type=Path, help="complex series (time, y, x), .npy")
    parser.add_argument("--gaussian", type=float, default=3, help="sigma in pixels [3]")
    parser.add_argument("--estimator", choices=["evd", "emi"], required=True)
    parser.add_argument("--crop", type=int, required=True, help="side of the square in pixels")
    parser.add_argument("--out", type=Path, required=True)
    return parser.parse_args()


def main():
    options = arguments()
    field = np.load(options.field, mmap_mode="r")
    field = field[:, *middle(field.shape, options.crop)].astype(np.complex64)
    (dolphin, run_phase_linking), import_s, _ = timed(load_dolphin)
    half = half_window(options.gaussian)

    def link():
        return run_phase_linking(
            field,
            half_window=dolphin.HalfWindow(half, half),
            use_evd=options.estimator == "evd",
            compute_crlb=False,
        )

    _, first_s, _ = timed(link)
    linked, wall_s, cpu_s = timed(link)
    np.save(options.out, np.angle(linked.cpx_phase).astype(np.float32))
    figures = {
        "version": dolphin.__version__,
        "window": 2 * half + 1,
        "wall_s": wall_s,
        "cpu_s": cpu_s,
        "setup_s": import_s + max(first_s - wall_s, 0),
        "emi_share": float(np.mean(linked.estimator)),
    }
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
