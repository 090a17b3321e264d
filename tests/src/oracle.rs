//! The paper's estimators, slow and plain: what the fast code is compared with.
//!
//! Written from `paper.tex` (line numbers below are of that file) and from the readings settled in
//! `design/estimators.md`, without a look at the fast code: dense matrices, direct sums, `f64`.
//!
//! Conventions throughout:
//! * Frames, rows, columns and lags count from 0; N is the number of frames.
//! * Phases are in radians. C(t,Δt) = U(t) U*(t+Δt), so arg C(t,Δt) = φ(t) − φ(t+Δt).
//! * A *pair* is (t, Δt) with Δt ≥ 1 and t+Δt ≤ N−1. Lists of pairs are in the order of the rows
//!   of S (lines 890-901): (0,1), (0,2), …, (1,1), (1,2), …; see [`pair_list`].
//! * Images are flat and in C order, (y, x); series are (time, y, x).
//! * A lag limit beyond N−1 means N−1.

use crate::wide::{self, Wide};
use num_complex::Complex;
use std::f64::consts::PI;

/// P₀, the probability that random phasors stay below the threshold b (line 806).
pub const THRESHOLD_PROBABILITY: f64 = 0.99999;
/// D, the number of preceding phases the unwrapping looks at, Δt = 0 included (lines 834–840).
pub const UNWRAP_DEPTH: usize = 10;
/// μ₁, the regularisation that fixes the gauge (line 936).
pub const MU_1: f64 = 0.02;
/// μ₂, the regularisation of first differences, which bridges gaps (line 936).
pub const MU_2: f64 = 0.001;
/// Index of the frame whose phase Γ₁ pulls to zero, where there are that many (line 923).
pub const GAUGE_FRAME: usize = 4;
/// N₀, the number of frames whose mean phase is taken as zero, where there are that many
/// (line 948).
pub const REFERENCE_FRAMES: usize = 5;

// ---------------------------------------------------------------------------------------------
// The data and the cross-spectrum
// ---------------------------------------------------------------------------------------------

/// A series of complex fields U(t, y, x) of one layer.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// N, the number of frames.
    pub frames: usize,
    /// Number of rows (y).
    pub height: usize,
    /// Number of columns (x).
    pub width: usize,
    /// U, of shape (time, y, x) in C order: `frames · height · width` values.
    pub field: Vec<Complex<f64>>,
}

impl Series {
    /// U(t), of shape (y, x).
    ///
    /// # Panics
    /// If there is no frame `t`.
    pub fn frame(&self, t: usize) -> &[Complex<f64>] {
        let pixels = self.height * self.width;
        &self.field[t * pixels..(t + 1) * pixels]
    }
}

/// C_U(y,x; t,Δt) = U(y,x; t) U*(y,x; t+Δt), of shape (y, x) (line 720).
///
/// Its phase is φ(t) − φ(t+Δt).
///
/// # Panics
/// If `t + lag` is beyond the last frame.
pub fn cross_spectrum(series: &Series, t: usize, lag: usize) -> Vec<Complex<f64>> {
    let (now, later) = (series.frame(t), series.frame(t + lag));
    now.iter().zip(later).map(|(u, v)| u * v.conj()).collect()
}

/// The phase difference cross-spectrum of two ranges of layers, of shape (y, x) (lines 727–735):
///
/// C^{Z₁−Z₂}(y,x; t,Δt) = (Σ_{z∈Z₁} C(y,x,z; t,Δt)) (Σ_{z∈Z₂} C(y,x,z; t,Δt))*.
///
/// `layers[z]` is the series of layer z, all of one shape; `z1` and `z2` list the layers of Z₁ and
/// Z₂. With Δφ = φ_{Z₁} − φ_{Z₂} its phase is Δφ(t) − Δφ(t+Δt).
///
/// # Panics
/// If a listed layer does not exist or `t + lag` is beyond the last frame.
pub fn layer_difference(
    layers: &[Series],
    z1: &[usize],
    z2: &[usize],
    t: usize,
    lag: usize,
) -> Vec<Complex<f64>> {
    let sum_over = |chosen: &[usize]| {
        let pixels = layers[0].height * layers[0].width;
        let mut sum = vec![Complex::new(0.0, 0.0); pixels];
        for &z in chosen {
            for (sum, c) in sum.iter_mut().zip(cross_spectrum(&layers[z], t, lag)) {
                *sum += c;
            }
        }
        sum
    };
    sum_over(z1).iter().zip(sum_over(z2)).map(|(first, second)| first * second.conj()).collect()
}

/// C/|C|, and 0 where C = 0.
fn phasor(c: Complex<f64>) -> Complex<f64> {
    let modulus = c.norm();
    if modulus > 0.0 { c / modulus } else { Complex::new(0.0, 0.0) }
}

/// arg z, and 0 where z = 0 (whatever the signs of its zeros).
fn arg(z: Complex<f64>) -> f64 {
    if z.norm() > 0.0 { z.arg() } else { 0.0 }
}

/// All pairs (t, Δt), 1 ≤ Δt ≤ `max_lag`, t+Δt < `frames`, in the order of the rows of S
/// (lines 890-901).
pub fn pair_list(frames: usize, max_lag: usize) -> Vec<(usize, usize)> {
    let mut list = Vec::new();
    for t in 0..frames {
        for lag in 1..frames - t {
            if lag <= max_lag {
                list.push((t, lag));
            }
        }
    }
    list
}

// ---------------------------------------------------------------------------------------------
// The ensemble average
// ---------------------------------------------------------------------------------------------

/// The averaged cross-spectrum of one curve or of one pixel, and what is derived from it.
///
/// The vectors over pairs are in the order of [`pair_list`]`(frames, max_lag)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Pairs {
    /// N, the number of frames.
    pub frames: usize,
    /// The largest Δt held.
    pub max_lag: usize,
    /// ⟨C(t,0)⟩ for each frame t: the mean of |U|², or for two layers of the product of powers.
    pub power: Vec<f64>,
    /// ⟨C(t,Δt)⟩ for each pair.
    pub mean: Vec<Complex<f64>>,
    /// arg⟨C(t,Δt)⟩ = φ(t) − φ(t+Δt), wrapped to −π … π, for each pair; 0 where ⟨C⟩ = 0.
    pub phase: Vec<f64>,
    /// |⟨C/|C|⟩|, 0 … 1, for each pair; C/|C| counts as 0 where C = 0 (lines 770, 776).
    pub phasor: Vec<f64>,
    /// |γ̂| = |⟨C(t,Δt)⟩| / √(⟨C(t,0)⟩⟨C(t+Δt,0)⟩), for each pair; 0 where a power is 0.
    pub coherence: Vec<f64>,
}

impl Pairs {
    /// Where the pair (t, Δt) stands in the vectors over pairs, or `None` if it is not held.
    pub fn index(&self, t: usize, lag: usize) -> Option<usize> {
        pair_list(self.frames, self.max_lag).iter().position(|&pair| pair == (t, lag))
    }

    /// The same with only the lags up to `max_lag`.
    pub fn up_to_lag(&self, max_lag: usize) -> Pairs {
        let kept: Vec<usize> = pair_list(self.frames, self.max_lag)
            .iter()
            .enumerate()
            .filter(|(_, (_, lag))| *lag <= max_lag)
            .map(|(index, _)| index)
            .collect();
        let choose = |values: &[f64]| kept.iter().map(|&index| values[index]).collect();
        Pairs {
            frames: self.frames,
            max_lag: self.max_lag.min(max_lag),
            power: self.power.clone(),
            mean: kept.iter().map(|&index| self.mean[index]).collect(),
            phase: choose(&self.phase),
            phasor: choose(&self.phasor),
            coherence: choose(&self.coherence),
        }
    }

    /// From ⟨C(t,0)⟩ (N values), ⟨C(t,Δt)⟩ and ⟨C/|C|⟩ (one value per pair, all lags).
    fn from_means(power: Vec<f64>, mean: Vec<Complex<f64>>, phasors: &[Complex<f64>]) -> Pairs {
        let frames = power.len();
        let max_lag = frames - 1;
        let coherence = pair_list(frames, max_lag)
            .iter()
            .zip(&mean)
            .map(|(&(t, lag), c)| {
                let scale = power[t].sqrt() * power[t + lag].sqrt();
                if scale > 0.0 { c.norm() / scale } else { 0.0 }
            })
            .collect();
        Pairs {
            frames,
            max_lag,
            phase: mean.iter().map(|&c| arg(c)).collect(),
            phasor: phasors.iter().map(|p| p.norm()).collect(),
            coherence,
            power,
            mean,
        }
    }
}

/// Averages over a mask, ⟨C(t,Δt)⟩_M = 1/|M| Σ_{(x,y)∈M} C(x,y; t,Δt) and likewise ⟨C/|C|⟩_M, for
/// all t and Δt (line 745).
///
/// `mask` is of shape (y, x), true inside M.
///
/// # Panics
/// If the mask has the wrong size or is empty.
pub fn mask_mean(series: &Series, mask: &[bool]) -> Pairs {
    mask_mean_of(series.frames, mask, |t, lag| cross_spectrum(series, t, lag))
}

/// [`mask_mean`] of any cross-spectrum, such as [`layer_difference`]: `spectrum(t, Δt)` gives C of
/// shape (y, x), and is called with Δt = 0 as well.
///
/// # Panics
/// If the mask has the wrong size or is empty, or if there is no frame.
pub fn mask_mean_of(
    frames: usize,
    mask: &[bool],
    spectrum: impl Fn(usize, usize) -> Vec<Complex<f64>>,
) -> Pairs {
    let power = (0..frames).map(|t| mean_over(mask, &spectrum(t, 0)).re).collect();
    let mut mean = Vec::new();
    let mut phasors = Vec::new();
    for (t, lag) in pair_list(frames, frames - 1) {
        let c = spectrum(t, lag);
        mean.push(mean_over(mask, &c));
        let unit: Vec<_> = c.into_iter().map(phasor).collect();
        phasors.push(mean_over(mask, &unit));
    }
    Pairs::from_means(power, mean, &phasors)
}

/// 1/|M| Σ_{M} value.
fn mean_over(mask: &[bool], values: &[Complex<f64>]) -> Complex<f64> {
    assert_eq!(mask.len(), values.len(), "the mask must have the size of the image");
    let mut sum = Complex::new(0.0, 0.0);
    let mut count = 0;
    for (&inside, value) in mask.iter().zip(values) {
        if inside {
            sum += value;
            count += 1;
        }
    }
    assert!(count > 0, "the mask is empty");
    sum / f64::from(count)
}

/// Averages over a Gaussian neighbourhood, ⟨C⟩ = G ∗ C and ⟨C/|C|⟩ = G ∗ (C/|C|), for all t and Δt
/// and for every pixel (lines 750–756, 776): one [`Pairs`] per pixel, in the order (y, x).
///
/// The convolution is circular; see [`gaussian_filter`]. `sigma_px` is σ_Gauss in pixels.
///
/// # Panics
/// If `sigma_px` is not positive or there is no frame.
pub fn gaussian_mean(series: &Series, sigma_px: f64) -> Vec<Pairs> {
    gaussian_mean_of(series.frames, series.height, series.width, sigma_px, |t, lag| {
        cross_spectrum(series, t, lag)
    })
}

/// [`gaussian_mean`] of any cross-spectrum, such as [`layer_difference`]: `spectrum(t, Δt)` gives
/// C of shape (y, x), and is called with Δt = 0 as well.
///
/// # Panics
/// If `sigma_px` is not positive, a spectrum has the wrong size, or there is no frame.
pub fn gaussian_mean_of(
    frames: usize,
    height: usize,
    width: usize,
    sigma_px: f64,
    spectrum: impl Fn(usize, usize) -> Vec<Complex<f64>>,
) -> Vec<Pairs> {
    let filter = |image: &[Complex<f64>]| gaussian_filter(image, height, width, sigma_px);
    let power: Vec<_> = (0..frames).map(|t| filter(&spectrum(t, 0))).collect();
    let mut mean = Vec::new();
    let mut phasors = Vec::new();
    for (t, lag) in pair_list(frames, frames - 1) {
        let c = spectrum(t, lag);
        mean.push(filter(&c));
        let unit: Vec<_> = c.into_iter().map(phasor).collect();
        phasors.push(filter(&unit));
    }
    let at = |images: &[Vec<Complex<f64>>], pixel: usize| -> Vec<Complex<f64>> {
        images.iter().map(|image| image[pixel]).collect()
    };
    (0..height * width)
        .map(|pixel| {
            let power = at(&power, pixel).iter().map(|c| c.re).collect();
            Pairs::from_means(power, at(&mean, pixel), &at(&phasors, pixel))
        })
        .collect()
}

/// The kernel exp(−d²/(2σ²)) along one axis of `length` pixels, at d = 0 … `length`−1, wrapped
/// around (the sum over d + every multiple of `length`) and normalised to sum 1 (line 753).
///
/// # Panics
/// If `sigma_px` is not positive or `length` is 0.
pub fn gaussian_kernel(length: usize, sigma_px: f64) -> Vec<f64> {
    assert!(sigma_px > 0.0 && sigma_px.is_finite(), "σ must be positive");
    assert!(length > 0, "an axis must have pixels");
    // exp(−d²/(2σ²)) < 1e−18 for d > 9.2 σ.
    let images = (9.2 * sigma_px / length as f64).ceil() as i64 + 1;
    let mut kernel = vec![0.0; length];
    for (d, value) in kernel.iter_mut().enumerate() {
        for image in -images..=images {
            let distance = d as f64 + (image * length as i64) as f64;
            *value += (-distance * distance / (2.0 * sigma_px * sigma_px)).exp();
        }
    }
    let sum: f64 = kernel.iter().sum();
    kernel.iter().map(|value| value / sum).collect()
}

/// G ∗ image, the circular convolution in x and y with a sampled Gaussian of variance σ² (line
/// 753): result(y,x) = Σ_{y′,x′} g_y(y−y′) g_x(x−x′) image(y′,x′), indices modulo the size, g from
/// [`gaussian_kernel`]. `image` is of shape (y, x), σ in pixels.
///
/// # Panics
/// If `sigma_px` is not positive or the image has the wrong size.
pub fn gaussian_filter(
    image: &[Complex<f64>],
    height: usize,
    width: usize,
    sigma_px: f64,
) -> Vec<Complex<f64>> {
    assert_eq!(image.len(), height * width, "the image must be height × width");
    let circulant = |length: usize| -> Vec<Vec<f64>> {
        let kernel = gaussian_kernel(length, sigma_px);
        let entry = |to: usize, from: usize| kernel[(length + to - from) % length];
        (0..length).map(|to| (0..length).map(|from| entry(to, from)).collect()).collect()
    };
    let (along_y, along_x) = (circulant(height), circulant(width));
    let nought = Complex::new(0.0, 0.0);
    let mut smooth_in_x = vec![nought; height * width];
    for y in 0..height {
        let line = &image[y * width..(y + 1) * width];
        for x in 0..width {
            let products = along_x[x].iter().zip(line).map(|(g, value)| value * g);
            smooth_in_x[y * width + x] = products.sum();
        }
    }
    let mut smooth = vec![nought; height * width];
    for y in 0..height {
        for (from, &g) in along_y[y].iter().enumerate() {
            for x in 0..width {
                smooth[y * width + x] += smooth_in_x[from * width + x] * g;
            }
        }
    }
    smooth
}

// ---------------------------------------------------------------------------------------------
// The weights
// ---------------------------------------------------------------------------------------------

/// Number of looks of a Gaussian average that has the paper's σ: 1/√(2L) = 1/(√(8π) σ_Gauss), so
/// L = 4π σ_Gauss² (lines 814, 818). Independent pixels assumed; σ_Gauss in pixels.
pub fn gaussian_looks(sigma_px: f64) -> f64 {
    4.0 * PI * sigma_px * sigma_px
}

/// b = A₀(P₀) = √(−2σ² ln(1 − P₀)), P₀ = 0.99999, σ = 1/√(2L) (lines 800–818).
///
/// L is |M| for a mask and [`gaussian_looks`] (that is, σ = 1/(√(8π) σ_Gauss)) for images.
pub fn rayleigh_threshold(looks: f64) -> f64 {
    let sigma = 1.0 / (2.0 * looks).sqrt();
    (-2.0 * sigma * sigma * (1.0 - THRESHOLD_PROBABILITY).ln()).sqrt()
}

/// w = T(|⟨C/|C|⟩| − b), T(x) = max(x, 0) (lines 770–786).
pub fn paper_weight(phasor_modulus: f64, looks: f64) -> f64 {
    (phasor_modulus - rayleigh_threshold(looks)).max(0.0)
}

/// γ² = max(0, (Lγ̂² − 1)/(L − 1)): the squared coherence without its bias (estimators.md). Zero
/// for L ≤ 1, where nothing is known.
pub fn debiased_squared_coherence(coherence: f64, looks: f64) -> f64 {
    if looks <= 1.0 {
        return 0.0;
    }
    ((looks * coherence * coherence - 1.0) / (looks - 1.0)).max(0.0)
}

/// √(−ln 1e−5 / L): below this coherence γ̂ the Fisher weight is zero (estimators.md).
pub fn fisher_threshold(looks: f64) -> f64 {
    (-(1e-5f64.ln()) / looks).sqrt()
}

/// w = γ²/(1 − γ²) with γ² from [`debiased_squared_coherence`] and 1 − γ² not below 1e−4, so w ≤
/// 1e4; zero where γ̂ < [`fisher_threshold`]. It takes the place of the paper's w, and so enters as
/// w² (estimators.md).
pub fn fisher_weight(coherence: f64, looks: f64) -> f64 {
    if coherence < fisher_threshold(looks) {
        return 0.0;
    }
    let squared = debiased_squared_coherence(coherence, looks).min(1.0);
    squared / (1.0 - squared).max(1e-4)
}

/// Which weights the least squares use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weighting {
    /// The paper's, [`paper_weight`] of [`Pairs::phasor`].
    Paper,
    /// [`fisher_weight`] of [`Pairs::coherence`].
    Fisher,
}

/// One weight per pair, in the order of [`pair_list`].
pub fn weights(pairs: &Pairs, weighting: Weighting, looks: f64) -> Vec<f64> {
    match weighting {
        Weighting::Paper => pairs.phasor.iter().map(|&p| paper_weight(p, looks)).collect(),
        Weighting::Fisher => pairs.coherence.iter().map(|&g| fisher_weight(g, looks)).collect(),
    }
}

/// Which frames are valid: those with at least one pair of weight > 0.
pub fn valid_frames(frames: usize, max_lag: usize, weights: &[f64]) -> Vec<bool> {
    let mut valid = vec![false; frames];
    for ((t, lag), &weight) in pair_list(frames, max_lag).into_iter().zip(weights) {
        if weight > 0.0 {
            valid[t] = true;
            valid[t + lag] = true;
        }
    }
    valid
}

// ---------------------------------------------------------------------------------------------
// Unwrapping in Δt
// ---------------------------------------------------------------------------------------------

/// Phases unwrapped along Δt, and how sure each choice of branch was.
#[derive(Clone, Debug, PartialEq)]
pub struct Unwrapped {
    /// The unwrapped phases, rad; as many and in the same order as the wrapped ones.
    pub phase: Vec<f64>,
    /// How far each choice was from falling out differently, rad. From Δt = D on: the sum of
    /// absolute differences at the next best branch less that at the chosen one. Before, where
    /// the phase is taken as it is: π − |phase|, the distance from the cut of arg.
    pub margin: Vec<f64>,
}

/// Unwraps arg⟨C(t,Δt)⟩ of one t along Δt (lines 834–840).
///
/// `phases[k]` belongs to Δt = k+1; Δt = 0, with phase 0, comes before them and counts as one of
/// the `depth` (D) phases assumed free of wrapping. So for Δt = D, D+1, …: the phase is increased
/// or decreased by 2π as long as Σ_{j=1…D} |phase(Δt) − unwrapped phase(Δt−j)| keeps decreasing.
///
/// # Panics
/// If `depth` is 0.
pub fn unwrap_row(phases: &[f64], depth: usize) -> Unwrapped {
    assert!(depth > 0, "unwrapping needs at least one preceding phase");
    let mut unwrapped = vec![0.0]; // index Δt
    let mut margin = Vec::new();
    for (k, &wrapped) in phases.iter().enumerate() {
        let lag = k + 1;
        if lag < depth {
            unwrapped.push(wrapped);
            margin.push(PI - wrapped.abs());
            continue;
        }
        let preceding = &unwrapped[lag - depth..lag];
        let sum = |phase: f64| preceding.iter().map(|before| (phase - before).abs()).sum::<f64>();
        let branch = |turns: i64| wrapped + 2.0 * PI * turns as f64;
        let mut turns = 0;
        while sum(branch(turns + 1)) < sum(branch(turns)) {
            turns += 1;
        }
        while sum(branch(turns - 1)) < sum(branch(turns)) {
            turns -= 1;
        }
        let next_best = sum(branch(turns + 1)).min(sum(branch(turns - 1)));
        margin.push(next_best - sum(branch(turns)));
        unwrapped.push(branch(turns));
    }
    Unwrapped { phase: unwrapped.split_off(1), margin }
}

/// [`unwrap_row`] for every t of `pairs`: c_φ of line 877 and the margins, in the order of
/// [`pair_list`].
///
/// # Panics
/// If `depth` is 0.
pub fn unwrap_pairs(pairs: &Pairs, depth: usize) -> Unwrapped {
    let list = pair_list(pairs.frames, pairs.max_lag);
    let mut all = Unwrapped { phase: Vec::new(), margin: Vec::new() };
    for t in 0..pairs.frames {
        let of_t = list.iter().zip(&pairs.phase).filter(|(pair, _)| pair.0 == t);
        let row: Vec<f64> = of_t.map(|(_, &phase)| phase).collect();
        let unwrapped = unwrap_row(&row, depth);
        all.phase.extend(unwrapped.phase);
        all.margin.extend(unwrapped.margin);
    }
    all
}

/// The usual unwrapping in t: multiples of 2π are added so that neighbours differ by at most π,
/// starting at frame 0, which stays (lines 987-988).
pub fn unwrap_in_time(phases: &[f64]) -> Vec<f64> {
    let mut unwrapped: Vec<f64> = Vec::new();
    for &wrapped in phases {
        let mut phase = wrapped;
        if let Some(&before) = unwrapped.last() {
            while phase - before > PI {
                phase -= 2.0 * PI;
            }
            while phase - before < -PI {
                phase += 2.0 * PI;
            }
        }
        unwrapped.push(phase);
    }
    unwrapped
}

// ---------------------------------------------------------------------------------------------
// Least squares
// ---------------------------------------------------------------------------------------------

/// S, one row per pair with 1 at t and −1 at t+Δt, so that c_φ = S φ (lines 884–906). P rows of N.
pub fn difference_matrix(frames: usize, max_lag: usize) -> Vec<Vec<f64>> {
    let mut matrix = Vec::new();
    for (t, lag) in pair_list(frames, max_lag) {
        let mut row = vec![0.0; frames];
        row[t] = 1.0;
        row[t + lag] = -1.0;
        matrix.push(row);
    }
    matrix
}

/// Γ₁, 1 at i = j = `gauge` and 0 otherwise (line 923). N rows of N.
pub fn gamma_1(frames: usize, gauge: usize) -> Vec<Vec<f64>> {
    let entry = |i, j| if i == j && i == gauge { 1.0 } else { 0.0 };
    (0..frames).map(|i| (0..frames).map(|j| entry(i, j)).collect()).collect()
}

/// Γ₂, 1 at i = j ≠ 0, −1 at i = j+1 and 0 otherwise: the first differences φ_i − φ_{i−1}
/// (line 930). N rows of N.
pub fn gamma_2(frames: usize) -> Vec<Vec<f64>> {
    let entry = |i: usize, j: usize| {
        if i == j && i != 0 {
            1.0
        } else if i == j + 1 {
            -1.0
        } else {
            0.0
        }
    };
    (0..frames).map(|i| (0..frames).map(|j| entry(i, j)).collect()).collect()
}

/// What the least squares need besides the data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regularisation {
    /// μ₁, the strength of Γ₁.
    pub mu_1: f64,
    /// μ₂, the strength of Γ₂.
    pub mu_2: f64,
    /// Index of the frame that Γ₁ pulls to zero.
    pub gauge: usize,
    /// N₀, the number of frames at the start whose mean is taken as zero phase.
    pub reference_frames: usize,
}

impl Regularisation {
    /// The paper's: μ₁ = 0.02, μ₂ = 0.001, frame 4, N₀ = 5 (lines 922-935, 936, 948); with fewer than
    /// five frames the gauge is min(4, N−1) and N₀ = min(5, N).
    ///
    /// # Panics
    /// If there is no frame.
    pub fn paper(frames: usize) -> Regularisation {
        Regularisation {
            mu_1: MU_1,
            mu_2: MU_2,
            gauge: GAUGE_FRAME.min(frames - 1),
            reference_frames: REFERENCE_FRAMES.min(frames),
        }
    }
}

/// Adds MᵀD²M to `normal`, D the diagonal matrix of `factors` (one per row of M).
fn add_normal(normal: &mut [Vec<Wide>], matrix: &[Vec<f64>], factors: &[f64]) {
    assert_eq!(matrix.len(), factors.len(), "one factor per row");
    for (row, &factor) in matrix.iter().zip(factors) {
        let squared = Wide::product(factor, factor);
        for (i, &left) in row.iter().enumerate().filter(|(_, entry)| **entry != 0.0) {
            for (j, &right) in row.iter().enumerate().filter(|(_, entry)| **entry != 0.0) {
                normal[i][j] = normal[i][j] + squared * Wide::from(left * right);
            }
        }
    }
}

/// The phase of every frame, by least squares (lines 854–918):
///
/// φ = (SᵀW²S + μ₁²Γ₁ᵀΓ₁ + μ₂²Γ₂ᵀΓ₂)⁻¹ SᵀW²c, then less its mean over the first N₀ frames, of which
/// only valid ones count (line 946; [`valid_frames`]). If none of them is valid nothing is
/// subtracted.
///
/// `unwrapped` is c (rad) and `weights` the diagonal of W, both in the order of [`pair_list`]. The
/// products are summed entry by entry, which is the same as multiplying the matrices, and solved
/// in double-double. Returns φ, rad, one per frame.
///
/// # Panics
/// If the lengths do not fit, or if the matrix is singular (only with μ₁ or μ₂ zero).
pub fn solve(
    frames: usize,
    max_lag: usize,
    unwrapped: &[f64],
    weights: &[f64],
    regularisation: &Regularisation,
) -> Vec<f64> {
    let s = difference_matrix(frames, max_lag);
    assert_eq!(unwrapped.len(), s.len(), "one phase per pair");
    let Regularisation { mu_1, mu_2, gauge, reference_frames } = *regularisation;

    let mut normal = vec![vec![Wide::ZERO; frames]; frames];
    add_normal(&mut normal, &s, weights);
    add_normal(&mut normal, &gamma_1(frames, gauge), &vec![mu_1; frames]);
    add_normal(&mut normal, &gamma_2(frames), &vec![mu_2; frames]);

    let mut right = vec![vec![Wide::ZERO]; frames];
    for ((row, &weight), &c) in s.iter().zip(weights).zip(unwrapped) {
        let weighted = Wide::product(weight, weight) * Wide::from(c);
        for (i, &entry) in row.iter().enumerate().filter(|(_, entry)| **entry != 0.0) {
            right[i][0] = right[i][0] + weighted * Wide::from(entry);
        }
    }

    let solution = wide::solve(normal, right).expect("the normal matrix is singular");
    let phase: Vec<Wide> = solution.iter().map(|row| row[0]).collect();

    let valid = valid_frames(frames, max_lag, weights);
    let reference: Vec<usize> = (0..reference_frames).filter(|&frame| valid[frame]).collect();
    let mut mean = Wide::ZERO;
    for &frame in &reference {
        mean = mean + phase[frame] / Wide::from(reference.len() as f64);
    }
    phase.iter().map(|&phase| (phase - mean).to_f64()).collect()
}

/// What the paper's estimator makes of one curve or one pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// φ, rad, one per frame, zero at the mean of the valid reference frames.
    pub phase: Vec<f64>,
    /// Which frames had at least one pair of weight > 0; the others are bridged.
    pub valid: Vec<bool>,
    /// The weights, in the order of [`pair_list`].
    pub weights: Vec<f64>,
    /// The smallest margin (rad; [`Unwrapped::margin`]) of any choice of branch the phase depends
    /// on: in the row of each t, up to the last Δt of weight > 0. Infinite if there is none.
    pub margin: f64,
    /// The smallest distance of any pair from having its weight switched on or off: of |⟨C/|C|⟩|
    /// from b, or of γ̂ from its threshold. Infinite without pairs.
    pub threshold_distance: f64,
}

/// The paper's estimator: weights, unwrapping with D = 10 and least squares with the paper's
/// regularisation, of lags up to `max_lag`. `looks` is L of the weights.
///
/// # Panics
/// If `pairs` are inconsistent.
pub fn phase_from_pairs(
    pairs: &Pairs,
    max_lag: usize,
    weighting: Weighting,
    looks: f64,
) -> Solution {
    let pairs = pairs.up_to_lag(max_lag);
    let list = pair_list(pairs.frames, pairs.max_lag);
    let weights = weights(&pairs, weighting, looks);
    let unwrapped = unwrap_pairs(&pairs, UNWRAP_DEPTH);
    let regularisation = Regularisation::paper(pairs.frames);
    let phase = solve(pairs.frames, pairs.max_lag, &unwrapped.phase, &weights, &regularisation);

    let mut last_used = vec![0; pairs.frames];
    for (&(t, lag), &weight) in list.iter().zip(&weights) {
        if weight > 0.0 {
            last_used[t] = lag;
        }
    }
    let matters = |&(&(t, lag), _): &(&(usize, usize), &f64)| lag <= last_used[t];
    let margins = list.iter().zip(&unwrapped.margin).filter(matters);
    let (levels, threshold) = match weighting {
        Weighting::Paper => (&pairs.phasor, rayleigh_threshold(looks)),
        Weighting::Fisher => (&pairs.coherence, fisher_threshold(looks)),
    };
    Solution {
        phase,
        valid: valid_frames(pairs.frames, pairs.max_lag, &weights),
        margin: margins.map(|(_, &margin)| margin).fold(f64::INFINITY, f64::min),
        threshold_distance: levels
            .iter()
            .map(|level| (level - threshold).abs())
            .fold(f64::INFINITY, f64::min),
        weights,
    }
}

/// The paper's phase curve of a mask: [`mask_mean`], then [`phase_from_pairs`]. L is |M| unless
/// `looks` is given. Returns φ, rad, one per frame.
///
/// # Panics
/// If the mask has the wrong size or is empty.
pub fn paper_phase_curve(
    series: &Series,
    mask: &[bool],
    max_lag: usize,
    weighting: Weighting,
    looks: Option<f64>,
) -> Vec<f64> {
    let size = mask.iter().filter(|inside| **inside).count() as f64;
    let pairs = mask_mean(series, mask);
    phase_from_pairs(&pairs, max_lag, weighting, looks.unwrap_or(size)).phase
}

/// What the paper's estimator makes of a series of images.
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseImages {
    /// φ, rad, of shape (time, y, x).
    pub phase: Vec<f64>,
    /// [`Solution::valid`], of shape (time, y, x).
    pub valid: Vec<bool>,
    /// [`Solution::margin`] of each pixel, rad, of shape (y, x). Comparisons leave out pixels
    /// below 1e−3.
    pub margin: Vec<f64>,
    /// [`Solution::threshold_distance`] of each pixel, of shape (y, x).
    pub threshold_distance: Vec<f64>,
}

/// The paper's phase images: [`gaussian_mean`], then [`phase_from_pairs`] in every pixel. L is
/// 4πσ_Gauss² ([`gaussian_looks`]) unless `looks` is given.
///
/// # Panics
/// If `sigma_px` is not positive.
pub fn paper_phase_images(
    series: &Series,
    sigma_px: f64,
    max_lag: usize,
    weighting: Weighting,
    looks: Option<f64>,
) -> PhaseImages {
    let looks = looks.unwrap_or(gaussian_looks(sigma_px));
    images_from_pairs(&gaussian_mean(series, sigma_px), max_lag, weighting, looks)
}

/// [`phase_from_pairs`] of every pixel, put together as images.
///
/// # Panics
/// If the pixels do not all have the same number of frames, or if there is no pixel.
pub fn images_from_pairs(
    pixels: &[Pairs],
    max_lag: usize,
    weighting: Weighting,
    looks: f64,
) -> PhaseImages {
    let solutions: Vec<Solution> =
        pixels.iter().map(|pairs| phase_from_pairs(pairs, max_lag, weighting, looks)).collect();
    let mut images = PhaseImages {
        phase: Vec::new(),
        valid: Vec::new(),
        margin: solutions.iter().map(|solution| solution.margin).collect(),
        threshold_distance: solutions.iter().map(|s| s.threshold_distance).collect(),
    };
    for t in 0..pixels[0].frames {
        images.phase.extend(solutions.iter().map(|solution| solution.phase[t]));
        images.valid.extend(solutions.iter().map(|solution| solution.valid[t]));
    }
    images
}

// ---------------------------------------------------------------------------------------------
// The two simple walks
// ---------------------------------------------------------------------------------------------

/// `phases` less the mean of the first min(5, N) (line 946); here every frame counts as valid.
fn less_reference_mean(phases: &[f64]) -> Vec<f64> {
    let reference = &phases[..REFERENCE_FRAMES.min(phases.len())];
    let mean = reference.iter().sum::<f64>() / reference.len() as f64;
    phases.iter().map(|phase| phase - mean).collect()
}

/// C(t₀, t − t₀) for t before t₀ too: C(t₀, −Δt) = U(t₀) U*(t₀−Δt) = C*(t₀−Δt, Δt).
fn spectrum_from(series: &Series, reference_frame: usize, t: usize) -> Vec<Complex<f64>> {
    if t >= reference_frame {
        cross_spectrum(series, reference_frame, t - reference_frame)
    } else {
        let forward = cross_spectrum(series, t, reference_frame - t);
        forward.iter().map(|c| c.conj()).collect()
    }
}

/// Phase differences to one frame, φ(t) = −arg Σ_M C(t₀, t−t₀) (lines 410, 984, with the sign of
/// line 720), for t before t₀ too; then unwrapped in t ([`unwrap_in_time`]), then less the mean of
/// the first min(5, N) frames. t₀ is `reference_frame`, or the last frame if that comes first.
/// Returns φ, rad, one per frame.
///
/// # Panics
/// If the mask has the wrong size or is empty, or if there is no frame.
pub fn direct_curve(series: &Series, mask: &[bool], reference_frame: usize) -> Vec<f64> {
    let start = reference_frame.min(series.frames - 1);
    let wrapped: Vec<f64> = (0..series.frames)
        .map(|t| -arg(mean_over(mask, &spectrum_from(series, start, t))))
        .collect();
    less_reference_mean(&unwrap_in_time(&wrapped))
}

/// Phase differences to one frame in every pixel, φ(t) = −arg(G ∗ C(t₀, t−t₀)) (lines 410, 980,
/// with the sign of line 720): wrapped, then less the mean of the first min(5, N) frames, and not
/// wrapped again. t₀ is `reference_frame`, or the last frame if that comes first. Returns φ, rad,
/// of shape (time, y, x).
///
/// # Panics
/// If `sigma_px` is not positive, or if there is no frame.
pub fn direct_images(series: &Series, sigma_px: f64, reference_frame: usize) -> Vec<f64> {
    let start = reference_frame.min(series.frames - 1);
    let smooth = |t: usize| {
        let c = spectrum_from(series, start, t);
        gaussian_filter(&c, series.height, series.width, sigma_px)
    };
    let images: Vec<Vec<f64>> =
        (0..series.frames).map(|t| smooth(t).into_iter().map(|c| -arg(c)).collect()).collect();
    images_less_reference_mean(&images)
}

/// [`less_reference_mean`] in every pixel of `images[t]`; returns shape (time, y, x).
fn images_less_reference_mean(images: &[Vec<f64>]) -> Vec<f64> {
    let pixels = images[0].len();
    let mut result = vec![0.0; images.len() * pixels];
    for pixel in 0..pixels {
        let curve: Vec<f64> = images.iter().map(|image| image[pixel]).collect();
        for (t, phase) in less_reference_mean(&curve).into_iter().enumerate() {
            result[t * pixels + pixel] = phase;
        }
    }
    result
}

/// Knox and Thompson's walk in single steps, φ_n = φ_{n−1} − arg⟨C(n−1, 1)⟩_M, φ₀ = 0 (line 421,
/// with the sign of line 720), less the mean of the first min(5, N) frames. Returns φ, rad, one
/// per frame.
///
/// # Panics
/// If the mask has the wrong size or is empty, or if there is no frame.
pub fn one_step_curve(series: &Series, mask: &[bool]) -> Vec<f64> {
    let mut phase = vec![0.0];
    for n in 1..series.frames {
        let c = mean_over(mask, &cross_spectrum(series, n - 1, 1));
        phase.push(phase[n - 1] - arg(c));
    }
    less_reference_mean(&phase)
}

/// [`one_step_curve`] in every pixel, with ⟨C⟩ = G ∗ C. Returns φ, rad, of shape (time, y, x).
///
/// # Panics
/// If `sigma_px` is not positive.
pub fn one_step_images(series: &Series, sigma_px: f64) -> Vec<f64> {
    let mut images = vec![vec![0.0; series.height * series.width]];
    for n in 1..series.frames {
        let c = cross_spectrum(series, n - 1, 1);
        let smooth = gaussian_filter(&c, series.height, series.width, sigma_px);
        let before = &images[n - 1];
        images.push(before.iter().zip(smooth).map(|(phase, c)| phase - arg(c)).collect());
    }
    images_less_reference_mean(&images)
}

// ---------------------------------------------------------------------------------------------
// Uncertainty
// ---------------------------------------------------------------------------------------------

/// Variance of arg⟨C⟩ of one pair, rad²: (1 − γ²)/(2Lγ²), γ² from [`debiased_squared_coherence`],
/// not above π²/3 (a phase that is anywhere in −π … π) (estimators.md).
pub fn pair_variance(coherence: f64, looks: f64) -> f64 {
    let squared = debiased_squared_coherence(coherence, looks).min(1.0);
    let variance = (1.0 - squared) / (2.0 * looks * squared);
    // With γ² = 0 the quotient is infinite, or not a number should L be 0 as well.
    if variance < PI * PI / 3.0 { variance } else { PI * PI / 3.0 }
}

/// Standard deviation of the phases that [`solve`] returns, that is of φ_n − the mean of the valid
/// reference frames; rad, one per frame (estimators.md; pairs taken as independent).
///
/// Cov φ = A⁻¹ (SᵀW²VW²S + μ₂²Γ₂ᵀΓ₂) A⁻¹ with A = SᵀW²S + μ₂²Γ₂ᵀΓ₂, V the diagonal of
/// [`pair_variance`]: Γ₂ counts as a measurement of variance 1/μ₂², and in place of Γ₁ the phase
/// of the gauge frame is fixed at 0. With e_n picking φ_n − the reference mean and ψ = A⁻¹e_n the
/// variance is e_nᵀ Cov e_n = Σ_pairs w⁴ v (ψ_t − ψ_{t+Δt})² + μ₂² Σ_i (ψ_i − ψ_{i−1})², and this is
/// summed. If no reference frame is valid it is the standard deviation of φ_n − φ_gauge. Infinite
/// for all frames if A is singular (only with μ₂ = 0).
///
/// `coherence` (γ̂) and `weights` are in the order of [`pair_list`]; `looks` is L.
///
/// # Panics
/// If the lengths do not fit.
pub fn phase_sigma(
    frames: usize,
    max_lag: usize,
    coherence: &[f64],
    weights: &[f64],
    looks: f64,
    regularisation: &Regularisation,
) -> Vec<f64> {
    let s = difference_matrix(frames, max_lag);
    assert_eq!(coherence.len(), s.len(), "one coherence per pair");
    let Regularisation { mu_2, gauge, reference_frames, .. } = *regularisation;
    let (zero, one) = (Wide::ZERO, Wide::from(1.0));

    let mut normal = vec![vec![zero; frames]; frames];
    add_normal(&mut normal, &s, weights);
    add_normal(&mut normal, &gamma_2(frames), &vec![mu_2; frames]);

    // Column n of `functionals` is e_n.
    let valid = valid_frames(frames, max_lag, weights);
    let reference: Vec<usize> = (0..reference_frames).filter(|&frame| valid[frame]).collect();
    let share = one / Wide::from(reference.len().max(1) as f64);
    let entry = |frame: usize, n: usize| {
        let own = if frame == n { one } else { zero };
        if reference.contains(&frame) { own - share } else { own }
    };
    let mut functionals: Vec<Vec<Wide>> =
        (0..frames).map(|frame| (0..frames).map(|n| entry(frame, n)).collect()).collect();

    // φ_gauge = 0: its row and column become those of the identity.
    for row in &mut normal {
        row[gauge] = zero;
    }
    normal[gauge] = vec![zero; frames];
    normal[gauge][gauge] = one;
    functionals[gauge] = vec![zero; frames];

    let Some(psi) = wide::solve(normal, functionals) else {
        return vec![f64::INFINITY; frames];
    };
    let mut variance = vec![0.0; frames];
    for (((t, lag), &weight), &coherence) in
        pair_list(frames, max_lag).into_iter().zip(weights).zip(coherence)
    {
        for (n, variance) in variance.iter_mut().enumerate() {
            let gain = weight * weight * (psi[t][n] - psi[t + lag][n]).to_f64();
            *variance += gain * gain * pair_variance(coherence, looks);
        }
    }
    for i in 1..frames {
        for (n, variance) in variance.iter_mut().enumerate() {
            let gain = mu_2 * (psi[i][n] - psi[i - 1][n]).to_f64();
            *variance += gain * gain;
        }
    }
    variance.iter().map(|variance| variance.sqrt()).collect()
}

/// The Cramér–Rao bound of a linear functional of the phases, rad² (estimators.md; Guarnieri and
/// Tebaldini 2007): X = 2L(Γ∘Γ⁻¹ − I), var(eᵀφ) ≥ eᵀX⁺e.
///
/// `gamma` is Γ, the N×N matrix of coherences, row after row, symmetric and positive definite with
/// a unit diagonal; `looks` is L; `functional` is e, N values whose sum is 0 (only phase
/// differences are observable; the pseudo-inverse ignores any mean of e). Infinite if no chain of
/// coherent pairs joins all frames.
///
/// # Panics
/// If the lengths do not fit or Γ is singular.
pub fn crlb(gamma: &[f64], looks: f64, functional: &[f64]) -> f64 {
    let n = functional.len();
    assert_eq!(gamma.len(), n * n, "Γ must be N × N");
    let widened = |i: usize, j: usize| Wide::from(gamma[i * n + j]);
    let matrix: Vec<Vec<Wide>> = (0..n).map(|i| (0..n).map(|j| widened(i, j)).collect()).collect();
    let unit = |i, j| Wide::from(if i == j { 1.0 } else { 0.0 });
    let identity = (0..n).map(|i| (0..n).map(|j| unit(i, j)).collect()).collect();
    let inverse = wide::solve(matrix, identity).expect("Γ is singular");

    // The rows of X sum to 0. Filled up along (1, …, 1) by the mean of its diagonal, X becomes
    // invertible, and for e orthogonal to (1, …, 1) the inverse is the pseudo-inverse.
    let x =
        |i: usize, j: usize| Wide::from(2.0 * looks) * (widened(i, j) * inverse[i][j] - unit(i, j));
    let trace = (0..n).fold(Wide::ZERO, |sum, i| sum + x(i, i));
    let fill = trace / Wide::from((n * n) as f64);
    let filled = (0..n).map(|i| (0..n).map(|j| x(i, j) + fill).collect()).collect();
    let mean = functional.iter().sum::<f64>() / n as f64;
    let e: Vec<f64> = functional.iter().map(|value| value - mean).collect();
    let right = e.iter().map(|&value| vec![Wide::from(value)]).collect();
    match wide::solve(filled, right) {
        Some(solution) => e.iter().zip(solution).map(|(e, row)| e * row[0].to_f64()).sum(),
        None => f64::INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plain generator of uniform numbers in 0 … 1 (the high bits of a 64-bit LCG).
    struct Random(u64);

    impl Random {
        fn uniform(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        }

        /// Circular complex Gaussian of unit variance.
        fn gaussian(&mut self) -> Complex<f64> {
            let radius = (-(1.0 - self.uniform()).ln()).sqrt();
            Complex::from_polar(radius, 2.0 * PI * self.uniform())
        }
    }

    /// U(t, pixel) = a(pixel) e^{iφ(t)}, a a fixed speckle field.
    fn rigid(height: usize, width: usize, phase: &[f64]) -> Series {
        let mut random = Random(7);
        let speckle: Vec<_> = (0..height * width).map(|_| random.gaussian()).collect();
        let mut field = Vec::new();
        for &phase in phase {
            field.extend(speckle.iter().map(|a| a * Complex::from_polar(1.0, phase)));
        }
        Series { frames: phase.len(), height, width, field }
    }

    /// A field that decorrelates: U(t) = e^{iφ(t)} a(t), a(t) = ρ a(t−1) + √(1−ρ²) noise.
    fn walking(height: usize, width: usize, phase: &[f64], rho: f64, seed: u64) -> Series {
        let mut random = Random(seed);
        let mut speckle: Vec<_> = (0..height * width).map(|_| random.gaussian()).collect();
        let mut field = Vec::new();
        for &phase in phase {
            field.extend(speckle.iter().map(|a| a * Complex::from_polar(1.0, phase)));
            for a in &mut speckle {
                *a = *a * rho + random.gaussian() * (1.0 - rho * rho).sqrt();
            }
        }
        Series { frames: phase.len(), height, width, field }
    }

    fn ramp(frames: usize, step: f64) -> Vec<f64> {
        (0..frames).map(|t| t as f64 * step).collect()
    }

    fn worst(a: &[f64], b: &[f64]) -> f64 {
        assert_eq!(a.len(), b.len());
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn sign_of_the_cross_spectrum() {
        let series = rigid(2, 2, &[0.0, 0.3, 0.5]);
        let pairs = mask_mean(&series, &[true; 4]);
        assert!(worst(&pairs.phase, &[-0.3, -0.5, -0.2]) < 1e-14);
        assert_eq!(pairs.index(1, 1), Some(2));
        assert!(worst(&pairs.phasor, &[1.0; 3]) < 1e-14);
        assert!(worst(&pairs.coherence, &[1.0; 3]) < 1e-14);
    }

    #[test]
    fn ramp_is_recovered() {
        // 9 lags of 0.2 rad stay below π, 39 lags go beyond 2π: the rows have to be unwrapped.
        let truth = ramp(40, 0.2);
        let expected = less_reference_mean(&truth);
        let series = rigid(8, 8, &truth);
        let mask = [true; 64];
        let fisher = paper_phase_curve(&series, &mask, 39, Weighting::Fisher, None);
        assert!(worst(&fisher, &expected) < 1e-9);
        let banded = paper_phase_curve(&series, &mask, 12, Weighting::Fisher, None);
        assert!(worst(&banded, &expected) < 1e-9);
        // Γ₂ pulls the ends of the ramp in by about μ₂² 0.2/(N w²): 1.5e−8 with the paper's w.
        let paper = paper_phase_curve(&series, &mask, 39, Weighting::Paper, None);
        assert!(worst(&paper, &expected) < 1e-7);
        let pairs = mask_mean(&series, &mask);
        let w = weights(&pairs, Weighting::Paper, 64.0);
        let c = unwrap_pairs(&pairs, UNWRAP_DEPTH);
        let without = Regularisation { mu_2: 0.0, ..Regularisation::paper(40) };
        assert!(worst(&solve(40, 39, &c.phase, &w, &without), &expected) < 1e-9);
        assert!(worst(&direct_curve(&series, &mask, 4), &expected) < 1e-9);
        assert!(worst(&one_step_curve(&series, &mask), &expected) < 1e-9);
    }

    #[test]
    fn solve_is_the_formula() {
        // Line 918 with every matrix written out, W as a P × P diagonal, in plain f64.
        type Matrix = Vec<Vec<f64>>;
        fn transpose(a: &Matrix) -> Matrix {
            (0..a[0].len()).map(|j| a.iter().map(|row| row[j]).collect()).collect()
        }
        fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
            let columns = transpose(b);
            let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum();
            a.iter().map(|row| columns.iter().map(|column| dot(row, column)).collect()).collect()
        }
        let mut random = Random(3);
        let (n, lags) = (7, 5);
        let s = difference_matrix(n, lags);
        let p = s.len();
        assert_eq!(p, 6 + 5 + 4 + 3 + 2);
        let w: Vec<f64> = (0..p).map(|_| random.uniform()).collect();
        let c: Vec<f64> = (0..p).map(|_| 6.0 * random.uniform() - 3.0).collect();
        let diagonal: Matrix =
            (0..p).map(|i| (0..p).map(|j| if i == j { w[i] } else { 0.0 }).collect()).collect();
        let stw2 = multiply(&transpose(&s), &multiply(&diagonal, &diagonal));
        let data = multiply(&stw2, &s);
        let (g1, g2) = (gamma_1(n, 4), gamma_2(n));
        let (g1, g2) = (multiply(&transpose(&g1), &g1), multiply(&transpose(&g2), &g2));
        let right = multiply(&stw2, &c.iter().map(|&c| vec![c]).collect());
        let phase = solve(n, lags, &c, &w, &Regularisation::paper(n));
        // Undo the reference: Γ₁ puts the gauge frame within rounding of 0, as SᵀW²c sums to 0.
        let phase: Matrix = phase.iter().map(|value| vec![value - phase[4]]).collect();
        for i in 0..n {
            let left: f64 = (0..n)
                .map(|j| (data[i][j] + 4e-4 * g1[i][j] + 1e-6 * g2[i][j]) * phase[j][0])
                .sum();
            assert!((left - right[i][0]).abs() < 1e-12, "{i}: {left} {}", right[i][0]);
        }
    }

    #[test]
    fn gauge_does_not_matter() {
        let series = walking(6, 6, &ramp(24, 0.15), 0.9, 11);
        let pairs = mask_mean(&series, &[true; 36]);
        let c = unwrap_pairs(&pairs, UNWRAP_DEPTH).phase;
        for weighting in [Weighting::Paper, Weighting::Fisher] {
            let w = weights(&pairs, weighting, 36.0);
            let usual = Regularisation::paper(24);
            let phase = solve(24, 23, &c, &w, &usual);
            for other in [
                Regularisation { mu_1: 20.0, ..usual },
                Regularisation { mu_1: 1e-6, ..usual },
                Regularisation { gauge: 17, ..usual },
            ] {
                assert!(worst(&solve(24, 23, &c, &w, &other), &phase) < 1e-9);
            }
        }
        // Weights of 1e4 on either side of a gap that only Γ₂ (μ₂² = 1e−6) bridges.
        let c: Vec<f64> = pair_list(8, 7).iter().map(|&(_, lag)| -0.1 * lag as f64).collect();
        let joined = |&(t, lag): &(usize, usize)| (t < 5) == (t + lag < 5);
        let strong = |pair: &(usize, usize)| if joined(pair) { 1e4 } else { 0.0 };
        let w: Vec<f64> = pair_list(8, 7).iter().map(strong).collect();
        let phase = solve(8, 7, &c, &w, &Regularisation::paper(8));
        // Γ₂ makes the step across the gap 0.
        let expected = [-0.2, -0.1, 0.0, 0.1, 0.2, 0.2, 0.3, 0.4];
        assert!(worst(&phase, &expected) < 1e-9);
    }

    #[test]
    fn dead_frame_is_bridged() {
        for dead in [2, 4, 9] {
            let truth = ramp(16, 0.1);
            let mut series = rigid(8, 8, &truth);
            series.field[dead * 64..(dead + 1) * 64].fill(Complex::new(0.0, 0.0));
            let pairs = mask_mean(&series, &[true; 64]);
            let solution = phase_from_pairs(&pairs, 15, Weighting::Fisher, 64.0);
            assert!((0..16).all(|t| solution.valid[t] == (t != dead)));
            let reference: Vec<f64> = (0..5).filter(|&t| t != dead).map(|t| truth[t]).collect();
            let mean = reference.iter().sum::<f64>() / reference.len() as f64;
            let expected: Vec<f64> = truth.iter().map(|phase| phase - mean).collect();
            assert!(worst(&solution.phase, &expected) < 1e-9, "{dead}: {solution:?}");
        }
    }

    #[test]
    fn few_frames() {
        for frames in [1, 2, 3, 4] {
            let truth = ramp(frames, 0.3);
            let expected = less_reference_mean(&truth);
            let series = rigid(8, 8, &truth);
            let mask = [true; 64];
            for weighting in [Weighting::Paper, Weighting::Fisher] {
                let phase = paper_phase_curve(&series, &mask, 100, weighting, None);
                assert!(worst(&phase, &expected) < 1e-5, "{phase:?}");
                let images = paper_phase_images(&series, 1.5, 100, weighting, None);
                let first: Vec<f64> = images.phase.iter().step_by(64).copied().collect();
                assert!(worst(&first, &expected) < 1e-5);
            }
            assert!(worst(&direct_curve(&series, &mask, 4), &expected) < 1e-12);
            assert!(worst(&one_step_curve(&series, &mask), &expected) < 1e-12);
            let expected: Vec<f64> = expected.iter().flat_map(|phase| [*phase; 64]).collect();
            assert!(worst(&direct_images(&series, 1.5, 4), &expected) < 1e-12);
            assert!(worst(&one_step_images(&series, 1.5), &expected) < 1e-12);
        }
    }

    #[test]
    fn no_weight_gives_no_phase() {
        // Two pixels: b > 1, all weights 0.
        let series = rigid(1, 2, &ramp(6, 0.3));
        let pairs = mask_mean(&series, &[true; 2]);
        let solution = phase_from_pairs(&pairs, 5, Weighting::Paper, 2.0);
        assert_eq!(solution.phase, vec![0.0; 6]);
        assert_eq!(solution.valid, vec![false; 6]);
        assert_eq!(solution.margin, f64::INFINITY);
    }

    #[test]
    fn thresholds_and_weights() {
        assert!((rayleigh_threshold(1000.0) - 0.107298).abs() < 1e-6);
        // σ = 1/√(2|M|) and 1/(√(8π) σ_Gauss) as the paper has them.
        let sigma = 1.0 / ((8.0 * PI).sqrt() * 3.0);
        let b = (-2.0 * sigma * sigma * 1e-5f64.ln()).sqrt();
        assert!((rayleigh_threshold(gaussian_looks(3.0)) - b).abs() < 1e-11);
        assert_eq!(paper_weight(0.05, 1000.0), 0.0);
        assert!((paper_weight(1.0, 1000.0) - (1.0 - 0.107298)).abs() < 1e-6);
        assert!((fisher_weight(1.0, 100.0) - 1e4).abs() < 1e-6);
        assert_eq!(fisher_weight(0.33, 100.0), 0.0);
        let squared = (100.0 * 0.25 - 1.0) / 99.0;
        assert!((fisher_weight(0.5, 100.0) - squared / (1.0 - squared)).abs() < 1e-14);
        assert!((pair_variance(0.0, 100.0) - PI * PI / 3.0).abs() < 1e-14);
        assert_eq!(pair_variance(1.0, 100.0), 0.0);
    }

    #[test]
    fn rayleigh_threshold_is_seldom_passed() {
        // Mean of L random phasors above A₀(P): with P = 0.99999 about 1 in 1e5.
        let mut random = Random(5);
        let over = (0..20_000)
            .filter(|_| {
                let sum: Complex<f64> =
                    (0..50).map(|_| Complex::from_polar(1.0, 2.0 * PI * random.uniform())).sum();
                (sum / 50.0).norm() > rayleigh_threshold(50.0) / 5.0f64.sqrt()
            })
            .count();
        // b/√5 is the threshold of probability 1e−5^(1/5) = 0.1.
        assert!((1850..2150).contains(&over), "{over}");
    }

    #[test]
    fn unwrapping() {
        let wrap = |phase: f64| Complex::from_polar(1.0, phase).arg();
        let truth: Vec<f64> = (1..60).map(|lag| -0.3 * lag as f64).collect();
        let wrapped: Vec<f64> = truth.iter().copied().map(wrap).collect();
        assert!(worst(&unwrap_row(&wrapped, 10).phase, &truth) < 1e-12);
        // One outlier does not carry over.
        let mut outlier = wrapped.clone();
        outlier[20] = wrap(truth[20] + 2.5);
        let result = unwrap_row(&outlier, 10).phase;
        for k in (0..59).filter(|&k| k != 20) {
            assert!((result[k] - truth[k]).abs() < 1e-12);
        }
        // Faster than π in the first D lags: "free of wrapping" is wrong, as known.
        let fast: Vec<f64> = (1..60).map(|lag| wrap(-0.43 * lag as f64)).collect();
        assert!((unwrap_row(&fast, 10).phase[58] + 0.43 * 59.0).abs() > 6.0);
        // Unwrapping starts at Δt = D: the phase of Δt = 9 is left alone.
        let mut late = vec![0.0; 10];
        late[8] = 3.1;
        late[9] = -3.1;
        let result = unwrap_row(&late, 10);
        assert_eq!(result.phase[8], 3.1);
        assert!((result.margin[8] - (PI - 3.1)).abs() < 1e-15);
    }

    #[test]
    fn unwrapping_margin() {
        // D = 1, the phase before is 0 (Δt = 0): −x stays for x < π by a margin of 2π − 2x.
        let result = unwrap_row(&[-3.0], 1);
        assert_eq!(result.phase, vec![-3.0]);
        assert!((result.margin[0] - (2.0 * PI - 6.0)).abs() < 1e-12);
        // D = 2: before are 0 and 3; of −3 and −3 + 2π the latter is nearer, by
        // (3 + 6) − (2π−3 + 2π−6) = 18 − 4π; and beyond it (−3 + 4π) costs 4π more.
        let result = unwrap_row(&[3.0, -3.0], 2);
        assert!((result.phase[1] - (2.0 * PI - 3.0)).abs() < 1e-12);
        let chosen = (2.0 * PI - 3.0) + (2.0 * PI - 6.0);
        assert!((result.margin[1] - (9.0 - chosen)).abs() < 1e-12);
        // Preceding phases more than 2π apart make exact ties of the sums: margin 0, and the
        // phase stays where it is.
        let result = unwrap_row(&[3.0, 2.0 * PI - 3.0, 1.0], 1);
        assert!(result.margin.iter().all(|&margin| margin >= 0.0));
        let tie = unwrap_row(&[-8.0, -1.0], 2);
        assert_eq!(tie.phase[1], -1.0);
        assert!(tie.margin[1] < 1e-12, "{tie:?}");
    }

    #[test]
    fn gaussian_of_a_constant() {
        let value = Complex::new(0.7, -1.3);
        for (height, width, sigma) in [(5, 8, 0.3), (12, 7, 2.0), (4, 3, 25.0), (1, 6, 1.0)] {
            let smooth = gaussian_filter(&vec![value; height * width], height, width, sigma);
            assert!(smooth.iter().all(|c| (c - value).norm() < 1e-14));
        }
    }

    #[test]
    fn gaussian_is_the_periodic_sum() {
        let (height, width, sigma) = (9, 12, 2.3);
        let mut random = Random(9);
        let image: Vec<_> = (0..height * width).map(|_| random.gaussian()).collect();
        let smooth = gaussian_filter(&image, height, width, sigma);
        // The image repeated endlessly (±4 times is enough), and the plain 2-D kernel.
        let reach = |length: usize| 4 * length as i64;
        for (y, x) in [(0, 0), (4, 11), (8, 6)] {
            let mut sum = Complex::new(0.0, 0.0);
            let mut norm = 0.0;
            for dy in -reach(height)..=reach(height) {
                for dx in -reach(width)..=reach(width) {
                    let g = (-((dy * dy + dx * dx) as f64) / (2.0 * sigma * sigma)).exp();
                    let from_y = (y as i64 - dy).rem_euclid(height as i64) as usize;
                    let from_x = (x as i64 - dx).rem_euclid(width as i64) as usize;
                    sum += image[from_y * width + from_x] * g;
                    norm += g;
                }
            }
            assert!((smooth[y * width + x] - sum / norm).norm() < 1e-13);
        }
        // Variance of the kernel, in a window wide enough: σ².
        let kernel = gaussian_kernel(64, sigma);
        let variance: f64 =
            (-32..32i64).map(|d| (d * d) as f64 * kernel[d.rem_euclid(64) as usize]).sum();
        assert!((variance - sigma * sigma).abs() < 1e-9);
    }

    #[test]
    fn images_of_a_wide_filter_are_the_curve() {
        // With σ far beyond the image the Gaussian is flat: every pixel is the mean over all.
        let series = walking(6, 5, &ramp(12, 0.1), 0.95, 21);
        let curve = phase_from_pairs(&mask_mean(&series, &[true; 30]), 11, Weighting::Fisher, 30.0);
        let images = paper_phase_images(&series, 60.0, 11, Weighting::Fisher, Some(30.0));
        for (t, &phase) in curve.phase.iter().enumerate() {
            let image = &images.phase[t * 30..(t + 1) * 30];
            assert!(image.iter().all(|pixel| (pixel - phase).abs() < 1e-9));
        }
        assert!(images.margin.iter().all(|margin| (margin - curve.margin).abs() < 1e-9));
    }

    #[test]
    fn direct_images_are_not_wrapped_again() {
        let series = rigid(4, 4, &ramp(12, 0.9));
        let images = direct_images(&series, 1.0, 4);
        // φ(t) − φ(4) wrapped is −2.683 at t = 0, then −2.7, −1.8, −0.9, 0.
        let first = 2.0 * PI - 3.6;
        let mean = (first - 2.7 - 1.8 - 0.9) / 5.0;
        assert!((images[0] - (first - mean)).abs() < 1e-12);
        assert!((images[16] - (-2.7 - mean)).abs() < 1e-12);
        assert!((images[8 * 16] - (3.6 - 2.0 * PI - mean)).abs() < 1e-12);
    }

    #[test]
    fn layers_are_compared() {
        // Two pairs of layers sharing a motion of 1 rad per frame; theirs differ by a ramp.
        let bulk = ramp(10, 1.0);
        let truth = ramp(10, 0.2);
        let moved: Vec<f64> = bulk.iter().zip(&truth).map(|(bulk, own)| bulk + own).collect();
        let layers = [
            rigid(8, 8, &moved),
            walking(8, 8, &bulk, 1.0, 2),
            rigid(8, 8, &moved),
            walking(8, 8, &bulk, 1.0, 3),
        ];
        let spectrum = |t, lag| layer_difference(&layers, &[0, 2], &[1, 3], t, lag);
        let pairs = mask_mean_of(10, &[true; 64], spectrum);
        let phase = phase_from_pairs(&pairs, 9, Weighting::Fisher, 64.0).phase;
        assert!(worst(&phase, &less_reference_mean(&truth)) < 1e-9);
        let pixels = gaussian_mean_of(10, 8, 8, 2.0, spectrum);
        let phase = phase_from_pairs(&pixels[9], 9, Weighting::Fisher, 64.0).phase;
        assert!(worst(&phase, &less_reference_mean(&truth)) < 1e-9);
    }

    #[test]
    fn sigma_is_that_of_the_linear_map() {
        // φ is linear in c: perturb each c in turn, and add up.
        let n = 9;
        let series = walking(10, 10, &ramp(n, 0.1), 0.8, 4);
        let pairs = mask_mean(&series, &[true; 100]).up_to_lag(6);
        let w = weights(&pairs, Weighting::Fisher, 100.0);
        let plain = Regularisation { mu_2: 1e-7, ..Regularisation::paper(n) };
        let sigma = phase_sigma(n, 6, &pairs.coherence, &w, 100.0, &plain);
        let mut variance = vec![0.0; n];
        for p in 0..w.len() {
            let mut c = vec![0.0; w.len()];
            c[p] = 1.0;
            for (sum, gain) in variance.iter_mut().zip(solve(n, 6, &c, &w, &plain)) {
                *sum += gain * gain * pair_variance(pairs.coherence[p], 100.0);
            }
        }
        for (sigma, variance) in sigma.iter().zip(variance) {
            assert!((sigma - variance.sqrt()).abs() < 1e-9);
        }
        // A frame without any pair: Γ₂ alone holds it between its neighbours, each by 1/μ₂.
        let list = pair_list(n, n - 1);
        let w: Vec<f64> =
            list.iter().map(|&(t, lag)| if t == 6 || t + lag == 6 { 0.0 } else { 1.0 }).collect();
        let sigma =
            phase_sigma(n, n - 1, &vec![0.9; w.len()], &w, 100.0, &Regularisation::paper(n));
        assert!((sigma[6] - 1000.0 / 2f64.sqrt()).abs() < 1.0, "{sigma:?}");
        assert!(sigma[5] < 0.1 && sigma[8] < 0.1);
    }

    #[test]
    fn sigma_of_two_frames() {
        // φ₁ − (φ₀ + φ₁)/2 is half the one difference, the mean of c (weight 1, variance v) and of
        // Γ₂'s 0 (weight μ₂², variance 1/μ₂²).
        let sigma = phase_sigma(2, 1, &[0.8], &[1.0], 50.0, &Regularisation::paper(2));
        let expected = 0.5 * (pair_variance(0.8, 50.0) + 1e-6).sqrt() / (1.0 + 1e-6);
        assert!(worst(&sigma, &[expected, expected]) < 1e-12);
    }

    #[test]
    fn bound_of_a_random_walk() {
        let bound = |n: usize, rho: f64, looks: f64| {
            let gamma: Vec<f64> =
                (0..n * n).map(|k| rho.powi((k / n).abs_diff(k % n) as i32)).collect();
            let mut functional = vec![0.0; n];
            functional[0] -= 1.0;
            functional[n - 1] += 1.0;
            crlb(&gamma, looks, &functional)
        };
        for (n, rho, looks) in [(2, 0.5, 10.0), (5, 0.3, 100.0), (20, 0.97, 7.0), (70, 0.9, 1e4)] {
            let exact = (n - 1) as f64 * (1.0 - rho * rho) / (2.0 * looks * rho * rho);
            assert!((bound(n, rho, looks) / exact - 1.0).abs() < 1e-9);
        }
        // The table: std at λ/32 and λ/16, N = 70.
        for (looks, slow, fast) in [(100.0, 0.2398, 0.5425), (1000.0, 0.0758, 0.1716)] {
            assert!((bound(70, 0.9258, looks).sqrt() - slow).abs() < 1e-4);
            assert!((bound(70, 0.7346, looks).sqrt() - fast).abs() < 1e-4);
        }
        // Frames that nothing joins.
        assert_eq!(crlb(&[1.0, 0.0, 0.0, 1.0], 10.0, &[-1.0, 1.0]), f64::INFINITY);
    }

    #[test]
    fn one_step_reaches_the_bound() {
        // For a random walk the one-step walk is at the bound, the paper's somewhat above it.
        let (n, rho, looks, runs) = (20, 0.9, 144, 150);
        let bound = ((n - 1) as f64 * (1.0 - rho * rho) / (2.0 * looks as f64 * rho * rho)).sqrt();
        let (mut step, mut paper) = (0.0, 0.0);
        for seed in 0..runs {
            let series = walking(12, 12, &ramp(n, 0.05), rho, 1000 + seed);
            let truth = 0.05 * (n - 1) as f64;
            let curve = one_step_curve(&series, &[true; 144]);
            step += (curve[n - 1] - curve[0] - truth).powi(2) / runs as f64;
            let curve = paper_phase_curve(&series, &[true; 144], n - 1, Weighting::Paper, None);
            paper += (curve[n - 1] - curve[0] - truth).powi(2) / runs as f64;
        }
        let (step, paper) = (step.sqrt() / bound, paper.sqrt() / bound);
        assert!((0.85..1.2).contains(&step), "{step}");
        assert!((0.9..1.5).contains(&paper), "{paper}");
    }
}
