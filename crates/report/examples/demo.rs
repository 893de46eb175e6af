//! Writes a report of synthetic data, to look at: `demo report.html [picture.svg]`.

#[path = "../tests/it/data.rs"]
mod data;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args_os().skip(1);
    let page = arguments
        .next()
        .ok_or("give the path of the page to write")?;
    let mut results = data::plausible();
    results.header.campaign = "Demonstration with synthetic data".to_owned();
    std::fs::write(page, report::render(&results)?.html)?;
    if let Some(picture) = arguments.next() {
        let best = results
            .approaches
            .last()
            .and_then(|a| a.outcome.as_ref().ok());
        let drawing = best
            .and_then(|optimum| optimum.drawing.as_ref())
            .ok_or("no drawing")?;
        std::fs::write(picture, report::chart_gears(drawing)?)?;
    }
    Ok(())
}
