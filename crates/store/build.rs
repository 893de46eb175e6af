//! Applies the migrations to a scratch database, against which `sqlx::query!` checks every
//! statement. Building the store therefore needs no installed or running database.

#![expect(
    clippy::disallowed_methods,
    reason = "cargo tells build scripts its folders by variables"
)]

use std::error::Error;
use std::path::{Path, PathBuf};

use sqlx::Connection as _;
use sqlx::migrate::Migrator;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};

fn main() -> Result<(), Box<dyn Error>> {
    let migrations = Path::new("../../migrations");
    println!("cargo:rerun-if-changed={}", migrations.display());
    println!("cargo:rerun-if-changed=build.rs");
    for entry in std::fs::read_dir(migrations)? {
        println!("cargo:rerun-if-changed={}", entry?.path().display());
    }

    let out_dir = std::env::var_os("OUT_DIR").ok_or("cargo sets OUT_DIR for build scripts")?;
    let scratch = PathBuf::from(out_dir).join("schema.db");
    if scratch.exists() {
        std::fs::remove_file(&scratch)?;
    }
    tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?
        .block_on(async {
            let options = SqliteConnectOptions::new()
                .filename(&scratch)
                .create_if_missing(true);
            let mut connection = SqliteConnection::connect_with(&options).await?;
            Migrator::new(migrations)
                .await?
                .run(&mut connection)
                .await?;
            connection.close().await?;
            Ok::<(), Box<dyn Error>>(())
        })?;

    println!(
        "cargo:rustc-env=DATABASE_URL=sqlite://{}",
        scratch.display()
    );
    // A `SQLX_OFFLINE` set by the user would make the macros look for a query cache, which the
    // repository does not keep.
    println!("cargo:rustc-env=SQLX_OFFLINE=false");
    Ok(())
}
