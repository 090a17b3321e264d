#!/usr/bin/env python3
"""Cross-spectra of simulated series and the phases that an independent estimator in numpy finds in them.

    python3 make.py DIRECTORY_OF_LINK_PHASES      (the numpy estimator, link_phases.py)

Writes, for each scenario, NAME.f32: the lower triangle of C (row by row, i >= j; re, im), and NAME.f64: acquisition times, phase minus
that of the first valid frame, its standard deviation, frame quality; N numbers each; little-endian.
"""
import sys
import numpy as np

sys.path.insert(0, sys.argv[1])
from link_phases import link_phases

N = 70


def decay(t, sigma):
    """exp(-(2 k sigma)^2 |dt| / 2): random walk of the scatterers, sigma in wavelengths per frame"""
    return np.exp(-0.5 * (4 * np.pi * sigma) ** 2 * np.abs(np.subtract.outer(t, t)))


def noisy(gamma, share):
    """additive noise leaves `share` of the coherence"""
    return share * gamma + (1 - share) * np.eye(len(gamma))


def outliers(gamma, frames):
    s = np.ones(len(gamma))
    s[frames] = 0
    out = gamma * np.outer(s, s)
    np.fill_diagonal(out, 1)
    return out


def sample(gamma, phase, looks, rng):
    root = np.linalg.cholesky(gamma + 1e-12 * np.eye(len(gamma)))
    g = rng.standard_normal((len(gamma), looks, 2)) @ [1, 1j] / np.sqrt(2)
    u = np.exp(1j * phase)[:, None] * (root @ g)
    return (u @ u.conj().T / looks).astype(np.complex64)


t = np.arange(float(N))
pairs = np.arange(N) // 2 * 11.0 + np.arange(N) % 2
curve = np.where(t >= 5, np.cumsum(np.where(t >= 5, 0.0314 + 0.0157 * np.sin(0.1 * (t - 5)), 0)), 0)
period = 0.6 * np.exp(-0.0771 * np.abs(np.subtract.outer(t, t))) + 0.4 * np.cos(2 * np.pi * np.subtract.outer(t, t) / 20)
SCENARIOS = {
    "slow": (t, decay(t, 1 / 32), curve, 1000),
    "fast": (t, decay(t, 1 / 16), curve, 100),
    "noise_outliers": (t, outliers(noisy(decay(t, 1 / 32), 0.5), [11, 30, 52]), curve, 1000),
    "floor": (t, 0.2 + 0.8 * decay(t, 1 / 16), curve, 100),
    "periodic": (t, period + 1e-6 * np.eye(N), curve, 1000),
    "steep": (t, decay(t, 1 / 32), 2.0 * t, 1000),
    "pairs": (pairs, decay(pairs, 1 / 32), 0.01 * pairs, 1000),
    "dark": (t, np.eye(N), curve, 100),
}
for number, (name, (times, gamma, phase, looks)) in enumerate(SCENARIOS.items()):
    c = sample(gamma, phase, looks, np.random.default_rng(number))
    lower = np.tril_indices(N)
    c = np.triu(c.conj().T, 1) + np.tril(c)
    np.fill_diagonal(c, c.diagonal().real)
    found = link_phases(c.astype(complex), looks, times)
    c[lower].astype("<c8").tofile(f"{name}.f32")
    np.concatenate([times, found["phase"], found["sigma"], found["s"]]).astype("<f8").tofile(f"{name}.f64")
    print(name, looks, "periodic" if found["periodic"] else "", found["phase"][-1], found["sigma"][-1], found["valid"].sum(), "misfit", found["misfit"])
