//! Writes a report of synthetic data, to look at: `report report.html [picture.svg]`.

#[allow(dead_code, reason = "the tests use more of it")]
#[path = "../tests/it/report/data/mod.rs"]
mod data;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args_os().skip(1);
    let page = arguments
        .next()
        .ok_or("give the path of the page to write")?;
    let mut report = data::plausible();
    report.snapshot.campaign.name = "Demonstration with synthetic data".to_owned();
    std::fs::write(page, results::report::render(&report)?.html)?;
    if let Some(picture) = arguments.next() {
        let gears = report.gears.as_ref().ok_or("no gears")?;
        let illustration = gears.illustrations.values().next_back();
        let drawing = &illustration.ok_or("no drawing")?.drawing;
        let chart = results::report::charts::gears(drawing)?;
        std::fs::write(picture, chart.standalone())?;
    }
    Ok(())
}
