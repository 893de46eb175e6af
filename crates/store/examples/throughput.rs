//! How fast the store takes samples and gives them back: `throughput [DESIGNS] [SAMPLES] [FILE]`.
//!
//! Four callers submit one batch per design, as four busy workers would.

#![expect(clippy::print_stdout, reason = "a program for the command line")]

use std::time::Instant;

use store::{Batch, CampaignRow, DesignRow, Error, SampleRow, Store};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let designs: u64 = arguments.next().map_or(Ok(1000), |a| a.parse())?;
    let samples: u64 = arguments.next().map_or(Ok(500), |a| a.parse())?;
    let path = arguments
        .next()
        .map_or_else(|| std::env::temp_dir().join("throughput.db"), Into::into);
    let campaign = CampaignRow {
        name: "throughput".into(),
        file_text: String::new(),
        digest: format!("{designs} {samples}"),
        seed: 0,
        program_version: env!("CARGO_PKG_VERSION").into(),
        model_digest: None,
    };
    let store = Store::create_or_open(&path, &campaign).await?;
    let rows: Vec<DesignRow> = (0..designs)
        .map(|design| DesignRow {
            design,
            x_p: 0.0,
            x_r: 0.0,
            ha0_p: 1.0,
            ha0_r: 1.0,
            hf0_p: 1.0,
            hf0_r: 1.0,
        })
        .collect();
    store.put_designs(&rows).await?;

    let start = Instant::now();
    let mut callers = tokio::task::JoinSet::new();
    for caller in 0..4 {
        let writer = store.writer()?;
        callers.spawn(async move {
            for design in (caller..designs).step_by(4) {
                let row = |sample| SampleRow {
                    design,
                    sample,
                    delta_ste_um: 1.0 / (sample + 1) as f64,
                };
                let samples = (0..samples).map(row).collect();
                writer
                    .submit(Batch {
                        samples,
                        ..Batch::default()
                    })
                    .await?;
            }
            Ok::<(), Error>(())
        });
    }
    while let Some(caller) = callers.join_next().await {
        caller??;
    }
    println!(
        "{} samples stored in {:.2?}",
        designs * samples,
        start.elapsed()
    );

    let start = Instant::now();
    let missing = store.missing_work(samples).await?;
    println!(
        "missing work found ({} designs) in {:.2?}",
        missing.len(),
        start.elapsed()
    );
    let start = Instant::now();
    let digest = store.samples_digest().await?;
    println!("digest {} in {:.2?}", &digest[..16], start.elapsed());
    let start = Instant::now();
    println!("{:?} in {:.2?}", store.progress().await?, start.elapsed());
    let start = Instant::now();
    store.close().await?;
    println!("closed in {:.2?}", start.elapsed());
    let start = Instant::now();
    Store::create_or_open(&path, &campaign).await?;
    println!("opened and checked again in {:.2?}", start.elapsed());
    Ok(())
}
