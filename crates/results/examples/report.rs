//! Writes a report of synthetic data, to look at: `report report.html [picture.svg]`.

#[allow(dead_code, reason = "the tests use more of it")]
#[path = "../tests/it/report/data.rs"]
mod data;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args_os().skip(1);
    let page = arguments
        .next()
        .ok_or("give the path of the page to write")?;
    let mut results = data::plausible();
    results.header.campaign = "Demonstration with synthetic data".to_owned();
    std::fs::write(page, results::report::render(&results)?.html)?;
    if let Some(picture) = arguments.next() {
        let gears = results.gears.as_ref().ok_or("no gears")?;
        let illustration = gears.illustrations.values().next_back();
        let drawing = &illustration.ok_or("no drawing")?.drawing;
        std::fs::write(picture, results::report::chart_gears(drawing)?)?;
    }
    Ok(())
}
