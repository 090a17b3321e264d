"""Run `phasewalk phase`, numpy_phase.py and dolphin on the same series, one after the other.

    side_by_side.py PHASEWALK F.npy [--gaussian 3] [--max-lag L] [--crop 128]

Each is one process on all cores. Of phasewalk and NumPy all of it counts: reading and writing
files, Python's imports, the program's survey of the data. dolphin computes the square in the middle
only, and of it counts what dolphin_phase.py times. Of each the faster of two runs counts: the first
may wait for the machine to find it memory. Errors are taken on the same pixels for all. Results are
left beside F.npy.
"""

import argparse
import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from agreement import compare
from crop import middle
from phase_errors import checked_frames, errors, inside
from process_cost import measure

PEERS = Path(__file__).parent
CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()


@dataclass(frozen=True)
class Run:
    """One contender's figures; its images are in `path`."""

    name: str
    path: Path
    wall_s: float
    cpu_s: float
    peak_mb: float
    setup_s: float | None = None
    """Imports and compilation, where they are not part of `wall_s`."""
    cropped: bool = False
    """The images are wrapped phases of the crop alone."""
    window: int = 0
    """Side of the rectangle that is averaged over."""

    def images(self, square):
        """Phases (time, y, x) of the crop."""
        images = np.load(self.path, mmap_mode="r")
        return np.asarray(images if self.cropped else images[:, *square])


def faster_of_two(name, command):
    """The cost of the faster run."""
    return min((measure(name, command) for _ in range(2)), key=lambda cost: cost.wall_s)


def whole(name, command, path):
    """A contender that is timed from start to end on the whole images."""
    cost = faster_of_two(name, command)
    return Run(name, path, cost.wall_s, cost.cpu_s, cost.peak_mb)


def run_dolphin(estimator, options):
    """dolphin on the crop."""
    path = options.field.with_suffix(f".dolphin-{estimator}.npy")
    script = [sys.executable, PEERS / "dolphin_phase.py", options.field, "--out", path]
    how = ["--estimator", estimator, "--crop", str(options.crop), "--gaussian", options.gaussian]
    cost = faster_of_two(f"dolphin, {estimator.upper()}", script + how)
    told = json.loads(cost.printed.splitlines()[-1])
    name = f"dolphin {told['version']}, {estimator.upper()}"
    if estimator == "emi":
        name += f" (at {100 * told['emi_share']:.0f} % of the pixels, else EVD)"
    times = (told["wall_s"], told["cpu_s"], cost.peak_mb, told["setup_s"])
    return Run(name, path, *times, cropped=True, window=told["window"])


def run_all(options):
    """Everything that is timed; memory of this process would count, so no images are read yet."""
    field = options.field
    method = ["--gaussian", options.gaussian]
    if options.max_lag:
        method += ["--max-lag", options.max_lag]

    def ours(name):
        path = field.with_suffix(f".{name}.npy")
        command = [options.program.resolve(), "phase", field, *method, "--method", name, "-o", path]
        return whole(f"Phasewalk, `--method {name}`", command, path)

    path = field.with_suffix(".numpy.npy")
    numpy = [sys.executable, PEERS / "numpy_phase.py", field, *method, "--out", path]
    runs = [ours("paper"), ours("linked"), whole("NumPy + scipy.fft, paper's method", numpy, path)]
    return runs + [run_dolphin(estimator, options) for estimator in ("evd", "emi")]


def header(frames):
    """First lines of the table."""
    checked = " / ".join(map(str, checked_frames(frames)))
    names = [
        "",
        "pixels",
        "wall",
        "CPU",
        "per pixel, wall / CPU",
        "start, compile",
        "peak memory",
        f"rms error modulo 2π, frames {checked}",
        "last frame, turns counted",
    ]
    return f"| {' | '.join(names)} |\n{'|---' * len(names)}|"


def row(run, pixels, off):
    """A line of the table."""
    cells = [
        run.name,
        f"{pixels}",
        f"{run.wall_s:.1f} s",
        f"{run.cpu_s:.1f} s",
        f"{run.wall_s / pixels * 1e6:.0f} / {run.cpu_s / pixels * 1e6:.0f} µs",
        "" if run.setup_s is None else f"{run.setup_s:.1f} s",
        f"{run.peak_mb:.0f} MB",
        " / ".join(f"{value:.2f}" for value in off.modulo) + " rad",
        f"{off.last:.2f} rad",
    ]
    return f"| {' | '.join(cells)} |"


def report(runs, options):
    """Print what was compared, and the table in Markdown."""
    field = options.field
    frames, height, width = np.load(field, mmap_mode="r").shape
    square = middle((height, width), options.crop)
    mask = np.load(field.with_suffix(".mask.npy"))[square]
    pixels = inside(mask, max(run.window for run in runs) // 2 + 1)
    truth = np.load(field.with_suffix(".phase.npy"))
    print(
        f"\n{frames} frames of {width} x {height} pixels, {CORES} cores; errors of"
        f" {pixels.sum()} pixels of the x in the middle {mask.shape[1]} x {mask.shape[0]}\n"
    )
    print(header(frames))
    for run in runs:
        off = errors(run.images(square)[:, pixels], truth, wrapped=run.cropped)
        print(row(run, mask.size if run.cropped else height * width, off))


def arguments():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("program", type=Path)
    parser.add_argument("field", type=Path, help="with .mask.npy and .phase.npy beside it")
    parser.add_argument("--gaussian", default="3")
    parser.add_argument("--max-lag")
    parser.add_argument("--crop", type=int, default=128)
    return parser.parse_args()


def main():
    options = arguments()
    runs = run_all(options)
    report(runs, options)
    ours, _, numpy, *_ = runs
    agreement = compare(*(np.load(run.path, mmap_mode="r") for run in (ours, numpy)))
    print(f"\nphasewalk and NumPy, paper's method: {agreement}")
    if not agreement.good:
        sys.exit("the two do not agree")


if __name__ == "__main__":
    main()
