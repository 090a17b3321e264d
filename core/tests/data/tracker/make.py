#!/usr/bin/env python3
"""Input and expected output of tracker_reference.rs: make.py <reference.py>

The argument is the numpy reference of the estimator, whose function `track` runs its class `Tracker` on a matrix of averaged
cross-spectra. Everything is simulated here, with fixed seeds. Per scenario:

  <name>.cross.f32    C_ij = <U_i conj U_j>, i < j, row after row, (re, im); powers 1
  <name>.curves.f64   times, filtered phases, smoothed phases, filtered sigmas, smoothed sigmas: N numbers each

all little-endian. The reference gets the cross-spectra as they are stored.
"""
import importlib.util
import pathlib
import sys

import numpy as np

N = 70
WALK = np.exp(-((2 * 2 * np.pi / 32) ** 2) / 2)  # coherence of neighbours, scatterers moving by lambda/32: 0.9258
HERE = pathlib.Path(__file__).parent


def looks_of(gamma, looks, rng):
    """`looks` circular Gaussian series with the coherence matrix gamma: (N, looks)."""
    white = rng.standard_normal((len(gamma), looks)) + 1j * rng.standard_normal((len(gamma), looks))
    return np.linalg.cholesky(gamma) @ white / np.sqrt(2)


def gamma_of(times, noise=0.0, floor=0.0, outliers=(), breaks=()):
    """Coherence of the frames: random walk over a static floor, additive noise (power over that of the signal), frames and
    moments without any coherence with the others."""
    lag = np.abs(np.subtract.outer(times, times))
    gamma = (floor + (1 - floor) * WALK**lag) / (1 + noise)
    for k in outliers:
        gamma[k, :] = gamma[:, k] = 0
    for k in breaks:
        gamma[:k, k:] = gamma[k:, :k] = 0
    np.fill_diagonal(gamma, 1)
    return gamma


def scenarios():
    """name, looks, times, coherence, settings of the tracker"""
    even = np.arange(N, dtype=float)
    gap = even + 9 * (even >= 25) + 4 * (even >= 48)
    for looks in (1000, 100):
        yield f"walk-{looks}", looks, even, gamma_of(even), {}
        yield f"noise-{looks}", looks, even, gamma_of(even, noise=1.0), {}
        yield f"outliers-{looks}", looks, even, gamma_of(even, outliers=(11, 30, 31)), {}
        yield f"floor-{looks}", looks, even, gamma_of(even, floor=0.2), {}
        yield f"gap-{looks}", looks, gap, gamma_of(gap), {}
    yield "break-1000", 1000, even, gamma_of(even, breaks=(40,)), {}
    yield "no-anchor-100", 100, even, gamma_of(even, noise=0.5), {"anchor": False}


def main():
    spec = importlib.util.spec_from_file_location("reference", sys.argv[1])
    reference = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(reference)
    for seed, (name, looks, times, gamma, settings) in enumerate(scenarios()):
        rng = np.random.default_rng(seed)
        phase = 0.25 * times + 0.6 * np.sin(0.15 * times)
        fields = looks_of(gamma, looks, rng) * np.exp(1j * phase)[:, None]
        fields /= np.sqrt((np.abs(fields) ** 2).mean(1))[:, None]
        cross = fields @ fields.conj().T / looks
        upper = cross[np.triu_indices(N, 1)].astype("<c8")
        stored = np.eye(N, dtype=complex)
        stored[np.triu_indices(N, 1)] = upper
        stored[np.tril_indices(N, -1)] = stored.T.conj()[np.tril_indices(N, -1)]
        filtered, smoothed, sigma, smoothed_sigma, _ = reference.track(stored, looks, times, **settings)
        upper.tofile(HERE / f"{name}.cross.f32")
        curves = np.array([times, filtered, smoothed, sigma, smoothed_sigma])
        curves.astype("<f8").tofile(HERE / f"{name}.curves.f64")
        error = smoothed - phase - (smoothed - phase)[0]
        print(f"{name:14} error at the end {error[-1]:8.4f} rad, sigma {smoothed_sigma[-1]:7.4f} rad")


if __name__ == "__main__":
    main()
