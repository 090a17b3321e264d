//! How large the computed piece of the retina is: laterally and in depth.

use super::kernel::TAPS;
use super::motion::Motion;
use super::pose::Pose;
use super::retina::Surface;
use super::scene::OctScene;
use crate::error::{Error, Result};

/// Pixels around the image that the field is computed for: tissue there reaches in through the
/// aperture.
const MARGIN: usize = 12;
/// Depth planes per depth pixel.
pub const PLANES_PER_PX: usize = 2;
/// Depth that stays free at both ends, depth pixels.
const FREE_DEPTH: f64 = 6.0;
/// Points along each side at which the surface is looked at.
const LOOKS: usize = 17;
/// Standard deviations of the random walk that are allowed for.
const WALK_DEVIATIONS: f64 = 7.0;

/// Sizes of everything that is computed.
#[derive(Debug, Clone)]
pub struct Geometry {
    /// Surface of the IS/OS.
    pub surface: Surface,
    /// Rows and columns of the computed field, the image in the middle.
    pub field: [usize; 2],
    /// First row and column of the image in the field.
    pub corner: [usize; 2],
    /// Number of depth planes.
    pub planes: usize,
    /// Depth of the first plane, depth pixels.
    pub first_plane_px: f64,
    /// First and last tissue coordinates that ever come into the field, (y, x).
    pub tissue: [[f64; 2]; 2],
    /// How far scatterers may walk, pixels.
    pub walk_px: f64,
}

impl Geometry {
    /// The geometry of `scene` under `motions`; the retina comes to lie in the middle of the depths.
    ///
    /// # Errors
    /// When the layers and their motion need more depth than the number of images gives.
    pub fn new(scene: &OctScene, motions: &[Motion]) -> Result<Self> {
        let size = [scene.height, scene.width];
        let field = size.map(|n| good_length(n + 2 * MARGIN));
        let corner = [0, 1].map(|axis| (field[axis] - size[axis]) / 2);
        let mut surface = Surface {
            centre_px: 0.0,
            tilt_px: scene.surface_tilt_px,
            curvature_px: scene.curvature_px,
            size,
        };
        let (tissue, isos) = survey(&surface, motions, field, corner);
        let walk = scene.micro_motion_wavelengths[0].max(scene.micro_motion_wavelengths[1])
            * WALK_DEVIATIONS
            * libm::sqrt(scene.sweeps as f64);
        let layers = layer_limits(scene, isos, walk);
        surface.centre_px = centre(scene, motions, layers)?;
        let reach = TAPS as f64 / 2.0 / PLANES_PER_PX as f64 + 0.5;
        let planes = (layers[1] - layers[0] + 2.0 * reach) * PLANES_PER_PX as f64;
        Ok(Self {
            first_plane_px: surface.centre_px + layers[0] - reach,
            surface,
            field,
            corner,
            planes: planes as usize + 1,
            tissue,
            walk_px: walk / scene.pitch_wavelengths,
        })
    }
}

/// The tissue that comes into the field at any time, and the least and greatest depth of the IS/OS
/// there.
fn survey(
    surface: &Surface,
    motions: &[Motion],
    field: [usize; 2],
    corner: [usize; 2],
) -> ([[f64; 2]; 2], [f64; 2]) {
    let mut tissue = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    let mut depth = [f64::INFINITY, f64::NEG_INFINITY];
    let at = |i: usize, axis: usize| {
        i as f64 / (LOOKS - 1) as f64 * field[axis] as f64 - corner[axis] as f64 - 0.5
    };
    for motion in motions {
        for piece in &motion.path {
            let pose = Pose::new(surface.size, piece.shift_px, motion.rotation_rad);
            for look in 0..LOOKS * LOOKS {
                let point = pose.origin([at(look / LOOKS, 0), at(look % LOOKS, 1)]);
                for axis in 0..2 {
                    tissue[0][axis] = tissue[0][axis].min(point[axis]);
                    tissue[1][axis] = tissue[1][axis].max(point[axis]);
                }
                let here = surface.depth_px(point);
                depth = [depth[0].min(here), depth[1].max(here)];
            }
        }
    }
    (tissue, depth)
}

/// Least and greatest depth of any scatterer, with room for its random walk, the tilt of the bulk
/// phase and the elongation.
fn layer_limits(scene: &OctScene, isos: [f64; 2], walk_wavelengths: f64) -> [f64; 2] {
    let turns = 2.0 * walk_wavelengths + scene.phase_tilt_rad / std::f64::consts::PI + 1.0;
    let room = turns * scene.depth_px_per_turn();
    let fold = |start: f64, pick: fn(f64, f64) -> f64, side: f64| {
        let ends = scene.layers.iter().map(|l| l.offset_px + side * l.thickness_px / 2.0);
        ends.fold(start, pick)
    };
    [isos[0] + fold(0.0, f64::min, -1.0) - room, isos[1] + fold(0.0, f64::max, 1.0) + room]
}

/// Depth of the IS/OS that puts the layers, with their axial motion, in the middle of the depths.
fn centre(scene: &OctScene, motions: &[Motion], layers: [f64; 2]) -> Result<f64> {
    let (mut low, mut high) = (0.0f64, 0.0f64);
    for motion in motions {
        let [z, doppler] = [motion.shift_px[0], motion.doppler_px];
        low = low.min(z + doppler.min(0.0));
        high = high.max(z + doppler.max(0.0));
    }
    let [first, last] = [layers[0] + low, layers[1] + high];
    let depth = scene.images as f64 / 2.0;
    let needed = last - first + 2.0 * FREE_DEPTH;
    if needed > depth {
        return Err(Error::usage(format!(
            "--images {}: the layers and their motion need {needed:.0} depth pixels, half as many as \
             images: take at least {:.0} images or less motion",
            scene.images,
            (2.0 * needed).ceil()
        )));
    }
    Ok((depth - first - last) / 2.0)
}

/// The least length ≥ `n` without prime factors above 5: its transform is quick.
pub fn good_length(n: usize) -> usize {
    let smooth = |mut n: usize| {
        for prime in [2, 3, 5] {
            while n.is_multiple_of(prime) {
                n /= prime;
            }
        }
        n == 1
    };
    (n.max(1)..).find(|&length| smooth(length)).unwrap_or(n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::oct::motion::motions;
    use crate::simulate::oct::presets::Preset;
    use crate::simulate::oct::schedule::events;

    fn of(scene: &OctScene) -> Result<Geometry> {
        Geometry::new(scene, &motions(scene, &events(scene)))
    }

    #[test]
    fn every_preset_and_seed_fits() {
        for preset in [Preset::Easy, Preset::Medium, Preset::Faulty, Preset::Human] {
            for seed in 0..50 {
                let scene = OctScene { seed, ..preset.scene() };
                let geometry = of(&scene).unwrap();
                let relative = geometry.surface.centre_px / (scene.images as f64 / 2.0);
                assert!((0.4..0.65).contains(&relative), "{preset:?} {seed}: {relative}");
                let last = geometry.first_plane_px + geometry.planes as f64 / 2.0;
                assert!(geometry.first_plane_px > 0.0 && last < scene.images as f64 / 2.0);
            }
        }
    }

    #[test]
    fn too_few_images_are_refused() {
        let scene = OctScene { images: 64, ..Preset::Medium.scene() };
        let error = of(&scene).unwrap_err().to_string();
        assert!(error.contains("--images 64") && error.contains("at least"), "{error}");
    }

    #[test]
    fn good_lengths() {
        assert_eq!([97, 121, 1, 664].map(good_length), [100, 125, 1, 675]);
    }
}
