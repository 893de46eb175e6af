//! One pair as a folder of an HTML page, charts and tables.

use std::path::{Path, PathBuf};

use gear::{Member, Pair};
use problem::PairFile;
use results::report::{
    self, FlankProfile, PairPage, PressureCurves, RandomFlanks, SteCurves, TorqueCurves,
    WearProfiles, charts,
};
use results::table::{Column, Table};
use stats::streams::{Purpose, stream};

use super::{Figures, Request, Simulation, WearChoice, exchange, text};

/// Number of random wear profiles on the page.
const WEAR_PROFILES: u64 = 10;

/// The subject of a page: a pair and its simulation.
#[derive(Debug, Clone, Copy)]
pub struct Subject<'a> {
    /// The pair's name.
    pub title: &'a str,
    /// The version of the program, for the page's end.
    pub program_version: &'a str,
    /// The pair file.
    pub file: &'a PairFile,
    /// The simulation requested.
    pub request: Request,
}

/// Writes `pair.html` with its charts as SVG and their points as CSV into the folder `out`, which is
/// made if need be; returns the page's path. A pair that is not simulable has no page.
///
/// # Errors
///
/// A file cannot be written.
pub fn write_page(
    subject: &Subject<'_>,
    simulation: &Simulation,
    out: &Path,
) -> anyhow::Result<Option<PathBuf>> {
    let Some(figures) = &simulation.figures else {
        return Ok(None);
    };
    let pair = super::pair(subject.file, 1)?;
    let curves = Curves::of(&pair, subject);
    let page = page(subject, simulation, figures, &pair, &curves);
    for (name, chart) in [
        ("section.svg", charts::gears(&page.drawing)?),
        ("axonometric.svg", charts::solid(&page.drawing)?),
        ("ste.svg", charts::ste(&page.ste)?),
        ("torque.svg", charts::torque(&page.torque)?),
        ("pressure.svg", charts::pressure(&page.pressure)?),
        ("contact.svg", charts::contact(&page.contact)?),
        ("profile-pinion.svg", charts::profile(&page.profiles[0])?),
        ("profile-mate.svg", charts::profile(&page.profiles[1])?),
    ] {
        report::write_file(out, name, chart.standalone())?;
    }
    if let Some(wear) = &page.wear {
        let chart = charts::wear(wear, charts::FULL)?;
        report::write_file(out, "wear.svg", chart.standalone())?;
        report::write_file(out, "wear.csv", curves.wear_table().csv()?)?;
    }
    report::write_file(out, "ste.csv", curves.ste_table().csv()?)?;
    report::write_file(out, "torque.csv", curves.torque_table().csv()?)?;
    report::write_file(out, "pressure.csv", curves.pressure_table().csv()?)?;
    for (name, content) in exchange::files(subject, &pair, &figures.sheet)? {
        report::write_file(out, name, content)?;
    }
    report::write_file(out, "pair.html", report::render_pair(&page)?)?;
    Ok(Some(out.join("pair.html")))
}

/// The curves of a pair: unworn, and with the requested wear.
struct Curves {
    ste: SteCurves,
    torque: TorqueCurves,
    /// Places on the path of contact, mm from the pinion's base tangent point.
    place: Vec<f64>,
    /// The pitch point, mm from the pinion's base tangent point.
    pitch: f64,
    /// Unworn and worn pressure, MPa; the latter is empty without wear.
    pressure: [Vec<f64>; 2],
    /// Roll angles of pinion and mate at the places, rad.
    roll: [Vec<f64>; 2],
    /// The profiles of pinion and mate.
    profiles: [FlankProfile; 2],
    /// Depth of the mean wear on the flanks of pinion and mate, µm; empty without wear.
    depth_um: [Vec<f64>; 2],
    /// Depths of random wear on the pinion's flank, µm.
    random_um: Vec<Vec<f64>>,
}

impl Curves {
    fn of(pair: &Pair, subject: &Subject<'_>) -> Self {
        let geometry = pair.geometry();
        let wear = subject.file.wear;
        let micrometres = |depths: &[f64]| depths.iter().map(|d| d * 1e3).collect::<Vec<f64>>();
        let mut ste = report::ste(pair, &wear);
        let (mut worn_mpa, mut random_um) = (Vec::new(), Vec::new());
        let mut depth_um = [Vec::new(), Vec::new()];
        let is_worn = subject.request.wear != WearChoice::None;
        let mut random = None;
        let mut profiles = report::profiles(pair, None);
        if subject.request.wear == WearChoice::None {
            ste.worn_um.clear();
        } else {
            let worn = pair.archard(&wear);
            depth_um = [0, 1].map(|i| micrometres(&worn.depth[i]));
            profiles = report::profiles(pair, Some(&worn.depth));
            worn_mpa = worn.pressure;
        }
        if subject.request.wear == WearChoice::Random {
            let mut sampler = subject.file.sampler(pair);
            let seed = subject.request.seed;
            let samples = u64::from(subject.request.samples);
            random_um = (0..samples.min(WEAR_PROFILES))
                .map(|index| sampler.draw_profile(&mut stream(seed, Purpose::Wear, 0, index)))
                .map(|profile| micrometres(&profile.depth[0]))
                .collect();
            random = Some(RandomFlanks {
                scatter: subject.file.scatter(),
                seed,
                samples: subject.request.samples,
            });
        }
        let place = pair.path().to_vec();
        let roll = Member::BOTH.map(|member| {
            let angles = place.iter().map(|&s| geometry.roll_angle(member, s));
            angles.collect()
        });
        Self {
            ste,
            torque: report::over_torque(pair, is_worn.then_some(&wear), random),
            place,
            pitch: geometry.s_pitch,
            pressure: [pair.pressure().to_vec(), worn_mpa],
            roll,
            profiles,
            depth_um,
            random_um,
        }
    }

    /// Distances of the places from the pitch point, mm; negative before it.
    fn pitch_distances(&self) -> Vec<f64> {
        self.place.iter().map(|s| s - self.pitch).collect()
    }

    fn ste_table(&self) -> Table {
        let SteCurves {
            phase,
            unworn_um,
            worn_um,
            ..
        } = &self.ste;
        columns(&[
            ("phase", phase),
            ("unworn_um", unworn_um),
            ("worn_um", worn_um),
        ])
    }

    fn torque_table(&self) -> Table {
        let TorqueCurves {
            torque_nm,
            unworn_um,
            worn_um,
            band_um: [low, high],
            ..
        } = &self.torque;
        columns(&[
            ("pinion_torque_nm", torque_nm),
            ("unworn_um", unworn_um),
            ("worn_um", worn_um),
            ("random_p10_um", low),
            ("random_p90_um", high),
        ])
    }

    fn pressure_table(&self) -> Table {
        let [unworn, worn] = &self.pressure;
        columns(&[
            ("from_pitch_point_mm", &self.pitch_distances()),
            ("unworn_mpa", unworn),
            ("worn_mpa", worn),
        ])
    }

    fn wear_table(&self) -> Table {
        let [pinion, mate] = &self.roll;
        let [pinion_depth, mate_depth] = &self.depth_um;
        let from_pitch = self.pitch_distances();
        let mut all: Vec<(&str, &[f64])> = vec![
            ("from_pitch_point_mm", &from_pitch),
            ("pinion_roll_angle_rad", pinion),
            ("mate_roll_angle_rad", mate),
            ("pinion_mean_depth_um", pinion_depth),
            ("mate_mean_depth_um", mate_depth),
        ];
        let names: Vec<String> = (1..=self.random_um.len())
            .map(|index| format!("pinion_sample_{index}_um"))
            .collect();
        all.extend(
            names
                .iter()
                .zip(&self.random_um)
                .map(|(name, depths)| (name.as_str(), depths.as_slice())),
        );
        columns(&all)
    }
}

/// A table of these columns; an empty one is left out.
fn columns(all: &[(&str, &[f64])]) -> Table {
    let all: Vec<_> = all
        .iter()
        .filter(|(_, values)| !values.is_empty())
        .collect();
    let mut table = Table::new(all.iter().map(|(name, _)| Column::number(*name)).collect());
    let length = all.first().map_or(0, |(_, values)| values.len());
    table.rows = (0..length)
        .map(|row| all.iter().map(|(_, values)| values[row].into()).collect())
        .collect();
    table
}

fn page(
    subject: &Subject<'_>,
    simulation: &Simulation,
    figures: &Figures,
    pair: &Pair,
    curves: &Curves,
) -> PairPage {
    let verdict = text::verdict(&simulation.constraints);
    let [unworn_mpa, worn_mpa] = curves.pressure.clone();
    PairPage {
        title: subject.title.to_owned(),
        program_version: subject.program_version.to_owned(),
        verdict: format!(
            "The pair is {}.",
            verdict.lines().next().unwrap_or_default()
        ),
        warnings: simulation.warnings.clone(),
        sheet: figures.sheet.clone(),
        constraints: simulation.constraints.clone(),
        figures: text::rows(figures, simulation.wear),
        drawing: report::drawing(pair),
        ste: curves.ste.clone(),
        torque: curves.torque.clone(),
        pressure: PressureCurves {
            place_mm: curves.pitch_distances(),
            unworn_mpa,
            worn_mpa,
        },
        contact: {
            let wear = subject.file.wear;
            let is_worn = subject.request.wear != WearChoice::None;
            report::contact(pair, is_worn.then_some(&wear))
        },
        profiles: curves.profiles.clone(),
        samples: figures.samples_um.clone().zip(figures.p90_um),
        wear: (!curves.depth_um[0].is_empty()).then(|| WearProfiles {
            subject: format!(
                "Flank of the pinion; {}.{}",
                mate_wear(&curves.depth_um),
                match figures.manufacture {
                    Some(_) => " Slope deviations are not drawn.",
                    None => "",
                }
            ),
            roll_angle_rad: curves.roll[0].clone(),
            archard_um: curves.depth_um[0].clone(),
            random_um: curves.random_um.clone(),
        }),
    }
}

/// The mean wear of the mate beside the pinion's, in words.
fn mate_wear([pinion, mate]: &[Vec<f64>; 2]) -> String {
    if pinion == mate {
        return "the mean wear of the mate is as deep at the same place of the path of contact"
            .to_owned();
    }
    let deepest = mate.iter().fold(0.0, |most: f64, depth| most.max(*depth));
    format!("the mean wear of the mate is at most {deepest:.2} µm deep")
}
