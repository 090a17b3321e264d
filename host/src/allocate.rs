//! Large buffers that fail with a message instead of ending the program.

#[cfg(target_os = "linux")]
mod pages;

use crate::error::{Error, Result};

/// An empty vector with room for `len` elements.
///
/// # Errors
/// When the machine refuses the memory.
pub fn reserve<T>(len: usize, what: &str) -> Result<Vec<T>> {
    let mut buffer = Vec::new();
    buffer.try_reserve_exact(len).map_err(|_| {
        let mebibytes = (len as u128 * size_of::<T>() as u128) >> 20;
        Error::failed(format!("not enough memory: {what} need {mebibytes} MiB"))
    })?;
    #[cfg(target_os = "linux")]
    pages::advise(&mut buffer);
    Ok(buffer)
}

/// `len` default values (zeros).
///
/// # Errors
/// When the machine refuses the memory.
pub fn zeros<T: Clone + Default>(len: usize, what: &str) -> Result<Vec<T>> {
    filled(T::default(), len, what)
}

/// `len` copies of `value`.
///
/// # Errors
/// When the machine refuses the memory.
pub fn filled<T: Clone>(value: T, len: usize, what: &str) -> Result<Vec<T>> {
    let mut buffer = reserve(len, what)?;
    buffer.resize(len, value);
    Ok(buffer)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_much_is_an_error() {
        let error = zeros::<u64>(usize::MAX / 16, "test buffers").unwrap_err();
        assert!(error.to_string().contains("test buffers"), "{error}");
        assert_eq!(error.exit_status(), 1);
    }
}
