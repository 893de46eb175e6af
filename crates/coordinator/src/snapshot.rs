//! What the store holds, as the planner wants to see it.

use std::collections::{BTreeMap, BTreeSet};

use campaign::formulation::{VARIABLE_NAMES, Variables};
use campaign::plan::{OpenDesign, State, VerifyPoint};
use campaign::{Approach, Campaign};
use serde_json::{Map, Value};
use store::{OptimumRow, Store};

/// The name of the model of P90 in the store.
pub const P90_MODEL: &str = "p90";

/// The approach of that name.
#[must_use]
pub fn approach_of(name: &str) -> Option<Approach> {
    Approach::ALL
        .into_iter()
        .find(|approach| approach.name() == name)
}

/// All variables by name, as the store keeps them; `null` for an approach that found nothing.
#[must_use]
pub fn variables_to_json(variables: Option<&Variables>) -> String {
    let Some(variables) = variables else {
        return Value::Null.to_string();
    };
    let object: Map<String, Value> = VARIABLE_NAMES
        .iter()
        .zip(variables.values())
        .map(|(name, value)| ((*name).to_owned(), Value::from(value)))
        .collect();
    Value::Object(object).to_string()
}

/// Reads what [`variables_to_json`] wrote.
#[must_use]
pub fn variables_from_json(json: &str) -> Option<Variables> {
    let object: Map<String, Value> = serde_json::from_str(json).ok()?;
    let value = |index: usize| object.get(VARIABLE_NAMES[index]).and_then(Value::as_f64);
    let pair = |index: usize| Some([value(index)?, value(index + 1)?]);
    Some(Variables {
        profile_shift: pair(0)?,
        tool_addendum: pair(2)?,
        tool_dedendum: pair(4)?,
        tip_radius_mm: pair(6)?,
        root_radius_mm: pair(8)?,
        helix_angle_deg: value(10)?,
    })
}

/// The optima in the order of the paper's Table 5.
///
/// # Errors
///
/// The store cannot be read.
pub async fn optima(store: &Store) -> Result<Vec<OptimumRow>, store::Error> {
    let mut rows = store.optima().await?;
    rows.sort_by_key(|row| approach_of(&row.approach).map(Approach::number));
    Ok(rows)
}

/// The design of an optimum's row; none when the approach found no feasible one.
#[must_use]
pub fn optimum_variables(row: &OptimumRow) -> Option<Variables> {
    variables_from_json(&row.x_json)
}

/// Reads the state of the campaign; `more` names designs that want more samples than others.
///
/// Of the DoE only what is missing is read: a restart has to be quick however much is done.
///
/// # Errors
///
/// The store cannot be read.
pub async fn load(
    store: &Store,
    campaign: &Campaign,
    references: &[VerifyPoint],
    more: &BTreeMap<u64, u64>,
) -> Result<State, store::Error> {
    let progress = store.progress().await?;
    let wanted = u64::from(campaign.sampling.samples_per_design);
    let missing = store.missing_work(wanted, more).await?;
    // Designs that were given up before they had samples enough have no response to wait for. Those
    // that only wanted more make one from what they have.
    let lacks = |work: &&store::MissingWork| {
        !work.criteria && work.samples.iter().any(|range| range.start < wanted)
    };
    let unsampled = missing.iter().filter(lacks).count() as u64;
    let sampled = progress
        .feasible
        .saturating_sub(progress.ruled_out + unsampled);
    let open = missing.iter().map(|work| OpenDesign {
        // A DoE has at most 100 000 designs, and the samples of each are counted in 32 bits.
        design: work.design.design as u32,
        x: work.design.point(),
        missing: work
            .samples
            .iter()
            .map(|range| range.start as u32..range.end as u32)
            .collect(),
    });
    let mut state = State {
        designs: progress.designs as usize,
        open: open.collect(),
        has_responses: progress.designs == u64::from(campaign.doe.designs)
            && progress.responses == sampled,
        model: store.model(P90_MODEL).await?.map(|row| row.json.into()),
        ..State::default()
    };
    for run in store.optimiser_runs().await? {
        if let (Some(approach), Ok(start)) = (approach_of(&run.approach), u32::try_from(run.start))
        {
            state.runs.insert((approach, start));
        }
    }
    for optimum in store.optima().await? {
        let Some(approach) = approach_of(&optimum.approach) else {
            continue;
        };
        let stored = stored_samples(store, approach.name()).await?;
        state.verified.insert(approach, stored);
        state.optima.insert(approach, optimum_variables(&optimum));
    }
    for point in references {
        let stored = stored_samples(store, &point.name).await?;
        state.reference_points.push(VerifyPoint {
            stored,
            ..point.clone()
        });
    }
    Ok(state)
}

async fn stored_samples(store: &Store, point: &str) -> Result<BTreeSet<u32>, store::Error> {
    let rows = store.verify_samples(point).await?;
    Ok(rows
        .iter()
        .filter_map(|row| u32::try_from(row.sample).ok())
        .collect())
}
