//! The page: explanation, table, scenes with their images moving together, figures.

use std::fmt::Write as _;

use super::chart::{self, SceneCurve};
use super::stack::{Stack, png_address};
use crate::error::{Error, Result};
use crate::figures::canvas::{Canvas, escape};
use crate::figures::colormap::{COLORS, ColorMap};
use crate::figures::raster::Rgb8;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// All there is on the page. Every text is plain text: it is escaped here.
#[derive(Clone, Debug)]
pub struct Page<'a> {
    /// Title of the page.
    pub title: &'a str,
    /// What is to be seen, in one paragraph.
    pub explanation: &'a str,
    /// Tables, such as the errors of the methods.
    pub tables: Vec<Table>,
    /// Scenes, one shown at a time.
    pub scenes: Vec<Scene<'a>>,
    /// Figures below the scenes.
    pub figures: Vec<Still<'a>>,
}

/// A table; numbers come as they are to be read.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// What the table shows.
    pub caption: String,
    /// Names of the columns.
    pub header: Vec<String>,
    /// Cells, row by row; the first cell names the row.
    pub rows: Vec<Vec<String>>,
}

/// One simulated or measured series.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    /// Its name, such as `σ = λ/32`.
    pub label: &'a str,
    /// What is special about it.
    pub caption: &'a str,
    /// Image series shown side by side: speckle, direct, extended.
    pub stacks: Vec<Stack>,
    /// Phase curves below the images.
    pub curves: Vec<SceneCurve<'a>>,
}

/// A figure that does not move.
#[derive(Clone, Debug)]
pub struct Still<'a> {
    /// What it shows.
    pub caption: &'a str,
    /// The figure.
    pub canvas: &'a Canvas,
}

impl Page<'_> {
    /// The page as one file without any reference to another.
    ///
    /// # Errors
    /// When an image cannot be encoded.
    pub fn html(&self) -> Result<String> {
        let title = escape(self.title);
        let mut html = format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{title}</title>\n<link rel=\"icon\" href=\"data:,\">\n\
             <style>\n{STYLE}</style>\n</head>\n<body>\n\
             <main>\n<h1>{title}</h1>\n<p class=\"lead\">{}</p>\n",
            escape(self.explanation)
        );
        html.extend(self.tables.iter().map(Table::html));
        html += &self.tabs();
        for (n, scene) in self.scenes.iter().enumerate() {
            html += &scene.html(n)?;
        }
        for still in &self.figures {
            html += &still.html()?;
        }
        html += &format!("</main>\n<script>\n{SCRIPT}</script>\n</body>\n</html>\n");
        Ok(html)
    }

    /// Buttons that choose a scene; the script shows them, without it all scenes are visible.
    fn tabs(&self) -> String {
        if self.scenes.len() < 2 {
            return String::new();
        }
        let mut html =
            "<div class=\"tabs\" role=\"tablist\" aria-label=\"Scene\" hidden>\n".to_owned();
        for (n, scene) in self.scenes.iter().enumerate() {
            let label = escape(scene.label);
            html += &format!(
                "<button type=\"button\" role=\"tab\" id=\"tab-{n}\" aria-controls=\"scene-{n}\">\
                 {label}</button>\n"
            );
        }
        html + "</div>\n"
    }
}

impl Table {
    fn html(&self) -> String {
        if self.rows.is_empty() {
            return String::new();
        }
        let cells = |tag: &str, cells: &[String]| {
            cells.iter().fold(String::new(), |row, cell| {
                format!("{row}<{tag}>{}</{}>", escape(cell), &tag[..2])
            })
        };
        let mut html = format!(
            "<div class=\"wide\"><table>\n<caption>{}</caption>\n<thead><tr>{}</tr></thead>\n<tbody>\n",
            escape(&self.caption),
            cells("th scope=\"col\"", &self.header)
        );
        for row in &self.rows {
            let (name, numbers) = row.split_at(row.len().min(1));
            let name = cells("th scope=\"row\"", name);
            // Writing to a string cannot fail.
            let _ = writeln!(html, "<tr>{name}{}</tr>", cells("td", numbers));
        }
        html + "</tbody>\n</table></div>\n"
    }
}

impl Scene<'_> {
    fn html(&self, n: usize) -> Result<String> {
        let (label, caption) = (escape(self.label), escape(self.caption));
        let mut html = format!(
            "<section class=\"scene\" id=\"scene-{n}\" aria-label=\"{label}\">\n\
             <h2>{label}</h2>\n<p>{caption}</p>\n<div class=\"stacks\">\n"
        );
        for stack in &self.stacks {
            html += &self.stack(stack);
        }
        html += "</div>\n";
        html += &self.key()?;
        html += &self.scrubber(n);
        html += &self.chart()?;
        Ok(html + "</section>\n")
    }

    /// All images of a stack; visible is the last, where the methods differ most.
    fn stack(&self, stack: &Stack) -> String {
        let name = escape(stack.label());
        let kind = if stack.is_cyclic() { "stack cyclic" } else { "stack" };
        let mut html = format!("<figure class=\"{kind}\">\n<figcaption>{name}</figcaption>\n<div>");
        for (frame, address) in stack.addresses().enumerate() {
            let hidden = if frame + 1 == stack.len() { "" } else { " hidden" };
            let scene = escape(self.label);
            // Writing to a string cannot fail.
            let _ = writeln!(
                html,
                "<img src=\"{address}\" alt=\"{scene}, {name}, frame {frame}\" \
                 decoding=\"sync\"{hidden}>"
            );
        }
        html + "</div>\n</figure>\n"
    }

    /// What the colours of the phase images mean.
    fn key(&self) -> Result<String> {
        if !self.stacks.iter().any(Stack::is_cyclic) {
            return Ok(String::new());
        }
        let colors = &ColorMap::Phase.palette()[1..];
        let bar = Rgb8 { width: COLORS, height: 1, pixels: colors.as_flattened().to_vec() };
        let address = png_address(&bar.png()?);
        Ok(format!(
            "<p class=\"key\">phase / rad <span>\u{2212}π</span>\
             <img src=\"{address}\" alt=\"cyclic colour scale from \u{2212}π to π\">\
             <span>π</span></p>\n"
        ))
    }

    fn scrubber(&self, n: usize) -> String {
        let last = self.frames().saturating_sub(1);
        format!(
            "<div class=\"scrubber\">\n\
             <button type=\"button\" class=\"play\" aria-label=\"Play\">▶</button>\n\
             <input type=\"range\" id=\"frame-{n}\" min=\"0\" max=\"{last}\" value=\"{last}\" \
             step=\"1\" aria-label=\"Frame\">\n\
             <output for=\"frame-{n}\">frame {last} of {last}</output>\n</div>\n"
        )
    }

    /// Curves, and their values for the script to read out.
    fn chart(&self) -> Result<String> {
        if self.curves.is_empty() {
            return Ok(String::new());
        }
        let title = format!("Phase over time, {}", self.label);
        let values = self.curves.iter().map(|curve| (curve.label, curve.values));
        let json = serde_json::to_string(&values.collect::<Vec<_>>())
            .map_err(|what| Error::failed(format!("curves of the report: {what}")))?;
        Ok(format!(
            "<div class=\"chart\" data-curves=\"{}\">\n{}</div>\n\
             <p class=\"values\" aria-live=\"off\"></p>\n",
            escape(&json),
            chart::element(&title, &self.curves)?
        ))
    }

    fn frames(&self) -> usize {
        let images = self.stacks.iter().map(Stack::len);
        let values = self.curves.iter().map(|curve| curve.values.len());
        images.chain(values).max().unwrap_or(0)
    }
}

impl Still<'_> {
    fn html(&self) -> Result<String> {
        Ok(format!(
            "<figure class=\"still\">\n<div class=\"wide\">{}</div>\n<figcaption>{}</figcaption>\n</figure>\n",
            self.canvas.svg_element()?,
            escape(self.caption)
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Role;
    use ndarray::Array3;

    fn page(frames: usize) -> String {
        let field = Array3::from_shape_fn((frames, 12, 20), |(t, y, x)| (t + y * x) as f32);
        let missing = Array3::from_elem((frames, 12, 20), f32::NAN);
        let values: Vec<f64> =
            (0..frames).map(|t| t as f64 / 0.0_f64.max(t as f64 - 3.0)).collect();
        let scene = |label| Scene {
            label,
            caption: "a & b",
            stacks: vec![
                Stack::speckle("speckle", field.view()).unwrap(),
                Stack::phase("direct", missing.view()).unwrap(),
                Stack::phase("<extended>", field.view()).unwrap(),
            ],
            curves: vec![SceneCurve { label: "truth \"0\"", role: Role::Truth, values: &values }],
        };
        let canvas = Canvas::new(50.0, 40.0, "still");
        let page = Page {
            title: "</title><script>alert(1)</script>",
            explanation: "<b>bold</b>",
            tables: vec![Table {
                caption: "errors".to_owned(),
                header: vec!["method".to_owned(), "σ < 1".to_owned()],
                rows: vec![vec!["direct".to_owned(), "1.2 & more".to_owned()]],
            }],
            scenes: vec![scene("one"), scene("two")],
            figures: vec![Still { caption: "a figure", canvas: &canvas }],
        };
        page.html().unwrap()
    }

    #[test]
    fn every_frame_of_every_stack_is_there() {
        let html = page(7);
        assert_eq!(html.matches("decoding=\"sync\"").count(), 2 * 3 * 7);
        assert!(html.contains("alt=\"one, speckle, frame 6\""));
        assert!(html.contains("max=\"6\""));
        assert_eq!(html.matches("class=\"cursor\"").count(), 2);
        assert_eq!(html.matches("role=\"tab\"").count(), 2);
    }

    #[test]
    fn every_text_is_escaped() {
        let html = page(2);
        assert!(!html.contains("<script>alert") && !html.contains("<b>bold"));
        assert!(!html.contains("<extended>"));
        for text in ["&lt;b&gt;bold", "1.2 &amp; more", "σ &lt; 1", "truth &quot;0&quot;"] {
            assert!(html.contains(text), "{text}");
        }
    }

    #[test]
    fn nothing_is_loaded_from_elsewhere() {
        let html = page(2);
        for address in ["http:", "https:", "//cdn", "@import", "url("] {
            assert!(!html.contains(address), "{address}");
        }
        let outside = html.split(" src=\"").skip(1).any(|rest| !rest.starts_with("data:"));
        assert!(!outside);
    }

    #[test]
    fn a_page_without_frames_is_a_page() {
        assert!(page(0).contains("max=\"0\""));
        let empty = Page {
            title: "",
            explanation: "",
            tables: vec![Table::default()],
            scenes: vec![],
            figures: vec![],
        };
        assert!(empty.html().unwrap().ends_with("</html>\n"));
    }

    #[test]
    fn values_that_are_not_numbers_become_null() {
        assert!(page(5).contains("null"));
    }
}
