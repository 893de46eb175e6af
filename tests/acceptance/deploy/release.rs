//! The archive and the Debian package that `deploy/release` makes.

use std::path::Path;
use std::process::Command;

use acceptance::{Sandbox, assert_code, errors, printed, programs, root, skipped};

/// Runs a command that must succeed; returns what it printed.
fn done(command: &mut Command) -> String {
    let output = command.output().expect("it starts");
    assert_code(&output, 0);
    printed(&output)
}

#[test]
fn archive_and_package_have_programs_manuals_and_licences() {
    let sandbox = Sandbox::new();
    let out = sandbox.path("out");
    let mut release = Command::new(root().join("deploy/release"));
    release
        .arg("--out")
        .arg(&out)
        .arg("--programs")
        .arg(programs());
    release.args(["--without", "wheel,image,sbom"]);
    let output = release.output().expect("bash is there");
    if errors(&output).contains("dpkg-deb is missing") {
        skipped("dpkg is not installed");
        return;
    }
    assert_code(&output, 0);
    done(
        Command::new("sha256sum")
            .args(["--check", "--strict", "SHA256SUMS"])
            .current_dir(&out),
    );

    let name = format!(
        "pitchline-{}-{}-linux",
        env!("CARGO_PKG_VERSION"),
        std::env::consts::ARCH
    );
    let unpacked = sandbox.path("unpacked");
    std::fs::create_dir(&unpacked).unwrap();
    let archive = out.join(format!("{name}.tar.gz"));
    done(
        Command::new("tar")
            .arg("xzf")
            .arg(&archive)
            .arg("-C")
            .arg(&unpacked),
    );
    let mut packages = std::fs::read_dir(&out)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let package = packages.find(|path| path.extension().is_some_and(|end| end == "deb"));
    let package = package.expect("a Debian package");
    let control = done(Command::new("dpkg-deb").arg("--field").arg(&package));
    assert!(control.contains("Depends: libc6 (>= 2."), "{control}");
    let installed = sandbox.path("installed");
    done(
        Command::new("dpkg-deb")
            .arg("--extract")
            .arg(&package)
            .arg(&installed),
    );

    for (tree, manual) in [
        (unpacked.join(&name), "coordinator.1"),
        (installed.join("usr"), "coordinator.1.gz"),
    ] {
        for program in ["coordinator", "worker"] {
            let version = done(Command::new(tree.join("bin").join(program)).arg("--version"));
            assert!(version.contains(env!("CARGO_PKG_VERSION")), "{version}");
        }
        assert!(tree.join("share/man/man1").join(manual).exists());
        licences_are_complete(&tree.join("share/doc/pitchline"));
    }
}

/// Every linked crate has a folder of texts, or is listed with its licence.
fn licences_are_complete(doc: &Path) {
    let crates = std::fs::read_to_string(doc.join("licences.txt")).unwrap();
    let missing = std::fs::read_to_string(doc.join("licences/missing.txt")).unwrap();
    let names: Vec<&str> = crates
        .lines()
        .filter_map(|line| line.split(' ').next())
        .collect();
    assert!(names.len() > 100, "{crates}");
    for name in names {
        let has_text = doc.join("licences").join(name).is_dir();
        assert!(
            has_text != missing.contains(&format!("{name}: ")),
            "{name} has no licence text, and is not listed"
        );
    }
    assert!(doc.join("LICENSE-MIT").exists() && doc.join("examples/campaigns/pair.toml").exists());
}
