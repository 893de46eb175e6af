//! Single flipped bits in the pages that lead to rows: indexes, and tables that are kept like one.

use std::collections::BTreeMap;
use std::fs;

use store::{Error, Store};

use crate::damage::with_every_row;
use crate::{campaign, folder, read};

/// Bytes of a page.
const PAGE: usize = 4096;

/// Everything that decides what a coordinator does next.
async fn answers(store: &Store) -> Result<String, Error> {
    store.checked().await?;
    let told = (
        store.progress().await?,
        store.missing_work(100, &BTreeMap::new()).await?,
        store.sample_tallies().await?,
        store.criteria().await?,
        store.responses().await?,
        store.derivations().await?,
        store.models().await?,
        store.optimiser_runs().await?,
    );
    let rest = (
        store.evaluated().await?,
        store.optima().await?,
        store.infill().await?,
        store.stream_histories().await?,
        store.failure_groups().await?,
        store.knows_failure("w", 1).await?,
        store.generations().await?,
    );
    Ok(format!("{told:?} {rest:?}"))
}

/// The first bytes of index pages, leaves and inner ones: <https://www.sqlite.org/fileformat2.html> 1.6.
const INDEX: [u8; 2] = [0x0a, 0x02];

#[tokio::test]
async fn a_bit_that_flipped_in_an_index_is_found_or_changes_nothing() {
    let (_folder, path) = folder();
    with_every_row(&path).await;
    let whole = read(&path);
    let store = Store::open_read_only(&path).await.unwrap();
    let sound = answers(&store).await.unwrap();
    store.close().await.unwrap();

    let starts = (PAGE..whole.len()).step_by(PAGE);
    let pages: Vec<usize> = starts.filter(|at| INDEX.contains(&whole[*at])).collect();
    assert!(pages.len() > 5, "{} pages", pages.len());
    let mut found = 0;
    for page in pages {
        let used = (page..page + PAGE).filter(|at| whole[*at] != 0);
        // The first bytes locate all others.
        let some = used.enumerate().filter(|(i, _)| *i < 16 || i % 23 == 0);
        for (i, at) in some {
            let mut bytes = whole.clone();
            bytes[at] ^= 1 << (i % 8);
            fs::write(&path, &bytes).unwrap();
            let reading = match Store::open_read_only(&path).await {
                Ok(store) => {
                    let told = answers(&store).await;
                    store.close().await.unwrap();
                    told
                }
                Err(error) => Err(error),
            };
            let writing = match Store::create_or_open(&path, &campaign()).await {
                Ok(store) => {
                    let told = answers(&store).await;
                    store.close().await.unwrap();
                    told
                }
                Err(error) => Err(error),
            };
            for told in [reading, writing] {
                match told {
                    Ok(told) => assert_eq!(told, sound, "byte {at}"),
                    Err(
                        Error::Damaged { .. }
                        | Error::DamagedRows { .. }
                        | Error::OtherSchema { .. },
                    ) => found += 1,
                    Err(other) => panic!("byte {at}: {other}"),
                }
            }
        }
    }
    assert!(found > 100, "{found}");
}
