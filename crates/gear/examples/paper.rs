//! Our numbers beside those printed in the paper: Figures 6 to 10, Table 1 and Table 4.
//!
//! Run with `cargo run --release -p gear --example paper`.

#![expect(
    clippy::print_stdout,
    reason = "an example shows its results on standard output"
)]

use gear::{Discretisation, Kernel, Material, Pair, PairInput, Size, TipRule, ToothModel, Wear};
use stats::streams::{Purpose, stream};

/// Wear of the paper's campaign.
const WEAR: Wear = Wear {
    max_depth: 3.5e-3,
    kernel: Kernel::SquaredExponential,
    range: 0.2,
    variance: 0.01,
};

/// The 6-variable problem's design: x, ha0, hf0 of both gears; the rest is frozen.
fn design(v: [f64; 6]) -> PairInput {
    full(v, [0.0003, 0.19], [0.64, 0.23], 30.0)
}

fn full(v: [f64; 6], tip: [f64; 2], root: [f64; 2], beta_deg: f64) -> PairInput {
    PairInput {
        teeth: [20, 22],
        size: Size::CentreDistance(110.0),
        pressure_angle: 18_f64.to_radians(),
        helix_angle: beta_deg.to_radians(),
        face_width: 10.0,
        profile_shift: [v[0], v[1]],
        tool_addendum: [v[2], v[3]],
        tool_dedendum: [v[4], v[5]],
        tip_radius: tip,
        root_radius: root,
        tip_diameter: [None, None],
        tooth_model: ToothModel::HertzBeam,
        tip_rule: TipRule::AsCut,
        pinion_torque: 200e3,
        material: Material {
            youngs_modulus_mpa: 200e3,
            poisson_ratio: 0.29,
            yield_mpa: 980.0,
            hertz_limit_mpa: 1550.0,
        },
    }
}

/// Mean, standard deviation and mean + 1.28 SD of 500 draws, µm.
fn sample(pair: &Pair) -> (f64, f64, f64) {
    let mut sampler = pair.sampler(&WEAR);
    let draws: Vec<f64> = (0..500)
        .map(|k| sampler.draw(&mut stream(2009, Purpose::Wear, 0, k)))
        .collect();
    let mean = draws.iter().sum::<f64>() / 500.0;
    let var = draws.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / 499.0;
    (mean, var.sqrt(), mean + 1.28 * var.sqrt())
}

fn main() -> Result<(), gear::Error> {
    let disc = Discretisation::default();
    println!("Figures 6 to 10: ours (paper)");
    let rows = [
        (
            "Fig. 6",
            full(
                [-0.2, 0.2, 1.5, 1.4, 1.3, 1.17],
                [0.2, 0.1],
                [0.05, 0.1],
                10.0,
            ),
            ["2", "592", "11683", "1556", "2.45 unworn", "-"],
        ),
        (
            "Fig. 7",
            design([0.49, 0.49, 1.20, 1.11, 1.00, 1.09]),
            ["1.66", "1.47", "938", "443", "0.38 unworn", "6.38"],
        ),
        (
            "Fig. 8",
            design([0.20, 1.26, 1.44, 1.49, 1.27, 0.92]),
            ["1.71", "2.00", "1189", "558", "-", "3.37"],
        ),
        (
            "Fig. 9",
            design([-0.028, 0.86, 1.26, 1.32, 1.20, 0.81]),
            ["1.62", "2.00", "1115", "631", "1.49 Archard", "2.64"],
        ),
        (
            "Fig. 10",
            design([-0.004, 0.37, 1.37, 1.51, 1.27, 0.87]),
            ["1.72", "1.96", "1228", "614", "-", "3.29"],
        ),
    ];
    for (name, input, paper) in rows {
        let pair = Pair::new(&input, &disc)?;
        let unworn = pair.unworn();
        let worn = pair.archard(&WEAR).analysis;
        let stress = pair.root_stress();
        let root = stress[0].stress_mpa.max(stress[1].stress_mpa);
        let flag = if stress.iter().all(|s| s.in_range) {
            ""
        } else {
            " (notch out of range)"
        };
        let (mean, sd, p90) = sample(&pair);
        println!(
            "{name:8} m {:.3}  r_c {:.3} ({})  g_s {:.3} ({})  F {:.0} unworn {:.0} worn ({})  \
             σ_vm {root:.0}{flag} ({})",
            pair.geometry().normal_module,
            pair.geometry().contact_ratio,
            paper[0],
            pair.sliding().max,
            paper[1],
            unworn.hertz_pressure_mpa,
            worn.hertz_pressure_mpa,
            paper[2],
            paper[3],
        );
        println!(
            "         ΔSTE {:.3} unworn, {:.3} Archard ({})  random {mean:.2} ± {sd:.2}, P90 {p90:.2} \
             ({})  interference {:?}",
            unworn.delta_ste_um,
            worn.delta_ste_um,
            paper[4],
            paper[5],
            pair.interference(),
        );
    }

    println!("\nTable 1: mean, SD and P90 of ΔSTE over 500 samples, ours (paper)");
    for (k, (v, paper)) in [
        ([0.49, 0.49, 1.20, 1.11, 1.00, 1.09], [5.82, 0.41, 6.34]),
        ([0.00, 0.20, 1.02, 1.00, 0.90, 1.00], [6.22, 0.66, 7.06]),
        ([1.10, 1.00, 1.30, 1.40, 0.90, 0.90], [7.30, 0.44, 7.87]),
        ([0.40, -0.40, 1.70, 1.00, 0.90, 1.60], [6.66, 0.45, 7.24]),
    ]
    .into_iter()
    .enumerate()
    {
        let pair = Pair::new(&design(v), &disc)?;
        let archard = pair.archard(&WEAR).analysis.delta_ste_um;
        let (mean, sd, p90) = sample(&pair);
        println!(
            "#{}  Archard {archard:.2}  mean {mean:.2} ({})  SD {sd:.2} ({})  P90 {p90:.2} ({})",
            k + 1,
            paper[0],
            paper[1],
            paper[2]
        );
    }

    println!("\nTable 4: ΔSTE under Archard's wear and P90 over 500 samples, ours (paper)");
    for (k, (v, paper)) in [
        ([0.25, 1.37, 1.37, 0.85, 1.31, 0.80], [2.42, 3.03]),
        ([0.18, 0.69, 1.54, 1.01, 1.08, 1.05], [2.44, 3.07]),
        ([-0.21, 1.11, 0.90, 1.23, 1.61, 0.90], [2.46, 3.34]),
        ([-0.02, 1.10, 1.03, 0.81, 1.41, 1.00], [2.42, 3.21]),
        ([0.15, 0.71, 1.44, 1.07, 1.63, 1.16], [2.48, 2.88]),
        ([-0.12, -0.08, 1.25, 1.19, 1.63, 1.61], [2.45, 2.84]),
    ]
    .into_iter()
    .enumerate()
    {
        let pair = Pair::new(&design(v), &disc)?;
        let archard = pair.archard(&WEAR).analysis.delta_ste_um;
        let (_, sd, p90) = sample(&pair);
        println!(
            "#{}  Archard {archard:.2} ({})  SD {sd:.2}  P90 {p90:.2} ({})",
            k + 1,
            paper[0],
            paper[1]
        );
    }
    Ok(())
}
