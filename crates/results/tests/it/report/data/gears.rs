//! Outlines of a pair, and the pressure on a flank.

use results::report::*;

/// Involute outlines of 20 and 22 teeth at 110 mm, with radial lines below the base circle.
pub(super) fn gears(variables: &[f64; 11]) -> GearDrawing {
    const CENTRES: f64 = 110.0;
    let [xp, xr, hap, har, hfp, hfr, .., degrees] = *variables;
    let (normal, helix) = (18f64.to_radians(), degrees.to_radians());
    let transverse = (normal.tan() / helix.cos()).atan();
    let wanted = involute(transverse) + 2.0 * (xp + xr) * normal.tan() / 42.0;
    let working = inverse_involute(wanted);
    let module = 2.0 * CENTRES * helix.cos() * working.cos() / (42.0 * transverse.cos());
    let gear = |teeth: f64, x: f64, tool: f64, tip: f64, centre: [f64; 2], turn: f64| {
        let r = 0.5 * teeth * module / helix.cos();
        let base = r * transverse.cos();
        let (outer, root) = (r + module * (x + tip), r + module * (x - tool));
        let half = (std::f64::consts::FRAC_PI_2 + 2.0 * x * normal.tan()) / teeth;
        let angle = |radius: f64| {
            half + involute(transverse) - involute((base / radius.max(base)).min(1.0).acos())
        };
        let radii: Vec<f64> = (0..=24)
            .map(|i| root + (outer - root) * f64::from(i) / 24.0)
            .collect();
        let mut outline = Vec::new();
        for tooth in 0..teeth as u32 {
            let middle = turn + std::f64::consts::TAU * f64::from(tooth) / teeth;
            let mut push = |radius: f64, offset: f64| {
                let t = middle + offset;
                outline.push([centre[0] + radius * t.cos(), centre[1] + radius * t.sin()]);
            };
            radii
                .iter()
                .for_each(|&radius| push(radius, -angle(radius)));
            (1..6).for_each(|i| push(outer, angle(outer) * (f64::from(i) / 3.0 - 1.0)));
            radii
                .iter()
                .rev()
                .for_each(|&radius| push(radius, angle(radius)));
            let gap = std::f64::consts::TAU / teeth - 2.0 * angle(root);
            (1..6).for_each(|i| push(root, angle(root) + gap * f64::from(i) / 6.0));
        }
        GearOutline {
            outline,
            centre,
            pitch_radius_mm: Some(CENTRES * teeth / 42.0),
            base_radius_mm: Some(base),
        }
    };
    let pinion = gear(20.0, xp, hap, hfp, [0.0, 0.0], 0.0);
    let turn = std::f64::consts::PI * (1.0 + 1.0 / 22.0);
    let mate = gear(22.0, xr, har, hfr, [CENTRES, 0.0], turn);
    let pitch = CENTRES * 20.0 / 42.0;
    let (dx, dy) = (working.sin(), working.cos());
    GearDrawing {
        pinion,
        mate,
        line_of_action: Some([[pitch - 9.0 * dx, -9.0 * dy], [pitch + 9.0 * dx, 9.0 * dy]]),
        face_width_mm: 10.0,
        twist_rad: [0.11, -0.1],
        relief: None,
    }
}

fn involute(angle: f64) -> f64 {
    angle.tan() - angle
}

fn inverse_involute(value: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.2);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if involute(middle) < value {
            low = middle
        } else {
            high = middle
        }
    }
    low
}

/// A flank of which the far corner carries no load.
pub(super) fn contact() -> ContactPattern {
    let place_mm: Vec<f64> = (0..8).map(|i| -7.0 + 2.0 * f64::from(i)).collect();
    let across_mm: Vec<f64> = (0..5).map(|i| 1.0 + 2.0 * f64::from(i)).collect();
    let pressure = |s: f64| {
        let row = across_mm
            .iter()
            .map(|z| (1100.0 - 40.0 * s - 60.0 * z).max(0.0));
        row.map(|p| if p < 320.0 { 0.0 } else { p }).collect()
    };
    ContactPattern {
        is_worn: true,
        peak_mpa: 1450.0,
        pressure_mpa: place_mm.iter().map(|s| pressure(*s)).collect(),
        place_mm,
        across_mm,
        lines: vec![[[0.0, 5.0], [10.0, 0.0]]],
    }
}
