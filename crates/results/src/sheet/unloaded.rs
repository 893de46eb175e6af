//! The rows of a pair before its contact is solved.

use gear::UnloadedPair;
use gear::inspection::{Limits, Sheet};
use problem::PairFile;
use problem::formulation::{Design, Problem};

use super::conditions::conditions;
use super::{Row, Section};

/// The data sheet of the pair of a file.
#[must_use]
pub fn sections(file: &PairFile, pair: &UnloadedPair) -> Vec<Section> {
    let sheet = Sheet::new(pair);
    vec![
        gears(file, pair, &sheet),
        diameters(pair, &sheet),
        mesh(pair, &sheet),
        inspection(file, pair, &sheet),
        modifications(pair, &sheet),
        conditions(file, pair),
    ]
}

/// The data sheet of a design of a gear campaign; empty for an external simulator or a design without a pair.
#[must_use]
pub fn of_design(problem: &Problem, design: &Design) -> Vec<Section> {
    let campaign = problem.campaign();
    let gears = problem.gears().filter(|_| !campaign.is_external());
    let (Some(gears), Some(settings)) = (gears, campaign.gears()) else {
        return Vec::new();
    };
    let file = PairFile::of_design(settings, design);
    gears
        .pair(design)
        .map_or_else(|_| Vec::new(), |pair| sections(&file, &pair))
}

fn gears(file: &PairFile, pair: &UnloadedPair, sheet: &Sheet) -> Section {
    let (g, input) = (pair.geometry(), pair.input());
    Section {
        title: "Gears and basic rack",
        rows: vec![
            Row::each(
                "number_of_teeth",
                ["number of teeth", "z", ""],
                g.teeth.map(f64::from),
                0,
            ),
            Row::one(
                "normal_module_mm",
                ["normal module", "m_n", "mm"],
                g.normal_module,
                5,
            ),
            Row::one(
                "transverse_module_mm",
                ["transverse module", "m_t", "mm"],
                sheet.transverse_module,
                5,
            ),
            Row::one(
                "normal_pressure_angle_deg",
                ["normal pressure angle", "α_n", "°"],
                file.pair.pressure_angle_deg,
                4,
            ),
            Row::one(
                "helix_angle_deg",
                ["helix angle at the reference circle", "β", "°"],
                file.pair.helix_angle_deg,
                4,
            ),
            Row::each(
                "face_width_mm",
                ["face width", "b", "mm"],
                input.face_width,
                3,
            ),
            Row::each(
                "profile_shift_coefficient",
                ["profile shift coefficient", "x", ""],
                input.profile_shift,
                4,
            ),
            Row::each(
                "tip_alteration_coefficient",
                ["tip alteration coefficient", "k", ""],
                sheet.tip_alteration,
                4,
            ),
            Row::each(
                "addendum_coefficient",
                ["addendum of the basic rack", "h_aP*", ""],
                input.tool_dedendum,
                4,
            ),
            Row::each(
                "dedendum_coefficient",
                ["dedendum of the basic rack", "h_fP*", ""],
                input.tool_addendum,
                4,
            ),
            Row::each(
                "root_radius_coefficient",
                ["root radius of the basic rack", "ρ_fP*", ""],
                sheet.root_radius_factor,
                4,
            ),
            Row::each(
                "tip_rounding_mm",
                ["tip rounding", "ρ_a", "mm"],
                input.tip_radius,
                4,
            ),
        ],
    }
}

fn diameters(pair: &UnloadedPair, sheet: &Sheet) -> Section {
    let g = pair.geometry();
    let twice = |radii: [f64; 2]| radii.map(|radius| 2.0 * radius);
    let row =
        |key, quantity, symbol, diameters| Row::each(key, [quantity, symbol, "mm"], diameters, 4);
    Section {
        title: "Diameters",
        rows: vec![
            row("reference_diameter_mm", "reference", "d", twice(g.r)),
            row("base_diameter_mm", "base", "d_b", twice(g.r_b)),
            row(
                "working_diameter_mm",
                "working pitch",
                "d_w",
                sheet.working_diameter,
            ),
            row("tip_diameter_mm", "tip", "d_a", twice(g.r_a)),
            row(
                "tip_form_diameter_mm",
                "tip form",
                "d_Fa",
                sheet.tip_form_diameter,
            ),
            row(
                "active_tip_diameter_mm",
                "active tip",
                "d_Na",
                sheet.active_tip_diameter,
            ),
            row(
                "active_root_diameter_mm",
                "active root",
                "d_Nf",
                sheet.active_root_diameter,
            ),
            row(
                "root_form_diameter_mm",
                "root form",
                "d_Ff",
                sheet.root_form_diameter,
            ),
            row("root_diameter_mm", "root", "d_f", twice(g.r_f)),
        ],
    }
}

fn mesh(pair: &UnloadedPair, sheet: &Sheet) -> Section {
    let g = pair.geometry();
    let (transverse, overlap) = (g.eps_alpha_left(), g.eps_beta);
    let mut rows = vec![
        Row::one(
            "centre_distance_mm",
            ["centre distance", "a", "mm"],
            g.centre_distance,
            4,
        ),
        Row::one(
            "reference_centre_distance_mm",
            ["reference centre distance", "a_d", "mm"],
            sheet.reference_centre_distance,
            4,
        ),
        Row::one(
            "transverse_pressure_angle_deg",
            ["transverse pressure angle", "α_t", "°"],
            g.alpha_t.to_degrees(),
            4,
        ),
        Row::one(
            "working_pressure_angle_deg",
            ["transverse working pressure angle", "α_wt", "°"],
            g.alpha_wt.to_degrees(),
            4,
        ),
        Row::one(
            "transverse_pitch_mm",
            ["transverse pitch", "p_t", "mm"],
            sheet.transverse_pitch,
            4,
        ),
        Row::one(
            "base_pitch_mm",
            ["transverse base pitch", "p_bt", "mm"],
            g.base_pitch,
            4,
        ),
        Row::one(
            "normal_base_pitch_mm",
            ["normal base pitch", "p_bn", "mm"],
            sheet.normal_base_pitch,
            4,
        ),
    ];
    if let Some(lead) = sheet.lead {
        rows.push(Row::each("lead_mm", ["lead", "p_z", "mm"], lead, 3));
    }
    rows.extend([
        Row::one(
            "transverse_contact_ratio",
            ["transverse contact ratio", "ε_α", ""],
            transverse,
            4,
        ),
        Row::one("overlap_ratio", ["overlap ratio", "ε_β", ""], overlap, 4),
        Row::one(
            "total_contact_ratio",
            ["total contact ratio", "ε_γ", ""],
            transverse + overlap,
            4,
        ),
        Row::each(
            "tip_clearance_mm",
            ["tip clearance", "c", "mm"],
            g.clearance,
            4,
        ),
        Row::one(
            "backlash_mm",
            ["backlash at the working pitch circles", "j_wt", "mm"],
            g.backlash,
            4,
        ),
        Row::one(
            "normal_backlash_mm",
            ["normal backlash", "j_bn", "mm"],
            sheet.normal_backlash,
            4,
        ),
    ]);
    Section {
        title: "Mesh",
        rows,
    }
}

fn inspection(file: &PairFile, pair: &UnloadedPair, sheet: &Sheet) -> Section {
    let span =
        |of: fn(gear::inspection::Span) -> f64| sheet.span.map(|span| span.map_or(f64::NAN, of));
    let balls = |of: fn(gear::inspection::OverBalls) -> f64| {
        sheet.over_balls.map(|balls| balls.map_or(f64::NAN, of))
    };
    let land = |land: f64| land / pair.geometry().normal_module;
    let mut rows = vec![
        Row::each(
            "normal_tooth_thickness_mm",
            ["normal tooth thickness at d", "s_n", "mm"],
            sheet.tooth_thickness,
            4,
        ),
        Row::each(
            "tip_land_mm",
            ["tip land, normal section", "s_an", "mm"],
            sheet.tip_land,
            4,
        ),
        Row::each(
            "tip_land_modules",
            ["tip land in modules", "s_an*", ""],
            sheet.tip_land.map(land),
            3,
        ),
        Row::each(
            "spanned_teeth",
            ["teeth spanned", "k", ""],
            span(|span| f64::from(span.teeth)),
            0,
        ),
        Row::each(
            "span_mm",
            ["base tangent length (span)", "W_k", "mm"],
            span(|span| span.length),
            4,
        ),
        Row::each(
            "ball_diameter_mm",
            ["diameter of the measuring balls", "D_M", "mm"],
            balls(|balls| balls.ball),
            3,
        ),
        Row::each(
            "over_balls_mm",
            ["dimension over two balls", "M_dK", "mm"],
            balls(|balls| balls.dimension),
            4,
        ),
    ];
    if let Some(allowances) = &file.allowances {
        rows.extend(limits(&Limits::new(pair, sheet, &allowances.to_gear())));
    }
    Section {
        title: "Tooth thickness and its measurement",
        rows,
    }
}

/// The rows of measures with allowances.
fn limits(limits: &Limits) -> Vec<Row> {
    let mut rows = Vec::new();
    for (symbol, words, keys, measures) in [
        (
            "s_n",
            ["thickness, upper limit", "thickness, lower limit"],
            [
                "normal_tooth_thickness_upper_mm",
                "normal_tooth_thickness_lower_mm",
            ],
            limits.tooth_thickness.map(Some),
        ),
        (
            "W_k",
            ["span, upper limit", "span, lower limit"],
            ["span_upper_mm", "span_lower_mm"],
            limits.span,
        ),
        (
            "M_dK",
            ["over balls, upper limit", "over balls, lower limit"],
            ["over_balls_upper_mm", "over_balls_lower_mm"],
            limits.over_balls,
        ),
    ] {
        for limit in 0..2 {
            let values = measures.map(|one| one.map_or(f64::NAN, |one| one[limit]));
            rows.push(Row::each(
                keys[limit],
                [words[limit], symbol, "mm"],
                values,
                4,
            ));
        }
    }
    let [most, least] = limits.normal_backlash;
    for (key, words, value) in [
        ("normal_backlash_upper_mm", "greatest normal backlash", most),
        (
            "normal_backlash_lower_mm",
            "smallest normal backlash",
            least,
        ),
    ] {
        rows.push(Row::one(key, [words, "j_bn", "mm"], value, 4));
    }
    rows
}

fn modifications(pair: &UnloadedPair, sheet: &Sheet) -> Section {
    let corrections = pair.corrections();
    let mut rows = Vec::new();
    let relief = corrections
        .tip_relief
        .map(|relief| relief.filter(|relief| relief.amount > 0.0));
    let of =
        |value: fn(gear::TipRelief) -> f64| relief.map(|relief| relief.map_or(f64::NAN, value));
    if let Some(given) = relief.iter().flatten().next() {
        rows.extend([
            Row::each(
                "tip_relief_um",
                ["tip relief at the active tip", "C_αa", "µm"],
                of(|relief| 1e3 * relief.amount),
                2,
            ),
            Row::each(
                "tip_relief_length_mm",
                ["its length along the path of contact", "L_Ca", "mm"],
                of(|relief| relief.length),
                4,
            ),
            Row::each(
                "tip_relief_diameter_mm",
                ["diameter at which it starts", "d_Ca", "mm"],
                sheet
                    .relief_diameter
                    .map(|diameter| diameter.unwrap_or(f64::NAN)),
                4,
            ),
            Row::each(
                "root_relief_diameter_mm",
                ["root relief in its place ends at", "d_Cf", "mm"],
                sheet
                    .root_relief_diameter
                    .map(|diameter| diameter.unwrap_or(f64::NAN)),
                4,
            ),
            Row::text(
                "tip_relief_shape",
                "shape of the tip relief",
                given.shape.to_string(),
            ),
        ]);
    }
    for (key, words, mm) in [
        (
            "crowning_um",
            ["crowning of both flanks together", "C_β", "µm"],
            corrections.crowning,
        ),
        (
            "helix_slope_um",
            ["helix slope of both flanks together", "C_Hβ", "µm"],
            corrections.helix_slope,
        ),
        (
            "misalignment_um",
            ["misalignment of the shafts", "", "µm"],
            corrections.misalignment,
        ),
    ] {
        if mm != 0.0 {
            rows.push(Row::one(key, words, 1e3 * mm, 2));
        }
    }
    if rows.is_empty() {
        rows.push(Row::text(
            "modifications",
            "profile and helix modifications",
            "none".to_owned(),
        ));
    }
    Section {
        title: "Modifications, normal to the flank",
        rows,
    }
}
