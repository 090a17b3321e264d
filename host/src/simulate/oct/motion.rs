//! How the eye moves, sweep by sweep.

use super::random::{Purpose, Random};
use super::scene::OctScene;
use super::schedule::Event;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// Pieces of a sweep with a saccade, each with a position of its own.
const SACCADE_PIECES: usize = 16;
/// Largest angle between the x axis and the drift.
const DRIFT_ANGLE: f64 = 0.6;
/// Sideways wandering during the drift, as a fraction of it.
const WANDERING: f64 = 0.1;

/// Motion of the eye during one sweep, relative to the first sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// Displacement along z, depth pixels, and along y and x, pixels, in the middle of the sweep.
    pub shift_px: [f64; 3],
    /// Rotation about the middle of the image, from +x to +y.
    pub rotation_rad: f64,
    /// Depth shift by axial velocity, as the recording shows it.
    pub doppler_px: f64,
    /// c of the phase c·q² by axial acceleration.
    pub chirp_rad: f64,
    /// Tilt of the bulk phase over the height and over the width.
    pub tilt_rad: [f64; 2],
    /// How late the first image is.
    pub jitter_images: f64,
    /// Lateral positions during the sweep.
    pub path: Vec<Piece>,
}

/// Images of a sweep during which the eye stands still.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// The images.
    pub images: Range<usize>,
    /// Displacement along y and x, pixels.
    pub shift_px: [f64; 2],
}

/// The motion in every sweep. The first sweep defines zero; only the camera may be late there.
pub fn motions(scene: &OctScene, events: &[Event]) -> Vec<Motion> {
    let course = Course::new(scene);
    let mut jumped = [0.0; 2];
    let motion = |(t, &event): (usize, &Event)| {
        let before = course.position(t);
        let [from, to] = match event {
            Event::Saccade(number) => {
                let jump = course.jump(number);
                let start = jumped;
                jumped = [0, 1].map(|axis| jumped[axis] + jump[axis]);
                [start, jumped]
            }
            _ => [jumped; 2],
        };
        let at = |offset: [f64; 2]| [0, 1].map(|axis| before[axis] + offset[axis]);
        course.motion(t, path(scene.images, at(from), at(to)))
    };
    events.iter().enumerate().map(motion).collect()
}

/// Positions during a sweep that begins at one place and ends at another, with the smooth course of
/// a saccade.
fn path(images: usize, from: [f64; 2], to: [f64; 2]) -> Vec<Piece> {
    let pieces = if from == to { 1 } else { SACCADE_PIECES };
    let piece = |i: usize| {
        let done = (i as f64 + 0.5) / pieces as f64;
        let way = done * done * (3.0 - 2.0 * done);
        Piece {
            images: images * i / pieces..images * (i + 1) / pieces,
            shift_px: [0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * way),
        }
    };
    (0..pieces).map(piece).collect()
}

/// The slow course of the eye, and the random motion around it.
struct Course<'a> {
    scene: &'a OctScene,
    course: Random,
    motion: Random,
}

impl<'a> Course<'a> {
    fn new(scene: &'a OctScene) -> Self {
        let random = |purpose| Random::new(scene.seed, purpose);
        Self { scene, course: random(Purpose::Course), motion: random(Purpose::Motion) }
    }

    /// Share of the recording that is over, 0 … 1.
    fn time(&self, t: usize) -> f64 {
        t as f64 / (self.scene.sweeps - 1) as f64
    }

    /// Angle of the drift to the x axis, either way.
    fn drift_angle(&self) -> f64 {
        let way = if self.course.uniform(0, 1) < 0.5 { 0.0 } else { PI };
        way + DRIFT_ANGLE * self.course.symmetric(0, 2)
    }

    /// Where the eye is, saccades left out, (y, x): drift, wandering, and what differs from sweep to
    /// sweep.
    fn position(&self, t: usize) -> [f64; 2] {
        if t == 0 {
            return [0.0; 2];
        }
        let (time, angle) = (self.time(t), self.drift_angle());
        let length = self.course.between(self.scene.drift_px, 0, 3);
        let along = length * time;
        let across = WANDERING * length * libm::sin(TAU * 1.5 * time);
        let (sine, cosine) = libm::sincos(angle);
        let jitter = [1, 2].map(|axis| self.scene.lateral_px * self.motion.symmetric(t, axis));
        [along * sine + across * cosine + jitter[0], along * cosine - across * sine + jitter[1]]
    }

    /// A saccade, (y, x): the first against the drift, the next back, and so on.
    fn jump(&self, number: usize) -> [f64; 2] {
        let length = self.course.between(self.scene.saccade_px, number, 4);
        let back = if number.is_multiple_of(2) { PI } else { 0.0 };
        let angle = self.drift_angle() + back + 0.3 * self.course.symmetric(number, 5);
        let (sine, cosine) = libm::sincos(angle);
        [length * sine, length * cosine]
    }

    fn motion(&self, t: usize, path: Vec<Piece>) -> Motion {
        let scene = self.scene;
        let moving = if t == 0 { 0.0 } else { 1.0 };
        let symmetric = |axis| moving * self.motion.symmetric(t, axis);
        let normal = |axis| moving * self.motion.normal(t, axis);
        let middle = path.get(path.len() / 2).map_or([0.0; 2], |piece| piece.shift_px);
        let wild = symmetric(5);
        let torsion = scene.torsion_deg.to_radians();
        Motion {
            shift_px: [scene.axial_px * symmetric(0), middle[0], middle[1]],
            rotation_rad: torsion * libm::sin(TAU * (0.9 * self.time(t))),
            doppler_px: scene.doppler_px * normal(4).clamp(-2.5, 2.5)
                + scene.doppler_peak_px * wild * wild * wild,
            chirp_rad: scene.chirp_rad * normal(6),
            tilt_rad: [7, 8].map(|axis| scene.phase_tilt_rad * symmetric(axis)),
            jitter_images: scene.start_jitter_images * self.motion.uniform(t, 9),
            path,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::oct::presets::Preset;
    use crate::simulate::oct::schedule::events;

    fn of(scene: &OctScene) -> (Vec<Event>, Vec<Motion>) {
        let events = events(scene);
        let motions = motions(scene, &events);
        (events, motions)
    }

    #[test]
    fn the_first_sweep_defines_zero() {
        for preset in [Preset::Easy, Preset::Medium, Preset::Faulty, Preset::Human] {
            let (_, motions) = of(&preset.scene());
            let first = &motions[0];
            assert_eq!((first.shift_px, first.rotation_rad), ([0.0; 3], 0.0));
            assert_eq!((first.doppler_px, first.chirp_rad, first.tilt_rad), (0.0, 0.0, [0.0; 2]));
            assert!(motions[1].shift_px[1] != 0.0);
        }
    }

    #[test]
    fn medium_motion_stays_within_its_limits() {
        let (_, motions) = of(&Preset::Medium.scene());
        for motion in motions {
            let [z, y, x] = motion.shift_px.map(f64::abs);
            assert!(z <= 4.0 && y <= 3.0 && x <= 3.0 && motion.doppler_px.abs() <= 2.0);
            assert_eq!(motion.path.len(), 1);
            assert_eq!(motion.path[0].images, 0..256);
        }
    }

    #[test]
    fn a_human_eye_jumps_and_drifts() {
        for seed in 0..20 {
            let scene = OctScene { seed, ..Preset::Human.scene() };
            let (events, motions) = of(&scene);
            for (t, event) in events.iter().enumerate() {
                let Event::Saccade(_) = event else { continue };
                let [before, after] = [&motions[t - 1], &motions[t + 1]].map(|m| m.shift_px);
                let jump = (after[1] - before[1]).hypot(after[2] - before[2]);
                assert!((10.0..45.0).contains(&jump), "{jump}");
                let pieces = &motions[t].path;
                assert_eq!(pieces.len(), SACCADE_PIECES);
                assert_eq!((pieces[0].images.start, pieces[15].images.end), (0, scene.images));
            }
            let torsion = motions.iter().map(|m| m.rotation_rad.to_degrees().abs());
            assert!((0.25..0.301).contains(&torsion.fold(0.0, f64::max)));
            assert!(motions.iter().all(|m| (0.0..1.0).contains(&m.jitter_images)));
        }
    }
}
