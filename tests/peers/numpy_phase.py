"""Phase images by the paper's method in plain NumPy and scipy.fft: the peer of `phasewalk phase`.

It is what one would write today from the Methods of Hillmann et al., Sci Rep 9:11748 (2019):
vectorised over pixels, single precision where the data are, all cores (the rows t are
independent), memory bounded by one weight per pair and pixel. It shares no code with Phasewalk.

    numpy_phase.py F.npy --out P.npy --time      compute and save
    numpy_phase.py F.npy --check P.npy           compute and compare with another's result
"""

import argparse
import os
import resource
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

# The solver works on many small matrices, one block per thread: threads inside BLAS only disturb.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import scipy.fft

from agreement import compare

NEIGHBOURS = 10  # D
GAUGE_STRENGTH, DIFFERENCE_STRENGTH = 0.02, 0.001  # mu_1, mu_2
GAUGE_FRAME, REFERENCE_FRAMES = 4, 5
RANDOM_PROBABILITY = 0.99999  # P_0
SOLVER_BLOCK = 512  # pixels
CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()


def gaussian_transfer(shape, sigma, dtype):
    """Fourier transform of the sampled, periodic Gaussian whose samples sum to 1."""

    def along(n):
        images = int(np.ceil(10 * sigma / n)) + 1
        distance = np.arange(n) + n * np.arange(-images, images + 1)[:, None]
        kernel = np.exp(-(distance**2) / (2 * sigma**2)).sum(axis=0)
        return scipy.fft.fft(kernel / kernel.sum()).real  # symmetric: real

    height, width = shape
    return np.outer(along(height), along(width)).astype(dtype)


def average(image, transfer):
    """Circular convolution of a complex image."""
    spectrum = scipy.fft.fft2(image, workers=1)  # the threads are busy with other rows
    spectrum *= transfer
    return scipy.fft.ifft2(spectrum, overwrite_x=True, workers=1)


def unwrap(row):
    """Unwrap phases (dt, pixel), dt = 0, 1, ..., in place, from small dt to large ones.

    The first D are left alone. Each later one moves by 2 pi as long as that lowers the sum of its
    absolute differences to the D before it.
    """
    for dt in range(NEIGHBOURS, len(row)):
        before, phase = row[dt - NEIGHBOURS : dt], row[dt]
        total = np.abs(before - phase).sum(axis=0)
        # One step makes the sum at least 2 pi D - total: no gain up to pi D.
        (moving,) = np.nonzero(total > np.pi * NEIGHBOURS)
        for turn in (2 * np.pi, -2 * np.pi):
            pixels = moving
            while pixels.size:
                moved = phase[pixels] + phase.dtype.type(turn)
                new = np.abs(before[:, pixels] - moved).sum(axis=0)
                lower = new < total[pixels]
                pixels = pixels[lower]
                phase[pixels], total[pixels] = moved[lower], new[lower]


def cross_spectrum_row(field, t, lags, transfer, threshold):
    """arg<C(t, dt)> for dt = 0, 1, ... unwrapped, and w^2 for dt = 1, 2, ...; flat pixels."""
    real, pixels = transfer.dtype, transfer.size
    phase = np.zeros((lags + 1, pixels), real)
    square = np.empty((lags, pixels), real)
    for dt in range(1, lags + 1):
        c = field[t] * field[t + dt].conj()
        mean = average(c, transfer)
        phase[dt] = np.arctan2(mean.imag, mean.real).ravel()
        modulus = np.abs(c)
        modulus[modulus == 0] = 1
        c /= modulus
        weight = np.abs(average(c, transfer)) - real.type(threshold)
        np.maximum(weight, 0, out=weight)
        square[dt - 1] = np.square(weight).ravel()
    unwrap(phase)
    return phase, square


def normal_equations(field, sigma, max_lag):
    """w^2 of every pair (pair, pixel) and S^T W^2 c (frame, pixel), over all rows t."""
    frames, *shape = field.shape
    real = field.real.dtype
    rayleigh = 1 / (np.sqrt(8 * np.pi) * sigma)
    threshold = rayleigh * np.sqrt(-2 * np.log(1 - RANDOM_PROBABILITY))
    transfer = gaussian_transfer(shape, sigma, real)
    lags = [min(max_lag, frames - 1 - t) for t in range(frames)]
    first = np.concatenate(([0], np.cumsum(lags)))
    squares = np.empty((first[-1], transfer.size), real)
    right = np.zeros((frames, transfer.size))
    lock = threading.Lock()

    def row(t):
        phase, square = cross_spectrum_row(field, t, lags[t], transfer, threshold)
        squares[first[t] : first[t + 1]] = square
        square *= phase[1:]  # w^2 (phi_t - phi_s)
        with lock:
            right[t] += square.sum(axis=0, dtype=np.float64)
            right[t + 1 : t + 1 + lags[t]] -= square

    with ThreadPoolExecutor(CORES) as pool:
        list(pool.map(row, range(frames - 1)))
    return squares, right


def solve(squares, right, max_lag):
    """(S^T W^2 S + mu_1^2 G_1^T G_1 + mu_2^2 G_2^T G_2)^-1 S^T W^2 c, less the reference mean."""
    frames, pixels = right.shape
    t, s = np.triu_indices(frames, 1)
    near = s - t <= max_lag
    t, s = t[near], s[near]
    diagonal = np.arange(frames)
    gamma_2 = np.eye(frames)[1:] - np.eye(frames)[:-1]
    tikhonov = DIFFERENCE_STRENGTH**2 * gamma_2.T @ gamma_2
    gauge = min(GAUGE_FRAME, frames - 1)
    tikhonov[gauge, gauge] += GAUGE_STRENGTH**2
    phases = np.empty((frames, pixels), np.float32)

    def block(start):
        part = slice(start, min(start + SOLVER_BLOCK, pixels))
        square = squares[:, part].T
        matrix = np.zeros((len(square), frames, frames))
        matrix[:, t, s] = -square
        matrix += matrix.transpose(0, 2, 1)
        total = -matrix.sum(axis=2)
        matrix[:, diagonal, diagonal] = total
        matrix += tikhonov
        solution = np.linalg.solve(matrix, right[:, part].T[..., None])[..., 0]
        measured = (total > 0)[:, :REFERENCE_FRAMES]  # frames that no pair reaches do not count
        reference = (solution[:, :REFERENCE_FRAMES] * measured).sum(axis=1)
        reference /= np.maximum(measured.sum(axis=1), 1)
        phases[:, part] = (solution - reference[:, None]).T

    with ThreadPoolExecutor(CORES) as pool:
        list(pool.map(block, range(0, pixels, SOLVER_BLOCK)))
    return phases


def phase_images(field, sigma, max_lag=None):
    """Phases (time, y, x) in radians, float32; NaN where a pixel is not finite or always zero."""
    frames = len(field)
    max_lag = max_lag or frames - 1
    usable = np.isfinite(field).all(axis=0) & (field != 0).any(axis=0)
    if not usable.all():
        field = np.where(usable, field, 0)
    squares, right = normal_equations(field, sigma, max_lag)
    phases = solve(squares, right, max_lag).reshape(field.shape)
    phases[:, ~usable] = np.nan
    return phases


def arguments():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("field", type=Path, help="complex series (time, y, x), .npy")
    parser.add_argument("--gaussian", type=float, default=3, help="sigma in pixels [3]")
    parser.add_argument("--max-lag", type=int, help="use pairs up to this far apart [all]")
    parser.add_argument("--double", action="store_true", help="compute in double precision")
    parser.add_argument("--out", type=Path, help="save the images here, .npy")
    parser.add_argument("--check", type=Path, help="compare with these images, .npy")
    parser.add_argument("--time", action="store_true", help="print time and memory taken")
    return parser.parse_args()


def main():
    options = arguments()
    start = time.perf_counter()
    field = np.load(options.field)
    field = field.astype(np.complex128 if options.double else np.complex64, copy=False)
    phases = phase_images(field, options.gaussian, options.max_lag)
    if options.out:
        np.save(options.out, phases)
    if options.time:
        wall = time.perf_counter() - start
        usage = resource.getrusage(resource.RUSAGE_SELF)
        cpu, peak = usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024
        per_pixel = wall / phases[0].size * 1e6
        print(f"{wall:.1f} s, CPU {cpu:.1f} s, peak {peak:.0f} MiB, {per_pixel:.0f} us per pixel")
    if options.check:
        agreement = compare(np.load(options.check), phases)
        print(agreement)
        if not agreement.good:
            sys.exit(f"{options.check} does not agree with NumPy")


if __name__ == "__main__":
    main()
