//! The two ends of the photoreceptor outer segments: their names and colours in every figure.

use super::colormap::Rgb;

/// An end of the outer segments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Junction of inner and outer segments.
    IsOs,
    /// Outer-segment tips.
    Tips,
}

impl Layer {
    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::IsOs => "IS/OS",
            Self::Tips => "outer-segment tips",
        }
    }

    /// Its colour (Okabe and Ito's sky blue and orange): seen on black and on white.
    #[must_use]
    pub fn color(self) -> Rgb {
        match self {
            Self::IsOs => [86, 180, 233],
            Self::Tips => [230, 159, 0],
        }
    }
}
