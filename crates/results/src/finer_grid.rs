//! The error of the campaign's grid: an optimum's measure on a finer grid.

use problem::Design;
use problem::formulation::Problem;
use problem::task::VERIFICATION;
use stats::Samples;
use stats::streams::stream;

/// Samples of both measures, from the same random numbers.
const SAMPLES: u64 = 100;

/// The measure on a grid twice as fine less that on the campaign's grid, µm. It is about three quarters of the
/// campaign grid's error, which falls with the square of the cell size. `None` if the built-in model cannot simulate
/// the design, and for an external simulator.
pub(crate) fn difference_um(problem: &Problem, design: &Design) -> Option<f64> {
    let mut campaign = problem.campaign().clone();
    if campaign.is_external() {
        return None;
    }
    campaign.gears_mut()?.grid = problem.gears()?.discretisation().refined(2);
    Some(measure(&Problem::new(campaign), design)? - measure(problem, design)?)
}

fn measure(problem: &Problem, design: &Design) -> Option<f64> {
    let mut sampler = problem.gears()?.loaded(design).ok()?.sampler();
    let campaign = problem.campaign();
    let (purpose, number) = VERIFICATION;
    let mut samples = Samples::none(problem.sampled().len());
    for index in 0..SAMPLES {
        samples.push(&sampler.draw(&mut stream(campaign.seed, purpose, number, index)));
    }
    let values = problem.objective().values(&samples);
    let verified = campaign.sampling.verified(&values).ok()?;
    Some(verified.value)
}

#[cfg(test)]
mod tests {
    use problem::Campaign;

    use super::*;

    #[test]
    fn the_campaigns_grid_is_close_to_a_finer_one() {
        let campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        let problem = Problem::new(campaign);
        let x = problem.free_point(&[0.5; 6]);
        let design = problem.design(&x, problem.base());
        let difference = difference_um(&problem, &design).unwrap().abs();
        assert!(difference > 0.0 && difference < 0.01, "{difference}");
    }

    /// The greatest ΔSTE of all cases of relieved flanks, as the campaign samples it.
    #[test]
    fn the_finer_grid_has_the_campaigns_relief_and_load_cases() {
        let text = include_str!("../../../campaigns/pair.toml");
        let problem = Problem::new(Campaign::parse("pair.toml", text).unwrap());
        let x = problem.free_point(&vec![0.5; problem.coordinates().len()]);
        let design = problem.design(&x, problem.base());
        let whole = measure(&problem, &design).unwrap();
        let difference = difference_um(&problem, &design).unwrap();
        assert!(
            difference != 0.0 && difference.abs() < 0.03 * whole,
            "{difference} of {whole}"
        );
        let corrections = problem.gears().unwrap().corrections(&design);
        assert!(
            corrections.pure_involute(problem.gears().unwrap().pair(&design).unwrap().geometry())
                > 0.0
        );
        let mut bare = problem.campaign().clone();
        bare.gears_mut().unwrap().load.cases.clear();
        let bare = measure(&Problem::new(bare), &design).unwrap();
        assert!((whole - bare).abs() > 0.03 * whole, "{bare} of {whole}");
    }
}
