//! The NumPy files that go in, written here byte by byte, and those that come out, read by `npyz`.

use num_complex::Complex32;
use std::fs;
use std::path::Path;

/// Write any array: type as NumPy names it, such as `<c8`, shape, and the bytes behind the header.
///
/// # Panics
/// If the file cannot be written.
pub fn save_bytes(path: &Path, data_type: &str, shape: &[usize], data: &[u8]) {
    let lengths: String = shape.iter().map(|n| format!("{n},")).collect();
    let mut text =
        format!("{{'descr': '{data_type}', 'fortran_order': False, 'shape': ({lengths}), }}");
    while (text.len() + 11) % 64 != 0 {
        text.push(' ');
    }
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes.extend(data);
    fs::write(path, bytes).expect("the file can be written");
}

/// Write a complex64 array.
pub fn save_complex(path: &Path, shape: &[usize], values: &[Complex32]) {
    let data: Vec<u8> =
        values.iter().flat_map(|u| [u.re.to_le_bytes(), u.im.to_le_bytes()]).flatten().collect();
    save_bytes(path, "<c8", shape, &data);
}

/// Write a boolean array.
pub fn save_mask(path: &Path, shape: &[usize], mask: &[bool]) {
    let data: Vec<u8> = mask.iter().map(|&inside| u8::from(inside)).collect();
    save_bytes(path, "|b1", shape, &data);
}

/// Shape and numbers of a float32 array.
///
/// # Panics
/// If the file is none.
#[must_use]
pub fn load_f32(path: &Path) -> (Vec<usize>, Vec<f32>) {
    load(path)
}

/// Shape and numbers of a float64 array.
///
/// # Panics
/// If the file is none.
#[must_use]
pub fn load_f64(path: &Path) -> (Vec<usize>, Vec<f64>) {
    load(path)
}

/// Shape and numbers of a boolean array.
///
/// # Panics
/// If the file is none.
#[must_use]
pub fn load_mask(path: &Path) -> (Vec<usize>, Vec<bool>) {
    load(path)
}

/// Shape and numbers of a complex64 array.
///
/// # Panics
/// If the file is none.
#[must_use]
pub fn load_complex(path: &Path) -> (Vec<usize>, Vec<Complex32>) {
    load(path)
}

fn load<T: npyz::Deserialize>(path: &Path) -> (Vec<usize>, Vec<T>) {
    let bytes = fs::read(path).expect("the file is there");
    let file = npyz::NpyFile::new(bytes.as_slice()).expect("it is an .npy file");
    let shape = file.shape().iter().map(|&n| n as usize).collect();
    (shape, file.into_vec().expect("it holds numbers of this type"))
}
