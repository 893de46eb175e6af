//! Compiles `proto/` with a pure Rust compiler, so the machine needs no `protoc`, and computes the digest of the
//! sources.

#![expect(
    clippy::disallowed_methods,
    reason = "cargo tells build scripts its folders by variables"
)]

use std::error::Error;
use std::path::{Path, PathBuf};

#[path = "src/identity/sources.rs"]
mod sources;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::var("CARGO_MANIFEST_DIR")?);
    let workspace = folder
        .ancestors()
        .nth(2)
        .ok_or("the crate lies in crates/ of its workspace")?;
    compile_protocol(workspace)?;
    for root in sources::roots(workspace)? {
        println!("cargo:rerun-if-changed={}", root.display());
    }
    println!(
        "cargo:rustc-env=PITCHLINE_SOURCES={}",
        sources::digest(workspace)?
    );
    Ok(())
}

fn compile_protocol(workspace: &Path) -> Result<(), Box<dyn Error>> {
    let root = workspace.join("proto");
    let file = root.join("pitchline/v1/pitchline.proto");
    println!("cargo:rerun-if-changed={}", root.display());
    let descriptors = protox::compile([&file], [&root])?;
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    std::fs::write(
        out.join("pitchline.bin"),
        protox::prost::Message::encode_to_vec(&descriptors),
    )?;
    let mut code = tonic_prost_build::configure();
    // Shards are files of leases.
    for message in ["Unit", "LeaseId", "Lease", "Design", "Candidate"] {
        code = code.type_attribute(
            format!("pitchline.v1.{message}"),
            "#[derive(serde::Serialize, serde::Deserialize)]",
        );
    }
    code.compile_fds(descriptors)?;
    Ok(())
}
