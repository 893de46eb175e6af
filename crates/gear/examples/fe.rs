use gear::*;
use serde_json::Value;
use std::time::Instant;
fn q(mut v: Vec<f64>, l: f64) -> f64 {
    if v.is_empty() {
        return f64::NAN;
    }
    v.sort_by(f64::total_cmp);
    let at = l * (v.len() - 1) as f64;
    let (a, b) = (v[at.floor() as usize], v[at.ceil() as usize]);
    a + at.fract() * (b - a)
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let phases: usize = args[2].parse().unwrap();
    let model = match args[3].as_str() {
        "wb" => ToothModel::WeberBanaschek,
        _ => ToothModel::Coupled,
    };
    let verbose = args.len() > 4;
    let pairs: Value = serde_json::from_str(&std::fs::read_to_string(&args[1]).unwrap()).unwrap();
    let two = |v: &Value| [v[0].as_f64().unwrap(), v[1].as_f64().unwrap()];
    let mut rows: Vec<(Vec<String>, f64, f64, f64, f64)> = vec![];
    let mut designs = vec![];
    let mut samples = vec![];
    for p in pairs.as_array().unwrap() {
        let m = p["normal_module_mm"].as_f64().unwrap();
        let rho = two(&p["root_radius"]).map(|r| r * m);
        let beta = p["helix_angle_deg"].as_f64().unwrap();
        for c in p["cases"].as_array().unwrap() {
            let input = PairInput {
                teeth: [
                    p["teeth"][0].as_u64().unwrap() as u32,
                    p["teeth"][1].as_u64().unwrap() as u32,
                ],
                size: Size::NormalModule(m),
                pressure_angle: p["pressure_angle_deg"].as_f64().unwrap().to_radians(),
                helix_angle: beta.to_radians(),
                face_width: p["face_width_mm"].as_f64().unwrap(),
                profile_shift: two(&p["profile_shift"]),
                tool_addendum: two(&p["tool_addendum"]),
                tool_dedendum: two(&p["tool_dedendum"]),
                tip_radius: [0.0; 2],
                root_radius: rho,
                tip_diameter: [None; 2],
                hub_radius: two(&p["hub_radius_mm"]).map(Some),
                tooth_model: model,
                tip_rule: TipRule::AsCut,
                pinion_torque: c["pinion_torque_nmm"].as_f64().unwrap(),
                material: Material {
                    youngs_modulus_mpa: 206e3,
                    poisson_ratio: 0.3,
                    yield_mpa: 900.0,
                    hertz_limit_mpa: 1500.0,
                },
            };
            let mut corr = Corrections::default();
            if c["tip_relief_um"].is_array() {
                let (a, l) = (two(&c["tip_relief_um"]), two(&c["tip_relief_length_mm"]));
                for (i, mem) in Member::BOTH.into_iter().enumerate() {
                    corr = corr.with_tip_relief(
                        mem,
                        TipRelief {
                            amount: a[i] * 1e-3,
                            length: l[i],
                            shape: ReliefShape::Linear,
                        },
                    );
                }
            }
            if let Some(v) = c["crowning_um"].as_f64() {
                corr = corr.with_crowning(v * 1e-3);
            }
            if let Some(v) = c["helix_slope_um"].as_f64() {
                corr = corr.with_helix_slope(v * 1e-3);
            }
            let disc = Discretisation { cells: 64, phases };
            let t = Instant::now();
            let pair = match Pair::with_corrections(&input, &corr, &disc) {
                Ok(p) => p,
                Err(e) => {
                    println!("{} {}: {e}", p["name"], c["name"]);
                    continue;
                }
            };
            designs.push(t.elapsed().as_secs_f64());
            let gap: Vec<f64> = match c["wear_um"].as_array() {
                None => vec![0.0; pair.path().len()],
                Some(w) => {
                    let s: Vec<f64> = p["wear_places_mm"]
                        .as_array()
                        .unwrap()
                        .iter()
                        .map(|v| v.as_f64().unwrap())
                        .collect();
                    pair.path()
                        .iter()
                        .map(|&x| {
                            let k = s.partition_point(|&a| a <= x).clamp(1, s.len() - 1);
                            let u = ((x - s[k - 1]) / (s[k] - s[k - 1])).clamp(0.0, 1.0);
                            let g = |k: usize| w[k].as_f64().unwrap() * 1e-3;
                            g(k - 1) + u * (g(k) - g(k - 1))
                        })
                        .collect()
                }
            };
            let a = pair.with_gap(&gap);
            let wear = Wear {
                law: WearLaw::Archard { max_depth_um: 3.0 },
                kernel: Kernel::SquaredExponential,
                range: 0.2,
                variance: 0.01,
            };
            use stats::streams::{Purpose, stream};
            let mut rng = stream(1, Purpose::Test, 0, 0);
            let mut sampler = pair.sampler(&wear);
            let t = Instant::now();
            for _ in 0..20 {
                std::hint::black_box(sampler.draw(&mut rng));
            }
            samples.push(t.elapsed().as_secs_f64() / 20.0);
            let (r, rm, rp) = (
                c["delta_ste_um"].as_f64().unwrap(),
                c["mean_ste_um"].as_f64().unwrap(),
                c["pressure_mpa"].as_f64().unwrap(),
            );
            let mean = a.ste_um.iter().sum::<f64>() / a.ste_um.len() as f64;
            let e = (a.delta_ste_um - r).abs();
            let e = (e / r * 100.0).min(e / 0.05 * 5.0);
            let mut cls: Vec<String> = c["classes"]
                .as_array()
                .unwrap()
                .iter()
                .map(|s| s.as_str().unwrap().to_owned())
                .collect();
            cls.push(if beta == 0.0 { "spur" } else { "helical" }.into());
            let eb = pair.geometry().eps_beta;
            if eb > 0.5 && (eb - eb.round()).abs() < 0.02 {
                cls.push("integer".into());
            }
            cls.push("all".into());
            if verbose {
                println!(
                    "{:18} {:32} fe {:7.3} got {:7.3} {:+6.1}% mean {:6.2} {:6.2} p {:6.0} {:6.0}",
                    p["name"].as_str().unwrap(),
                    c["name"].as_str().unwrap(),
                    r,
                    a.delta_ste_um,
                    100.0 * (a.delta_ste_um / r - 1.0),
                    rm,
                    mean,
                    rp,
                    a.hertz_pressure_mpa
                );
            }
            rows.push((
                cls,
                e,
                a.delta_ste_um / r - 1.0,
                mean / rm - 1.0,
                a.hertz_pressure_mpa / rp - 1.0,
            ));
        }
    }
    for class in [
        "all",
        "spur",
        "helical",
        "bare",
        "relieved",
        "worn",
        "misaligned",
        "crowned",
        "integer",
    ] {
        let r: Vec<_> = rows
            .iter()
            .filter(|r| r.0.iter().any(|c| c == class))
            .collect();
        let col = |f: &dyn Fn(&&(Vec<String>, f64, f64, f64, f64)) -> f64| {
            r.iter().map(|r| f(r)).collect::<Vec<_>>()
        };
        println!(
            "{class:10} {:4} err {:5.1} {:6.1} bias {:+5.1}% mean {:+5.1} |p95 {:5.1}| p {:+5.1} |p95 {:5.1}|",
            r.len(),
            q(col(&|r| r.1), 0.5),
            q(col(&|r| r.1), 0.95),
            100.0 * q(col(&|r| r.2), 0.5),
            100.0 * q(col(&|r| r.3), 0.5),
            100.0 * q(col(&|r| r.3.abs()), 0.95),
            100.0 * q(col(&|r| r.4), 0.5),
            100.0 * q(col(&|r| r.4.abs()), 0.95)
        );
    }
    println!(
        "design ms {:.2} [{:.2} {:.2}]  sample us {:.1} [{:.1} {:.1}]",
        1e3 * q(designs.clone(), 0.5),
        1e3 * q(designs.clone(), 0.05),
        1e3 * q(designs, 0.95),
        1e6 * q(samples.clone(), 0.5),
        1e6 * q(samples.clone(), 0.05),
        1e6 * q(samples, 0.95)
    );
}
