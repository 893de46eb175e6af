//! The simulation as text.

use std::fmt::Write as _;

use problem::formulation::Constraint;
use results::{number::fixed, sheet};

use super::{Figures, Simulation, WearChoice};

/// The simulation as text.
#[must_use]
pub fn describe(simulation: &Simulation) -> String {
    let Some(figures) = &simulation.figures else {
        let reason = simulation.reason.as_deref().unwrap_or_default();
        return format!("the pair cannot be simulated: {reason}\n");
    };
    let mut text = sheet::describe(&figures.sheet);
    for (name, value) in rows(figures, simulation.wear) {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{name:<28}{value}");
    }
    text + "\n" + &verdict(&simulation.constraints)
}

/// The figures that are not in the data sheet, with their names and units, in the order in which they are shown; `wear`
/// is that of the analysis.
pub(super) fn rows(figures: &Figures, wear: WearChoice) -> Vec<(String, String)> {
    let mut rows = Vec::new();
    let [pressure, delta_ste] = match wear {
        WearChoice::None => ["contact pressure, unworn", "ΔSTE, unworn"],
        WearChoice::Archard | WearChoice::Random => {
            ["contact pressure, mean wear", "ΔSTE, mean wear"]
        }
    };
    let pair = |values: [f64; 2]| format!("{:.4}, {:.4}", values[0], values[1]);
    let mut line = |name: &str, value: String| rows.push((name.to_owned(), value));
    line(
        "largest specific sliding",
        format!("{:.4}", figures.specific_sliding.max),
    );
    line(
        "flank margins",
        format!("{} mm", pair(figures.flank_margin_mm)),
    );
    line(pressure, format!("{:.1} MPa", figures.hertz_pressure_mpa));
    line(
        "root stresses, load at tip",
        format!("{} MPa", pair(figures.root_stress_mpa)),
    );
    let rated = &figures.iso_6336;
    let remark = if rated.in_range {
        ""
    } else {
        " (contact ratio outside the formulas' range)"
    };
    let stress = |mpa: [f64; 2]| format!("{:.0}, {:.0} MPa", mpa[0], mpa[1]);
    let root_safety = match rated.root_safety {
        [None, None] => "S_F takes material.bending_limit_mpa, the σ_FE of ISO 6336-5".to_owned(),
        safety => {
            let [pinion, mate] = safety.map(|one| fixed(one.unwrap_or(f64::NAN), 4));
            format!("S_F {pinion}, {mate}")
        }
    };
    let edition = u32::from(rated.edition);
    line(
        "ISO 6336-3, roots",
        format!(
            "σ_F {}; {root_safety} (edition {edition}){remark}",
            stress(rated.root_stress_mpa)
        ),
    );
    line(
        "ISO 6336-2, flanks",
        format!(
            "σ_H {}; S_H {}{remark}",
            stress(rated.flank_stress_mpa),
            pair(rated.flank_safety)
        ),
    );
    let [application, dynamic, face, transverse] = rated.load_factors;
    line(
        "with K_A, K_v, K_Hβ, K_Hα",
        format!("{application}, {dynamic}, {face}, {transverse}"),
    );
    line(delta_ste, format!("{:.4} µm", figures.delta_ste_um));
    if let Some(finer) = &figures.finer_grid {
        line(
            "on a grid twice as fine",
            format!(
                "ΔSTE {:.4} µm, contact pressure {:.1} MPa",
                finer.delta_ste_um, finer.hertz_pressure_mpa
            ),
        );
    }
    line("the model's own error", figures.model_error.to_owned());
    if let Some(scatter) = &figures.manufacture {
        if let (Some(class), Some([pinion, mate])) =
            (scatter.flank_class, scatter.slope_tolerance_um)
        {
            let helix = scatter
                .helix_slope_tolerance_um
                .map(|[pinion, mate]| format!("; helix slopes ±{pinion:.2}, ±{mate:.2} µm"));
            line(
                "flank class of ISO 1328-1",
                format!(
                    "{class}: profile slopes ±{pinion:.2}, ±{mate:.2} µm{} (three standard deviations)",
                    helix.unwrap_or_default()
                ),
            );
        }
        if let Some(um) = scatter.misalignment_um {
            line(
                "misalignment of the shafts",
                format!("±{um} µm over the face (three standard deviations)"),
            );
        }
        if let Some(um) = scatter.tip_relief_tolerance_um {
            line(
                "amounts of tip relief",
                format!("±{um} µm (three standard deviations)"),
            );
        }
        let slopes = match (&scatter.flank_class, scatter.helix_slope_tolerance_um) {
            (None, _) => "profile and helix slopes, ",
            (_, None) => "helix slopes, ",
            _ => "",
        };
        let left_out = format!("{slopes}pitch and form deviations, dynamics");
        line("not in the random ΔSTE", left_out);
    }
    if let (Some(mean), Some(sd), Some(p90)) = (figures.mean_um, figures.sd_um, figures.p90_um) {
        let interval = figures.p90_interval_um.map_or_else(
            || " (too few samples for an interval)".to_owned(),
            |[low, high]| format!(" [{low:.4}; {high:.4}]"),
        );
        line(
            "ΔSTE with random wear",
            format!("mean {mean:.4}, SD {sd:.4}, P90 {p90:.4}{interval} µm"),
        );
    }
    rows.extend(figures.cases.rows());
    rows
}

/// Whether the pair is feasible, and every constraint that it breaks.
pub(super) fn verdict(constraints: &[Constraint]) -> String {
    let count = constraints.len();
    let broken = || constraints.iter().filter(|constraint| !constraint.holds());
    match broken().count() {
        0 => format!("feasible: all {count} constraints hold\n"),
        many => broken().fold(
            format!("infeasible: {many} of {count} constraints broken\n"),
            |text, constraint| text + &format!("  {constraint}\n"),
        ),
    }
}
