//! An external simulator that takes a millisecond of CPU time per sample.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::Context as _;
use rustix::time::{ClockId, clock_gettime};
use serde_json::{Value, json};

fn cpu_nanoseconds() -> i64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec * 1_000_000_000 + time.tv_nsec
}

/// Answers requests until there are no more.
pub(super) fn simulate() -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    for line in std::io::stdin().lock().lines() {
        let request: Value = serde_json::from_str(&line?)?;
        let id = &request["id"];
        let answer = match request["request"].as_str() {
            Some("describe") => json!({"id": id, "protocol": 2, "version": "slow 1"}),
            Some("sample") => {
                // Time on the processor, so that a sample costs the same on a busy machine.
                let until = cpu_nanoseconds() + 1_000_000;
                while cpu_nanoseconds() < until {
                    std::hint::spin_loop();
                }
                json!({"id": id, "delta_ste_um": 1.5})
            }
            _ => json!({"id": id, "contact_ratio": 1.6, "specific_sliding": 1.3,
                "root_stress_mpa": 500.0, "clearance_p_mm": 0.9, "clearance_r_mm": 0.6,
                "flank_margin_p_mm": 0.4, "flank_margin_r_mm": 0.2,
                "delta_ste_um": 1.25, "hertz_pressure_mpa": 1180.0,
                "delta_ste_archard_um": 1.25, "hertz_pressure_worn_mpa": 1180.0}),
        };
        writeln!(out, "{answer}")?;
        out.flush()?;
    }
    Ok(())
}

/// Sends the program the requests of a worker.
pub(super) fn ask(program: &Path, designs: usize, samples: usize) -> anyhow::Result<()> {
    let mut child = Command::new(program)
        .arg("simulate")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?;
    let mut to = child.stdin.take().context("it is piped")?;
    let mut from = BufReader::new(child.stdout.take().context("it is piped")?);
    let design = json!({"x_p": 0.25, "x_r": 0.5, "ha0_p": 1.4, "ha0_r": 1.3, "hf0_p": 1.1,
        "hf0_r": 1.0, "rho_a_p_mm": 0.1, "rho_a_r_mm": 0.1, "rho_f_p_mm": 0.8,
        "rho_f_r_mm": 0.8, "beta_deg": 30.0, "normal_module_mm": 4.36});
    let mut line = String::new();
    for _ in 0..designs {
        // One evaluation for each state.
        let questions = ["evaluate", "evaluate"]
            .into_iter()
            .chain(std::iter::repeat_n("sample", samples));
        for request in questions {
            let seed = [
                2_683_476_519_u32,
                2_690_815_214,
                3_170_936_498,
                3_816_220_716,
            ];
            let asked = json!({"id": 1, "request": request, "design": design, "seed": seed});
            writeln!(to, "{asked}")?;
            line.clear();
            from.read_line(&mut line)?;
            let answer: Value = serde_json::from_str(&line)?;
            std::hint::black_box(answer["delta_ste_um"].as_f64());
        }
    }
    drop(to);
    child.wait()?;
    Ok(())
}
