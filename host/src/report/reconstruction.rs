//! The page of a reconstruction: its key figures and a picture of every step.

use super::html::{Page, Still, Table};
use crate::error::Result;
use crate::figures::Canvas;

/// All there is on the page.
#[derive(Clone, Debug)]
pub struct Reconstruction<'a> {
    /// Name of the recording.
    pub recording: &'a str,
    /// What was done, in a sentence or two.
    pub summary: &'a str,
    /// Key figures: name, value with its unit.
    pub results: Vec<(String, String)>,
    /// The pictures, in the order of work.
    pub pictures: Vec<(Step, &'a Canvas)>,
}

/// A step of the reconstruction that has a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Spectrum of the source and what is left without it.
    Source,
    /// Spectrum to depth, dispersion.
    Dispersion,
    /// Registration.
    Motion,
    /// Segmentation.
    Surfaces,
    /// Flattening and choice of the layers' depths.
    Layers,
    /// The layers' images.
    EnFace,
}

impl Step {
    /// Name of the picture's file, without its ending.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Source => "source",
            Self::Dispersion => "dispersion",
            Self::Motion => "motion",
            Self::Surfaces => "surfaces",
            Self::Layers => "layers",
            Self::EnFace => "enface",
        }
    }

    /// What the picture shows and what to look for.
    fn about(self) -> &'static str {
        match self {
            Self::Source => {
                "The source. Mean of every image of a sweep: all sweeps should follow one curve. \
                 A sweep beside it was saturated, missing or short, or the eye was closed."
            }
            Self::Dispersion => {
                "From spectrum to depth. The same B-scan before and after the correction of \
                 dispersion: layers should become thin, and nothing should stand still at one \
                 depth across the whole image."
            }
            Self::Motion => {
                "Motion. Where the image of every sweep lies relative to the first, by depth, row \
                 and column, and its rotation if it was looked for. Grey sweeps were left out."
            }
            Self::Surfaces => {
                "Surfaces. The two ends of the outer segments as they were found, over the \
                 averaged volume: both lines should follow their layers without a jump."
            }
            Self::Layers => {
                "Layers. The mean A-line after flattening. Shaded are the depths whose phases are \
                 compared: each should hold one peak and nothing of its neighbour."
            }
            Self::EnFace => {
                "En face. Amplitude of the two layers. Speckle should be sharp to the edges: \
                 blurred speckle means that motion is left."
            }
        }
    }
}

impl Reconstruction<'_> {
    /// The page as one file without any reference to another.
    ///
    /// # Errors
    /// When an image cannot be encoded.
    pub fn html(&self) -> Result<String> {
        let title = format!("Reconstruction of {}", self.recording);
        let still = |&(step, canvas): &(Step, _)| Still { caption: step.about(), canvas };
        let page = Page {
            title: &title,
            explanation: self.summary,
            tables: vec![self.table()],
            scenes: Vec::new(),
            figures: self.pictures.iter().map(still).collect(),
        };
        page.html()
    }

    fn table(&self) -> Table {
        let row = |(name, value): &(String, String)| vec![name.clone(), value.clone()];
        Table {
            caption: "What was found".to_owned(),
            header: vec!["quantity".to_owned(), "value".to_owned()],
            rows: self.results.iter().map(row).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_holds_every_figure_and_picture() {
        let canvas = Canvas::new(50.0, 40.0, "a picture");
        let steps = [Step::Source, Step::Dispersion, Step::Motion];
        let more = [Step::Surfaces, Step::Layers, Step::EnFace];
        let page = Reconstruction {
            recording: "<run>.cihx",
            summary: "21 of 24 sweeps used.",
            results: vec![("a2 at the band edge".to_owned(), "\u{2212}22.1 rad".to_owned())],
            pictures: steps.into_iter().chain(more).map(|step| (step, &canvas)).collect(),
        };
        let html = page.html().unwrap();
        for text in ["&lt;run&gt;.cihx", "21 of 24", "a2 at the band edge", "\u{2212}22.1 rad"] {
            assert!(html.contains(text), "{text}");
        }
        assert_eq!(html.matches("<title>a picture</title>").count(), 6);
        assert!(!html.contains("http"));
    }

    #[test]
    fn a_page_of_nothing_is_a_page() {
        let page = Reconstruction { recording: "", summary: "", results: vec![], pictures: vec![] };
        assert!(page.html().unwrap().ends_with("</html>\n"));
    }
}
