//! The retina: thin layers of scatterers that follow one curved, tilted surface.

use serde::{Deserialize, Serialize};

/// One layer of scatterers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Layer {
    /// What an anatomist calls it.
    pub name: String,
    /// Depth behind the inner/outer segment line (IS/OS), depth pixels.
    pub offset_px: f64,
    /// Full thickness, depth pixels; the scatterers are spread over it evenly.
    pub thickness_px: f64,
    /// Amplitude of its fringes over those of the IS/OS.
    pub brightness: f64,
    /// Whether it lies behind the outer segments and moves when they grow.
    pub elongates: bool,
}

/// Name of the inner/outer segment line.
pub const ISOS: &str = "IS/OS";
/// Name of the tips of the outer segments.
pub const TIPS: &str = "outer-segment tips";

/// The layers of all presets: 28 µm of outer segment at 5.1 µm per pixel.
pub fn layers() -> Vec<Layer> {
    let layer = |name: &str, offset_px, thickness_px, brightness, elongates| Layer {
        name: name.to_owned(),
        offset_px,
        thickness_px,
        brightness,
        elongates,
    };
    vec![
        layer("nerve fibres", -22.0, 2.0, 0.6, false),
        layer("inner plexiform layer", -13.0, 5.0, 0.35, false),
        layer("external limiting membrane", -4.5, 0.6, 0.25, false),
        layer(ISOS, 0.0, 0.8, 1.0, false),
        layer(TIPS, 5.5, 0.8, 0.7, true),
        layer("pigment epithelium", 8.6, 1.5, 1.0, true),
        layer("choroid", 13.5, 4.0, 0.2, true),
    ]
}

/// Depth of the IS/OS in the first sweep.
#[derive(Debug, Clone, Copy)]
pub struct Surface {
    /// Depth in the middle of the image, depth pixels.
    pub centre_px: f64,
    /// Rise over the whole height and the whole width, depth pixels.
    pub tilt_px: [f64; 2],
    /// Depth of the middle below the corners, depth pixels.
    pub curvature_px: f64,
    /// Height and width of the image.
    pub size: [usize; 2],
}

impl Surface {
    /// Depth at (y, x), pixels of the first sweep: a plane plus 2c r²/(1 + r²), which is c in the
    /// corners (r = 1) and levels off outside the image.
    pub fn depth_px(&self, [y, x]: [f64; 2]) -> f64 {
        let over_half = |p: f64, n: usize| {
            let half = n as f64 / 2.0;
            (p - (n as f64 - 1.0) / 2.0) / half
        };
        let (v, u) = (over_half(y, self.size[0]), over_half(x, self.size[1]));
        let r2 = (u * u + v * v) / 2.0;
        self.centre_px
            + (self.tilt_px[0] * v + self.tilt_px[1] * u) / 2.0
            + 2.0 * self.curvature_px * r2 / (1.0 + r2)
    }

    /// Depths at all pixels, shape (y, x), with `offset_px` added.
    pub fn image(&self, offset_px: f64) -> Vec<f32> {
        let [height, width] = self.size;
        let row =
            |y| (0..width).map(move |x| (self.depth_px([y as f64, x as f64]) + offset_px) as f32);
        (0..height).flat_map(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tilt_and_curvature_are_what_they_say() {
        let surface =
            Surface { centre_px: 60.0, tilt_px: [3.0, 5.0], curvature_px: 4.0, size: [96, 144] };
        let at = |y: f64, x: f64| surface.depth_px([y, x]);
        assert!((at(47.5, 71.5) - 60.0).abs() < 1e-12);
        assert!((at(95.5, 143.5) - at(-0.5, -0.5) - 8.0).abs() < 1e-12);
        assert!((at(95.5, 143.5) - 60.0 - 4.0 - 4.0).abs() < 1e-12);
        assert_eq!(surface.image(0.0).len(), 96 * 144);
    }

    #[test]
    fn the_evaluated_layers_exist() {
        let layers = layers();
        let offset = |name| layers.iter().find(|l| l.name == name).map(|l| l.offset_px);
        assert_eq!(offset(ISOS), Some(0.0));
        assert_eq!(offset(TIPS), Some(5.5));
    }
}
