"""What a process takes from its start to its end."""

import os
import subprocess
import sys
import time
from dataclasses import dataclass

MEGABYTE = 1e6
# ru_maxrss counts KiB on Linux and bytes on macOS.
RSS_UNIT = 1 if sys.platform == "darwin" else 1024


@dataclass(frozen=True)
class Cost:
    """Time and memory; what the process printed."""

    wall_s: float
    cpu_s: float
    peak_mb: float
    """Not below what the measuring process itself holds, some 35 MB."""
    printed: str


def measure(name, command):
    """Run to the end; a failure ends everything."""
    print(f"running {name} ...", flush=True)
    start = time.perf_counter()
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, encoding="utf-8"
    )
    printed = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"{name} failed with status {process.returncode}: {' '.join(map(str, command))}")
    cpu = usage.ru_utime + usage.ru_stime
    return Cost(wall, cpu, usage.ru_maxrss * RSS_UNIT / MEGABYTE, printed)
