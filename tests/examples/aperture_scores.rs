//! Is the error bar true where an aperture makes neighbouring pixels alike?
//! `cargo run --release -p phasewalk-tests --example aperture_scores -- [SEEDS]`: discs of speckle of the simulated
//! scene (lambda/32, aperture 0.06 cycles per wavelength) outside of the x, whose phase stays 0; standard deviation of phase /
//! sigma at the last frame +- its standard error, with the looks estimated from the frames and with one for every
//! pixel.

use phasewalk::curve::{Region, Selection, link_region};
use phasewalk::io::Shape;
use phasewalk::looks::{PointSpread, SpatialCoherence};
use phasewalk::method::{Depths, Method, Plan};
use phasewalk::progress::Progress;
use phasewalk::series::{HeldSeries, survey};
use phasewalk::simulate::SpeckleScene;

const SIDE: usize = 160;
const FRAMES: usize = 70;
/// Discs of 109 and of 385 pixels.
const RADII: [f64; 2] = [6.0, 11.14];
/// Middles (y, x) of the four gaps between the arms of the x.
const PLACES: [[f64; 2]; 4] = [[80.0, 26.0], [80.0, 134.0], [26.0, 80.0], [134.0, 80.0]];

/// Looks and the end phase over its standard deviation, of one disc.
#[derive(Clone, Copy)]
struct Disc {
    pixels: usize,
    effective_looks: f64,
    effective: f64,
    nominal: f64,
}

fn main() {
    let seeds = std::env::args().nth(1).map_or(25, |n| n.parse().expect("SEEDS is a number"));
    let scenes: Vec<HeldSeries> = (1..=seeds).map(scene).collect();
    println!("| pixels | effective looks | z, effective looks | z, one look a pixel |");
    println!("|---|---|---|---|");
    for radius in RADII {
        let discs: Vec<Disc> = scenes.iter().flat_map(|series| discs(series, radius)).collect();
        let mean = |value: &dyn Fn(&Disc) -> f64| {
            discs.iter().map(value).sum::<f64>() / discs.len() as f64
        };
        let spread = |value: &dyn Fn(&Disc) -> f64| mean(&|disc| value(disc).powi(2)).sqrt();
        let (z, nominal) = (spread(&|disc| disc.effective), spread(&|disc| disc.nominal));
        let error = z / (2.0 * discs.len() as f64).sqrt();
        let looks = mean(&|disc| disc.effective_looks);
        println!("| {} | {looks:.1} | {z:.2} ± {error:.2} | {nominal:.2} |", discs[0].pixels);
    }
}

fn scene(seed: u64) -> HeldSeries {
    let scene = SpeckleScene {
        width: SIDE,
        height: SIDE,
        frames: FRAMES,
        sigma_wavelengths: 1.0 / 32.0,
        seed,
        ..SpeckleScene::default()
    };
    let mut field = Vec::with_capacity(FRAMES * SIDE * SIDE);
    scene
        .for_each_frame(&Progress::hidden(), |_, frame| {
            field.extend_from_slice(frame);
            Ok(())
        })
        .expect("the scene is simulated");
    let shape = Shape { frames: FRAMES, depth: 1, height: SIDE, width: SIDE };
    HeldSeries::new(shape, field).expect("it has its shape")
}

fn discs(series: &HeldSeries, radius: f64) -> Vec<Disc> {
    let survey = survey(series, &[0]).expect("every pixel is bright");
    let coherence = SpatialCoherence::estimate(series, &survey, &[0]).expect("it is in memory");
    let mut plan = Plan::new(Method::Linked, FRAMES, None, None, Depths::single())
        .expect("there are enough frames");
    plan.params.reference_frames = 1;
    let disc = |[y, x]: [f64; 2]| {
        let inside = |i: usize| ((i / SIDE) as f64 - y).hypot((i % SIDE) as f64 - x) < radius;
        let mask: Vec<bool> = (0..SIDE * SIDE).map(inside).collect();
        let silent = Progress::hidden();
        let selection = Selection::new(&survey.valid, &mask, SIDE, None);
        let selection = selection.expect("the disc has pixels");
        let spread = PointSpread::of(&coherence);
        let selection = selection.without_leakage(&spread, &coherence, &mask, &survey.valid);
        let region = Region::read(series, survey.scale, selection, &plan, &silent);
        let region = region.expect("it is in memory");
        let effective_looks = region.looks(&coherence);
        let score = |looks: f64| {
            let linked = link_region(&region, &plan, looks, &silent).expect("there is memory");
            let end = linked.rows.last().expect("there are frames");
            end.phase_rad / end.sigma_rad
        };
        let pixels = region.pixels();
        let (effective, nominal) = (score(effective_looks), score(pixels as f64));
        Disc { pixels, effective_looks, effective, nominal }
    };
    PLACES.into_iter().map(disc).collect()
}
