//! The speckles that are streamed to the board's on-line solver: a few pixels of a complex series.

use crate::error::{Error, Result};
use crate::io::{Series, Shape, open_series, read_mask};
use crate::looks::{Looks, SpatialCoherence};
use crate::progress::Progress;
use crate::series::{Survey, survey};
use num_complex::Complex32;
use phasewalk_core::online;
use std::path::{Path, PathBuf};

/// Which pixels of a series.
#[derive(Debug, Clone, Copy)]
pub struct Choice<'a> {
    /// Those of this mask (y, x); none: all.
    pub mask: Option<&'a Path>,
    /// So many of them, evenly; none: all.
    pub pick: Option<usize>,
    /// Depth pixel of a series with a z axis.
    pub depth: Option<usize>,
    /// How the looks are found; none: each speckle is one.
    pub looks: Option<Looks>,
}

/// The speckles of all volumes.
#[derive(Debug, Clone)]
pub struct Speckles {
    /// The series.
    pub source: PathBuf,
    /// How many independent ones they count as.
    pub looks: f32,
    /// Pixels of the mask that cannot be used: not finite, or dark in all volumes.
    pub left_out: usize,
    count: usize,
    /// Volume by volume.
    samples: Vec<Complex32>,
}

impl Speckles {
    /// Read at most `volumes` volumes of a series for a board that solves at most `most` speckles.
    /// All are scaled by one power of two, as in every evaluation: phases do not see it.
    ///
    /// # Errors
    /// When series or mask cannot be read, there are too many pixels or too few, or the user
    /// interrupts.
    pub fn read(
        path: &Path,
        choice: &Choice<'_>,
        most: usize,
        volumes: Option<usize>,
    ) -> Result<Self> {
        let series = open_series(path)?;
        let series = series.as_ref();
        let shape = series.shape();
        let depth = depth(choice.depth, shape.depth)?;
        let survey = survey(series, &[depth]).map_err(|error| error.about(path))?;
        let inside = match choice.mask {
            Some(mask) => read_mask(mask, shape.height, shape.width)?,
            None => vec![true; shape.height * shape.width],
        };
        let usable = usable(&inside, &survey);
        let left_out = inside.iter().filter(|&&inside| inside).count() - usable.len();
        let pixels = picked(&usable, choice, most).map_err(|what| Error::file(path, what))?;
        let looks = looks(series, &survey, depth, &pixels, choice.looks)?;
        // Whether it can be solved at all.
        online::check(pixels.len(), looks.into())?;
        let count = pixels.len();
        let volumes = shape.frames.min(volumes.unwrap_or(usize::MAX));
        let samples = samples(series, &survey, depth, &pixels, volumes)?;
        Ok(Self { source: path.to_owned(), looks, left_out, count, samples })
    }

    /// Speckles of each volume.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Number of volumes.
    #[must_use]
    pub fn volumes(&self) -> usize {
        self.samples.len() / self.count.max(1)
    }

    /// The speckles of a volume; none: it is behind the last.
    #[must_use]
    pub fn volume(&self, volume: usize) -> Option<&[Complex32]> {
        self.samples.chunks_exact(self.count.max(1)).nth(volume)
    }
}

fn depth(given: Option<usize>, depths: usize) -> Result<usize> {
    match given {
        None if depths == 1 => Ok(0),
        None => Err(Error::usage(format!(
            "--depth: the series has {depths} depth pixels: say which of 0 to {}",
            depths - 1
        ))),
        Some(depth) if depth < depths => Ok(depth),
        Some(depth) => {
            let last = depths - 1;
            Err(Error::usage(format!("--depth {depth}: there are depth pixels 0 to {last}")))
        }
    }
}

fn usable(inside: &[bool], survey: &Survey) -> Vec<usize> {
    let both = inside.iter().zip(&survey.valid).enumerate();
    both.filter(|(_, (inside, valid))| **inside && **valid).map(|(pixel, _)| pixel).collect()
}

fn picked(
    usable: &[usize],
    choice: &Choice<'_>,
    most: usize,
) -> std::result::Result<Vec<usize>, String> {
    let all = usable.len();
    let whose = if choice.mask.is_some() { "the mask" } else { "a frame" };
    let count = choice.pick.unwrap_or(all);
    if count > all {
        return Err(format!("--pick {count}: {whose} has {all} usable pixels only"));
    }
    if count > most {
        let pick = choice.pick.map_or(String::new(), |pick| format!("--pick {pick}: "));
        return Err(format!(
            "{pick}{whose} gives {count} speckles, the board's solver takes at most {most}: give a \
             smaller --mask, or --pick {most} takes so many evenly"
        ));
    }
    Ok((0..count).filter_map(|n| usable.get(n * all / count).copied()).collect())
}

/// Each pixel is a look unless asked for otherwise.
fn looks(
    series: &dyn Series,
    survey: &Survey,
    depth: usize,
    pixels: &[usize],
    asked: Option<Looks>,
) -> Result<f32> {
    let nominal = pixels.len() as f64;
    let effective = match asked {
        Some(Looks::Effective) => {
            let Shape { height, width, .. } = series.shape();
            let mut mask = vec![false; height * width];
            for &pixel in pixels {
                if let Some(inside) = mask.get_mut(pixel) {
                    *inside = true;
                }
            }
            let within = survey.within(&mask);
            SpatialCoherence::estimate(series, &within, &[depth])?.looks_of_mask(&mask, width)
        }
        _ => nominal,
    };
    Ok(asked.unwrap_or(Looks::Nominal).choose(nominal, effective) as f32)
}

fn samples(
    series: &dyn Series,
    survey: &Survey,
    depth: usize,
    pixels: &[usize],
    volumes: usize,
) -> Result<Vec<Complex32>> {
    let Shape { height, width, .. } = series.shape();
    let progress = Progress::new("reading the speckles", volumes as u64);
    let mut image = vec![Complex32::default(); height * width];
    let mut samples = Vec::with_capacity(volumes * pixels.len());
    for volume in 0..volumes {
        series.read_rows(volume, depth, 0..height, &mut image)?;
        samples
            .extend(pixels.iter().filter_map(|&pixel| image.get(pixel)).map(|u| u * survey.scale));
        progress.advance(1)?;
    }
    Ok(samples)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_picked_evenly_and_not_too_many() {
        let usable: Vec<usize> = (100..200).collect();
        let choice = |pick| Choice { mask: None, pick, depth: None, looks: None };
        let picked = |pick| picked(&usable, &choice(pick), 64);
        assert_eq!(picked(Some(4)).unwrap(), [100, 125, 150, 175]);
        assert_eq!(picked(Some(64)).unwrap().len(), 64);
        assert!(picked(None).unwrap_err().contains("100 speckles"));
        assert!(picked(Some(65)).unwrap_err().contains("at most 64"));
        assert!(picked(Some(101)).unwrap_err().contains("100 usable"));
    }

    #[test]
    fn a_depth_is_asked_for_where_there_are_several() {
        assert_eq!(depth(None, 1).unwrap(), 0);
        assert_eq!(depth(Some(2), 3).unwrap(), 2);
        assert!(depth(None, 3).unwrap_err().to_string().contains("0 to 2"));
        assert!(depth(Some(3), 3).unwrap_err().to_string().contains("0 to 2"));
    }
}
