//! The contents of a report: what the pages show, gathered by the caller.
//!
//! A value that could not be computed is `f64::NAN`; it appears as a dash in the tables and is left
//! out of the charts. An empty list appears as a sentence that says so.

use std::collections::BTreeMap;

use campaign::Approach;
use campaign::formulation::{Constraint, Problem};
use stats::OrderStatistic;

use crate::costs::StageCost;
use crate::optima::Optima;

/// Everything that one report shows.
#[derive(Debug, Clone)]
pub struct ReportData {
    /// The problem, for names, units and constraints.
    pub problem: Problem,
    /// Which campaign, how large, at what cost.
    pub header: Header,
    /// What an unfinished campaign lacks, a clause each; empty once it is finished. Nothing is recommended
    /// before that.
    pub missing: Vec<String>,
    /// What was put in, as (label, value with unit).
    pub inputs: Vec<(String, String)>,
    /// Where and when the report was made, as (label, value).
    pub made: Vec<(String, String)>,
    /// What the recommended number does not include, in sentences.
    pub left_out: String,
    /// The optima of the approaches (Table 5), verified and ranked.
    pub optima: Optima,
    /// The kriging model, if there is one.
    pub kriging: Option<KrigingFit>,
    /// Remarks, warnings, and what the model leaves out.
    pub notes: Vec<String>,
    /// What only a gear campaign has.
    pub gears: Option<GearData>,
}

/// What the report of a gear campaign shows besides.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GearData {
    /// Whether the campaign is the paper's, so that its printed figures belong beside the results.
    pub compare_with_paper: bool,
    /// The preliminary designs (Tables 1 and 2).
    pub preliminary: Vec<PreliminaryDesign>,
    /// The simulable designs of the experiment, in design order (Table 3, Figures 4 and 5).
    pub doe: Vec<DoePoint>,
    /// Designs of similar ΔSTE under Archard's wear (Table 4).
    pub similar: Vec<SimilarDesign>,
    /// Wear depths of one flank (Figure 2).
    pub wear: Option<WearProfiles>,
    /// Drawings and curves of the optima.
    pub illustrations: BTreeMap<Approach, Illustration>,
    /// The runs of the approaches that have an optimiser.
    pub runs: BTreeMap<Approach, Vec<OptimiserRun>>,
    /// The rounds of infill; absent without an enrichment.
    pub enrichment: Option<Enrichment>,
    /// The paper's printed designs on this model; shown only with `compare_with_paper`.
    pub printed: Vec<PrintedDesign>,
}

/// What the built-in model draws of a pair.
#[derive(Debug, Clone, PartialEq)]
pub struct Illustration {
    /// P90 on the converged grid less P90 on the campaign's grid, from the same wear, µm.
    pub converged_difference_um: Option<f64>,
    /// The gears in mesh.
    pub drawing: GearDrawing,
    /// Static transmission error over one mesh period.
    pub ste: SteCurves,
    /// Contact pressure over the flank.
    pub contact: Option<ContactPattern>,
}

/// Which campaign, how large, at what cost.
#[derive(Debug, Clone, PartialEq)]
pub struct Header {
    /// The campaign's name.
    pub campaign: String,
    /// The digest of what the campaign's values depend on, whatever its size: it tells whose report a file is,
    /// see [`crate::report::campaign_digest`].
    pub campaign_digest: String,
    /// The campaign's seed.
    pub seed: u64,
    /// Version of the program that computed the samples.
    pub program_version: String,
    /// Digest of all samples: equal digests mean equal results.
    pub samples_digest: String,
    /// n, the designs of the experiment.
    pub designs: usize,
    /// k, the Monte Carlo samples per design.
    pub samples_per_design: usize,
    /// What the percentile is called: P90.
    pub percentile: String,
    /// How many of the n designs could be simulated.
    pub simulable: usize,
    /// Why the others could not, with how many designs each reason concerns.
    pub refused: Vec<(String, usize)>,
    /// Calls of the gear simulator in the whole campaign.
    pub simulator_calls: u64,
    /// Wall and CPU time by stage, in the order of the stages.
    pub stages: Vec<StageCost>,
    /// Further (label, value) pairs, shown as they are.
    pub facts: Vec<(String, String)>,
}

/// One preliminary design, simulated often enough to know its distribution (Tables 1 and 2).
#[derive(Debug, Clone, PartialEq)]
pub struct PreliminaryDesign {
    /// x_p, x_r, ha0_p, ha0_r, hf0_p, hf0_r.
    pub variables: [f64; 6],
    /// How many samples the statistics rest on.
    pub samples: usize,
    /// Mean of ΔSTE, µm.
    pub mean_um: f64,
    /// Standard deviation of ΔSTE, µm.
    pub sd_um: f64,
    /// Estimated 90 % percentile of ΔSTE, µm.
    pub p90_um: f64,
    /// p value of the Lilliefors test: small values speak against a normal distribution.
    pub lilliefors_p: f64,
    /// Variance of a percentile estimated from k samples, µm² (Equation (14)).
    pub p90_variance_um2: f64,
}

/// The responses of one simulable design.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DoePoint {
    /// ΔSTE without wear, µm.
    pub delta_ste_um: f64,
    /// ΔSTE with Archard's wear, µm.
    pub delta_ste_archard_um: f64,
    /// Estimated 90 % percentile of ΔSTE with random wear, µm.
    pub p90_um: f64,
}

/// One design of Table 4.
#[derive(Debug, Clone, PartialEq)]
pub struct SimilarDesign {
    /// x_p, x_r, ha0_p, ha0_r, hf0_p, hf0_r.
    pub variables: [f64; 6],
    /// ΔSTE with Archard's wear, µm.
    pub delta_ste_archard_um: f64,
    /// Its 90 % percentile; `None` without samples.
    pub p90: Option<OrderStatistic>,
}

/// Wear depths along one flank (Figure 2).
#[derive(Debug, Clone, PartialEq)]
pub struct WearProfiles {
    /// Which flank and which design, for the caption.
    pub subject: String,
    /// Roll angles, rad.
    pub roll_angle_rad: Vec<f64>,
    /// Archard's depth at each roll angle, µm, positive where material is missing.
    pub archard_um: Vec<f64>,
    /// Random depths, one list per profile, each as long as the roll angles, µm.
    pub random_um: Vec<Vec<f64>>,
}

/// One kriging model and how well it predicts.
#[derive(Debug, Clone, PartialEq)]
pub struct KrigingFit {
    /// What was fitted, for example "P90 after the design of experiments".
    pub title: String,
    /// The unit of what was fitted; empty for a number without one.
    pub unit: String,
    /// The covariance function's name.
    pub kernel: String,
    /// Fitted parameters.
    pub parameters: Vec<Parameter>,
    /// Q² of the leave-one-out predictions: 1 is perfect, 0 no better than the mean.
    pub q2: f64,
    /// Root mean square of the leave-one-out errors, µm.
    pub rmse: f64,
    /// Share of the observations, 0 to 1, within their leave-one-out 90 % prediction interval.
    pub coverage_90: f64,
    /// The leave-one-out predictions.
    pub leave_one_out: Vec<LeaveOneOut>,
    /// What a reader ought to know of the fit, in sentences.
    pub warnings: Vec<String>,
    /// The model along each variable through the recommended design.
    pub slices: Vec<Slice>,
    /// The share of each variable in the variance of the model's mean over the box.
    pub indices: Vec<VariableIndices>,
}

/// A model along one variable, with all others at the recommended design.
#[derive(Debug, Clone, PartialEq)]
pub struct Slice {
    /// The variable's name, by which the chart's file is called.
    pub variable: String,
    /// What the axis calls it, with its unit.
    pub label: String,
    /// Where the recommended design lies.
    pub at: f64,
    /// Value of the variable, mean, lower and upper end of the 95 % interval.
    pub points: Vec<[f64; 4]>,
}

/// Sobol' indices of one variable.
#[derive(Debug, Clone, PartialEq)]
pub struct VariableIndices {
    /// The variable.
    pub variable: String,
    /// First-order index, 0 to 1: what it does by itself.
    pub first: f64,
    /// Total index, 0 to 1: what it does together with the others, too.
    pub total: f64,
}

/// One fitted parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its unit; empty for a pure number.
    pub unit: String,
}

/// One observation and what the model predicts for it from all the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeaveOneOut {
    /// The design's number.
    pub design: u64,
    /// The observation, µm.
    pub observed: f64,
    /// The prediction, µm.
    pub predicted: f64,
    /// The residual over its standard deviation.
    pub standardised: f64,
}

/// One optimiser run from one start.
#[derive(Debug, Clone, PartialEq)]
pub struct OptimiserRun {
    /// The start's number, from 1.
    pub start: usize,
    /// (evaluations so far, best penalised objective so far), in the order of the run.
    pub best: Vec<(u64, f64)>,
    /// Evaluations at which the run restarted.
    pub restarts: Vec<u64>,
}

/// Two gears in mesh, positioned in one transverse plane; all lengths in mm, y upwards.
#[derive(Debug, Clone, PartialEq)]
pub struct GearDrawing {
    /// The pinion.
    pub pinion: GearOutline,
    /// The mating gear.
    pub mate: GearOutline,
    /// Ends of the path of contact.
    pub line_of_action: Option<[[f64; 2]; 2]>,
    /// Face width, mm.
    pub face_width_mm: f64,
    /// By how much the far end of the face is turned against the near one, for pinion and mate, radians
    /// anticlockwise; zero for spur gears.
    pub twist_rad: [f64; 2],
}

/// One gear's outline.
#[derive(Debug, Clone, PartialEq)]
pub struct GearOutline {
    /// Points of the outline in order: all round the gear, or the teeth near the contact only.
    pub outline: Vec<[f64; 2]>,
    /// Centre of the gear.
    pub centre: [f64; 2],
    /// Radius of the operating pitch circle.
    pub pitch_radius_mm: Option<f64>,
    /// Radius of the base circle.
    pub base_radius_mm: Option<f64>,
}

/// Static transmission error over one mesh period.
#[derive(Debug, Clone, PartialEq)]
pub struct SteCurves {
    /// Mesh phase as a share of the period, usually 0 to 1.
    pub phase: Vec<f64>,
    /// STE of the unworn gears at each phase, µm; may be empty.
    pub unworn_um: Vec<f64>,
    /// STE with Archard's wear at each phase, µm; may be empty.
    pub worn_um: Vec<f64>,
}

/// Contact pressure along the path of contact.
#[derive(Debug, Clone, PartialEq)]
pub struct PressureCurves {
    /// Places on the path of contact, mm from the pitch point; negative where the pinion's root is
    /// in contact.
    pub place_mm: Vec<f64>,
    /// Largest pressure over the mesh period at each place on unworn flanks, MPa; may be empty.
    pub unworn_mpa: Vec<f64>,
    /// The same with Archard's wear, MPa; may be empty.
    pub worn_mpa: Vec<f64>,
}

/// Contact pressure over the flank of one tooth.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactPattern {
    /// Whether the flanks have the mean wear.
    pub is_worn: bool,
    /// Middles of even parts of the path of contact, mm from the pitch point; negative where the pinion's
    /// root is in contact.
    pub place_mm: Vec<f64>,
    /// Middles of even parts of the face, mm.
    pub across_mm: Vec<f64>,
    /// Pressure when the line of contact passes, MPa: a row for each place on the path.
    pub pressure_mpa: Vec<Vec<f64>>,
    /// The lines of contact at one moment: place across the face and place on the path of both ends.
    pub lines: Vec<[[f64; 2]; 2]>,
}

/// Everything that the page of one gear pair shows.
#[derive(Debug, Clone, PartialEq)]
pub struct PairPage {
    /// What the pair is called, for example by its file.
    pub title: String,
    /// Version of the program that simulated.
    pub program_version: String,
    /// Whether the pair is feasible, in a sentence.
    pub verdict: String,
    /// The constraints with the pair's values.
    pub constraints: Vec<Constraint>,
    /// Further (label, value with unit) pairs, shown as they are.
    pub figures: Vec<(String, String)>,
    /// The gears in mesh.
    pub drawing: GearDrawing,
    /// Static transmission error over the mesh.
    pub ste: SteCurves,
    /// Contact pressure along the path of contact.
    pub pressure: PressureCurves,
    /// Contact pressure over the flank.
    pub contact: ContactPattern,
    /// Wear depths of the pinion's flank; absent without wear.
    pub wear: Option<WearProfiles>,
}

/// Rounds of infill points near the optimum, on top of the DoE.
#[derive(Debug, Clone, PartialEq)]
pub struct Enrichment {
    /// The unit of the percentile; empty for a number without one.
    pub unit: String,
    /// The rounds, in their order.
    pub rounds: Vec<EnrichmentRound>,
    /// δ of the stopping rule, µm.
    pub tolerance: f64,
    /// Why the enrichment ended, in a sentence; empty while it goes on.
    pub stop: String,
    /// Samples of the DoE that the first round rests on.
    pub doe_samples: u64,
    /// Verified P90 of the recommended design, µm.
    pub verified_um: Option<f64>,
    /// The 95 % interval in which an estimate from as many verification samples is to be expected, from the
    /// model's uncertainty and the verification's, µm.
    pub interval_of_estimate_um: Option<(f64, f64)>,
}

/// One round of infill.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnrichmentRound {
    /// The round, from 1.
    pub round: u64,
    /// New designs.
    pub new_designs: u64,
    /// Designs that got more samples.
    pub further_turns: u64,
    /// Samples asked for.
    pub samples: u64,
    /// Points whose samples were quarantined.
    pub failed: u64,
    /// Points that broke a constraint and got no samples.
    pub ruled_out: u64,
    /// The most that was expected of an observation, µm.
    pub expected_improvement: f64,
    /// The model's prediction for the recommended design, µm.
    pub predicted: f64,
    /// Lower end of its 95 % interval, µm.
    pub low: f64,
    /// Upper end of it, µm.
    pub high: f64,
}

/// One of the paper's printed designs (Figures 6 to 10), computed on this model.
#[derive(Debug, Clone, PartialEq)]
pub struct PrintedDesign {
    /// The figure's number, 6 to 10.
    pub figure: u8,
    /// The model's figures, or why the design could not be simulated.
    pub outcome: Result<PrintedFigures, String>,
    /// Drawing and curves of a design that no approach of the campaign has.
    pub illustration: Option<Illustration>,
}

/// The model's figures for one printed design.
#[derive(Debug, Clone, PartialEq)]
pub struct PrintedFigures {
    /// r_c.
    pub contact_ratio: ModelFigure,
    /// g_s.
    pub specific_slip: ModelFigure,
    /// σ_vm, MPa.
    pub von_mises_mpa: ModelFigure,
    /// F, MPa.
    pub pressure_mpa: ModelFigure,
    /// The criterion that the figure's caption gives, µm.
    pub criterion: ModelFigure,
    /// P90, µm; used for the figures whose P90 the paper gives (7 to 10).
    pub p90_um: ModelFigure,
}

/// One figure of the model and a remark on how it compares.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelFigure {
    /// The model's value.
    pub value: f64,
    /// The remark; may be empty.
    pub note: String,
}

impl From<f64> for ModelFigure {
    fn from(value: f64) -> Self {
        Self {
            value,
            note: String::new(),
        }
    }
}
