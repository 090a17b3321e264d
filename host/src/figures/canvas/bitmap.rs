//! A drawing as pixels: drawn finer than asked for, then averaged, so that edges are smooth.

use plotters::prelude::{BitMapBackend, DrawingBackend, RGBColor};

use super::super::colormap::Rgb;
use super::super::geometry::{Point, Rect, dashes};
use super::super::raster::Rgb8;
use super::{Anchor, Canvas, Mark, PNG_SCALE, Stroke, TextStyle, font};
use crate::error::{Error, Result};

/// Pixels drawn per pixel kept, along each axis.
const FINE: usize = 2;
/// Most pixels drawn along one axis.
const LARGEST: f64 = 16_384.0;

/// Plays the drawing back into pixels.
pub(super) fn render(canvas: &Canvas) -> Result<Rgb8> {
    let mut surface = Surface::new(canvas)?;
    for mark in &canvas.marks {
        match mark {
            Mark::Image(at, image) => surface.image(at, image),
            Mark::Line(points, stroke) => surface.line(points, stroke)?,
            Mark::Fill(points, color) => surface.fill(points, *color)?,
            Mark::Disc(center, radius, color) => surface.disc(*center, *radius, *color)?,
            Mark::Text(at, text, style) => surface.text(*at, text, style)?,
        }
    }
    Ok(surface.averaged())
}

/// The fine pixels while they are drawn.
struct Surface {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
    /// Fine pixels per point.
    scale: f64,
}

impl Surface {
    fn new(canvas: &Canvas) -> Result<Self> {
        let fine = FINE as f64;
        let side = |points: f64| (points * f64::from(PNG_SCALE)).ceil() * fine;
        let (width, height) = (side(canvas.width), side(canvas.height));
        let fits = |side: f64| (1.0..=LARGEST).contains(&side);
        if !(fits(width) && fits(height)) {
            let (w, h) = canvas.size();
            return Err(Error::failed(format!(
                "a figure of {w} x {h} points cannot be drawn: draw fewer panels"
            )));
        }
        let (width, height) = (width as usize, height as usize);
        Ok(Self {
            width,
            height,
            pixels: vec![255; 3 * width * height],
            scale: f64::from(PNG_SCALE) * fine,
        })
    }

    /// Whole kept pixels show one pixel of the image each: nothing is blurred.
    fn image(&mut self, at: &Rect, image: &Rgb8) {
        if image.width == 0 || image.pixels.len() != 3 * image.width * image.height {
            return;
        }
        let source = |fine: usize, start: f64, length: f64, count: usize| {
            let kept = (fine / FINE) as f64 + 0.5;
            let part = (kept / f64::from(PNG_SCALE) - start) / length;
            (0.0..1.0).contains(&part).then_some((part * count as f64) as usize)
        };
        let columns: Vec<_> = (0..self.width)
            .filter_map(|x| source(x, at.x, at.w, image.width).map(|column| (x, column)))
            .collect();
        for y in 0..self.height {
            let Some(row) = source(y, at.y, at.h, image.height) else {
                continue;
            };
            for &(x, column) in &columns {
                let from = 3 * (row.min(image.height - 1) * image.width + column);
                let to = 3 * (y * self.width + x);
                self.pixels[to..to + 3].copy_from_slice(&image.pixels[from..from + 3]);
            }
        }
    }

    /// Every straight piece a rectangle, every corner a disc: round joins.
    fn line(&mut self, points: &[Point], stroke: &Stroke) -> Result<()> {
        let room = Rect::new(
            -stroke.width,
            -stroke.width,
            self.width as f64 / self.scale + 2.0 * stroke.width,
            self.height as f64 / self.scale + 2.0 * stroke.width,
        );
        let half = stroke.width / 2.0;
        for curve in room.clip_curve(points) {
            let pieces = match stroke.dash {
                Some(dash) => dashes(&curve, dash),
                None => vec![curve],
            };
            for piece in pieces {
                for pair in piece.windows(2) {
                    self.fill(&bar(pair[0], pair[1], half), stroke.color)?;
                }
                for &joint in piece.iter().skip(1).take(piece.len().saturating_sub(2)) {
                    self.disc(joint, half, stroke.color)?;
                }
            }
        }
        Ok(())
    }

    fn disc(&mut self, (x, y): Point, radius: f64, color: Rgb) -> Result<()> {
        const CORNERS: usize = 24;
        let circle = (0..CORNERS).map(|n| {
            let (sin, cos) = (std::f64::consts::TAU * n as f64 / CORNERS as f64).sin_cos();
            (x + radius * cos, y + radius * sin)
        });
        self.fill(&circle.collect::<Vec<_>>(), color)
    }

    fn fill(&mut self, points: &[Point], [r, g, b]: Rgb) -> Result<()> {
        if points.len() < 3 || points.iter().any(|p| !(p.0.is_finite() && p.1.is_finite())) {
            return Ok(());
        }
        let fine =
            |length: f64| (length * self.scale).clamp(-LARGEST, 2.0 * LARGEST).round() as i32;
        let corners: Vec<_> = points.iter().map(|&(x, y)| (fine(x), fine(y))).collect();
        let size = (self.width as u32, self.height as u32);
        BitMapBackend::with_buffer(&mut self.pixels, size)
            .fill_polygon(corners, &RGBColor(r, g, b))
            .map_err(|what| Error::failed(format!("drawing a figure: {what}")))
    }

    fn text(&mut self, at: Point, text: &str, style: &TextStyle) -> Result<()> {
        let width = font::width(text, style.size, style.bold);
        let back = match style.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => width / 2.0,
            Anchor::End => width,
        };
        let (x, y) = match style.upright {
            true => (at.0, at.1 + back),
            false => (at.0 - back, at.1),
        };
        let origin = ((x * self.scale).round() as i32, (y * self.scale).round() as i32);
        let drawn = font::visit(text, style.size * self.scale, style.bold, |x, y, coverage| {
            let (x, y) = if style.upright { (y, -x) } else { (x, y) };
            let (x, y) = (origin.0.saturating_add(x), origin.1.saturating_add(y));
            self.blend(x, y, style.color, coverage);
        });
        match drawn {
            true => Ok(()),
            false => Err(Error::failed("the embedded font cannot be read: build Phasewalk anew")),
        }
    }

    fn blend(&mut self, x: i32, y: i32, color: Rgb, coverage: f32) {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else {
            return;
        };
        if x >= self.width || y >= self.height {
            return;
        }
        let at = 3 * (y * self.width + x);
        for (old, new) in self.pixels[at..at + 3].iter_mut().zip(color) {
            let mixed = f32::from(*old) + coverage * (f32::from(new) - f32::from(*old));
            *old = mixed.round() as u8;
        }
    }

    fn averaged(&self) -> Rgb8 {
        let (width, height) = (self.width / FINE, self.height / FINE);
        let part = |x: usize, y: usize, channel: usize| {
            let fine = (0..FINE * FINE).map(|n| (FINE * x + n % FINE, FINE * y + n / FINE));
            let sum: usize = fine
                .map(|(x, y)| usize::from(self.pixels[3 * (y * self.width + x) + channel]))
                .sum();
            ((sum + FINE * FINE / 2) / (FINE * FINE)) as u8
        };
        let pixels = (0..width * height)
            .flat_map(|n| [0, 1, 2].map(|channel| part(n % width, n / width, channel)));
        Rgb8 { width, height, pixels: pixels.collect() }
    }
}

/// A straight line as a rectangle, `half` to both sides.
fn bar(from: Point, to: Point, half: f64) -> [Point; 4] {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let shrink = half / dx.hypot(dy).max(f64::MIN_POSITIVE);
    let (nx, ny) = (-dy * shrink, dx * shrink);
    [
        (from.0 + nx, from.1 + ny),
        (to.0 + nx, to.1 + ny),
        (to.0 - nx, to.1 - ny),
        (from.0 - nx, from.1 - ny),
    ]
}
