//! The methods that are compared, always in this order.

use crate::error::Result;
use crate::figures::style;
use crate::method::Method;
use phasewalk_core::weights::Weighting;

/// Place of the direct difference to the fifth frame in [`METHODS`].
pub const DIRECT: usize = 0;
/// Place of the Knox-Thompson walk in single steps.
pub const ONE_STEP: usize = 1;
/// Place of the paper's extended Knox-Thompson method.
pub const PAPER: usize = 2;
/// Place of linked phases, which the paper does not have.
pub const LINKED: usize = 3;

/// The methods.
pub const METHODS: [Method; 4] =
    [Method::Direct, Method::OneStep, Method::Paper(Weighting::Paper), Method::Linked];

/// Their names for people.
pub const NAMES: [&str; 4] =
    [style::DIRECT_NAME, style::ONE_STEP_NAME, style::EXTENDED_NAME, style::LINKED_NAME];

/// One value for each of [`METHODS`].
pub type ByMethod<T> = [T; 4];

/// Compute the value of every method.
///
/// # Errors
/// The first error of `value`.
pub fn by_method<T>(mut value: impl FnMut(Method) -> Result<T>) -> Result<ByMethod<T>> {
    let [direct, one_step, paper, linked] = METHODS;
    Ok([value(direct)?, value(one_step)?, value(paper)?, value(linked)?])
}
