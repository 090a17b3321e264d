//! Everything on one page.

use super::settings::Settings;
use crate::error::Result;
use crate::figures::Canvas;
use crate::report::{Page, Still, Table};

const TITLE: &str = "Phasewalk: the paper's figures and numbers";

const EXPLANATION: &str = "\
Everything that can be computed of \u{201c}Phase-sensitive interferometry of decorrelated speckle \
patterns\u{201d} (Hillmann, Spahr et al., Sci Rep 9:11748, 2019) without its measurements, with the \
paper's simulated scene, whose truth is known. The paper gives no size of the x, no aperture and no \
width of the Gaussian; those are ours. A claim is judged by the paper's own method; \u{2018}linked\u{2019} \
is the same number of the maximum-likelihood method, which the paper does not have. Visibility is 1 where \
the x stands out as in the ideal image, and 0 in noise. The limits are ours.";

const ABOUT_FIGURE1: &str = "\
The paper's Figure 1, b\u{2013}g: magnitude (above) and phase (below) of the cross-spectrum. Without \
decorrelation both ways work. With it, one pixel is noise; averaged over the x, the phase is reliable \
near Δt = 0, where the walk stays, and the direct difference ends in noise.";

const ABOUT_FIGURE2: &str = "\
The paper's Figure 2: phase images by every method, and below the speckle they were made from. The \
extended method is the paper's to the letter: its threshold takes pixels for independent looks, of which \
the aperture leaves fewer, so noise passes where the motion is strong; a narrower Gaussian (--gaussian 3) \
loses the x at λ/16 altogether.";

const ABOUT_FIGURE3: &str = "\
The paper's Figure 3: phase of the x by every method, mean over all runs; bands are one standard \
deviation. Below: what is left of the field after a time. The aperture mixes light from outside into \
the rim of the x; that alone, at σ = 0, keeps the mean below the truth.";

/// The figures of the page.
pub struct Figures {
    /// Figure 1.
    pub cross_spectra: Canvas,
    /// Figure 2.
    pub images: Canvas,
    /// Figure 3.
    pub curves: Canvas,
}

/// The page as HTML, the tables in the order given.
///
/// # Errors
/// When an image cannot be encoded.
pub fn html(settings: &Settings, tables: Vec<Table>, figures: &Figures) -> Result<String> {
    let still = |canvas, caption| Still { canvas, caption };
    let page = Page {
        title: TITLE,
        explanation: &format!("{EXPLANATION} Here: {}.", settings.words()),
        tables,
        scenes: Vec::new(),
        figures: vec![
            still(&figures.cross_spectra, ABOUT_FIGURE1),
            still(&figures.images, ABOUT_FIGURE2),
            still(&figures.curves, ABOUT_FIGURE3),
        ],
    };
    page.html()
}
