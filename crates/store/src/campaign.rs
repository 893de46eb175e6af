//! The campaign that a store belongs to.

use crate::Error;
use crate::connection::Connection;
use crate::derived::{self, DerivedResult};
use crate::receipt::Receipt;
use crate::row::{self, Columns, Row};

/// The campaign that a store belongs to: its only row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CampaignRow {
    /// The campaign's name.
    pub name: String,
    /// The text of the campaign file.
    pub file_text: String,
    /// Digest of the file's canonical content, in hex. Two files with the same digest are the same
    /// campaign.
    pub digest: String,
    /// The seed of every random stream.
    pub seed: u64,
    /// Version of the program that created the store.
    pub program_version: String,
    /// Digest of the gear model that filled the store; `None` until
    /// [`pin_model_digest`](crate::Store::pin_model_digest).
    pub model_digest: Option<String>,
}

impl Row for CampaignRow {
    const TABLE: &'static str = "campaign";

    fn key(&self) -> String {
        "one 1".to_owned()
    }

    fn add_to(&self, columns: &mut Columns) {
        columns
            .text(&self.name)
            .text(&self.file_text)
            .text(&self.digest)
            .bits(self.seed)
            .text(&self.program_version)
            .option(self.model_digest.as_deref(), Columns::text);
    }
}

pub(crate) async fn read(connection: &mut Connection<'_>) -> Result<CampaignRow, Error> {
    let query = sqlx::query!(
        "SELECT name, file_text, digest, seed, program_version, model_digest, seal FROM campaign"
    );
    let row = connection.optional(query).await?;
    // A store is created together with its campaign.
    let row = row.ok_or_else(|| connection.damaged("its campaign row is missing"))?;
    let campaign = CampaignRow {
        name: row.name,
        file_text: row.file_text,
        digest: row.digest,
        seed: row.seed.cast_unsigned(),
        program_version: row.program_version,
        model_digest: row.model_digest,
    };
    connection.check(campaign, row.seal)
}

/// Stores the campaign, replacing the previous one.
pub(crate) async fn write(
    connection: &mut Connection<'_>,
    row: &CampaignRow,
) -> Result<Receipt, Error> {
    let seal = row::seal(row)?;
    let seed = row.seed.cast_signed();
    let query = sqlx::query!(
        "INSERT OR REPLACE INTO campaign
             (one, name, file_text, digest, seed, program_version, model_digest, seal)
         VALUES (1, ?, ?, ?, ?, ?, ?, ?)",
        row.name,
        row.file_text,
        row.digest,
        seed,
        row.program_version,
        row.model_digest,
        seal,
    );
    connection.execute(query).await?;
    Ok(Receipt::new(1))
}

/// Sets the digest of the gear model if there is none yet, and refuses another one.
pub(crate) async fn pin_model_digest(
    connection: &mut Connection<'_>,
    digest: &str,
) -> Result<Receipt, Error> {
    let mut row = read(connection).await?;
    match row.model_digest {
        Some(stored) if stored == digest => Ok(Receipt {
            duplicate_rows: 1,
            ..Receipt::default()
        }),
        Some(stored) => Err(Error::ModelDigestConflict {
            stored,
            offered: digest.to_owned(),
        }),
        None => {
            row.model_digest = Some(digest.to_owned());
            write(connection, &row).await
        }
    }
}

/// Replaces the campaign by a larger one and removes the responses, so that all results computed from them are found to
/// be outdated while the larger campaign samples.
pub(crate) async fn extend(
    connection: &mut Connection<'_>,
    row: &CampaignRow,
) -> Result<Receipt, Error> {
    let stored = read(connection).await?;
    if stored.seed != row.seed {
        return Err(Error::OtherSeed {
            stored: stored.seed,
            offered: row.seed,
        });
    }
    let row = CampaignRow {
        name: row.name.clone(),
        file_text: row.file_text.clone(),
        digest: row.digest.clone(),
        ..stored
    };
    derived::remove(connection, &[DerivedResult::Responses]).await?;
    write(connection, &row).await
}
