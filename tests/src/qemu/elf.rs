//! What an image's file says of itself.

use object::{Object, ObjectSection, ObjectSymbol};
use std::path::Path;

/// The address of a symbol.
pub fn symbol(image: &Path, name: &str) -> Option<u32> {
    let bytes = std::fs::read(image).ok()?;
    let file = object::File::parse(&*bytes).ok()?;
    let symbol = file.symbols().find(|symbol| symbol.name() == Ok(name))?;
    Some(symbol.address() as u32)
}

/// Bytes of these sections.
pub fn sections(image: &Path, names: &[&str]) -> u64 {
    let bytes = std::fs::read(image).expect("the image can be read");
    let file = object::File::parse(&*bytes).expect("it is an ELF file");
    let sections = names.iter().filter_map(|name| file.section_by_name(name));
    sections.map(|section| section.size()).sum()
}
