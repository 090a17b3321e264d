//! Zarr v3 groups, the native container.
//!
//! | file | what it holds |
//! |---|---|
//! | `node` | the metadata of a group or an array, as stored |
//! | `reader` | opening the arrays, with messages for what can be wrong |
//! | `series` | complex frames, read row by row |
//! | `writer` | a group of arrays, written in pieces |

mod node;
mod reader;
mod series;
mod writer;

pub(crate) use node::{ArrayNode, Node};
pub(crate) use reader::{read_coordinate, read_flags};
pub(crate) use series::ZarrSeries;
pub(crate) use writer::{ArrayWriter, Compression, GroupWriter, Layout};

/// Errors of the library span several lines at times; ours have one.
fn one_line(error: &impl std::fmt::Display) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}
