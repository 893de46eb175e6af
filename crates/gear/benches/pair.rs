//! One new design, one worn sample, and the plain 64 × 21 sum on the same gap.
//!
//! Run with `cargo bench -p gear`. Accuracy goes with speed: the command `coordinator tradeoff`
//! measures both.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
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
            &Discretisation::default(),
        )
        .expect("the paper's Figure 7 is feasible"),
    ];
    while pairs.len() < DESIGNS {
        pairs.extend(Pair::new(
            &PairInput {
                tooth_model: model,
                ..design(BOX.map(|[low, high]| rng.random_range(low..high)))
            },
            &Discretisation::default(),
        ));
    }
    pairs
}

fn bench(criterion: &mut Criterion) {
    for &model in ToothModel::ALL {
        let pairs = designs(model);
        let mut group = criterion.benchmark_group(model.name());
        group.bench_function("new design, criteria, unworn and Archard", |b| {
            let mut k = 0;
            b.iter(|| {
                k = (k + 1) % DESIGNS;
                let pair = Pair::new(pairs[k].input(), &Discretisation::default());
                pair.map(|pair| {
                    black_box((pair.sliding(), pair.interference(), pair.root_stress()));
                    (pair.unworn(), pair.archard(&WEAR))
                })
            });
        });
        group.bench_function("sampler", |b| {
            let mut k = 0;
            b.iter(|| {
                k = (k + 1) % DESIGNS;
                pairs[k].sampler(&WEAR)
            });
        });
        let mut samplers: Vec<_> = pairs.iter().map(|pair| pair.sampler(&WEAR)).collect();
        group.bench_function("worn sample", |b| {
            let mut k = 0;
            b.iter(|| {
                k += 1;
                samplers[k % DESIGNS].draw(&mut stream(2009, Purpose::Test, 1, k as u64))
            });
        });
        let mut sums: Vec<_> = pairs
            .iter()
            .zip(&mut samplers)
            .map(|(pair, sampler)| {
                let profile = sampler.draw_profile(&mut stream(2009, Purpose::Test, 2, 0));
                let [a, b] = &profile.depth;
                let gap: Vec<f64> = a.iter().zip(b).map(|(a, b)| a + b).collect();
                (
                    PlainSum::new(pair, &pair.archard(&WEAR).s, PlainSum::TEXTBOOK),
                    gap,
                )
            })
            .collect();
        group.bench_function("plain 64 x 21 sum without its random field", |b| {
            let mut k = 0;
            b.iter(|| {
                k = (k + 1) % DESIGNS;
                let (sum, gap) = &mut sums[k];
                sum.delta_ste_um(gap)
            });
        });
        group.finish();
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
