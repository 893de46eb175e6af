//! A block of consecutive samples of one stream: a row of their table.

use ledger::StreamId;
use stats::Samples;

use crate::Error;
use crate::row::{Columns, Row};
use crate::values::key;

/// Consecutive samples of one stream.
#[derive(Debug, Clone, PartialEq)]
pub struct SampleBlock {
    /// The design, optimum or infill point.
    pub stream: StreamId,
    /// Index of the first sample.
    pub first_sample: u64,
    /// The samples, with a value for each sampled response.
    pub samples: Samples,
}

impl SampleBlock {
    /// The index after the last sample.
    #[must_use]
    pub fn end(&self) -> u64 {
        self.first_sample.saturating_add(self.samples.len() as u64)
    }

    /// The samples with their indices.
    pub fn indexed(&self) -> impl Iterator<Item = (u64, &[f64])> {
        (self.first_sample..self.end()).zip(self.samples.rows())
    }

    /// Refuses samples that SQLite would not return unchanged.
    pub(crate) fn refuse_unstorable(&self) -> Result<(), Error> {
        let last = (self.samples.len() as u64).saturating_sub(1);
        let last = self.first_sample.saturating_add(last);
        if i64::try_from(last).is_err() {
            return Err(Error::TooLarge {
                column: "sample_block.first_sample".to_owned(),
                value: last,
            });
        }
        match self
            .samples
            .values()
            .iter()
            .position(|value| value.is_nan())
        {
            None => Ok(()),
            Some(place) => {
                let sample = self.first_sample + (place / self.samples.width()) as u64;
                Err(Error::NotFinite {
                    column: "sample_block.samples".to_owned(),
                    key: format!("sample {sample} of {}", self.stream),
                    value: f64::NAN,
                })
            }
        }
    }
}

/// A block with the number of its origin.
#[derive(Debug, PartialEq)]
pub(crate) struct StoredBlock {
    pub(crate) block: SampleBlock,
    pub(crate) origin: Option<i64>,
}

impl Row for StoredBlock {
    const TABLE: &'static str = "sample_block";

    fn key(&self) -> String {
        let SampleBlock {
            first_sample,
            stream,
            ..
        } = self.block;
        format!("first_sample {first_sample} of {stream}")
    }

    fn add_to(&self, columns: &mut Columns) {
        columns
            .stream(self.block.stream)
            .count("first_sample", self.block.first_sample)
            .count("responses", self.block.samples.width() as u64)
            .outcomes("samples", self.block.samples.values())
            .option(self.origin.map(i64::cast_unsigned), Columns::bits);
    }
}

/// A set of streams.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Streams {
    /// The designs of the DoE.
    Designs,
    One(StreamId),
    All,
}

impl Streams {
    /// The least and the greatest key.
    pub(crate) fn keys(self) -> (i64, i64) {
        match self {
            Self::Designs => (0, key(StreamId::point(0)) - 1),
            Self::One(stream) => (key(stream), key(stream)),
            Self::All => (0, i64::MAX),
        }
    }
}
