//! How fast each part of the image decorrelates: maps in the result, numbers, a picture.

use super::Task;
use crate::error::Result;
use crate::figures::{Canvas, CoherenceMap, CoherenceMaps};
use crate::image::{Quantity, Tiles, diffusion_um2, walk_nm};
use crate::io::{ImageWriter, Series, Shape};
use ndarray::ArrayView2;
use serde_json::{Value, json};

/// The maps of a series.
pub(super) struct Decorrelation {
    label: String,
    size: (usize, usize),
    wavelength_nm: Option<f64>,
    /// Is it the product of two layers that decorrelates?
    two: bool,
    /// What the times are counted in.
    unit: &'static str,
    /// Each quantity's image (y, x).
    images: Vec<(Quantity, &'static str, Vec<f32>)>,
}

impl Decorrelation {
    pub(super) fn of(task: &Task<'_>, tiles: &Tiles) -> Self {
        let Shape { height, width, .. } = task.good.shape();
        let two = task.plan.depths.has_two_layers();
        let image =
            |(quantity, name): (Quantity, &'static str)| (quantity, name, quantity.image(tiles));
        Self {
            label: task.arguments.label(),
            size: (height, width),
            // The rate of two layers' product is the sum of theirs, which says how far neither walks.
            wavelength_nm: task.wavelength_nm.filter(|_| !two),
            two,
            unit: task.time_unit(),
            images: Quantity::ALL.into_iter().map(image).collect(),
        }
    }

    /// Into the result, with the motion where the wavelength is known.
    pub(super) fn write(&self, writer: &ImageWriter) -> Result<()> {
        for (_, name, image) in &self.images {
            writer.write_map(name, image)?;
        }
        match self.walk() {
            Some(walk) => writer.write_map("walk_nm", &walk),
            None => Ok(()),
        }
    }

    /// sigma of the scatterers' walk in nm, (y, x).
    fn walk(&self) -> Option<Vec<f32>> {
        let wavelength = self.wavelength_nm?;
        let nm = |&rate: &f32| walk_nm(f64::from(rate), wavelength) as f32;
        Some(self.image(Quantity::DecayRate).iter().map(nm).collect())
    }

    fn image(&self, wanted: Quantity) -> &[f32] {
        let found = self.images.iter().find(|(quantity, ..)| *quantity == wanted);
        found.map_or(&[], |(_, _, image)| image)
    }

    /// Median and range of every quantity.
    pub(super) fn facts(&self) -> Value {
        let mut facts = serde_json::Map::new();
        for (_, name, image) in &self.images {
            let [low, median, high] = spread(image);
            facts.insert((*name).to_owned(), json!({ "median": median, "low": low, "high": high }));
        }
        if let Some(wavelength) = self.wavelength_nm {
            let rate = spread(self.image(Quantity::DecayRate))[1];
            facts.insert("walk_nm".to_owned(), json!(walk_nm(rate, wavelength)));
            facts.insert("diffusion_um2".to_owned(), json!(diffusion_um2(rate, wavelength)));
        }
        Value::Object(facts)
    }

    pub(super) fn in_words(&self) -> String {
        let of = |quantity| spread(self.image(quantity));
        let [low, rate, high] = of(Quantity::DecayRate);
        if rate.is_nan() {
            return "decorrelation: nan (no coherence was found, or fewer than three frames)"
                .to_owned();
        }
        let percent = |quantity| 100.0 * of(quantity)[1];
        let unit = self.unit;
        let motion = self.wavelength_nm.map_or(String::new(), |wavelength| {
            let (walk, diffusion) = (walk_nm(rate, wavelength), diffusion_um2(rate, wavelength));
            format!(
                " (path to the scatterers: {walk:.1} nm a root {unit}, {diffusion:.2e} um^2/{unit})"
            )
        });
        let of_what = if self.two { " of both layers together" } else { "" };
        format!(
            "decorrelation{of_what} {rate:.3} ({low:.3} to {high:.3}) per {unit}{motion}, static {:.0} %, noise {:.0} %",
            percent(Quantity::Static),
            percent(Quantity::Noise)
        )
    }

    pub(super) fn draw(&self) -> Canvas {
        let walk = self.walk();
        let unit = self.unit;
        let rate = self.image(Quantity::DecayRate);
        let mut maps = vec![(format!("decay rate / (1/{unit})"), rate, None)];
        if let Some(walk) = &walk {
            maps.push((format!("walk / (nm a root {unit})"), walk, None));
        }
        maps.push(("static share".to_owned(), self.image(Quantity::Static), Some(1.0)));
        maps.push(("noise share".to_owned(), self.image(Quantity::Noise), Some(1.0)));
        let maps: Vec<CoherenceMap<'_>> =
            maps.iter().filter_map(|(label, values, top)| self.map(label, values, *top)).collect();
        CoherenceMaps { label: &self.label, maps }.draw()
    }

    fn map<'a>(
        &self,
        label: &'a str,
        values: &'a [f32],
        top: Option<f32>,
    ) -> Option<CoherenceMap<'a>> {
        let values = ArrayView2::from_shape(self.size, values).ok()?;
        Some(CoherenceMap { label, values, top })
    }
}

/// Smallest, middle and largest value of those that are known.
fn spread(image: &[f32]) -> [f64; 3] {
    let mut values: Vec<f32> = image.iter().copied().filter(|value| !value.is_nan()).collect();
    values.sort_unstable_by(f32::total_cmp);
    let at = |place: usize| values.get(place).map_or(f64::NAN, |&value| f64::from(value));
    [at(0), at(values.len() / 2), at(values.len().saturating_sub(1))]
}
