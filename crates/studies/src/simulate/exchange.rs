//! A simulated pair as files for other programs: its data sheet, profiles for measuring machines, outlines for CAD.

use std::fmt::Write as _;

use gear::{Member, Pair};
use results::sheet::{self, Section};
use results::table::{Column, Table};

use super::Subject;

mod rexs;

pub use rexs::{PairImport, import};

/// Points on each involute and each fillet of a profile and of an outline.
const POINTS: usize = 40;

/// Points closer than this are one, mm.
const SAME_MM: f64 = 1e-9;

/// The files by name.
///
/// # Errors
///
/// A table cannot be written.
pub(super) fn files(
    subject: &Subject<'_>,
    pair: &Pair,
    sections: &[Section],
) -> anyhow::Result<Vec<(&'static str, Vec<u8>)>> {
    let sheet = serde_json::to_vec_pretty(&sheet::json(sections))?;
    let rexs = rexs::write(subject.title, subject.program_version, subject.file, pair);
    Ok(vec![
        ("pair.rexs", rexs.into_bytes()),
        ("sheet.json", sheet),
        ("profiles.csv", profiles(pair).csv()?),
        (
            "pinion.dxf",
            dxf(&outline(pair, Member::Pinion)).into_bytes(),
        ),
        ("mate.dxf", dxf(&outline(pair, Member::Gear)).into_bytes()),
    ])
}

/// The transverse profile of one tooth of each gear: the points where the flanks are involutes have a roll angle.
fn profiles(pair: &Pair) -> Table {
    let numbers = [
        "x_mm",
        "y_mm",
        "modified_x_mm",
        "modified_y_mm",
        "radius_mm",
        "roll_angle_deg",
        "modification_um",
    ];
    let columns = [Column::text("gear")]
        .into_iter()
        .chain(numbers.map(Column::number));
    let mut table = Table::new(columns.collect());
    for (member, name) in Member::BOTH.into_iter().zip(["pinion", "mate"]) {
        let points = gear::tooth_profile(pair, member, POINTS);
        table.rows.extend(points.iter().map(|point| {
            vec![
                name.into(),
                point.nominal[0].into(),
                point.nominal[1].into(),
                point.modified[0].into(),
                point.modified[1].into(),
                point.radius.into(),
                point.roll_angle.map(f64::to_degrees).into(),
                (1e3 * point.depth).into(),
            ]
        }));
    }
    table
}

/// The outline of a gear without points that coincide.
fn outline(pair: &Pair, member: Member) -> Vec<[f64; 2]> {
    let mut outline = gear::gear_outline(pair, member, POINTS);
    let apart = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) > SAME_MM;
    outline.dedup_by(|a, b| !apart(a, b));
    while let [first, .., last] = &outline[..]
        && !apart(first, last)
    {
        outline.pop();
    }
    outline
}

/// A closed polyline as a drawing in DXF, release 12, whose unit is the millimetre.
fn dxf(outline: &[[f64; 2]]) -> String {
    // $INSUNITS is younger than release 12; programs that know it take it from there, too.
    let mut text = "0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n9\n$INSUNITS\n70\n4\n0\nENDSEC\n\
                    0\nSECTION\n2\nENTITIES\n0\nPOLYLINE\n8\nGEAR\n66\n1\n10\n0.0\n20\n0.0\n30\n0.0\n70\n1\n"
        .to_owned();
    for [x, y] in outline {
        // Writing to a string does not fail.
        let _ = write!(
            text,
            "0\nVERTEX\n8\nGEAR\n10\n{x:.9}\n20\n{y:.9}\n30\n0.0\n"
        );
    }
    text + "0\nSEQEND\n8\nGEAR\n0\nENDSEC\n0\nEOF\n"
}

#[cfg(test)]
mod tests;
