//! Prints everything the simulator says about one pair: by default the paper's optimum without
//! wear (its Figure 7), or one with other profile shifts and tool heights.
//!
//! Run with `cargo run --release -p gear --example analyse -- x1 x2 ha0_1 ha0_2 hf0_1 hf0_2 [model]`.

#![expect(
    clippy::print_stdout,
    reason = "an example shows its results on standard output"
)]

use std::error::Error;

use gear::{
    Discretisation, Kernel, Material, Member, Pair, PairInput, Size, TipRule, ToothModel, Wear,
    gear_outline, rating,
};
use stats::streams::{Purpose, stream};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mut v = [0.49, 0.49, 1.20, 1.11, 1.00, 1.09];
    for (value, argument) in v.iter_mut().zip(&arguments) {
        *value = argument.parse()?;
    }
    let tooth_model = arguments
        .get(6)
        .map_or(Ok(ToothModel::HertzBeam), |name| name.parse())?;
    let input = PairInput {
        teeth: [20, 22],
        size: Size::CentreDistance(110.0),
        pressure_angle: 18_f64.to_radians(),
        helix_angle: 30_f64.to_radians(),
        face_width: 10.0,
        profile_shift: [v[0], v[1]],
        tool_addendum: [v[2], v[3]],
        tool_dedendum: [v[4], v[5]],
        tip_radius: [0.0003, 0.19],
        root_radius: [0.64, 0.23],
        tip_diameter: [None, None],
        tooth_model,
        tip_rule: TipRule::AsCut,
        pinion_torque: 200e3,
        material: Material {
            youngs_modulus_mpa: 200e3,
            poisson_ratio: 0.29,
            yield_mpa: 980.0,
            hertz_limit_mpa: 1550.0,
        },
    };
    let wear = Wear {
        max_depth: 3.5e-3,
        kernel: Kernel::SquaredExponential,
        range: 0.2,
        variance: 0.01,
    };

    let pair = Pair::new(&input, &Discretisation::default())?;
    println!("{:#?}", pair.geometry());
    println!("{:#?}", pair.sliding());
    println!(
        "{:#?} clear: {}",
        pair.interference(),
        pair.interference().is_clear()
    );
    for (member, stress) in Member::BOTH.into_iter().zip(pair.root_stress()) {
        println!("{member}: {stress:#?}");
    }
    println!(
        "single pair stiffness at the pitch point {:.2} N/(mm µm)",
        pair.pitch_stiffness()
    );

    println!("ISO 6336, for comparison: {:#?}", rating::rate(&pair, 1.0));

    let (unworn, worn) = (pair.unworn(), pair.archard(&wear));
    println!("{:>8} {:>10}", "phase", "STE µm");
    for (phase, ste) in unworn.phases.iter().zip(&unworn.ste_um) {
        println!("{phase:8.4} {ste:10.4}");
    }
    for (state, analysis) in [("unworn", &unworn), ("worn", &worn.analysis)] {
        println!(
            "{state}: ΔSTE {:.4} µm, Hertz pressure {:.1} MPa",
            analysis.delta_ste_um, analysis.hertz_pressure_mpa
        );
    }
    let mut sampler = pair.sampler(&wear);
    print!(
        "random wear ({} modes, {:.1e} and {:.1e} of the variance left out), ΔSTE in µm:",
        sampler.modes(),
        sampler.truncation()[0],
        sampler.truncation()[1]
    );
    for k in 0..8 {
        print!(
            " {:.4}",
            sampler.draw(&mut stream(2009, Purpose::Wear, 0, k))
        );
    }
    println!();
    println!(
        "outline of the pinion: {} points",
        gear_outline(&pair, Member::Pinion, 24).len()
    );
    Ok(())
}
