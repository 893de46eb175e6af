//! Computes the digest of the sources, and recomputes it when one of them changes.

#![expect(
    clippy::disallowed_methods,
    reason = "cargo tells build scripts its folders by variables"
)]

use std::error::Error;
use std::path::Path;

#[path = "src/sources.rs"]
mod sources;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::var_os("CARGO_MANIFEST_DIR").ok_or("cargo sets CARGO_MANIFEST_DIR")?;
    let workspace = Path::new(&folder)
        .ancestors()
        .nth(2)
        .ok_or("the crate lies in crates/ of its workspace")?;
    for root in sources::roots(workspace)? {
        println!("cargo:rerun-if-changed={}", root.display());
    }
    println!(
        "cargo:rustc-env=PITCHLINE_SOURCES={}",
        sources::digest(workspace)?
    );
    Ok(())
}
