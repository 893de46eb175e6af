//! Load, forces, material and tolerances of a pair, as rows.

use gear::UnloadedPair;
use problem::PairFile;

use super::{Row, Section};

/// The tangential, radial and axial force of a mesh without friction at its working pitch point, N.
fn bearing_forces(pair: &UnloadedPair) -> [f64; 3] {
    let g = pair.geometry();
    let (sine, cosine) = g.alpha_wt.sin_cos();
    [cosine, sine, g.beta_b.tan()].map(|share| share * pair.base_force())
}

pub(super) fn conditions(file: &PairFile, pair: &UnloadedPair) -> Section {
    let (g, materials) = (pair.geometry(), file.material.each());
    let torque = file.load.pinion_torque_nm;
    let ratio = f64::from(g.teeth[1]) / f64::from(g.teeth[0]);
    let um = |tolerances: [f64; 2]| tolerances.map(|mm| 1e3 * mm);
    let newtons = |key, words, symbol, force| Row::one(key, [words, symbol, "N"], force, 1);
    let [tangential, radial, axial] = bearing_forces(pair);
    let mut rows = vec![
        Row::each(
            "torque_nm",
            ["torque", "T", "N·m"],
            [torque, torque * ratio],
            2,
        ),
        newtons(
            "tangential_force_n",
            "tangential force, reference circle",
            "F_t",
            pair.input().pinion_torque / g.r[0],
        ),
        newtons(
            "working_tangential_force_n",
            "tangential force, working circle",
            "F_wt",
            tangential,
        ),
        newtons(
            "radial_force_n",
            "radial force, working circle",
            "F_r",
            radial,
        ),
        newtons("axial_force_n", "axial force", "F_a", axial),
        Row::texts(
            "material",
            "material",
            materials.map(|one| {
                one.name
                    .map_or_else(|| "by its numbers".to_owned(), |name| name.to_string())
            }),
        ),
        Row::each(
            "youngs_modulus_gpa",
            ["Young’s modulus", "E", "GPa"],
            materials.map(|one| one.youngs_modulus_gpa),
            1,
        ),
        Row::each(
            "poisson_ratio",
            ["Poisson’s ratio", "ν", ""],
            materials.map(|one| one.poisson_ratio),
            3,
        ),
        Row::each(
            "contact_limit_mpa",
            ["allowable contact stress number", "σ_Hlim", "MPa"],
            materials.map(|one| one.contact_limit_mpa),
            0,
        ),
    ];
    let bending = materials.map(|one| one.bending_limit_mpa);
    if bending.iter().any(Option::is_some) {
        rows.push(Row::each(
            "bending_limit_mpa",
            ["allowable bending stress number", "σ_FE", "MPa"],
            bending.map(|limit| limit.unwrap_or(f64::NAN)),
            0,
        ));
    }
    match file.scatter().flank_class {
        Some(class) => rows.extend([
            Row::one(
                "flank_class",
                ["flank tolerance class, ISO 1328-1", "A", ""],
                f64::from(class.number()),
                0,
            ),
            Row::each(
                "profile_slope_tolerance_um",
                ["profile slope tolerance", "f_HαT", "µm"],
                um(class.slope_tolerances(g)),
                2,
            ),
            Row::each(
                "helix_slope_tolerance_um",
                ["helix slope tolerance", "f_HβT", "µm"],
                um(class.helix_slope_tolerances(g, pair.input().face_width)),
                2,
            ),
        ]),
        None => rows.push(Row::text(
            "flank_class",
            "flank tolerance class, ISO 1328-1",
            "not given".to_owned(),
        )),
    }
    rows.push(Row::text(
        "tooth_model",
        "tooth model",
        file.pair.tooth_model.to_string(),
    ));
    Section {
        title: "Load, material and tolerances",
        rows,
    }
}

#[cfg(test)]
mod tests {
    use problem::Campaign;
    use problem::formulation::Problem;

    use super::*;

    #[test]
    fn bearing_forces_balance_the_torque_and_add_up_to_the_normal_force() {
        let problem = Problem::new(Campaign::parse("paper.toml", Campaign::PAPER).unwrap());
        let design = problem.design(&[0.25, 1.37, 1.37, 0.85, 1.31, 0.80], problem.base());
        let pair = problem.gears().unwrap().pair(&design).unwrap();
        let [tangential, radial, axial] = bearing_forces(&pair);
        let (g, torque) = (pair.geometry(), pair.input().pinion_torque);
        let working_radius =
            g.centre_distance * f64::from(g.teeth[0]) / f64::from(g.teeth[0] + g.teeth[1]);
        let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
        close(tangential * working_radius, torque);
        close(axial, torque / g.r[0] * g.beta.tan());
        close(
            radial.hypot(tangential).hypot(axial),
            pair.base_force() / g.beta_b.cos(),
        );
    }
}
