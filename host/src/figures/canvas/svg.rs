//! A drawing as SVG. Written here and not by plotters' backend, which knows whole pixels only and
//! no embedded images.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;

use super::super::colormap::Rgb;
use super::super::geometry::{Point, Rect};
use super::super::raster::Rgb8;
use super::{Anchor, Canvas, Mark, Stroke, TextStyle, font};
use crate::error::Result;

/// A text with every character replaced that means something in XML or HTML.
#[must_use]
pub fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '&' => safe.push_str("&amp;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            c if c.is_control() && !c.is_whitespace() => safe.push('\u{fffd}'),
            c => safe.push(c),
        }
    }
    safe
}

/// The drawing as a file of its own.
pub(super) fn file(canvas: &Canvas) -> Result<String> {
    let namespace = r#"<svg xmlns="http://www.w3.org/2000/svg""#;
    Ok(element(canvas)?.replacen("<svg", namespace, 1))
}

/// The drawing as an element of an HTML page.
pub(super) fn element(canvas: &Canvas) -> Result<String> {
    let (w, h) = (number(canvas.width), number(canvas.height));
    let (title, family) = (escape(&canvas.title), font::FAMILY);
    let mut svg = format!(
        "<svg width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" role=\"img\" \
         font-family=\"{family}, Verdana, sans-serif\">\n<title>{title}</title>\n\
         <rect width=\"{w}\" height=\"{h}\" fill=\"#fff\"/>\n"
    );
    for mark in &canvas.marks {
        svg += &match mark {
            Mark::Image(at, image) => picture(at, image)?,
            Mark::Line(points, stroke) => line(points, stroke),
            Mark::Fill(points, fill) => polygon(points, *fill),
            Mark::Disc(center, radius, fill) => disc(*center, *radius, *fill),
            Mark::Text(at, content, style) => text(*at, content, style),
        };
    }
    svg += "</svg>\n";
    Ok(svg)
}

fn picture(at: &Rect, image: &Rgb8) -> Result<String> {
    if image.pixels.is_empty() {
        return Ok(String::new());
    }
    let (x, y, w, h) = (number(at.x), number(at.y), number(at.w), number(at.h));
    let data = BASE64.encode(image.png()?);
    Ok(format!(
        "<image x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" preserveAspectRatio=\"none\" \
         style=\"image-rendering:pixelated\" href=\"data:image/png;base64,{data}\"/>\n"
    ))
}

fn line(points: &[Point], stroke: &Stroke) -> String {
    let (color, width) = (hex(stroke.color), number(stroke.width));
    let dash = stroke.dash.map_or_else(String::new, |(on, off)| {
        format!(" stroke-dasharray=\"{} {}\"", number(on), number(off))
    });
    let points = coordinates(points);
    format!(
        "<polyline points=\"{points}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"{width}\" \
         stroke-linejoin=\"round\"{dash}/>\n"
    )
}

fn polygon(points: &[Point], fill: Rgb) -> String {
    let (points, fill) = (coordinates(points), hex(fill));
    format!("<polygon points=\"{points}\" fill=\"{fill}\"/>\n")
}

fn disc((x, y): Point, radius: f64, fill: Rgb) -> String {
    let (x, y, r, fill) = (number(x), number(y), number(radius), hex(fill));
    format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\" fill=\"{fill}\"/>\n")
}

fn text((x, y): Point, content: &str, style: &TextStyle) -> String {
    let (x, y, size) = (number(x), number(y), number(style.size));
    let (fill, content) = (hex(style.color), escape(content));
    let anchor = match style.anchor {
        Anchor::Start => "start",
        Anchor::Middle => "middle",
        Anchor::End => "end",
    };
    let mut extra = String::new();
    if style.bold {
        extra += " font-weight=\"bold\"";
    }
    if style.upright {
        extra += &format!(" transform=\"rotate(-90 {x} {y})\"");
    }
    format!(
        "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" text-anchor=\"{anchor}\" \
         fill=\"{fill}\"{extra}>{content}</text>\n"
    )
}

fn coordinates(points: &[Point]) -> String {
    points.iter().fold(String::new(), |mut list, &(x, y)| {
        let gap = if list.is_empty() { "" } else { " " };
        // Writing to a string cannot fail.
        let _ = write!(list, "{gap}{},{}", number(x), number(y));
        list
    })
}

fn hex([r, g, b]: Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// A length with as many decimals as can be seen; what is no number becomes 0.
fn number(value: f64) -> String {
    if !value.is_finite() {
        return "0".to_owned();
    }
    let fixed = format!("{:.2}", value.clamp(-1e6, 1e6));
    fixed.trim_end_matches('0').trim_end_matches('.').to_owned()
}
