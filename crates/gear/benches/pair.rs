//! One new design, one worn sample, and the plain 64 × 21 sum on the same gap.
//!
//! Run with `cargo bench -p gear`. Accuracy goes with speed: the command `coordinator tradeoff`
//! measures both.

use divan::{Bencher, black_box};
use gear::paper::{BOX, FIGURE_7, WEAR, design};
use gear::{Discretisation, Pair, PairInput, PlainSum, ToothModel};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

/// Designs of the random mix. A single design is not representative: the flanks of some separate.
const DESIGNS: usize = 32;

fn designs(model: ToothModel) -> Vec<Pair> {
    let mut rng = stream(2009, Purpose::Test, 0, 0);
    let mut pairs = vec![
        Pair::new(
            &PairInput {
                tooth_model: model,
                ..design(FIGURE_7)
            },
            &Discretisation::of(model),
        )
        .expect("the paper's Figure 7 is feasible"),
    ];
    while pairs.len() < DESIGNS {
        pairs.extend(Pair::new(
            &PairInput {
                tooth_model: model,
                ..design(BOX.map(|[low, high]| rng.random_range(low..high)))
            },
            &Discretisation::of(model),
        ));
    }
    pairs
}

#[divan::bench(args = ToothModel::ALL, name = "new design, criteria, unworn and Archard")]
fn new_design(bencher: Bencher, model: &ToothModel) {
    let pairs = designs(*model);
    let mut next = pairs.iter().cycle();
    bencher.bench_local(|| {
        let pair = next.next().expect("a cycle has no end");
        let pair = Pair::new(pair.input(), &Discretisation::of(*model));
        pair.map(|pair| {
            black_box((pair.sliding(), pair.interference(), pair.root_stress()));
            (pair.unworn(), pair.archard(&WEAR))
        })
    });
}

#[divan::bench(args = ToothModel::ALL)]
fn sampler(bencher: Bencher, model: &ToothModel) {
    let pairs = designs(*model);
    let mut next = pairs.iter().cycle();
    bencher.bench_local(|| next.next().expect("a cycle has no end").sampler(&WEAR));
}

#[divan::bench(args = ToothModel::ALL, name = "worn sample")]
fn worn_sample(bencher: Bencher, model: &ToothModel) {
    let pairs = designs(*model);
    let mut samplers: Vec<_> = pairs.iter().map(|pair| pair.sampler(&WEAR)).collect();
    let mut k = 0;
    bencher.bench_local(|| {
        k += 1;
        samplers[k % DESIGNS].draw(&mut stream(2009, Purpose::Test, 1, k as u64))
    });
}

#[divan::bench(args = ToothModel::ALL, name = "plain 64 x 21 sum without its random field")]
fn plain_sum(bencher: Bencher, model: &ToothModel) {
    let pairs = designs(*model);
    let mut sums: Vec<_> = pairs
        .iter()
        .map(|pair| {
            let profile = pair
                .sampler(&WEAR)
                .draw_profile(&mut stream(2009, Purpose::Test, 2, 0));
            let [a, b] = &profile.depth;
            let gap: Vec<f64> = a.iter().zip(b).map(|(a, b)| a + b).collect();
            (
                PlainSum::new(pair, &pair.archard(&WEAR).s, PlainSum::TEXTBOOK),
                gap,
            )
        })
        .collect();
    let mut k = 0;
    bencher.bench_local(|| {
        k = (k + 1) % DESIGNS;
        let (sum, gap) = &mut sums[k];
        sum.delta_ste_um(gap)
    });
}

fn main() {
    divan::main();
}
