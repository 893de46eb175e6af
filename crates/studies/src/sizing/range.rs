//! The sizes of a study: the command's lists, and every combination of them.

use anyhow::{Context as _, bail};
use clap::Args;
use problem::Campaign;
use problem::file::Dimensions;

use crate::arguments::share;
use crate::sweep::Teeth;

/// The most sizes of a study.
const MOST_SIZES: usize = 2000;

/// The sizes to search.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct Range {
    /// Numbers of teeth of the pinion: 17..30 is 17 to 29, 17..=30 is 17 to 30
    #[arg(long, value_name = "RANGE")]
    pub teeth: Teeth,
    /// Largest deviation of the gear ratio from the campaign's, as a share of it
    #[arg(long, value_name = "SHARE", default_value_t = 0.02, value_parser = share)]
    pub ratio_tolerance: f64,
    /// Normal modules in mm, such as 2.5,2.75,3 [default: the campaign's]
    #[arg(long = "modules", value_name = "LIST", value_delimiter = ',', value_parser = length)]
    pub modules_mm: Vec<f64>,
    /// Face widths in mm, such as 25,30 [default: the campaign's]
    #[arg(long = "face-widths", value_name = "LIST", value_delimiter = ',', value_parser = length)]
    pub face_widths_mm: Vec<f64>,
    /// Helix angles in degrees, such as 12,15,18, each of which is then fixed [default: the
    /// campaign's]
    #[arg(long = "helix-angles", value_name = "LIST", value_delimiter = ',', value_parser = angle,
        allow_hyphen_values = true)]
    pub helix_angles_deg: Vec<f64>,
    /// Standard racks that cut both gears, such as iso-53-a,iso-53-c [default: the campaign's tools]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = rack)]
    pub racks: Vec<gear::Rack>,
}

/// One size: a campaign with its teeth and dimensions.
#[derive(Debug, Clone, PartialEq)]
pub struct Size {
    /// Teeth of pinion and mate.
    pub teeth: [u32; 2],
    pub dimensions: Dimensions,
    pub(super) campaign: Campaign,
}

impl Range {
    /// The sizes of a campaign, by their teeth and then their dimensions.
    ///
    /// # Errors
    ///
    /// No mate is within the tolerance, there are too many sizes, or the campaign is invalid with one of them.
    pub fn sizes(&self, file: &str, campaign: &Campaign) -> anyhow::Result<Vec<Size>> {
        let sections = campaign.gears().context("sizes are of gears")?;
        let pair = &sections.pair;
        let [pinion, mate] = pair.teeth().map(f64::from);
        let ratio = pair.gear_ratio.unwrap_or(mate / pinion);
        if !self.modules_mm.is_empty() && pair.normal_module_mm.is_none() {
            bail!(
                "the module of campaign {} follows from its centre distance: leave out --modules, or give \
                 pair.normal_module_mm",
                campaign.name
            );
        }
        let all = self.dimensions()?;
        let mut sizes = Vec::new();
        for pinion in self.teeth.iter() {
            let exact = f64::from(pinion) * ratio;
            let room = 1e-9 + exact * self.ratio_tolerance;
            let mates = (exact - room).ceil() as u32..=(exact + room).floor() as u32;
            for mate in mates {
                for &dimensions in &all {
                    let teeth = [pinion, mate];
                    sizes.push(Size {
                        teeth,
                        dimensions,
                        campaign: campaign.with_size(file, teeth, dimensions)?,
                    });
                    require_few(sizes.len())?;
                }
            }
        }
        if sizes.is_empty() {
            bail!(
                "no whole number of teeth is within {} % of the ratio {ratio:.4}: widen --ratio-tolerance or --teeth",
                100.0 * self.ratio_tolerance
            );
        }
        Ok(sizes)
    }

    /// Every combination of the listed dimensions.
    fn dimensions(&self) -> anyhow::Result<Vec<Dimensions>> {
        let widths = listed(&self.face_widths_mm);
        let (angles, racks) = (listed(&self.helix_angles_deg), listed(&self.racks));
        let mut all = Vec::new();
        for normal_module_mm in listed(&self.modules_mm) {
            for &face_width_mm in &widths {
                for &helix_angle_deg in &angles {
                    require_few(all.len() + racks.len())?;
                    all.extend(racks.iter().map(|&rack| Dimensions {
                        normal_module_mm,
                        face_width_mm,
                        helix_angle_deg,
                        rack,
                    }));
                }
            }
        }
        Ok(all)
    }
}

/// The values of a list; one `None`, which stands for the campaign's own value, if the list is empty.
fn listed<T: Copy>(list: &[T]) -> Vec<Option<T>> {
    match list.is_empty() {
        true => vec![None],
        false => list.iter().copied().map(Some).collect(),
    }
}

/// Refuses more than [`MOST_SIZES`] sizes.
fn require_few(sizes: usize) -> anyhow::Result<()> {
    if sizes > MOST_SIZES {
        bail!(
            "more than {MOST_SIZES} sizes: narrow --teeth or --ratio-tolerance, or shorten a list"
        );
    }
    Ok(())
}

/// Parses a length in mm.
fn length(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(length) if length > 0.0 && length <= 1000.0 => Ok(length),
        _ => Err("it must be a number from above 0 to 1000 mm".to_owned()),
    }
}

/// Parses a helix angle in degrees.
fn angle(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(angle) if (-60.0..=60.0).contains(&angle) => Ok(angle),
        _ => Err("it must be a helix angle from -60 to 60 degrees".to_owned()),
    }
}

/// Reads the name of a standard rack.
fn rack(text: &str) -> Result<gear::Rack, String> {
    let mut all = gear::Rack::ALL.iter();
    let found = all.find(|rack| rack.to_string() == text);
    found.copied().ok_or_else(|| {
        let names = gear::Rack::ALL.iter().map(ToString::to_string);
        format!("the racks are {}", names.collect::<Vec<_>>().join(", "))
    })
}
