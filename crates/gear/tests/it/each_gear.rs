//! Gears of a pair that differ in material, face width or allowances.

use gear::inspection::{Allowances, Limits, Sheet, relief_length};
use gear::rating::{self, Edition, Factors};
use gear::{
    Corrections, Discretisation, Material, Member, Pair, PairInput, PlainSum, ReliefShape,
    TipRelief, ToothModel, UnloadedPair,
};

use crate::general::plain;

const STEEL: Material = Material {
    youngs_modulus_mpa: 206e3,
    poisson_ratio: 0.3,
};
const PLASTIC: Material = Material {
    youngs_modulus_mpa: 2.8e3,
    poisson_ratio: 0.35,
};

fn pair(input: &PairInput) -> Pair {
    Pair::new(input, &Discretisation::of(input.tooth_model)).unwrap()
}

fn unloaded(input: &PairInput) -> UnloadedPair {
    UnloadedPair::new(input, &Corrections::default(), &Discretisation::default()).unwrap()
}

/// Elasticity factors Z_E of ISO 6336-2:2006, table 1, √MPa: steel on spheroidal iron, on cast steel, and on itself.
#[test]
fn elasticity_factors_are_those_of_the_standard() {
    for (modulus, z_e) in [(173e3, 181.4), (202e3, 188.9), (206e3, 189.8)] {
        let mate = Material {
            youngs_modulus_mpa: modulus,
            poisson_ratio: 0.3,
        };
        let input = PairInput {
            material: [STEEL, mate],
            ..plain()
        };
        let rating = rating::rate(&unloaded(&input), 1.0, &Factors::default());
        assert!((rating.z_e - z_e).abs() < 0.05, "{modulus}: {}", rating.z_e);
    }
}

/// Two equal gears touch at the pitch point in the middle of their path, where each has half of the compliance.
#[test]
fn each_gear_has_the_compliance_of_its_material() {
    let equal = |material, tooth_model| {
        pair(&PairInput {
            teeth: [30, 30],
            profile_shift: [0.0; 2],
            tooth_model,
            material,
            ..plain()
        })
    };
    let at_pitch = |material, model, load: f64| {
        let pair = equal(material, model);
        pair.compliance_under(pair.geometry().s_pitch, load)
    };
    let surface =
        |material: Material| (1.0 - material.poisson_ratio.powi(2)) / material.youngs_modulus_mpa;
    for model in [ToothModel::HertzBeam, ToothModel::Coupled] {
        // The approach of the contact depends on its half-width, which is that of equal materials under another load.
        let half = |material| {
            let load = 100.0 * 0.5 * (surface(STEEL) + surface(PLASTIC)) / surface(material);
            0.5 * at_pitch([material; 2], model, load)
        };
        let expected = half(STEEL) + half(PLASTIC);
        for material in [[STEEL, PLASTIC], [PLASTIC, STEEL]] {
            let q = at_pitch(material, model, 100.0);
            assert!((q / expected - 1.0).abs() < 1e-9, "{model}: {q} {expected}");
        }
    }
}

/// The plain sum of whole teeth has the approach of both surfaces, too.
#[test]
fn the_plain_sum_has_both_materials() {
    let pair = pair(&PairInput {
        tooth_model: ToothModel::WholeFaceBeam,
        material: [STEEL, PLASTIC],
        ..plain()
    });
    let worn = pair.archard(&crate::support::WEAR);
    let gap = vec![0.0; worn.s.len()];
    let sum = PlainSum::new(&pair, &worn.s, [8192, 256]).delta_ste_um(&gap);
    let ratio = pair.unworn().delta_ste_um / sum;
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
}

/// The transmission error does not depend on which gear is called the pinion: seen from the other gear, the path of
/// contact runs backwards.
#[test]
fn exchanged_gears_have_the_same_transmission_error() {
    for (tooth_model, tolerance) in [(ToothModel::HertzBeam, 1e-9), (ToothModel::Coupled, 1e-2)] {
        let input = PairInput {
            tooth_model,
            material: [STEEL, PLASTIC],
            helix_angle: 0.0,
            ..plain()
        };
        let ratio = f64::from(input.teeth[1]) / f64::from(input.teeth[0]);
        let swapped = |values: [f64; 2]| [values[1], values[0]];
        let exchanged = PairInput {
            teeth: [input.teeth[1], input.teeth[0]],
            profile_shift: swapped(input.profile_shift),
            tool_addendum: swapped(input.tool_addendum),
            tool_dedendum: swapped(input.tool_dedendum),
            tip_radius: swapped(input.tip_radius),
            root_radius: swapped(input.root_radius),
            pinion_torque: ratio * input.pinion_torque,
            material: [PLASTIC, STEEL],
            ..input.clone()
        };
        let [a, b] = [&input, &exchanged].map(|input| pair(input).unworn().delta_ste_um);
        assert!((a / b - 1.0).abs() < tolerance, "{tooth_model}: {a} {b}");
    }
}

/// Teeth touch over the narrower face; the root of the wider gear bears its load on up to a module more at each end.
#[test]
fn a_wider_gear_helps_its_own_root_alone() {
    let narrow = plain();
    let [b, _] = narrow.face_width;
    let module = unloaded(&narrow).geometry().normal_module;
    let root = |input: &PairInput| {
        let rating = rating::rate(&unloaded(input), 1.0, &Factors::default());
        rating.root.map(|root| root.stress_mpa)
    };
    let [narrow_pinion, narrow_mate] = root(&narrow);
    for (extra, counted) in [(module, module), (10.0 * module, 2.0 * module)] {
        let wide = PairInput {
            face_width: [b + extra, b],
            ..narrow.clone()
        };
        assert_eq!(pair(&wide).unworn(), pair(&narrow).unworn());
        let [pinion, mate] = root(&wide);
        assert_eq!(mate, narrow_mate);
        assert!((pinion * (b + counted) / (b * narrow_pinion) - 1.0).abs() < 1e-12);
    }
}

/// A tooth that is thicker by E has the measures of one with a profile shift that is greater by E/(2 m_n tan α_n).
#[test]
fn limits_are_the_measures_of_gears_with_another_profile_shift() {
    let input = plain();
    let pair = unloaded(&input);
    let g = pair.geometry();
    let sheet = Sheet::new(&pair);
    let allowances = Allowances {
        tooth_thickness: [[-0.06, -0.1], [0.02, -0.12]],
        centre_distance: 0.025,
    };
    let limits = Limits::new(&pair, &sheet, &allowances);
    for member in Member::BOTH {
        let i = member.index();
        for (limit, allowance) in allowances.tooth_thickness[i].into_iter().enumerate() {
            let mut other = input.clone();
            other.profile_shift[i] += allowance / (2.0 * g.normal_module * g.alpha_n.tan());
            let other = unloaded(&other);
            let other = other.geometry();
            let teeth = sheet.span[i].unwrap().teeth;
            let span = gear::inspection::base_tangent_length(other, member, teeth);
            let ball = sheet.over_balls[i].unwrap().ball;
            let over = gear::inspection::over_balls(other, member, ball);
            assert!((limits.span[i].unwrap()[limit] - span).abs() < 1e-9);
            assert!((limits.over_balls[i].unwrap()[limit] - over).abs() < 1e-9);
            // The anvils touch along the normal.
            let moved = limits.span[i].unwrap()[limit] - sheet.span[i].unwrap().length;
            assert!((moved - allowance * g.alpha_n.cos()).abs() < 1e-9);
        }
    }
    let [most, least] = limits.normal_backlash;
    assert!(most > sheet.normal_backlash && most > least);
    // Thickness alone: 0.22 and 0.04 mm are missing.
    let thickness = (0.22 - 0.04) * g.alpha_n.cos();
    let distance = 4.0 * 0.025 * g.alpha_wt.sin() * g.beta_b.cos();
    assert!((most - least - thickness - distance).abs() < 1e-12);
}

#[test]
fn a_relief_from_a_diameter_has_the_length_that_leads_to_it() {
    let relief = |length| TipRelief {
        amount: 0.01,
        length,
        shape: ReliefShape::Linear,
    };
    let corrections = Corrections::default()
        .with_tip_relief(Member::Pinion, relief(1.5))
        .with_tip_relief(Member::Gear, relief(2.5));
    let pair = UnloadedPair::new(&plain(), &corrections, &Discretisation::default()).unwrap();
    let sheet = Sheet::new(&pair);
    let diameters = sheet.relief_diameter;
    // Where the pinion's relief starts, the mate touches at the diameter at which its root relief would end.
    let g = pair.geometry();
    let s = g.s_out - 1.5;
    let end = 2.0 * g.r_b[1].hypot(g.path_length - s);
    assert!((sheet.root_relief_diameter[1].unwrap() - end).abs() < 1e-9);
    for (member, length) in Member::BOTH.into_iter().zip([1.5, 2.5]) {
        let diameter = diameters[member.index()].unwrap();
        assert!((relief_length(pair.geometry(), member, diameter) - length).abs() < 1e-9);
    }
}

/// Either gear of a pair may drive.
#[test]
fn the_mesh_stiffness_does_not_depend_on_which_gear_is_the_pinion() {
    let of = |input: &PairInput| {
        let rating = rating::rate(&unloaded(input), 1.0, &Factors::default());
        rating.stiffness.mesh_alpha
    };
    let input = plain();
    let mut other = input.clone();
    other.teeth.reverse();
    other.profile_shift.reverse();
    other.pinion_torque *= f64::from(input.teeth[1]) / f64::from(input.teeth[0]);
    assert_ne!(input.teeth[0], input.teeth[1]);
    assert!((of(&other) / of(&input) - 1.0).abs() < 1e-9);
}

/// Below a line load F_t K_A/b of 100 N/mm the stiffness falls with the fourth root of the load.
#[test]
fn the_mesh_stiffness_falls_under_a_light_load_only() {
    let of = |torque: f64, application_factor: f64| {
        let input = PairInput {
            pinion_torque: torque,
            ..plain()
        };
        let factors = Factors {
            application_factor,
            ..Factors::default()
        };
        let rating = rating::rate(&unloaded(&input), 1.0, &factors);
        (rating.tangential_force, rating.stiffness.single)
    };
    let input = plain();
    let full = of(1e6, 1.0);
    // The torque at which F_t/b is 100 N/mm.
    let limit = 1e6 * 100.0 * input.face_width[0] / full.0;
    for (torque, application_factor, part) in [
        (2.0 * limit, 1.0, 1.0),
        (limit / 16.0, 1.0, 0.5),
        (limit / 32.0, 2.0, 0.5),
    ] {
        let found = of(torque, application_factor).1 / full.1;
        assert!((found - part).abs() < 1e-9, "{torque}: {found}");
    }
}

/// Beyond 30° the factor Y_β is that of 30°, in both editions.
#[test]
fn the_helix_factor_of_the_root_grows_to_thirty_degrees() {
    for edition in [Edition::Of2006, Edition::Of2019] {
        let of = |degrees: f64| {
            let input = PairInput {
                helix_angle: degrees.to_radians(),
                ..plain()
            };
            let factors = Factors {
                edition,
                ..Factors::default()
            };
            let rating = rating::rate(&unloaded(&input), 1.0, &factors);
            assert!(rating.root[0].y_beta > 0.0);
            rating.root[0].y_beta
        };
        assert!((of(35.0) - of(30.0)).abs() < 1e-9, "{edition:?}");
        assert!((of(25.0) - of(30.0)).abs() > 1e-3, "{edition:?}");
    }
}
