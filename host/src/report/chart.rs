//! The curves of a scene as inline SVG, with a cursor the page moves.

use crate::error::Result;
use crate::figures::axes::Axes;
use crate::figures::canvas::{Canvas, Stroke};
use crate::figures::geometry::Rect;
use crate::figures::keys;
use crate::figures::scale::Span;
use crate::figures::style;

/// What a curve is; decides how it looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The phase that was put in.
    Truth,
    /// Phase difference to the first frame.
    Direct,
    /// One-step Knox-Thompson.
    OneStep,
    /// Extended Knox-Thompson.
    Extended,
}

/// A curve of a scene.
#[derive(Clone, Copy, Debug)]
pub struct SceneCurve<'a> {
    /// Its name in the key.
    pub label: &'a str,
    /// What it is.
    pub role: Role,
    /// Phase in radians per frame, NaN where there is none.
    pub values: &'a [f64],
}

impl Role {
    fn stroke(self) -> Stroke {
        match self {
            Self::Truth => Stroke::dashed(style::TRUTH, 1.6),
            Self::Direct => Stroke::solid(style::DIRECT, 1.8),
            Self::OneStep => Stroke::solid(style::ONE_STEP, 1.8),
            Self::Extended => Stroke::solid(style::EXTENDED, 2.2),
        }
    }

    /// What must stay visible is drawn later.
    fn order(self) -> u8 {
        match self {
            Self::Direct => 0,
            Self::OneStep => 1,
            Self::Extended => 2,
            Self::Truth => 3,
        }
    }
}

const AREA: Rect = Rect { x: 64.0, y: 44.0, w: 916.0, h: 240.0 };

/// The curves as an `<svg>` element whose line of class `cursor` is drawn at frame 0 and moved to
/// the last; its `data-step` is the distance of two frames.
pub(super) fn element(title: &str, curves: &[SceneCurve<'_>]) -> Result<String> {
    let frames = curves.iter().map(|curve| curve.values.len()).max().unwrap_or(0);
    let x = Span::new(0.0, frames.saturating_sub(1) as f64);
    let y = Span::of(curves.iter().flat_map(|curve| curve.values).copied()).padded(0.06);
    let axes = Axes::new(AREA, x, y);
    let mut canvas = Canvas::new(1000.0, AREA.bottom() + 46.0, title);
    draw(&mut canvas, &axes, curves);
    let (start, step) = (axes.place((0.0, 0.0)).0, AREA.w / (x.high - x.low));
    let cursor = format!(
        "<line class=\"cursor\" x1=\"{start}\" x2=\"{start}\" y1=\"{}\" y2=\"{}\" \
         data-step=\"{step}\" transform=\"translate({} 0)\"/>\n</svg>",
        AREA.y,
        AREA.bottom(),
        step * x.high
    );
    Ok(canvas.svg_element()?.replacen("</svg>", &cursor, 1))
}

fn draw(canvas: &mut Canvas, axes: &Axes, curves: &[SceneCurve<'_>]) {
    let mut ordered: Vec<_> = curves.iter().collect();
    ordered.sort_by_key(|curve| curve.role.order());
    for curve in ordered {
        let points = curve.values.iter().enumerate().map(|(t, &v)| (t as f64, v));
        axes.curve(canvas, points, curve.role.stroke());
    }
    axes.x_axis(canvas, Some("frame"));
    axes.y_axis(canvas, Some("phase / rad"));
    axes.frame(canvas);
    let entries: Vec<_> = curves.iter().map(|c| (c.label, c.role.stroke())).collect();
    keys::line_key(canvas, (AREA.x, 20.0), &entries);
}
