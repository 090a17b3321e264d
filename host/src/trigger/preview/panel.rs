//! A panel of the picture: three outputs over a span of time, dimensions below, an axis.

use super::Trace;
use super::scale::Scale;
use super::windows::{Window, signed};
use crate::trigger::summary::channel_name;
use phasewalk_firmware::channel::Channel;
use std::fmt::Write;

/// Width of the picture in pixels.
pub const WIDTH: f64 = 1200.0;
const LEFT: f64 = 130.0;
const RIGHT: f64 = 40.0;
const TITLE: f64 = 34.0;
const LANE: f64 = 30.0;
const PITCH: f64 = 46.0;
const DIMENSION: f64 = 26.0;
const AXIS: f64 = 52.0;
/// Pulses closer than this are drawn as one hatched block.
const APART: f64 = 1.5;
/// No pulse is drawn thinner.
const THIN: f64 = 1.0;
/// Estimated width of a letter, in pixels.
const LETTER: f64 = 6.6;

/// A dimension: from tick to tick, and what it says.
#[derive(Debug, Clone)]
pub struct Dimension {
    /// First tick.
    pub from: i64,
    /// Last tick.
    pub to: i64,
    /// What it says.
    pub label: String,
}

/// A panel.
#[derive(Debug)]
pub struct Panel<'a> {
    /// What is drawn.
    pub trace: &'a Trace,
    /// Which part.
    pub window: Window,
    /// Dimensions, each on a line of its own.
    pub dimensions: Vec<Dimension>,
    /// Numbers of the volumes above the laser's pulses.
    pub numbered: bool,
}

impl Panel<'_> {
    /// Its height in pixels.
    pub fn height(&self) -> f64 {
        TITLE + 3.0 * PITCH + DIMENSION * self.dimensions.len() as f64 + AXIS
    }

    /// Draw it with its upper border at `top`.
    pub fn draw(&self, svg: &mut String, top: f64) {
        let scale = self.scale();
        let title = escape(&self.window.title);
        let _ =
            writeln!(svg, "<text class=\"title\" x=\"20\" y=\"{:.1}\">{title}</text>", top + 18.0);
        let lanes = top + TITLE;
        self.grid(svg, &scale, lanes);
        for channel in Channel::ALL {
            self.lane(svg, &scale, channel, lanes + PITCH * channel.index() as f64);
        }
        if self.numbered {
            self.numbers(svg, &scale, lanes);
        }
        let bottom = lanes + 3.0 * PITCH;
        for (row, dimension) in self.dimensions.iter().enumerate() {
            let y = bottom + DIMENSION * (row as f64 + 0.5);
            draw_dimension(svg, &scale, dimension, lanes, y);
        }
    }

    /// Its time axis.
    pub fn scale(&self) -> Scale {
        Scale::new(&self.window, LEFT, WIDTH - LEFT - RIGHT, self.trace.ticks_per_second)
    }

    fn grid(&self, svg: &mut String, scale: &Scale, top: f64) {
        let bottom = top + 3.0 * PITCH + DIMENSION * self.dimensions.len() as f64;
        for (x, label) in scale.labels() {
            let _ = writeln!(
                svg,
                "<path class=\"grid\" d=\"M{x:.1} {top:.1}V{bottom:.1}\"/>\
                 <text class=\"tick\" x=\"{x:.1}\" y=\"{:.1}\">{label}</text>",
                bottom + 15.0
            );
        }
        let (unit, zero) = (scale.unit().0, self.window.zero_name);
        let name =
            if zero.is_empty() { format!("time in {unit}") } else { format!("{unit} {zero}") };
        let _ = writeln!(
            svg,
            "<text class=\"axis\" x=\"{:.1}\" y=\"{:.1}\">{name}</text>",
            (LEFT + WIDTH - RIGHT) / 2.0,
            bottom + 32.0
        );
    }

    fn lane(&self, svg: &mut String, scale: &Scale, channel: Channel, top: f64) {
        let (high, low) = (top + 4.0, top + 4.0 + LANE);
        let name = channel_name(channel);
        let blocks = self.blocks(scale, channel);
        let mut areas = String::new();
        for &Block { left, right, pulses } in &blocks {
            if let Some(label) = self.filling(channel, pulses) {
                block(svg, channel, [left, right, high, low], &label);
            }
            let _ = write!(areas, "M{left:.2} {low:.1}V{high:.1}H{right:.2}V{low:.1}Z");
        }
        let line = line(&blocks, high, low);
        let count = self.trace.pulses_within(channel, self.window.from, self.window.to).len();
        let count = if count == 1 { "1 pulse".to_owned() } else { format!("{count} pulses") };
        let _ = writeln!(
            svg,
            "<path class=\"{name} area\" d=\"{areas}\"/><path class=\"{name} line\" d=\"{line}\"/>\
             <text class=\"name {name}-text\" x=\"20\" y=\"{:.1}\">{name}</text>\
             <text class=\"count\" x=\"20\" y=\"{:.1}\">{count}</text>",
            high + 13.0,
            high + 28.0
        );
    }

    /// What a hatched block stands for: several pulses, or the frames of one; none: not hatched.
    fn filling(&self, channel: Channel, pulses: u32) -> Option<String> {
        if pulses > 1 {
            return Some(format!("{pulses} pulses"));
        }
        let plan = &self.trace.plan;
        let framed = plan.frame > 0 && channel == Channel::Camera;
        framed.then(|| format!("{} frames", plan.caps.images_per_sweep))
    }

    /// Pulses as they can be drawn: not too thin, and those too close together as one.
    fn blocks(&self, scale: &Scale, channel: Channel) -> Vec<Block> {
        let mut blocks: Vec<Block> = Vec::new();
        for &(rise, fall) in self.trace.pulses_within(channel, self.window.from, self.window.to) {
            let left = scale.x(signed(rise));
            let right = scale.x(signed(fall)).max(left + THIN);
            match blocks.last_mut().filter(|last| left - last.right < APART) {
                Some(last) => {
                    last.right = right;
                    last.pulses += 1;
                }
                None => blocks.push(Block { left, right, pulses: 1 }),
            }
        }
        blocks
    }

    /// Numbers of the volumes above their sweeps; close ones share a label.
    fn numbers(&self, svg: &mut String, scale: &Scale, top: f64) {
        let pulses = self.trace.pulses(Channel::Laser);
        let shown = self.trace.pulses_within(Channel::Laser, self.window.from, self.window.to);
        let Some(first) = shown.first() else { return };
        let begin = pulses.partition_point(|pulse| pulse.0 < first.0);
        let centre = |&(rise, fall): &(u64, u64)| {
            f64::midpoint(scale.x(signed(rise)), scale.x(signed(fall)))
        };
        let near = |a: &(u64, u64), b: &(u64, u64)| centre(b) - centre(a) < 12.0 * LETTER;
        let mut number = begin;
        for group in shown.chunk_by(near) {
            let last = number + group.len() - 1;
            let label = if last == number {
                format!("volume {number}")
            } else {
                format!("volumes {number} to {last}")
            };
            let [Some(left), Some(right)] = [group.first(), group.last()] else { return };
            let (x, y) = (f64::midpoint(centre(left), centre(right)), top - 1.0);
            let _ =
                writeln!(svg, "<text class=\"number\" x=\"{x:.1}\" y=\"{y:.1}\">{label}</text>");
            number = last + 1;
        }
    }
}

/// Pulses that are drawn as one.
struct Block {
    left: f64,
    right: f64,
    pulses: u32,
}

/// The level of an output. A pulse that begins before the panel or goes on behind it has no edge at
/// the border.
fn line(blocks: &[Block], high: f64, low: f64) -> String {
    let cut = blocks.first().is_some_and(|block| block.left <= LEFT);
    let mut line = format!("M{LEFT:.1} {:.1}", if cut { high } else { low });
    for &Block { left, right, .. } in blocks {
        let _ = write!(line, "H{left:.2}V{high:.1}H{right:.2}");
        if right < WIDTH - RIGHT {
            let _ = write!(line, "V{low:.1}");
        }
    }
    let _ = write!(line, "H{:.1}", WIDTH - RIGHT);
    line
}

/// A hatched block and what it stands for.
fn block(svg: &mut String, channel: Channel, [left, right, high, low]: [f64; 4], label: &str) {
    let name = channel_name(channel);
    let (width, height) = (right - left, low - high);
    let _ = writeln!(
        svg,
        "<rect x=\"{left:.2}\" y=\"{high:.1}\" width=\"{width:.2}\" height=\"{height:.1}\" \
         fill=\"url(#{name}-hatch)\"/>"
    );
    if width > letters(label) + 16.0 {
        let (x, y) = (f64::midpoint(left, right), f64::midpoint(high, low) + 4.0);
        let _ = writeln!(svg, "<text class=\"halo\" x=\"{x:.1}\" y=\"{y:.1}\">{label}</text>");
    }
}

fn draw_dimension(svg: &mut String, scale: &Scale, dimension: &Dimension, top: f64, y: f64) {
    let (left, right) = (scale.x(dimension.from), scale.x(dimension.to));
    for x in [left, right] {
        let _ = writeln!(svg, "<path class=\"extension\" d=\"M{x:.1} {top:.1}V{:.1}\"/>", y + 5.0);
    }
    let narrow = right - left < 24.0;
    if narrow {
        // Too narrow for arrows inside: they point at it from outside.
        for (from, to) in [(left - 16.0, left), (right + 16.0, right)] {
            let path = format!("M{from:.1} {y:.1}H{to:.1}");
            let _ = writeln!(svg, "<path class=\"dimension to\" d=\"{path}\"/>");
        }
    } else {
        let _ = writeln!(svg, "<path class=\"dimension\" d=\"M{left:.1} {y:.1}H{right:.1}\"/>");
    }
    let label = escape(&dimension.label);
    let width = letters(&dimension.label);
    let beside = if narrow { 22.0 } else { 8.0 };
    let (x, y, anchor) = if right - left > width + 24.0 {
        (f64::midpoint(left, right), y - 4.0, "middle")
    } else if right + beside + width < WIDTH {
        (right + beside, y + 4.0, "start")
    } else {
        (left - beside, y + 4.0, "end")
    };
    let _ = writeln!(
        svg,
        "<text class=\"label\" x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{label}</text>"
    );
}

fn letters(text: &str) -> f64 {
    LETTER * text.chars().count() as f64
}

/// Text as SVG takes it.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
