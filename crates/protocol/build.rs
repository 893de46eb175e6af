//! Compiles `proto/` with a pure Rust compiler, so the machine needs no `protoc`.

#![expect(
    clippy::disallowed_methods,
    reason = "cargo tells build scripts its folders by variables"
)]

use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let root = PathBuf::from(std::env::var("CARGO_MANIFEST_DIR")?).join("../../proto");
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
