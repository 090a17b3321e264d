"""Assert that NumPy, zarr-python and the csv module read what `phasewalk` writes.

    check_files.py DIR     DIR holds what `cargo xtask test` has put there:

    F.npy F.mask.npy F.phase.npy F.zarr   one scene in both formats
    P.npy P.zarr                          its phase images from F.npy
    C.npy C.zarr C.csv                    its phase curve
    holes.npy holes.zarr                  the scene with unusable pixels, written by Python
    H.npy H.zarr                          phase images of holes.npy and of holes.zarr
"""

import csv
import sys
from pathlib import Path

import numpy as np
import zarr

IMAGES, PIXELS, CURVE = ("time", "y", "x"), ("y", "x"), ("time",)


def expect(condition, what):
    """An assertion that `python -O` keeps and that says what it is about."""
    if not condition:
        sys.exit(f"check_files.py: not so: {what}")


def load(path, dtype, shape):
    """An .npy file, mapped, as users of large files do."""
    array = np.load(path, mmap_mode="r", allow_pickle=False)
    expect(array.dtype == np.dtype(dtype), f"{path} is {dtype}, not {array.dtype}")
    expect(array.shape == shape, f"{path} has shape {shape}, not {array.shape}")
    expect(array.flags.c_contiguous, f"{path} is in C order")
    return np.asarray(array)


def member(group, name, dtype, shape, dimensions):
    """An array of a Zarr group, whole."""
    where = f"{group.store_path}/{name}"
    expect(name in group, f"{where} is there")
    array = group[name]
    names = array.metadata.dimension_names
    expect(array.dtype == np.dtype(dtype), f"{where} is {dtype}, not {array.dtype}")
    expect(array.shape == shape, f"{where} has shape {shape}, not {array.shape}")
    expect(names == dimensions, f"{where} has dimensions {dimensions}, not {names}")
    return array[:]


def open_group(path):
    group = zarr.open_group(path, mode="r")
    expect(group.metadata.zarr_format == 3, f"{path} is Zarr version 3")
    expect("software" in group.attrs, f"{path} names the software that made it")
    return group


def same(a, b, what):
    expect(np.array_equal(a, b, equal_nan=a.dtype.kind in "fc"), f"{what} are equal")


def check_scene(folder):
    """The simulated field; returns its shape."""
    shape = np.load(folder / "F.npy", mmap_mode="r").shape
    frames, *pixels = shape
    field = load(folder / "F.npy", "<c8", shape)
    mask = load(folder / "F.mask.npy", bool, tuple(pixels))
    truth = load(folder / "F.phase.npy", "<f8", (frames,))
    expect(np.isfinite(field).all(), "the simulated field is finite")
    expect(mask.any() and not mask.all(), "the mask has an inside and an outside")
    group = open_group(folder / "F.zarr")
    same(member(group, "field", "<c8", shape, IMAGES), field, "fields in .npy and .zarr")
    same(member(group, "mask", bool, mask.shape, PIXELS), mask, "masks in .npy and .zarr")
    in_zarr = member(group, "truth_phase_rad", "<f8", truth.shape, CURVE)
    same(in_zarr, truth, "true phases in .npy and .zarr")
    amplitude = member(group, "amplitude", "<f4", shape, IMAGES)
    expect(np.allclose(amplitude, np.abs(field), rtol=1e-6), "amplitude is |field|")
    return shape


def check_images(folder, name, shape):
    """Phase images in both formats; returns them."""
    phases = load(folder / f"{name}.npy", "<f4", shape)
    group = open_group(folder / f"{name}.zarr")
    in_zarr = member(group, "phase_rad", "<f4", shape, IMAGES)
    same(in_zarr, phases, f"images {name} in .npy and .zarr")
    valid = member(group, "valid", bool, shape[1:], PIXELS)
    nan = np.isnan(phases)
    expect((nan == ~valid).all(), f"images {name} are NaN exactly where not valid")
    return phases


def check_curve(folder, frames):
    """One curve in three formats."""
    phase = load(folder / "C.npy", "<f8", (frames,))
    sigma = load(folder / "C.sigma.npy", "<f8", (frames,))
    group = open_group(folder / "C.zarr")
    same(member(group, "phase_rad", "<f8", (frames,), CURVE), phase, "curves in .npy and .zarr")
    same(member(group, "sigma_rad", "<f8", (frames,), CURVE), sigma, "sigmas in .npy and .zarr")
    with open(folder / "C.csv", newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    expect(header[:4] == ["frame", "time_s", "phase_rad", "sigma_rad"], f"header {header}")
    table = np.array(rows, dtype=np.float64)
    same(table[:, 0], np.arange(frames, dtype=np.float64), "frame numbers in .csv")
    same(table[:, 2], phase, "curves in .csv and .npy")
    same(table[:, 3], sigma, "sigmas in .csv and .npy")


def check_holes(folder, shape):
    """Unusable pixels become NaN, whoever wrote the series; the others keep their phase."""
    field = np.load(folder / "holes.npy")
    unusable = ~np.isfinite(field).all(axis=0) | (field == 0).all(axis=0)
    holes = check_images(folder, "H", shape)
    expect((np.isnan(holes).any(axis=0) == unusable).all(), "NaN exactly at unusable pixels")
    expect(np.isfinite(holes[:, ~unusable]).all(), "usable pixels have phases in every frame")


def main():
    folder = Path(sys.argv[1])
    shape = check_scene(folder)
    expect(np.isfinite(check_images(folder, "P", shape)).all(), "all pixels of P are finite")
    check_curve(folder, shape[0])
    check_holes(folder, shape)
    print(f"NumPy {np.__version__} and zarr-python {zarr.__version__} read what phasewalk writes")


if __name__ == "__main__":
    main()
