//! The hash of what an image is made of, which it says in its hello.

use crate::{Result, folders};
use std::fs;
use std::path::{Path, PathBuf};

/// FNV-1a of all sources in these files and folders of the workspace, in the order of their names.
pub(super) fn hash(places: &[&str]) -> Result<u32> {
    let mut files = Vec::new();
    for place in places {
        let path = folders::workspace().join(place);
        if path.is_dir() { collect(&path, &mut files)? } else { files.push(path) }
    }
    files.sort();
    let mut hash = 0x811C_9DC5_u32;
    for file in files {
        let bytes = fs::read(&file).map_err(|e| format!("cannot read {}: {e}", file.display()))?;
        for byte in bytes {
            hash = (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193);
        }
    }
    Ok(hash)
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> Result {
    let failed = |e: std::io::Error| format!("cannot read {}: {e}", folder.display());
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_dir() { collect(&path, files)? } else { files.push(path) }
    }
    Ok(())
}
