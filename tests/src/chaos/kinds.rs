//! The kinds of campaign in a round, and the undisturbed run that each is compared with.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::Violation;
use super::outcome::Outcome;
use super::programs::{BEAM, DIRECT, Programs};
use crate::{changed, root, small_campaign};

/// A kind of campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// The same number of samples for every design.
    Plain,
    /// Samples to a precision, for designs that the constraints do not rule out.
    Precise,
    /// Rounds of infill after the DoE.
    Enriched,
    /// Extended while verification samples of its first optimum are in flight.
    Grown,
    /// An external simulator that fails occasionally.
    External,
    /// An external simulator on one machine: `coordinator run`, which the simulator also kills.
    Alone,
    /// An external simulator that cannot compute one design without a licence.
    Licence,
    /// A problem without gears, with infill.
    Problem,
    /// A program that reads and writes files.
    Files,
    /// Without a network: jobs and results in files. Half of the campaigns name an accuracy.
    Sharded,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 10] = [
        Self::Plain,
        Self::Precise,
        Self::Enriched,
        Self::Grown,
        Self::External,
        Self::Alone,
        Self::Licence,
        Self::Problem,
        Self::Files,
        Self::Sharded,
    ];

    /// The kind's name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Precise => "precise",
            Self::Enriched => "enriched",
            Self::Grown => "grown",
            Self::External => "external",
            Self::Alone => "alone",
            Self::Licence => "licence",
            Self::Problem => "problem",
            Self::Files => "files",
            Self::Sharded => "sharded",
        }
    }

    /// The shipped external program that simulates the designs, if there is one.
    pub(crate) const fn simulator(self) -> Option<&'static str> {
        match self {
            Self::Plain | Self::Precise | Self::Enriched | Self::Grown | Self::Sharded => None,
            Self::External | Self::Alone | Self::Licence => Some("simulator.py"),
            Self::Problem => Some(DIRECT),
            Self::Files => Some(BEAM),
        }
    }

    /// Whether that program has outages.
    pub(crate) const fn has_outages(self) -> bool {
        self.simulator().is_some()
    }

    /// Whether that program fails occasionally in a round.
    pub(crate) const fn is_unreliable(self) -> bool {
        matches!(self, Self::External | Self::Alone | Self::Licence)
    }

    /// The campaign files, in the order in which they are run on the same store.
    fn texts(self, seed: u64) -> Vec<String> {
        let is_even = seed.is_multiple_of(2);
        match self {
            Self::Plain => {
                if is_even {
                    return vec![model(law(small_campaign(40, 6000), true), true)];
                }
                // Coupled cells take ten times as long for a sample, and two torques twice that.
                let text = model(law(small_campaign(40, 500), false), false);
                let model = "tooth_model = \"hertz-beam\"";
                let section = "\n[manufacture]\nflank_class = 7\nmisalignment_um = 10.0\n\
                               tip_relief_tolerance_um = 3.0\n[corrections]\ntip_relief_um = [0.0, 20.0]\n\
                               tip_relief_length_mm = 1.5\n[material.mate]\nname = \"16MnCr5\"\n\
                               [allowances]\ntooth_thickness_um = { pinion = [-50, -80], mate = [-50, -80] }\n";
                let cases = "[[load.cases]]\n[[load.cases]]\nwear = 0.0\ndelta_ste_max_um = 8.0\n\
                             [[load.cases]]\npinion_torque_nm = 50.0\n[material]";
                let text = change(&text, model, "tooth_model = \"coupled\"");
                let text = change(
                    &text,
                    "face_width_mm = 10.0",
                    "face_width_mm = [10.5, 10.0]",
                );
                vec![change(&text, "[material]", cases) + section]
            }
            Self::Precise => {
                let precision = "precision = 0.005\nsamples_max = 8000\nskip_violation = 2.0\n\
                                 estimator = \"chosen\"\nsamples_per_design = 1500 ";
                let text = small_campaign(40, 1500);
                vec![law(
                    change(&text, "samples_per_design = 1500 ", precision),
                    is_even,
                )]
            }
            Self::Enriched => {
                let section = "\n[enrichment]\ncriterion = \"expected-quantile-improvement\"\n\
                               samples = 600000\nrounds = 3\npoints_per_round = 4\n\
                               samples_per_point = 25000\ntolerance = 0.001\n";
                let text = bounds(small_campaign(60, 1000) + section, is_even);
                let cases = "[[load.cases]]\nweight = 2\n[[load.cases]]\nwear = 0.0\nweight = 1\n[material]";
                vec![if is_even {
                    text
                } else {
                    change(&text, "[material]", cases)
                }]
            }
            Self::Grown => {
                let grown = |designs, samples| {
                    let text = law(small_campaign(designs, samples), is_even);
                    change(&text, "\nsamples = 100 ", "\nsamples = 60000 ")
                };
                // The extended campaign also has another model of the same samples.
                vec![grown(30, 1500), model(grown(36, 2000), is_even)]
            }
            Self::External => vec![external(true)],
            Self::Alone | Self::Licence => vec![external(is_even)],
            Self::Problem => vec![problem(is_even)],
            Self::Files => vec![files()],
            Self::Sharded => {
                let text = small_campaign(40, 3000);
                let text = change(&text, "\nsamples = 100 ", "\nsamples = 20000 ");
                vec![if is_even {
                    let text = change(&text, "samples_per_design = 3000 ", "");
                    text + "\n[accuracy]\ntolerance_um = 0.05\n"
                } else {
                    text
                }]
            }
        }
    }
}

/// The campaign `shipped` with its own law of wear and tooth model, or with others.
fn law(shipped: String, is_shipped: bool) -> String {
    if is_shipped {
        return shipped;
    }
    let text = change(&shipped, "\"whole-face-beam\"", "\"hertz-beam\"");
    change(&text, "coefficient_per_mpa = 3.5e-7", "max_depth_um = 3.5")
}

/// The campaign `shipped` with its own bounds and limits, or with bounds and limits of every other form.
fn bounds(shipped: String, is_shipped: bool) -> String {
    if is_shipped {
        return shipped;
    }
    let text = change(
        &shipped,
        "\nprofile_shift = [-1.0, 2.0]",
        "\nprofile_shift = { pinion = [-0.5, 1.5], mate = 0.3 }",
    );
    let text = change(
        &text,
        "\ntool_dedendum = [0.8, 1.7] ",
        "\ntool_dedendum = { pinion = [0.8, 1.3], mate = \"tied\" } ",
    );
    change(
        &text,
        "\nspecific_sliding_max = 2.0",
        "\nspecific_sliding_max = 3.0\ntip_land_min_modules = 0.1\nflank_safety_min = 0.5",
    )
}

/// The campaign `shipped` with its own settings of kriging, or with others.
fn model(shipped: String, is_shipped: bool) -> String {
    if is_shipped {
        return shipped;
    }
    change(
        &shipped,
        "[kriging]\n",
        "[kriging]\nnoise = \"smoothed\"\nestimator = \"posterior-mode\"\nresponse = \"log\"\n",
    )
}

/// The campaign file of an example.
fn shipped(example: &str) -> String {
    let file = root().join("campaigns").join(example).join("campaign.toml");
    std::fs::read_to_string(file).expect("the example is shipped")
}

/// The example of an external simulator, with or without a precision.
fn external(is_precise: bool) -> String {
    let text = shipped("external");
    let samples = if is_precise {
        "samples_per_design = 120\nprecision = 0.005\nsamples_max = 360\n\
         skip_violation = 5.0"
    } else {
        "samples_per_design = 200"
    };
    let changes = [
        ("probe_designs = 3", "probe_designs = 0\nretry_s = 2.0"),
        ("designs = 60", "designs = 24"),
        // Failures quarantine their design, so that a retry can compute it.
        (
            "[sampling]\n",
            "[sampling]\nfailed = \"quarantines-design\"\n",
        ),
        ("samples_per_design = 25", samples),
        ("\nsamples = 100", "\nsamples = 1500"),
    ];
    changed(&text, &changes)
}

/// The example of a problem without gears, with infill. A failure in an outage is a result at once, until the campaign
/// is told to compute it again. The other form has discrete variables, another measure and a design of its own.
fn problem(is_shipped: bool) -> String {
    let text = change(&shipped("ishigami"), "designs = 150", "designs = 60");
    let text = match is_shipped {
        true => text,
        false => changed(
            &text,
            &[
                (
                    "name = \"x2\"\nlow = -3.141592653589793\nhigh = 3.141592653589793",
                    "name = \"x2\"\nlow = -3\nhigh = 3\ninteger = true",
                ),
                (
                    "name = \"x3\"\nlow = -3.141592653589793\nhigh = 3.141592653589793",
                    "name = \"x3\"\nvalues = [-3.0, -1.0, 2.0, 2.5]",
                ),
                ("measure = \"percentile\"", "measure = \"superquantile\""),
                ("designs = 60", "designs = 60\npoints = [[0.5, 1.0, 2.0]]"),
            ],
        ),
    };
    let text = change(&text, "samples_per_design = 30", "samples_per_design = 40");
    text + "\n[optimise]\nevaluations = 200\nstarts = 2\ndirect = true\n\n[verify]\nsamples = 500\n\n[enrichment]\n\
            criterion = \"expected-quantile-improvement\"\nsamples = 1600\nrounds = 3\n\
            points_per_round = 4\nsamples_per_point = 100\ntolerance = 0.001\n\n\
            [simulator]\nprobe_designs = 0\nretry_s = 2.0\nattempts = 1\n"
}

/// The example of a program that communicates through files, with infill, a constraint, and a second response with a
/// constraint on its samples. The campaign states in which lines the numbers are, and has designs of its own with known
/// samples and areas.
fn files() -> String {
    let changes = [
        (
            "[[responses]]\n",
            "[[constraints]]\nname = \"yield\"\nresponse = \"overstress\"\nmeasure = \"percentile\"\nmax = 0.0\n\n\
             [[responses]]\nname = \"overstress\"\nunit = \"psi\"\n\n[objective]\nresponse = \"displacement\"\n\n\
             [[responses]]\n",
        ),
        (
            "designs = 40",
            "designs = 24\npoints = [[2.5, 3.5], [4.0, 4.0]]\nsamples = [[[-5000.0, 1.9], [-9000.0, 2.0]]]\n\
             responses = [[8.75, 1.9], [16.0, 0.5]]",
        ),
        ("samples_per_design = 25", "samples_per_design = 15"),
        ("evaluations = 300", "evaluations = 100"),
        ("\nsamples = 400", "\nsamples = 150"),
    ];
    changed(&shipped("cantilever"), &changes)
        + "\n[enrichment]\ncriterion = \"expected-quantile-improvement\"\nsamples = 800\nrounds = 3\n\
           points_per_round = 4\nsamples_per_point = 40\ntolerance = 0.001\n\n\
           [simulator]\nprobe_designs = 0\nretry_s = 2.0\n\n[simulator.read]\n\
           displacement = { line = '^displacement', column = 3 }\narea = { line = '^area = (.*)' }\n\
           overstress = { line = '^overstress = (.*)' }\n"
}

fn change(text: &str, from: &str, to: &str) -> String {
    changed(text, &[(from, to)])
}

/// The undisturbed run of a campaign.
#[derive(Debug)]
pub(crate) struct Reference {
    /// The campaign's files, in the order in which they are run.
    pub(crate) files: Vec<PathBuf>,
    /// The contents of the store after the run.
    pub(crate) outcome: Outcome,
    /// Duration of the run.
    pub(crate) span: Duration,
}

impl Reference {
    /// Runs a campaign in `folder` without disturbance.
    pub(crate) fn run(
        kind: Kind,
        seed: u64,
        folder: &Path,
        programs: &Programs,
    ) -> Result<Self, Violation> {
        let db = format!("{}.db", kind.name());
        let since = Instant::now();
        let mut files = Vec::new();
        for (number, text) in kind.texts(seed).into_iter().enumerate() {
            let file = folder.join(format!("{}-{number}.toml", kind.name()));
            std::fs::write(&file, text).map_err(|error| Violation(error.to_string()))?;
            programs.run_alone(folder, &file, &db, kind.simulator())?;
            files.push(file);
        }
        let span = since.elapsed().max(Duration::from_secs(2));
        let outcome = Outcome::read(programs, folder, &db)?;
        if outcome.status["finished"] != true {
            let status = &outcome.status;
            return Err(Violation(format!("not even undisturbed: {status}")));
        }
        Ok(Self {
            files,
            outcome,
            span,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_campaigns_have_what_is_changed() {
        for kind in Kind::ALL {
            for seed in 0..2 {
                let count = if kind == Kind::Grown { 2 } else { 1 };
                assert_eq!(kind.texts(seed).len(), count, "{kind:?}");
            }
        }
    }
}
