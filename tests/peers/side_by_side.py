"""Time `phasewalk phase` and numpy_phase.py on the same series, one after the other.

    side_by_side.py PHASEWALK F.npy [--gaussian 3] [--max-lag L]

Each is one process on all cores, from its start to its end: reading and writing files, Python's
imports and the program's survey of the data count. Results are left beside F.npy.
"""

import argparse
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from agreement import compare

NUMPY_PHASE = Path(__file__).with_name("numpy_phase.py")
MEGABYTE = 1e6
# ru_maxrss counts KiB on Linux and bytes on macOS.
RSS_UNIT = 1 if sys.platform == "darwin" else 1024


@dataclass(frozen=True)
class Cost:
    """What one process took."""

    name: str
    wall_s: float
    cpu_s: float
    peak_mb: float


def measure(name, command):
    """Run to the end; a failure ends everything."""
    print(f"running {name} ...", flush=True)
    start = time.perf_counter()
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"{name} failed with status {process.returncode}: {' '.join(map(str, command))}")
    cpu = usage.ru_utime + usage.ru_stime
    return Cost(name, wall, cpu, usage.ru_maxrss * RSS_UNIT / MEGABYTE)


def table(costs, pixels):
    """Rows per program, and the ratio of the last to the first."""
    lines = [f"{'':<14}{'wall s':>10}{'CPU s':>10}{'peak MB':>10}{'us/pixel':>10}"]
    for cost in costs:
        per_pixel = cost.wall_s / pixels * 1e6
        numbers = f"{cost.wall_s:>10.2f}{cost.cpu_s:>10.2f}{cost.peak_mb:>10.0f}{per_pixel:>10.2f}"
        lines.append(f"{cost.name:<14}{numbers}")
    first, last = costs[0], costs[-1]
    wall, cpu = last.wall_s / first.wall_s, last.cpu_s / first.cpu_s
    memory = last.peak_mb / first.peak_mb
    lines.append(f"{'ratio':<14}{wall:>10.1f}{cpu:>10.1f}{memory:>10.1f}{wall:>10.1f}")
    return "\n".join(lines)


def arguments():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("program", type=Path)
    parser.add_argument("field", type=Path)
    parser.add_argument("--gaussian", default="3")
    parser.add_argument("--max-lag")
    return parser.parse_args()


def main():
    options = arguments()
    field = options.field
    method = ["--gaussian", options.gaussian]
    if options.max_lag:
        method += ["--max-lag", options.max_lag]
    results = [field.with_suffix(".phasewalk.npy"), field.with_suffix(".numpy.npy")]
    program = options.program.resolve()
    ours = [program, "phase", field, *method, "--method", "paper", "-o", results[0]]
    peer = [sys.executable, NUMPY_PHASE, field, *method, "--out", results[1]]
    costs = [measure("phasewalk", ours), measure("NumPy + SciPy", peer)]
    images = [np.load(path, mmap_mode="r") for path in results]
    agreement = compare(*images)
    frames, height, width = images[0].shape
    print(f"\n{frames} frames of {width} x {height} pixels, {os.cpu_count()} cores")
    print(table(costs, height * width))
    print(agreement)
    if not agreement.good:
        sys.exit("the two do not agree")


if __name__ == "__main__":
    main()
