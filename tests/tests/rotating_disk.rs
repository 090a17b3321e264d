//! Measured speckle with a known law: the crop of the rotating disk.

use phasewalk::demo::rotating_disk::{Geometry, RotatingDisk};
use phasewalk::io::open_series;
use phasewalk_tests::tolerance::{DISK_RANDOM_RAD, DISK_SLOPE_X, DISK_SLOPE_Z};
use std::path::Path;

/// Slope of the phase over 31 shots, rad/mm, measured on the whole image.
const LAW_RAD_PER_MM: f64 = -8.1;
/// Root mean square of a random phase, rad.
const RANDOM_RAD: f64 = 1.81;

#[test]
fn the_walk_keeps_the_law_where_the_direct_difference_is_noise() {
    let crop = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/rotating_disk/rotating_disk.npy");
    let series = open_series(&crop).unwrap();
    let geometry = Geometry::of(series.shape()).unwrap();
    let disk = RotatingDisk::evaluate(series.as_ref(), geometry, 2).unwrap();
    let last = disk.step(31).unwrap();
    assert!((last.slope_x_rad_per_mm - LAW_RAD_PER_MM).abs() < DISK_SLOPE_X, "{last:?}");
    assert!(last.slope_z_rad_per_mm.abs() < DISK_SLOPE_Z, "{last:?}");
    assert!(last.r_squared > 0.99, "{last:?}");
    assert!((last.direct_residual_rad - RANDOM_RAD).abs() < DISK_RANDOM_RAD, "{last:?}");
    assert!((last.linked_slope_x_rad_per_mm - LAW_RAD_PER_MM).abs() < DISK_SLOPE_X, "{last:?}");
    assert!(last.linked_slope_z_rad_per_mm.abs() < DISK_SLOPE_Z, "{last:?}");
    // While the speckle still holds, both measure the same.
    let first = disk.step(1).unwrap();
    assert!((first.slope_x_rad_per_mm - LAW_RAD_PER_MM / 31.0).abs() < DISK_SLOPE_X / 10.0);
    assert!(first.direct_residual_rad < 0.1, "{first:?}");
}
