"""A series as Python users have them: pixels lost to NaN or darkness, saved by other libraries.

    write_series.py F.npy DIR      reads F.npy, writes DIR/holes.npy and DIR/holes.zarr
"""

import sys
from pathlib import Path

import numpy as np
import zarr


def with_holes(field):
    """A copy with a block that is always zero and pixels that are NaN in one frame."""
    field = field.copy()
    field[:, 3:6, 4:9] = 0
    field[2, 10, 11] = np.nan
    field[-1, 0, -1] = np.inf
    return field


def main():
    source, folder = map(Path, sys.argv[1:])
    field = with_holes(np.load(source))
    np.save(folder / "holes.npy", field)
    group = zarr.open_group(folder / "holes.zarr", mode="w", zarr_format=3)
    names = ("time", "y", "x")
    chunks = (5, 16, 16)  # neither whole frames nor a divisor of the shape
    array = group.create_array(
        "field", shape=field.shape, chunks=chunks, dtype=field.dtype, dimension_names=names
    )
    array[:] = field


if __name__ == "__main__":
    main()
