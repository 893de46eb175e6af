//! Our numbers beside those printed in the paper: Figures 6 to 10, Table 1 and Table 4.
//!
//! Run with `cargo run --release -p gear --example paper`.

#![expect(
    clippy::print_stdout,
    reason = "an example shows its results on standard output"
)]

mod printed;

use gear::paper::{FIGURE_7, WEAR, design};
use gear::{Discretisation, Pair, PairInput};
use printed::{OPTIMA, TABLE_1, TABLE_4};
use stats::streams::{Purpose, stream};

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
            PairInput {
                tip_radius: [0.2, 0.1],
                root_radius: [0.05, 0.1],
                helix_angle: 10_f64.to_radians(),
                ..design([-0.2, 0.2, 1.5, 1.4, 1.3, 1.17])
            },
            ["2", "592", "11683", "1556", "2.45 unworn", "-"],
        ),
        (
            "Fig. 7",
            design(FIGURE_7),
            ["1.66", "1.47", "938", "443", "0.38 unworn", "6.38"],
        ),
        (
            "Fig. 8",
            design(OPTIMA[0].0),
            ["1.71", "2.00", "1189", "558", "-", "3.37"],
        ),
        (
            "Fig. 9",
            design(OPTIMA[1].0),
            ["1.62", "2.00", "1115", "631", "1.49 Archard", "2.64"],
        ),
        (
            "Fig. 10",
            design(OPTIMA[2].0),
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
    for (k, (v, paper)) in TABLE_1.into_iter().enumerate() {
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
    for (k, (v, paper)) in TABLE_4.into_iter().enumerate() {
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
