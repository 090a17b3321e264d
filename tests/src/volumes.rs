//! Groups of reconstructed volumes, written here byte by byte as Zarr v3 has them.

use crate::recording::Recording;
use num_complex::Complex32;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

/// A group as `phasewalk reconstruct` leaves it: the field of some depths, and what goes with it.
#[derive(Clone, Debug)]
pub struct Volumes {
    /// The field, (time, z, y, x).
    pub recording: Recording,
    /// Which sweeps are good.
    pub sweep_ok: Option<Vec<bool>>,
    /// Acquisition times, seconds.
    pub times_s: Option<Vec<f64>>,
    /// The group's attributes, a JSON object.
    pub attributes: Value,
}

impl Volumes {
    /// The field alone.
    #[must_use]
    pub fn new(recording: Recording) -> Self {
        Self { recording, sweep_ok: None, times_s: None, attributes: json!({}) }
    }

    /// Mark sweeps as bad and take their numbers away.
    pub fn lose(&mut self, sweeps: &[usize]) {
        let shape = self.recording.shape;
        let flags = self.sweep_ok.get_or_insert_with(|| vec![true; shape.frames]);
        for &sweep in sweeps {
            flags[sweep] = false;
        }
        for &sweep in sweeps {
            for z in 0..shape.depth {
                self.recording.image_mut(sweep, z).fill(Complex32::new(f32::NAN, f32::NAN));
            }
        }
    }

    /// The same without some sweeps, flags and all.
    #[must_use]
    pub fn without(&self, sweeps: &[usize]) -> Self {
        let shape = self.recording.shape;
        let kept: Vec<usize> = (0..shape.frames).filter(|t| !sweeps.contains(t)).collect();
        let mut recording = self.recording.clone();
        let volumes = recording.field.chunks(shape.depth * recording.pixels());
        let volumes: Vec<_> = volumes.map(<[Complex32]>::to_vec).collect();
        recording.field = kept.iter().flat_map(|&t| volumes[t].clone()).collect();
        recording.shape.frames = kept.len();
        let times_s = self.times_s.as_ref().map(|times| kept.iter().map(|&t| times[t]).collect());
        Self { recording, sweep_ok: None, times_s, attributes: self.attributes.clone() }
    }

    /// Write the group, one chunk per volume.
    ///
    /// # Panics
    /// If it cannot be written.
    pub fn save(&self, path: &Path) {
        let group = json!({"zarr_format": 3, "node_type": "group", "attributes": self.attributes});
        fs::create_dir(path).expect("the folder can be made");
        fs::write(path.join("zarr.json"), group.to_string()).expect("the group can be written");
        let shape = self.recording.shape;
        let lengths = [shape.frames, shape.depth, shape.height, shape.width];
        let bytes = |u: &Complex32| [u.re.to_le_bytes(), u.im.to_le_bytes()].concat();
        let field: Vec<u8> = self.recording.field.iter().flat_map(bytes).collect();
        save_array(&path.join("field"), ("complex64", json!([0.0, 0.0])), &lengths, &field);
        if let Some(flags) = &self.sweep_ok {
            let flags: Vec<u8> = flags.iter().map(|&ok| u8::from(ok)).collect();
            save_array(&path.join("sweep_ok"), ("bool", json!(false)), &[flags.len()], &flags);
        }
        if let Some(times) = &self.times_s {
            let bytes: Vec<u8> = times.iter().flat_map(|time| time.to_le_bytes()).collect();
            save_array(&path.join("time_s"), ("float64", json!(0.0)), &[times.len()], &bytes);
        }
    }
}

/// An array of `(data type, fill value)`: one chunk for each index of the first axis, but a single one
/// where there is no other axis.
fn save_array(path: &Path, (data_type, fill_value): (&str, Value), shape: &[usize], data: &[u8]) {
    let mut chunk = shape.to_vec();
    if chunk.len() > 1 {
        chunk[0] = 1;
    }
    let metadata = json!({
        "zarr_format": 3,
        "node_type": "array",
        "shape": shape,
        "data_type": data_type,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": chunk}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "fill_value": fill_value,
        "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}],
        "attributes": {},
    });
    fs::create_dir(path).expect("the folder can be made");
    fs::write(path.join("zarr.json"), metadata.to_string()).expect("the array can be written");
    let chunks = shape[0] / chunk[0];
    for (n, bytes) in data.chunks(data.len() / chunks).enumerate() {
        let mut file = path.join("c").join(n.to_string());
        for _ in 1..shape.len() {
            file.push("0");
        }
        fs::create_dir_all(file.parent().expect("it lies in c")).expect("a folder of chunks");
        fs::write(file, bytes).expect("the chunk can be written");
    }
}
