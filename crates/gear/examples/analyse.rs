//! Prints all results of the simulator for one pair: by default the paper's optimum without wear
//! (its Figure 7), or one with other profile shifts and tool heights.
//!
//! Run with `cargo run --release -p gear --example analyse -- x1 x2 ha0_1 ha0_2 hf0_1 hf0_2 [model]`.

#![expect(
    clippy::print_stdout,
    reason = "an example shows its results on standard output"
)]

use std::error::Error;

use gear::{
    Discretisation, Member, Pair, PairInput, ToothModel, gear_outline,
    paper::{self, WEAR},
    rating,
};
use stats::streams::{Purpose, stream};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mut v = paper::FIGURE_7;
    for (value, argument) in v.iter_mut().zip(&arguments) {
        *value = argument.parse()?;
    }
    let mut models = ToothModel::ALL.iter();
    let tooth_model = match arguments.get(6) {
        None => ToothModel::HertzBeam,
        Some(name) => *models
            .find(|model| model.to_string() == *name)
            .ok_or_else(|| format!("no tooth model is called {name}"))?,
    };
    let input = PairInput {
        tooth_model,
        ..paper::design(v)
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

    println!(
        "ISO 6336, for comparison: {:#?}",
        rating::rate(&pair, 1.0, &rating::Factors::default())
    );

    let (unworn, worn) = (pair.unworn(), pair.archard(&WEAR));
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
    let mut sampler = pair.sampler(&WEAR);
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
