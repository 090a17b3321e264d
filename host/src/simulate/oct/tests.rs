//! The whole recording against what it was made from.
