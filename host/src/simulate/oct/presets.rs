//! Recordings from easy to human.

use super::scene::OctScene;

/// A set of parameters with a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Preset {
    /// Gentle motion, bright layers, no faults
    Easy,
    /// Motion of pixels, dispersion, a nonlinear sweep, faint layers
    Medium,
    /// Medium as a down-sweep, with bad sweeps and dead pixels
    Faulty,
    /// A living eye: drift, saccades, a blink, torsion, axial velocity, a free-running camera
    Human,
}

impl Preset {
    /// Its parameters.
    #[must_use]
    pub fn scene(self) -> OctScene {
        match self {
            Self::Easy => easy(),
            Self::Medium => medium(),
            Self::Faulty => faulty(),
            Self::Human => human(),
        }
    }
}

fn easy() -> OctScene {
    OctScene {
        surface_tilt_px: [1.0, 2.0],
        curvature_px: 1.5,
        micro_motion_wavelengths: [0.02, 0.03],
        lateral_px: 0.8,
        axial_px: 1.0,
        dispersion_rad: [8.0, 2.0],
        ..OctScene::default()
    }
}

fn medium() -> OctScene {
    OctScene {
        bits: 12,
        surface_tilt_px: [3.0, 5.0],
        curvature_px: 4.0,
        micro_motion_wavelengths: [0.031, 0.05],
        lateral_px: 3.0,
        axial_px: 4.0,
        doppler_px: 0.8,
        chirp_rad: 0.3,
        dispersion_rad: [-22.0, 9.0],
        nonlinearity: 0.01,
        isos_fringe_dn: 16.0,
        ..OctScene::default()
    }
}

fn faulty() -> OctScene {
    OctScene {
        down_sweep: true,
        dispersion_rad: [18.0, -6.0],
        saturated_sweeps: 1,
        missing_sweeps: 1,
        short_sweeps: 1,
        dead_pixel_fraction: 0.001,
        ..medium()
    }
}

fn human() -> OctScene {
    OctScene {
        sweeps: 40,
        lateral_px: 0.5,
        axial_px: 2.0,
        drift_px: [15.0, 30.0],
        saccades: 2,
        blink_sweeps: 2,
        torsion_deg: 0.3,
        doppler_peak_px: 20.0,
        phase_tilt_rad: 3.0,
        start_jitter_images: 1.0,
        ..medium()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::ValueEnum;

    #[test]
    fn all_are_valid() {
        for preset in Preset::value_variants() {
            preset.scene().validate().unwrap();
        }
    }
}
