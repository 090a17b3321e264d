//! Zarr v3 groups, the native container.
//!
//! | file | what it holds |
//! |---|---|
//! | `node` | the metadata of a group or an array, as stored |
//! | `reader` | opening the arrays, with messages for what can be wrong |
//! | `series` | complex frames, read row by row |
//! | `appender` | an array that grows by whole images |
//! | `writer` | a group of arrays, written in pieces |

mod appender;
mod node;
mod reader;
mod series;
mod writer;

pub(crate) use appender::ImageAppender;
pub(crate) use node::{ArrayNode, Node};
pub(crate) use reader::{
    ReadableArray, cannot_read, find_array, open_array, read_coordinate, read_flags,
    single_threaded,
};
pub(crate) use series::{ZarrSeries, holds_doubles};
pub(crate) use writer::{ArrayWriter, Compression, GroupWriter, Layout};

/// Errors of the library span several lines at times; ours have one.
fn one_line(error: &impl std::fmt::Display) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}
