//! The five number types of the written files, each with its name in NPY and in Zarr.

use bytemuck::NoUninit;
use num_complex::Complex32;
use zarrs::array::{DataType, FillValue, data_type};

/// A number that the writers know.
pub(crate) trait Element: zarrs::array::Element + NoUninit {
    /// NumPy's type string, little-endian.
    const NPY_TYPE: &'static str;

    /// Bytes of a real number: of a complex one, each part is turned round by itself where the machine is big-endian.
    const PART: usize = size_of::<Self>();

    /// Zarr's data type.
    fn data_type() -> DataType;

    /// What a reader finds where nothing was written.
    fn fill_value() -> FillValue;
}

impl Element for u16 {
    const NPY_TYPE: &'static str = "<u2";

    fn data_type() -> DataType {
        data_type::uint16()
    }

    fn fill_value() -> FillValue {
        FillValue::from(0_u16)
    }
}

impl Element for f32 {
    const NPY_TYPE: &'static str = "<f4";

    fn data_type() -> DataType {
        data_type::float32()
    }

    fn fill_value() -> FillValue {
        FillValue::from(Self::NAN)
    }
}

impl Element for f64 {
    const NPY_TYPE: &'static str = "<f8";

    fn data_type() -> DataType {
        data_type::float64()
    }

    fn fill_value() -> FillValue {
        FillValue::from(Self::NAN)
    }
}

impl Element for bool {
    const NPY_TYPE: &'static str = "|b1";

    fn data_type() -> DataType {
        data_type::bool()
    }

    fn fill_value() -> FillValue {
        FillValue::from(false)
    }
}

impl Element for Complex32 {
    const NPY_TYPE: &'static str = "<c8";
    const PART: usize = size_of::<f32>();

    fn data_type() -> DataType {
        data_type::complex64()
    }

    fn fill_value() -> FillValue {
        FillValue::from(Self::new(0.0, 0.0))
    }
}
