//! The five number types of the written files, each with its name in NPY and in Zarr.

use num_complex::Complex32;
use zarrs::array::{DataType, FillValue, data_type};

/// A number that the writers know.
pub(crate) trait Element: zarrs::array::Element + Copy {
    /// NumPy's type string, little-endian.
    const NPY_TYPE: &'static str;

    /// Append the little-endian bytes of one number.
    fn append_to(self, bytes: &mut Vec<u8>);

    /// Zarr's data type.
    fn data_type() -> DataType;

    /// What a reader finds where nothing was written.
    fn fill_value() -> FillValue;
}

impl Element for u16 {
    const NPY_TYPE: &'static str = "<u2";

    fn append_to(self, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(&self.to_le_bytes());
    }

    fn data_type() -> DataType {
        data_type::uint16()
    }

    fn fill_value() -> FillValue {
        FillValue::from(0_u16)
    }
}

impl Element for f32 {
    const NPY_TYPE: &'static str = "<f4";

    fn append_to(self, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(&self.to_le_bytes());
    }

    fn data_type() -> DataType {
        data_type::float32()
    }

    fn fill_value() -> FillValue {
        FillValue::from(Self::NAN)
    }
}

impl Element for f64 {
    const NPY_TYPE: &'static str = "<f8";

    fn append_to(self, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(&self.to_le_bytes());
    }

    fn data_type() -> DataType {
        data_type::float64()
    }

    fn fill_value() -> FillValue {
        FillValue::from(Self::NAN)
    }
}

impl Element for bool {
    const NPY_TYPE: &'static str = "|b1";

    fn append_to(self, bytes: &mut Vec<u8>) {
        bytes.push(u8::from(self));
    }

    fn data_type() -> DataType {
        data_type::bool()
    }

    fn fill_value() -> FillValue {
        FillValue::from(false)
    }
}

impl Element for Complex32 {
    const NPY_TYPE: &'static str = "<c8";

    fn append_to(self, bytes: &mut Vec<u8>) {
        self.re.append_to(bytes);
        self.im.append_to(bytes);
    }

    fn data_type() -> DataType {
        data_type::complex64()
    }

    fn fill_value() -> FillValue {
        FillValue::from(Self::new(0.0, 0.0))
    }
}
