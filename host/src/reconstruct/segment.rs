//! stub
use crate::error::Result;
pub struct Hints { pub isos_px: Option<f64>, pub outer_segment_um: Option<f64> }
pub struct Surfaces { pub isos: Vec<f32>, pub ost: Vec<f32>, pub profile: Vec<f32>, pub origin: f64 }
pub fn segment(_mean: &[f32], shape: [usize; 3], _um: f64, hints: &Hints) -> Result<Surfaces> {
    let n = shape[1] * shape[2];
    let z = hints.isos_px.unwrap_or(50.0) as f32;
    Ok(Surfaces { isos: vec![z; n], ost: vec![z + 5.5; n], profile: vec![], origin: 0.0 })
}
