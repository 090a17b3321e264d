//! A picture to scale: the whole run, and a closer look at what matters in it.

use super::Trace;
use super::panel::{Dimension, Panel, WIDTH, escape};
use super::windows::{Window, closest, first_burst, signed, stimulus};
use crate::trigger::units::exact;
use phasewalk_firmware::channel::Channel;
use std::fmt::Write;

const HEADER: f64 = 66.0;

const STYLE: &str = "text{font-family:'DejaVu Sans',Verdana,Helvetica,Arial,sans-serif;fill:#222}\
.head{font-size:20px;font-weight:bold}.sub{font-size:13px;fill:#555}\
.title{font-size:14px;font-weight:bold}.name{font-size:14px;font-weight:bold}\
.count{font-size:11px;fill:#666}.tick{font-size:11px;text-anchor:middle;fill:#555}\
.axis{font-size:12px;text-anchor:middle;fill:#555}.number{font-size:11px;text-anchor:middle;fill:#555}\
.label{font-size:11.5px}.halo{font-size:12px;text-anchor:middle;stroke:#fff;stroke-width:4px;\
paint-order:stroke}.grid{stroke:#e6e6e6;fill:none}.extension{stroke:#999;stroke-dasharray:2 3;\
fill:none}.dimension{stroke:#444;fill:none;marker-start:url(#arrow);marker-end:url(#arrow)}\
.to{marker-start:none}\
.laser{stroke:#d55e00;fill:#d55e00;fill-opacity:.18;stroke-width:1.3}\
.camera{stroke:#0072b2;fill:#0072b2;fill-opacity:.18;stroke-width:1.3}\
.stimulus{stroke:#00805d;fill:#00805d;fill-opacity:.18;stroke-width:1.3}\
.laser-text{fill:#b34f00}.camera-text{fill:#00639b}.stimulus-text{fill:#006e50}\
.area{stroke:none}.line{fill:none}.zoom{fill:#f2c200;fill-opacity:.22}";

/// The picture.
#[must_use]
pub fn svg(trace: &Trace) -> String {
    let zooms = zooms(trace);
    let overview = overview(trace);
    let height = HEADER + overview.height() + zooms.iter().map(Panel::height).sum::<f64>() + 6.0;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{height:.0}\" \
         viewBox=\"0 0 {WIDTH} {height:.0}\">\n<style>{STYLE}</style>\n"
    );
    header(&mut svg, trace);
    let mut top = HEADER;
    mark_zooms(&mut svg, &overview, &zooms, top);
    for panel in std::iter::once(&overview).chain(&zooms) {
        panel.draw(&mut svg, top);
        top += panel.height();
    }
    svg.push_str("</svg>\n");
    svg
}

fn header(svg: &mut String, trace: &Trace) {
    let mut definitions = String::from(
        "<marker id=\"arrow\" viewBox=\"0 0 8 8\" refX=\"7.5\" refY=\"4\" markerWidth=\"8\" \
         markerHeight=\"8\" orient=\"auto-start-reverse\"><path d=\"M0 1L8 4L0 7Z\" fill=\"#444\"/>\
         </marker>",
    );
    for (name, color) in [("laser", "#d55e00"), ("camera", "#0072b2"), ("stimulus", "#00805d")] {
        let _ = write!(
            definitions,
            "<pattern id=\"{name}-hatch\" width=\"6\" height=\"6\" patternUnits=\"userSpaceOnUse\" \
             patternTransform=\"rotate(45)\"><rect width=\"6\" height=\"6\" fill=\"#fff\"/>\
             <rect width=\"2.5\" height=\"6\" fill=\"{color}\" fill-opacity=\".55\"/></pattern>"
        );
    }
    let (name, hash) = (escape(&trace.name), trace.hash);
    let plan = &trace.plan;
    let length = exact(plan.length(), trace.ticks_per_second);
    let tick = exact(1, trace.ticks_per_second);
    let volumes = plan.total_sweeps();
    let edges = trace.edges.len();
    let _ = writeln!(
        svg,
        "<title>{name}</title><defs>{definitions}</defs>\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <text class=\"head\" x=\"20\" y=\"30\">{name}</text>\n\
         <text class=\"sub\" x=\"20\" y=\"50\">compiled plan {hash:08x}: {volumes} volumes, {edges} \
         edges in {length}; drawn from the board's own sequencer, one tick is {tick}</text>"
    );
}

fn overview(trace: &Trace) -> Panel<'_> {
    let end = signed(trace.end()).max(1);
    let window = Window {
        title: "whole run".to_owned(),
        from: -end / 60,
        to: end + end / 60,
        zero: 0,
        zero_name: "after the start of the run",
    };
    Panel { trace, window, dimensions: Vec::new(), numbered: false }
}

/// Where the closer looks lie in the run; those at the same place share a label.
fn mark_zooms(svg: &mut String, overview: &Panel<'_>, zooms: &[Panel<'_>], top: f64) {
    let scale = overview.scale();
    let mut labels: Vec<(f64, String)> = Vec::new();
    for zoom in zooms {
        let (left, right) = (scale.x(zoom.window.from), scale.x(zoom.window.to));
        let width = (right - left).max(4.0);
        let _ = writeln!(
            svg,
            "<rect class=\"zoom\" x=\"{left:.1}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"140\"/>",
            top + 32.0
        );
        let letter: String = zoom.window.title.chars().take(1).collect();
        let x = left + width / 2.0;
        match labels.iter_mut().find(|(other, _)| (x - other).abs() < 26.0) {
            Some((_, label)) => label.push_str(&format!(", {letter}")),
            None => labels.push((x, letter)),
        }
    }
    for (x, label) in labels {
        let y = top + 29.0;
        let _ = writeln!(svg, "<text class=\"number\" x=\"{x:.1}\" y=\"{y:.1}\">{label}</text>");
    }
}

fn zooms(trace: &Trace) -> Vec<Panel<'_>> {
    let mut panels = vec![Panel {
        trace,
        window: first_burst(trace),
        dimensions: burst_dimensions(trace),
        numbered: true,
    }];
    if let Some(window) = stimulus(trace) {
        let dimensions = stimulus_dimensions(trace, &window);
        panels.push(Panel { trace, window, dimensions, numbered: true });
    }
    if let Some((window, first, second)) = closest(trace) {
        let (from, to) = (signed(first.tick), signed(second.tick));
        let ticks = second.tick - first.tick;
        let label = format!("{} ({ticks} ticks)", exact(ticks, trace.ticks_per_second));
        let dimensions = vec![Dimension { from, to, label }];
        panels.push(Panel { trace, window, dimensions, numbered: false });
    }
    for (panel, letter) in panels.iter_mut().zip('A'..) {
        panel.window.title = format!("{letter}: {}", panel.window.title);
    }
    panels
}

/// Pulses of the first sweep and the spacing of the burst's sweeps.
fn burst_dimensions(trace: &Trace) -> Vec<Dimension> {
    let time = |ticks: u64| exact(ticks, trace.ticks_per_second);
    let mut dimensions = Vec::new();
    for (channel, name) in [(Channel::Laser, "laser"), (Channel::Camera, "camera")] {
        let Some(&(rise, fall)) = trace.pulses(channel).first() else { continue };
        let mut label = format!("{name} {}", time(fall - rise));
        if channel == Channel::Camera && trace.plan.frame > 0 {
            let (images, frame) = (trace.plan.caps.images_per_sweep, time(trace.plan.frame.into()));
            label.push_str(&format!(": {images} frames, one every {frame} by the board's clock"));
        }
        dimensions.push(Dimension { from: signed(rise), to: signed(fall), label });
    }
    let delay = u64::from(trace.plan.laser.delay);
    for sweep in 1..trace.plan.sweeps {
        let (from, to) =
            (trace.plan.sweep_offset(sweep - 1) + delay, trace.plan.sweep_offset(sweep) + delay);
        let gap = time((to - from).saturating_sub(trace.plan.sweep_length()));
        let label = format!("sweep {} to {sweep}: {}, gap {gap}", sweep - 1, time(to - from));
        dimensions.push(Dimension { from: signed(from), to: signed(to), label });
    }
    dimensions
}

/// The interval, and the way from the trigger of the stimulus' sweep to the light.
fn stimulus_dimensions(trace: &Trace, window: &Window) -> Vec<Dimension> {
    let plan = &trace.plan;
    let time = |ticks: u64| exact(ticks, trace.ticks_per_second);
    let Some(stimulus) = plan.stimulus else { return Vec::new() };
    let mut dimensions = Vec::new();
    let delay = i64::from(plan.laser.delay);
    if window.from < window.zero - signed(plan.interval) {
        let gap = time(plan.interval.saturating_sub(plan.burst_length()));
        dimensions.push(Dimension {
            from: window.zero - signed(plan.interval) + delay,
            to: window.zero + delay,
            label: format!("interval {}, gap {gap}", time(plan.interval)),
        });
    }
    let light = signed(plan.stimulus_start(&stimulus));
    let trigger = window.zero + signed(plan.sweep_offset(stimulus.sweep)) + delay;
    let label = match light - trigger {
        0 => "stimulus in the same tick as the laser's trigger".to_owned(),
        later if later > 0 => format!("stimulus {} after the laser's trigger", time(later as u64)),
        earlier => format!("stimulus {} before the laser's trigger", time(earlier.unsigned_abs())),
    };
    dimensions.push(Dimension { from: light.min(trigger), to: light.max(trigger), label });
    dimensions
}
