//! Two gears in mesh, drawn to scale around the pitch point.

use super::HALF;
use crate::number;
use crate::report::drawing::{GearDrawing, GearOutline};
use crate::report::error::Error;
use crate::report::svg::{
    Canvas, Picture, Scale, Window, clip_polygon, clip_polyline, drawable, text_width,
};

/// Half the width shown, as a share of the centre distance: two or three teeth of a twenty-tooth gear.
const HALF_WIDTH: f64 = 0.17;
const TOP: f64 = 62.0;
const MARGIN: f64 = 10.0;
const RELIEF_DASH: &str = "3 2";

/// The gears in mesh around the pitch point, to scale.
///
/// # Errors
/// [`Error::NothingToDraw`] if no outline passes near the contact.
pub fn gears(drawing: &GearDrawing) -> Result<Picture, Error> {
    let gears = [finite(&drawing.pinion), finite(&drawing.mate)];
    let [width, height] = HALF;
    let (low, high) = ([MARGIN, TOP], [width - MARGIN, height - MARGIN]);
    let view = view(drawing, &gears, (high[1] - low[1]) / (high[0] - low[0])).ok_or(
        Error::NothingToDraw {
            chart: "gear drawing",
            why: "there is no outline",
        },
    )?;
    let scale = (high[0] - low[0]) / (view.high[0] - view.low[0]);
    let place = |p: &[f64; 2]| {
        [
            low[0] + (p[0] - view.low[0]) * scale,
            high[1] - (p[1] - view.low[1]) * scale,
        ]
    };
    let place_all = |points: &[[f64; 2]]| points.iter().map(place).collect::<Vec<_>>();
    let cut = |points: &[[f64; 2]]| {
        clip_polyline(points, &view)
            .iter()
            .map(|piece| place_all(piece))
            .collect::<Vec<_>>()
    };

    let outlines = gears.each_ref().map(|gear| {
        let mut line = gear.outline.clone();
        if is_closed(&line) {
            line.extend(gear.outline.first().copied());
        }
        cut(&line)
    });
    if outlines.iter().all(Vec::is_empty) {
        return Err(Error::NothingToDraw {
            chart: "gear drawing",
            why: "no outline passes near the contact",
        });
    }
    let mut canvas = Canvas::new();
    for (i, gear) in gears.iter().enumerate() {
        let mut area = gear.outline.clone();
        if !is_closed(&area) {
            // An arc of teeth is filled down to the centre.
            area.push(gear.centre);
        }
        canvas.area(
            &place_all(&clip_polygon(&area, &view)),
            &format!("body s{i}"),
        );
    }
    let circles = |radius: fn(&GearOutline) -> Option<f64>| {
        gears
            .iter()
            .filter_map(|g| Some(cut(&circle(g.centre, radius(g).filter(|r| r.is_finite())?))))
            .flatten()
            .collect::<Vec<_>>()
    };
    let pitch = circles(|g| g.pitch_radius_mm);
    let base = circles(|g| g.base_radius_mm);
    let path = drawing
        .line_of_action
        .filter(|ends| ends.iter().flatten().all(|v| drawable(*v, Scale::Linear)))
        .map_or_else(Vec::new, |ends| cut(&ends));
    canvas.lines(&pitch, "thin s2", "10 3 2 3");
    canvas.lines(&base, "thin s4", "3 3");
    for (i, outline) in outlines.iter().enumerate() {
        canvas.lines(outline, &format!("curve s{i}"), "");
    }
    let relief = drawing.relief.as_ref();
    for (i, flanks) in relief
        .iter()
        .flat_map(|relief| relief.flanks.iter().enumerate())
    {
        let pieces: Vec<_> = flanks.iter().flat_map(|flank| cut(flank)).collect();
        canvas.lines(&pieces, &format!("curve s{i}"), RELIEF_DASH);
    }
    canvas.lines(&path, "curve s3", "");
    canvas.rect(low, high, "frame");

    canvas.heading([MARGIN, MARGIN + 9.0], "Gears in mesh, transverse section");
    let relief = relief.map_or(1.0, |relief| relief.factor);
    let magnified = format!("tip relief × {relief}");
    let entries = [
        ("pinion", "curve s0", "", !outlines[0].is_empty()),
        ("mate", "curve s1", "", !outlines[1].is_empty()),
        (&*magnified, "curve s0", RELIEF_DASH, relief > 1.0),
        ("path of contact", "curve s3", "", !path.is_empty()),
        ("pitch circles", "thin s2", "10 3 2 3", !pitch.is_empty()),
        ("base circles", "thin s4", "3 3", !base.is_empty()),
    ];
    let mut at = [MARGIN, MARGIN + 27.0];
    for (name, class, dash, _) in entries.into_iter().filter(|e| e.3) {
        let entry = 32.0 + text_width(name);
        if at[0] > MARGIN && at[0] + entry > width - MARGIN {
            at = [MARGIN, at[1] + 17.0];
        }
        canvas.lines(
            &[vec![[at[0], at[1] - 4.0], [at[0] + 26.0, at[1] - 4.0]]],
            class,
            dash,
        );
        canvas.label([at[0] + 31.0, at[1]], name);
        at[0] += entry + 12.0;
    }
    scale_bar(
        &mut canvas,
        [low[0] + 10.0, high[1] - 12.0],
        scale,
        high[0] - low[0],
    );
    Ok(canvas.finish(
        width,
        height,
        "Transverse section of the gears in mesh near the contact",
    ))
}

/// The gear without points that cannot be drawn.
pub(super) fn finite(gear: &GearOutline) -> GearOutline {
    let mut gear = gear.clone();
    gear.outline
        .retain(|p| p.iter().all(|v| drawable(*v, Scale::Linear)));
    gear
}

/// The part of the plane to show, `aspect` times as high as wide. `None` without any outline point.
fn view(drawing: &GearDrawing, gears: &[GearOutline; 2], aspect: f64) -> Option<Window> {
    let around = |centre: [f64; 2], half: f64| Window {
        low: [centre[0] - half, centre[1] - half * aspect],
        high: [centre[0] + half, centre[1] + half * aspect],
    };
    let points = || gears.iter().flat_map(|g| &g.outline);
    points().next()?;
    let (a, b) = (drawing.pinion.centre, drawing.mate.centre);
    let distance = (b[0] - a[0]).hypot(b[1] - a[1]);
    if distance.is_finite() && distance > 1e-6 {
        // The pitch point divides the centre distance as the pitch radii do.
        let share = match (drawing.pinion.pitch_radius_mm, drawing.mate.pitch_radius_mm) {
            (Some(r), Some(s)) if r > 0.0 && s > 0.0 && (r + s).is_finite() => r / (r + s),
            _ => 0.5,
        };
        let centre = [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])];
        return Some(around(centre, HALF_WIDTH * distance));
    }
    let edge =
        |i: usize, pick: fn(f64, f64) -> f64, from: f64| points().map(|p| p[i]).fold(from, pick);
    let low = [0, 1].map(|i| edge(i, f64::min, f64::INFINITY));
    let high = [0, 1].map(|i| edge(i, f64::max, f64::NEG_INFINITY));
    let half = (0.5 * (high[0] - low[0]))
        .max(0.5 * (high[1] - low[1]) / aspect)
        .max(1e-3);
    Some(around(
        [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])],
        1.05 * half,
    ))
}

/// Whether the last point comes back to the first, within the spacing of the points.
fn is_closed(outline: &[[f64; 2]]) -> bool {
    let gap = |a: &[f64; 2], b: &[f64; 2]| (b[0] - a[0]).hypot(b[1] - a[1]);
    let (Some(first), Some(last)) = (outline.first(), outline.last()) else {
        return false;
    };
    let longest = outline
        .windows(2)
        .map(|p| gap(&p[0], &p[1]))
        .fold(0.0, f64::max);
    outline.len() > 3 && gap(first, last) <= 1.01 * longest
}

fn circle(centre: [f64; 2], radius: f64) -> Vec<[f64; 2]> {
    const SIDES: u32 = 720;
    (0..=SIDES)
        .map(|i| std::f64::consts::TAU * f64::from(i) / f64::from(SIDES))
        .map(|t| [centre[0] + radius * t.cos(), centre[1] + radius * t.sin()])
        .collect()
}

/// A bar of round length, at most a quarter of the drawing, since the drawing has no axes.
fn scale_bar(canvas: &mut Canvas, at: [f64; 2], scale: f64, width: f64) {
    let most = 0.25 * width / scale;
    let power = 10f64.powf(most.log10().floor());
    let length = [5.0, 2.0, 1.0]
        .map(|m| m * power)
        .into_iter()
        .find(|l| *l <= most);
    let length = length.unwrap_or(power);
    let end = at[0] + length * scale;
    let ends = [
        vec![at, [end, at[1]]],
        vec![[at[0], at[1] - 4.0], [at[0], at[1] + 4.0]],
        vec![[end, at[1] - 4.0], [end, at[1] + 4.0]],
    ];
    let text = format!("{} mm", number::significant(length, 1));
    // The bar has a background, because gear bodies and circles pass behind it.
    canvas.rect(
        [at[0] - 6.0, at[1] - 9.0],
        [end + text_width(&text) + 18.0, at[1] + 8.0],
        "bg plate",
    );
    canvas.lines(&ends, "tick", "");
    canvas.label([end + 7.0, at[1] + 4.0], &text);
}
