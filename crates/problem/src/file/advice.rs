//! Warnings about values that are valid but doubtful, mostly because of a wrong unit.

use gear::{LocalAmount, Range, Size, ToothModel, Wear, WearLaw};

use super::{
    FrozenSection, GearSections, HELIX_ANGLE, Load, Materials, PairFile, PairSection, ROOT_RADII,
    Setting, TIP_RADII, gear_size,
};

/// Soft plastics for gears have about this modulus.
const SOFTEST_GPA: f64 = 1.0;
/// A larger modulus was probably given in MPa. Tungsten carbide has about 650 GPa.
const STIFFEST_GPA: f64 = 1000.0;
/// Common face widths in mm, from watch wheels to ring mills.
const FACE_WIDTH_MM: [f64; 2] = [0.5, 1000.0];
/// Wear in µm above which no flank of a usual module is left.
const DEEPEST_WEAR_UM: f64 = 1000.0;
/// Variance of the wear's multiplier, whose mean is 1, above which more than 1 % of the multipliers are negative and
/// count as zero.
const MOST_VARIANCE: f64 = 0.18;
/// Amount of a correction in µm below which it cannot be made.
const LEAST_CORRECTION_UM: f64 = 0.5;
/// Modules in mm of gears, from watch wheels to mills.
const MODULES_MM: [f64; 2] = [0.05, 100.0];
/// Line load F_t/b in N/mm below which the torque was probably given in another unit.
const LEAST_LINE_LOAD: f64 = 1.0;
/// Share of the wear's depth above which a load case was probably given in percent.
const MOST_WEAR_SHARE: f64 = 10.0;
/// Usual profile shifts in modules, those that the paper allows.
const USUAL_SHIFT: [f64; 2] = [-1.0, 2.0];

impl PairFile {
    /// Advice about values that are valid but doubtful, one sentence each.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let input = self.to_gear();
        let geometry = gear::Geometry::new(&input).ok();
        let mut warnings =
            of_sections(&self.material, &self.wear, self.pair.face_width_mm.common());
        let pair = &self.pair;
        warnings.extend(of_torques(
            &self.load,
            input.size,
            pair.teeth,
            [pair.pressure_angle_deg, pair.face_width_mm.common()],
            self.material.contact_limit_mpa(),
        ));
        warnings.extend(of_hand("pair.helix_angle_deg", &[pair.helix_angle_deg]));
        if let Some(corrections) = &self.corrections {
            let relief = corrections.tip_relief_um.unwrap_or_default();
            let crowning = corrections.crowning_um.unwrap_or_default();
            warnings.extend(of_amounts([&relief, &[crowning]]));
        }
        warnings.extend(of_coupled(&self.pair, geometry.as_ref()));
        warnings
    }
}

impl GearSections {
    /// Advice about settings that are valid but doubtful.
    pub(super) fn warnings(&self) -> Vec<String> {
        let face_width_mm = self.pair.face_width_mm.common();
        let mut warnings = of_sections(&self.material, &self.wear, face_width_mm);
        let pair = &self.pair;
        let size = gear_size(pair.centre_distance_mm, pair.normal_module_mm);
        warnings.extend(of_torques(
            &self.load,
            size,
            pair.teeth(),
            [pair.pressure_angle_deg, face_width_mm],
            self.material.contact_limit_mpa(),
        ));
        warnings.extend(of_centre_distance(self));
        let helix = ends(&self.bounds.settings()[HELIX_ANGLE]);
        warnings.extend(of_hand("bounds.helix_angle_deg", &helix));
        if let Some(corrections) = &self.corrections {
            let [relief_p, relief_r, .., crowning, _] = corrections.settings();
            let relief = [ends(&relief_p), ends(&relief_r)].concat();
            warnings.extend(of_amounts([&relief, &ends(&crowning)]));
        }
        warnings.extend(of_frozen(self));
        warnings.extend(of_coupled_designs(self));
        warnings
    }
}

/// Warnings about the sections common to campaign and pair files.
fn of_sections(material: &Materials, wear: &Wear, face_width_mm: f64) -> Vec<String> {
    let mut warnings = Vec::new();
    for (place, material) in material.tables() {
        let modulus = material.youngs_modulus_gpa;
        if modulus > STIFFEST_GPA {
            warnings.push(format!(
                "{place}.youngs_modulus_gpa is {modulus} GPa: did you mean {}?",
                modulus * 1e-3
            ));
        }
        if modulus < SOFTEST_GPA {
            warnings.push(format!(
                "{place}.youngs_modulus_gpa is {modulus} GPa, less than that of soft plastics: steel has 206"
            ));
        }
    }
    let [least, most] = FACE_WIDTH_MM;
    if face_width_mm < least || face_width_mm > most {
        warnings.push(format!(
            "pair.face_width_mm is {face_width_mm} mm: face widths are usually from {least} to \
             {most} mm"
        ));
    }
    if let WearLaw::Archard { max_depth_um }
    | WearLaw::LocalArchard {
        amount: LocalAmount::MaxDepth { max_depth_um },
    } = wear.law
        && max_depth_um > DEEPEST_WEAR_UM
    {
        warnings.push(format!(
            "wear.max_depth_um is {max_depth_um} µm, which is {} mm: wear is usually a few micrometres deep",
            max_depth_um * 1e-3
        ));
    }
    if wear.variance > MOST_VARIANCE {
        warnings.push(format!(
            "wear.variance is {}: the wear depth has a standard deviation of {:.2} times its mean, and its random \
             multiplier is often negative, which counts as no wear and raises the mean: 0.01, the variance of the 2009 \
             paper, is 10 %",
            wear.variance,
            wear.variance.sqrt()
        ));
    }
    warnings
}

/// Warnings about a module, torques and shares of the wear that were probably given in another unit. A torque is too
/// large if its tangential force over face width and module is above the material's σ_Hlim in MPa: the root stress by
/// ISO 6336-3 is about three times that force. Pressure angle in degrees, face width in mm.
fn of_torques(
    load: &Load,
    size: Size,
    teeth: [u32; 2],
    [pressure_angle_deg, face_width_mm]: [f64; 2],
    contact_limit_mpa: f64,
) -> Vec<String> {
    let mut warnings = Vec::new();
    let named = || load.cases.iter().zip(load.case_names());
    for (case, name) in named().filter(|(case, _)| case.wear > MOST_WEAR_SHARE) {
        warnings.push(format!(
            "wear of the load case {name:?} is {}, that many times the depth of [wear]: did you mean {}?",
            case.wear,
            case.wear * 1e-2
        ));
    }
    // The module of a spur pair without profile shift is near enough.
    let module = gear::normal_module(teeth, size, pressure_angle_deg.to_radians(), 0.0, 0.0);
    // A strange face width has its own warning.
    let is_usual = (FACE_WIDTH_MM[0]..=FACE_WIDTH_MM[1]).contains(&face_width_mm);
    let Some(module) = module.ok().filter(|_| is_usual) else {
        return warnings;
    };
    let [least, most] = MODULES_MM;
    if module < least || module > most {
        let (key, given) = match size {
            Size::NormalModule(given)
            | Size::Both {
                normal_module: given,
                ..
            } => ("pair.normal_module_mm", given),
            Size::CentreDistance(given) => ("pair.centre_distance_mm", given),
        };
        warnings.push(format!(
            "{key} is {given} mm, for a module of about {module:.4} mm: modules are usually from {least} to {most} mm"
        ));
        return warnings;
    }
    let of_load = ("load.pinion_torque_nm".to_owned(), load.pinion_torque_nm);
    let line_load = 2e3 * of_load.1 / (module * f64::from(teeth[0]) * face_width_mm);
    if line_load < LEAST_LINE_LOAD {
        warnings.push(format!(
            "{} is {} N·m: its line load F_t/b is {line_load:.3} N/mm, below {LEAST_LINE_LOAD}: is the torque in N·m?",
            of_load.0, of_load.1
        ));
    }
    let of_cases = named().filter_map(|(case, name)| {
        let key = format!("pinion_torque_nm of the load case {name:?}");
        Some((key, case.pinion_torque_nm?))
    });
    for (key, torque) in std::iter::once(of_load).chain(of_cases) {
        let force = 2e3 * torque / (module * f64::from(teeth[0]));
        let stress = force / (face_width_mm * module);
        if stress > contact_limit_mpa {
            warnings.push(format!(
                "{key} is {torque} N·m: its tangential force over face width and module is {stress:.0} MPa, above the σ_Hlim \
                 of {contact_limit_mpa} MPa, which no tooth carries: did you mean {}?",
                torque * 1e-3
            ));
        }
    }
    warnings
}

/// A warning about negative helix angles, of which only the magnitude counts.
fn of_hand(key: &str, angles_deg: &[f64]) -> Option<String> {
    let negative = angles_deg.iter().find(|angle| **angle < 0.0)?;
    Some(format!(
        "{key} is {negative}: left and right hand give the same results, so give the magnitude alone"
    ))
}

/// Warnings about corrections whose largest amount, in µm, is too small to be made.
fn of_amounts([tip_relief_um, crowning_um]: [&[f64]; 2]) -> Vec<String> {
    let of = |(key, um): (&str, &[f64])| {
        let most = um.iter().fold(0.0, |most: f64, um| most.max(*um));
        (most > 0.0 && most < LEAST_CORRECTION_UM).then(|| {
            format!(
                "corrections.{key} is at most {most} µm: did you mean {}?",
                most * 1e3
            )
        })
    };
    let all = [
        ("tip_relief_um", tip_relief_um),
        ("crowning_um", crowning_um),
    ];
    all.into_iter().filter_map(of).collect()
}

/// A warning about a centre distance that, with the module, needs an unusual profile shift of the mate; it names the
/// distances of the usual shifts.
fn of_centre_distance(sections: &GearSections) -> Option<String> {
    let pair = &sections.pair;
    let (module, given) = (pair.normal_module_mm?, pair.centre_distance_mm?);
    let (teeth, pressure_angle) = (pair.teeth(), pair.pressure_angle_deg.to_radians());
    let distance = |helix: f64, sum: f64| {
        let unit = Size::CentreDistance(1.0);
        gear::normal_module(teeth, unit, pressure_angle, helix, sum).map(|of_unit| module / of_unit)
    };
    let settings = sections.bounds.settings();
    let magnitudes = ends(&settings[HELIX_ANGLE]);
    let helix = |pick: fn(f64, f64) -> f64| magnitudes.iter().copied().reduce(pick);
    let (least, most) = (
        helix(f64::min)?.max(0.0).to_radians(),
        helix(f64::max)?.to_radians(),
    );
    let pinion = ends(&settings[0]);
    let [low, high] = [
        *pinion.first()? + USUAL_SHIFT[0],
        *pinion.last()? + USUAL_SHIFT[1],
    ];
    // Without a solution for the least sum, the base circles touch.
    let shortest = distance(least, low).or_else(|_| {
        distance(least, 0.0)
            .map(|without| without / (pressure_angle.tan() / least.cos()).hypot(1.0))
    });
    let [shortest, longest] = [shortest.ok()?, distance(most, high).ok()?];
    (given < shortest || given > longest).then(|| {
        format!(
            "pair.centre_distance_mm is {given} mm: with {} and {} teeth, a module of {module} mm and the bounds of the helix angle and of \
             the pinion's profile shift, profile shifts of the mate from {} to {} give {shortest:.2} to {longest:.2} mm",
            teeth[0], teeth[1], USUAL_SHIFT[0], USUAL_SHIFT[1]
        )
    })
}

/// The ends of a variable's values; none if it is bound to another one.
fn ends(setting: &Setting) -> Vec<f64> {
    match *setting {
        Setting::Fixed(value) => vec![value],
        _ => setting.range().map_or_else(Vec::new, |ends| ends.to_vec()),
    }
}

/// The sentence about values outside the pairs for which the tooth model is known; `what` names them.
#[must_use]
pub fn outside(range: Range, what: &str, values: &[f64]) -> Option<String> {
    let strange: Vec<String> = values
        .iter()
        .filter(|value| !range.contains(**value))
        .map(|value| format!("{}", (1e4 * value).round() / 1e4))
        .collect();
    let [low, high] = range.limits;
    (!strange.is_empty()).then(|| {
        format!(
            "{what} is {}: the tooth model \"coupled\" was compared with finite elements for {} from {low} to {high}, \
             so that its error here is unknown",
            strange.join(", "),
            range.name
        )
    })
}

/// Warnings about a pair for which the coupled tooth model was not compared with finite elements.
fn of_coupled(pair: &PairSection, geometry: Option<&gear::Geometry>) -> Vec<String> {
    if pair.tooth_model != ToothModel::Coupled {
        return Vec::new();
    }
    let mut warnings = vec![
        outside(Range::TEETH, "pair.teeth", &pair.teeth.map(f64::from)),
        outside(
            Range::PRESSURE_ANGLE,
            "pair.pressure_angle_deg",
            &[pair.pressure_angle_deg],
        ),
        outside(
            Range::HELIX_ANGLE,
            "pair.helix_angle_deg",
            &[pair.helix_angle_deg.abs()],
        ),
    ];
    if let Some(geometry) = geometry {
        let width = geometry.face_width / geometry.normal_module;
        warnings.push(outside(
            Range::FACE_WIDTH,
            "the face width over the normal module",
            &[width],
        ));
    }
    warnings.into_iter().flatten().collect()
}

/// Warnings about a campaign with designs for which the coupled tooth model was not compared with finite elements.
fn of_coupled_designs(sections: &GearSections) -> Vec<String> {
    let pair = &sections.pair;
    if pair.tooth_model != ToothModel::Coupled {
        return Vec::new();
    }
    let settings = sections.bounds.settings();
    let mut shifts: Vec<f64> = settings[..2].iter().flat_map(ends).collect();
    shifts.sort_by(f64::total_cmp);
    shifts.dedup();
    let widths = pair
        .normal_module_mm
        .map(|module| pair.face_width_mm.common() / module);
    [
        outside(
            Range::TEETH,
            "the number of teeth",
            &pair.teeth().map(f64::from),
        ),
        outside(
            Range::PRESSURE_ANGLE,
            "pair.pressure_angle_deg",
            &[pair.pressure_angle_deg],
        ),
        outside(
            Range::FACE_WIDTH,
            "pair.face_width_mm over the normal module",
            widths.as_slice(),
        ),
        outside(
            Range::HELIX_ANGLE,
            "bounds.helix_angle_deg",
            &ends(&settings[HELIX_ANGLE])
                .into_iter()
                .map(f64::abs)
                .collect::<Vec<_>>(),
        ),
        outside(Range::PROFILE_SHIFT, "bounds.profile_shift", &shifts),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Warnings about frozen variables that the campaign's own bounds exclude.
///
/// The bounds of the radii are in modules. With a given centre distance every design has its own
/// module, so a radius is warned of only if no profile shift within the bounds allows it.
fn of_frozen(sections: &GearSections) -> Vec<String> {
    let mut warnings = Vec::new();
    let Some(frozen) = &sections.frozen else {
        return warnings;
    };
    let settings = sections.bounds.settings();
    if let (Some(helix), Some([low, high])) =
        (frozen.helix_angle_deg, settings[HELIX_ANGLE].range())
        && !(low..=high).contains(&helix)
    {
        warnings.push(format!(
            "frozen.helix_angle_deg is {helix}: bounds.helix_angle_deg allows {low} to {high}"
        ));
    }
    let Some(modules) = modules(sections, frozen, &settings) else {
        return warnings;
    };
    for (name, radii, settings) in [
        ("tip_radius", frozen.tip_radius_mm, &settings[TIP_RADII]),
        ("root_radius", frozen.root_radius_mm, &settings[ROOT_RADII]),
    ] {
        let members = ["pinion", "mate"].into_iter().zip(settings);
        for ((member, setting), radius) in members.zip(radii.into_iter().flatten()) {
            let Some([low, high]) = setting.range() else {
                continue;
            };
            let (low_mm, high_mm) = (low * modules[0], high * modules[1]);
            if !(low_mm..=high_mm).contains(&radius) {
                warnings.push(format!(
                    "frozen.{name}_mm of the {member} is {radius} mm: bounds.{name}_modules allows \
                     {low_mm:.4} to {high_mm:.4} mm ({low} to {high} modules)"
                ));
            }
        }
    }
    warnings
}

/// The smallest and largest normal module in mm of the campaign's designs with the frozen helix
/// angle. `None` if the angle is not frozen, or if a design at the bounds has no module.
fn modules(
    sections: &GearSections,
    frozen: &FrozenSection,
    settings: &[Setting],
) -> Option<[f64; 2]> {
    let pair = &sections.pair;
    let size = gear_size(pair.centre_distance_mm, pair.normal_module_mm);
    if let Size::NormalModule(module) = size {
        return Some([module; 2]);
    }
    let helix = match settings[HELIX_ANGLE] {
        Setting::Fixed(angle) => angle,
        _ => frozen.helix_angle_deg?,
    };
    let helix = helix.to_radians();
    let pressure_angle = pair.pressure_angle_deg.to_radians();
    let module = |sum| gear::normal_module(pair.teeth(), size, pressure_angle, helix, sum);
    let shifts = settings[..2].iter().map(|setting| match setting {
        Setting::Fixed(shift) => [*shift; 2],
        // The mate's shift follows only if the module is given, and that case has returned above.
        Setting::Relation(_) => settings[0].range().unwrap_or_default(),
        free => free.range().unwrap_or_default(),
    });
    let [low, high] = shifts.fold([0.0; 2], |[low, high], range| {
        [low + range[0], high + range[1]]
    });
    // Larger profile shifts give a smaller module with the same centre distance. The smallest
    // shifts may have no working pressure angle. As that angle goes to zero, m goes to
    // m(0)/cos α_t.
    let tan_transverse = pressure_angle.tan() / helix.cos();
    let largest = module(low).or_else(|_| module(0.0).map(|m| m * tan_transverse.hypot(1.0)));
    Some([module(high).ok()?, largest.ok()?])
}

#[cfg(test)]
mod tests;
