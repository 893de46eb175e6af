//! Synthetic results of a plausible shape, for the tests and the demonstration page. The numbers
//! are made up, apart from the gear outlines, which are those of the variables they stand beside.

mod gears;

use std::collections::BTreeMap;

use kriging::{Data, Settings, Surrogate};
use problem::formulation::Problem;
use problem::optimise::Solution;
use problem::{Approach, Campaign, Criteria, Design, GearCriteria};
use results::costs::StageCost;
use results::optima::Optima;
use results::report::*;
use results::snapshot::Snapshot;
use stages::cost::Cost;
use stages::fitting::ModelSummary;
use stages::optima::{NoOptimum, Optimum};
use stages::stage::Stage;
use stages::verification::Verification;
use stats::IntervalEstimate;
use store::{CampaignRow, CriteriaRow};

use gears::{contact, gears};

/// A small generator of its own, so that the data never change with a library.
struct Noise(u64);

impl Noise {
    /// Uniform in 0..1.
    fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// About standard normal.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// A whole campaign like the paper's.
pub(crate) fn plausible() -> Report {
    let doe = doe(SIMULABLE);
    let problem = problem();
    let model = model(&problem, &doe);
    let optima = Optima::new(&problem, optima());
    let recommended = optima.recommended().expect("an optimum is feasible");
    let found = recommended.optimum.found.as_ref();
    let sheet = found.map_or_else(
        |_| Vec::new(),
        |found| results::sheet::of_design(&problem, &found.design),
    );
    Report {
        snapshot: Snapshot {
            criteria: criteria(),
            samples: 204_409,
            optima,
            model: Some(model),
            costs: costs(),
            ..nothing(problem)
        },
        missing: Vec::new(),
        made: vec![("Machine".to_owned(), "bench".to_owned())],
        slices: vec![slice()],
        scatter: Vec::new(),
        indices: vec![VariableIndices {
            variable: symbol("x_p"),
            first: 0.31,
            total: 0.46,
        }],
        enrichment: Some(enrichment()),
        gears: Some(GearFigures {
            paper: Some(PaperFigures {
                preliminary: preliminary(),
                similar: similar(),
                designs: printed(),
            }),
            wear: Some(wear()),
            illustrations: illustrations(),
            sheet,
            doubts: Vec::new(),
            runs: runs(),
            doe,
        }),
    }
}

/// Number of simulable designs, of 3000.
const SIMULABLE: usize = 2175;

/// A campaign in which nothing was found.
pub(crate) fn nothing(problem: Problem) -> Snapshot {
    Snapshot {
        campaign: CampaignRow {
            name: "synthetic".to_owned(),
            file_text: Campaign::PAPER.to_owned(),
            digest: problem.campaign().digest(),
            seed: problem.campaign().seed,
            program_version: "0.1.0".to_owned(),
            model_digest: None,
        },
        problem,
        designs: Vec::new(),
        criteria: Vec::new(),
        responses: Vec::new(),
        samples: 0,
        samples_digest: "9f2c6c1d0b7e4a55e1d3c8f7a6b5948372615049f8e7d6c5b4a3928170655443"
            .to_owned(),
        optima: Optima::default(),
        runs: Vec::new(),
        model: None,
        infill: Vec::new(),
        rounds: Vec::new(),
        printed: BTreeMap::new(),
        failures: Vec::new(),
        costs: Vec::new(),
        doubts: Vec::new(),
    }
}

/// The paper's problem.
pub(crate) fn problem() -> Problem {
    Problem::new(Campaign::parse("paper.toml", Campaign::PAPER).unwrap())
}

fn enrichment() -> Enrichment {
    let rounds = (1..=4).map(|round| {
        let predicted = 1.60 - 0.06 * round as f64;
        EnrichmentRound {
            round,
            new_designs: 24 - 3 * round,
            further_turns: 3 * round,
            samples: 720,
            failed: u64::from(round > 2),
            ruled_out: 0,
            expected_improvement: 0.2 / (round * round * round) as f64,
            predicted,
            low: predicted - 0.06 / round as f64,
            high: predicted + 0.06 / round as f64,
        }
    });
    Enrichment {
        unit: "µm".to_owned(),
        rounds: rounds.collect(),
        tolerance: 0.01,
        stop: "The enrichment has converged.".to_owned(),
        doe_samples: 10_500,
        verified: Some(1.35),
        interval_of_estimate: Some((1.33, 1.39)),
    }
}

fn costs() -> Vec<StageCost> {
    let stage = |stage, cpu_seconds: f64| StageCost {
        stage,
        wall_seconds: 0.5 * cpu_seconds + 1.0,
        cpu_seconds,
    };
    vec![
        stage(Stage::Doe, 12.7),
        stage(Stage::Sample, 934.2),
        stage(Stage::Fit, 88.0),
        stage(Stage::Optimise, 310.4),
        stage(Stage::Verify, 21.6),
    ]
}

/// Rows with the reasons why designs are not simulable.
fn criteria() -> Vec<CriteriaRow> {
    let reasons = [
        (None, SIMULABLE),
        (Some("contact beyond a base tangent point: s = 1"), 611),
        (Some("involute equation has no solution"), 142),
        (Some("a mesh position has no pair in contact"), 72),
    ];
    let reasons = reasons.into_iter();
    let reasons = reasons.flat_map(|(reason, count)| std::iter::repeat_n(reason, count));
    (0..)
        .zip(reasons)
        .map(|(design, reason)| CriteriaRow {
            design,
            simulable: reason.is_none(),
            reason: reason.map(str::to_owned),
            responses: None,
        })
        .collect()
}

fn preliminary() -> Vec<PreliminaryDesign> {
    let rows = paper::PRELIMINARY.iter().zip([0.41, 0.03, 0.78, 0.22]);
    (1..)
        .zip(rows)
        .map(|(number, (printed, lilliefors_p))| PreliminaryDesign {
            number,
            printed,
            samples: 500,
            mean_um: printed.mean_um * 0.9,
            sd_um: printed.sd_um * 1.1,
            p90_um: printed.p90_um * 0.93,
            lilliefors_p,
            p90_variance_um2: printed.p90_variance_um2 * 1.21,
        })
        .collect()
}

fn similar() -> Vec<SimilarDesign> {
    (1..)
        .zip(&paper::SIMILAR)
        .map(|(number, printed)| SimilarDesign {
            number,
            printed,
            delta_ste_archard_um: printed.delta_ste_archard_um * 1.07,
            p90: Some(measure(printed.p90_um * 1.05)),
        })
        .collect()
}

fn doe(n: usize) -> Vec<DoePoint> {
    let mut noise = Noise(7);
    (0..n)
        .map(|_| {
            let delta_ste_um = 3.2 * (0.8 * noise.normal()).exp();
            let archard = 1.2 + 0.8 * delta_ste_um + 2.6 * (0.45 * noise.normal()).exp();
            DoePoint {
                delta_ste_um,
                delta_ste_archard_um: archard,
                measure_um: archard + 0.75 + 0.12 * noise.normal(),
            }
        })
        .collect()
}

/// The summary of a model of these designs, and a small model to stand beside it.
fn model(problem: &Problem, doe: &[DoePoint]) -> (ModelSummary, Surrogate) {
    let mut noise = Noise(11);
    let observed: Vec<f64> = doe.iter().map(|point| point.measure_um).collect();
    let standardised: Vec<f64> = doe.iter().map(|_| -noise.normal()).collect();
    let residuals = observed.iter().zip(&standardised).zip(0..);
    let residuals = residuals.map(|((observed, standardised), number)| {
        let deviation = 0.2 + 0.06 * observed;
        (number, 0.05 * observed - 0.3 + deviation * standardised)
    });
    let summary = ModelSummary {
        kernel: "Matérn 5/2".to_owned(),
        points: doe.len(),
        mu: 8.114,
        sigma2: 21.37,
        ranges: [1.842, 1.655, 0.8412, 0.9127, 2.315, 2.744]
            .map(Some)
            .to_vec(),
        negative_log_likelihood: 3127.45,
        q2: 0.874,
        rmse: 0.61,
        coverage90: 0.938,
        residuals: residuals.collect(),
        standardised,
        observed,
        best_of_doe: None,
        warnings: vec![
            "design 59 lies 5.1 standard deviations from its leave-one-out prediction".to_owned(),
        ],
        cpu_seconds: 88.0,
    };
    let d = problem.dimension();
    let x: Vec<f64> = (0..20 * d).map(|_| noise.uniform()).collect();
    let data = Data {
        x: &x,
        d,
        y: &x[..20],
        noise_variance: &[0.01; 20],
    };
    let surrogate = Surrogate::fit(&data, &Settings::default()).unwrap();
    (summary, surrogate)
}

fn wear() -> WearProfiles {
    let mut noise = Noise(3);
    let angles: Vec<f64> = (0..=160)
        .map(|i| 0.18 + 0.5 * f64::from(i) / 160.0)
        .collect();
    let archard: Vec<f64> = angles
        .iter()
        .map(|a| {
            let s = (a - 0.18) / 0.5;
            3.5 * (s - 0.47).abs() / 0.53 * (1.0 - 0.35 * (s * std::f64::consts::PI).sin())
        })
        .collect();
    let random = (0..10)
        .map(|_| {
            let waves: Vec<(f64, f64, f64)> = (0..6)
                .map(|_| {
                    (
                        0.05 * noise.normal(),
                        3.0 + 9.0 * noise.uniform(),
                        6.3 * noise.uniform(),
                    )
                })
                .collect();
            angles
                .iter()
                .zip(&archard)
                .map(|(a, w)| {
                    w * (1.0
                        + waves
                            .iter()
                            .map(|(c, f, p)| c * (f * a + p).cos())
                            .sum::<f64>())
                })
                .collect()
        })
        .collect();
    WearProfiles {
        subject: "Pinion flank of the optimum without wear.".to_owned(),
        roll_angle_rad: angles,
        archard_um: archard,
        random_um: random,
    }
}

fn found(row: &paper::ApproachRow, i: usize) -> Solution {
    let design = paper::printed(row.figure).expect("table 5 names printed designs");
    let margin = 0.012 * i as f64;
    let criteria = GearCriteria {
        contact_ratio: design.contact_ratio,
        specific_sliding: if i == 1 {
            2.284
        } else {
            design.specific_slip - 0.008
        },
        root_stress_mpa: design.von_mises_mpa * 1.1,
        hertz_pressure_mpa: design.pressure_mpa * 1.05,
        clearance_mm: [margin; 2],
        flank_margin_mm: [margin; 2],
        normal_module_mm: 3.0,
        details: None,
    };
    Solution {
        design: Design::new(design.variables.to_vec()),
        criterion: row.criterion * 0.95,
        criteria: Criteria::from(criteria),
        feasible: i != 1,
    }
}

/// The optima of the paper's approaches with their verification samples. Archard's breaks the slip limit.
pub(crate) fn optima() -> Vec<(Optimum, Option<Verification>)> {
    let rows = paper::APPROACHES.iter().enumerate();
    rows.map(|(i, row)| {
        let optimum = Optimum {
            approach: row.approach,
            found: Ok(found(row, i)),
            cost: Cost {
                simulator_calls: [36_000, 72_000, 126_000, 90_000][i],
                cpu_seconds: [61.2, 118.9, 1043.0, 934.2][i],
            },
            note: match i {
                1 => "with the printed penalty weight p = 10 the winner breaks g_s < 2.".to_owned(),
                _ => String::new(),
            },
        };
        let verification = verification(row.p90_um * 1.04, 0.004);
        (optimum, Some(verification))
    })
    .collect()
}

/// The same without any design.
pub(crate) fn no_optima(note: &str) -> Vec<(Optimum, Option<Verification>)> {
    let all = optima().into_iter().map(|(optimum, _)| Optimum {
        found: Err(NoOptimum::NoneSimulable),
        note: note.to_owned(),
        ..optimum
    });
    all.map(|optimum| (optimum, None)).collect()
}

/// 500 evenly spaced samples with this 90th percentile; `apart` is the distance of neighbours.
pub(crate) fn verification(p90: f64, apart: f64) -> Verification {
    let n: u32 = 500;
    let middle = 0.9 * f64::from(n - 1);
    let samples = (0..n).map(|i| p90 + apart * (f64::from(i) - middle));
    Verification {
        samples: samples.collect(),
        wanted: n as usize,
    }
}

fn illustrations() -> BTreeMap<Approach, Illustration> {
    let rows = paper::APPROACHES.iter().enumerate();
    rows.map(|(i, row)| {
        let design = paper::printed(row.figure).expect("table 5 names printed designs");
        let illustration = Illustration {
            grid_difference_um: Some(-0.0006),
            drawing: gears(&design.variables),
            ste: ste(i),
            contact: Some(contact()),
            torque: None,
        };
        (row.approach, illustration)
    })
    .collect()
}

fn runs() -> BTreeMap<Approach, Vec<OptimiserRun>> {
    let rows = paper::APPROACHES.iter().enumerate();
    let optimised = rows.filter(|(_, row)| row.approach != Approach::BestOfDoe);
    optimised
        .map(|(i, row)| (row.approach, (0..3).map(|start| run(i, start)).collect()))
        .collect()
}

fn measure(value: f64) -> IntervalEstimate {
    IntervalEstimate {
        n: 500,
        value,
        interval: Some((value - 0.05, value + 0.05)),
    }
}

fn run(approach: usize, start: u32) -> OptimiserRun {
    let mut noise = Noise(10 * approach as u64 + u64::from(start) + 1);
    let mut best = if start == 1 {
        100.0
    } else {
        20.0 + 10.0 * noise.uniform()
    };
    let end = 0.8 + 1.1 * approach as f64 + 0.3 * noise.uniform();
    let mut history = vec![(1, best)];
    for evaluations in (15..12_000).step_by(15) {
        if noise.uniform() < 0.15 {
            best = end + (best - end) * (0.75 + 0.25 * noise.uniform());
        }
        history.push((evaluations, best));
    }
    OptimiserRun {
        start,
        finished: true,
        history,
        restarts: vec![6000],
    }
}

fn ste(i: usize) -> SteCurves {
    let phase: Vec<f64> = (0..=128).map(|j| f64::from(j) / 128.0).collect();
    let wave = |level: f64, size: f64, modes: f64| {
        let tau = std::f64::consts::TAU;
        phase
            .iter()
            .map(|p| level + size * ((modes * tau * p).sin() + 0.3 * (tau * p).cos()))
            .collect()
    };
    SteCurves {
        unworn_um: wave(7.4, 0.17, 4.0),
        worn_um: wave(12.1, 0.7 + 0.2 * i as f64, 2.0),
        delta_um: [0.5, 2.1 + 0.6 * i as f64],
        phase,
    }
}

fn printed() -> Vec<PrintedDesign> {
    let designs = paper::PRINTED.iter().enumerate();
    designs
        .map(|(i, printed)| {
            let figure = |markup, unit, printed, ratio: f64| PrintedFigure {
                symbol: "",
                markup,
                unit,
                printed,
                ours: printed * ratio,
                note: String::new(),
            };
            let stress = if i == 0 { 0.333 } else { 1.15 };
            let note = match i {
                0 => "notch factor outside its range of validity",
                _ => "",
            };
            let criterion = if i == 3 { 1.95 } else { 1.04 };
            let mut figures = vec![
                figure("contact ratio", "", printed.contact_ratio, 1.003),
                figure("specific slip", "", printed.specific_slip, 0.997),
                PrintedFigure {
                    note: note.to_owned(),
                    ..figure("root stress", "MPa", printed.von_mises_mpa, stress)
                },
                figure("contact pressure", "MPa", printed.pressure_mpa, 1.12),
                figure("criterion", "µm", printed.criterion_um, criterion),
            ];
            figures.extend(
                printed
                    .p90_um
                    .map(|printed| figure("P90", "µm", printed, f64::NAN)),
            );
            PrintedDesign {
                printed,
                figures: match i {
                    4 => Err("the store holds no sample of it".to_owned()),
                    _ => Ok(figures),
                },
                illustration: (i == 0).then(|| Illustration {
                    grid_difference_um: None,
                    drawing: gears(&printed.variables),
                    ste: ste(i),
                    contact: None,
                    torque: None,
                }),
            }
        })
        .collect()
}

fn slice() -> Slice {
    let point = |k: u32| {
        let x = f64::from(k) / 30.0;
        let mean = 1.5 + (x - 0.4).powi(2);
        [x, mean, mean - 0.2, mean + 0.2]
    };
    Slice {
        variable: "x_p".to_owned(),
        label: symbol("x_p"),
        at: 0.4,
        points: (0..=30).map(point).collect(),
    }
}
