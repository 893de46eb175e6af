//! Campaigns derived from another one.

use std::fmt;

use super::bounds::Setting;
use super::{Campaign, FaceWidth, FileError, GearSections};

/// The dimensions that a size changes besides the teeth; those that are absent stay the campaign's.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Dimensions {
    /// Normal module, mm.
    pub normal_module_mm: Option<f64>,
    /// Face width, mm.
    pub face_width_mm: Option<f64>,
    /// Helix angle of all designs, degrees.
    pub helix_angle_deg: Option<f64>,
    /// The rack that cuts both gears.
    pub rack: Option<gear::Rack>,
}

impl Campaign {
    /// The campaign with another number of pinion teeth, and the text of its file. The number is appended to the
    /// campaign's name. The comparison with the paper is switched off, because the paper's designs all have one
    /// number of teeth. The mate's number follows from the ratio, or is unchanged; the module follows from the centre
    /// distance, or the reverse.
    ///
    /// `file` names the original in errors.
    ///
    /// # Errors
    ///
    /// The file is invalid with these teeth. The line is that of the new text.
    ///
    /// # Panics
    ///
    /// Never: a campaign is plain numbers and names, which TOML can hold.
    pub fn with_pinion_teeth(&self, file: &str, teeth: u32) -> Result<(Self, String), FileError> {
        let what = format!("{file} with {teeth} pinion teeth");
        self.with_sections(&what, &format!("z{teeth}"), |sections| {
            sections.pair.pinion_teeth = teeth;
        })
    }

    /// The same campaign with other teeth of both gears and these dimensions.
    ///
    /// # Errors
    ///
    /// As [`with_pinion_teeth`](Self::with_pinion_teeth).
    pub fn with_size(
        &self,
        file: &str,
        teeth: [u32; 2],
        dimensions: Dimensions,
    ) -> Result<Self, FileError> {
        let [pinion, mate] = teeth;
        let what = format!("{file} with {pinion} and {mate} teeth{dimensions}");
        let changed = self.with_sections(&what, &format!("z{pinion}-{mate}"), |sections| {
            sections.pair.pinion_teeth = pinion;
            (sections.pair.gear_ratio, sections.pair.gear_teeth) = (None, Some(mate));
            dimensions.change(sections);
        });
        Ok(changed?.0)
    }

    /// The same campaign with changed sections, and the text of its file. `suffix` is appended to the name, and `what`
    /// names the campaign in errors.
    fn with_sections(
        &self,
        what: &str,
        suffix: &str,
        change: impl FnOnce(&mut GearSections),
    ) -> Result<(Self, String), FileError> {
        let mut other = self.clone();
        other.name = format!("{}-{suffix}", self.name);
        if let Some(sections) = other.gears_mut() {
            change(sections);
            sections.report.compare_with_paper = false;
        }
        let text = toml::to_string(&other).expect("plain numbers and names serialise");
        Ok((Self::parse(what, &text)?, text))
    }
}

impl Dimensions {
    fn change(self, sections: &mut GearSections) {
        let pair = &mut sections.pair;
        pair.normal_module_mm = self.normal_module_mm.or(pair.normal_module_mm);
        let width = self.face_width_mm.map(FaceWidth::Both);
        pair.face_width_mm = width.unwrap_or(pair.face_width_mm);
        let (bounds, mut frozen) = (&mut sections.bounds, sections.frozen.as_mut());
        if let Some(degrees) = self.helix_angle_deg {
            bounds.helix_angle_deg = Setting::Fixed(degrees);
            // Only free variables can be frozen.
            if let Some(frozen) = &mut frozen {
                frozen.helix_angle_deg = None;
            }
        }
        if self.rack.is_some() {
            bounds.rack = self.rack;
            (bounds.tool_addendum, bounds.tool_dedendum) = (None, None);
            bounds.root_radius_modules = None;
            if let Some(frozen) = &mut frozen {
                frozen.root_radius_mm = None;
            }
        }
    }
}

/// The dimensions in words, each after a comma; empty without any.
impl fmt::Display for Dimensions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers = [
            ("module", self.normal_module_mm, " mm"),
            ("face width", self.face_width_mm, " mm"),
            ("helix angle", self.helix_angle_deg, "°"),
        ];
        for (name, value, unit) in numbers {
            if let Some(value) = value {
                write!(f, ", {name} {value}{unit}")?;
            }
        }
        self.rack.map_or(Ok(()), |rack| write!(f, ", rack {rack}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_teeth_change_the_pair_and_nothing_that_is_drawn_at_random() {
        let paper = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        let (other, text) = paper.with_pinion_teeth("paper.toml", 27).unwrap();
        assert_eq!(other.gears().unwrap().pair.teeth(), [27, 30]);
        assert_eq!(other.name, "paper-z27");
        assert!(!other.compares_with_paper());
        assert_eq!(Campaign::parse("again", &text).unwrap(), other);
        assert_ne!(other.digest(), paper.digest());
        let mut back = other;
        back.name.clone_from(&paper.name);
        let (sections, papers) = (back.gears_mut().unwrap(), paper.gears().unwrap());
        sections.pair.pinion_teeth = 20;
        sections.report = papers.report;
        assert_eq!(back, paper);
    }

    #[test]
    fn teeth_that_make_no_sense_are_refused_by_key() {
        let paper = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        let error = paper.with_pinion_teeth("my.toml", 2000).unwrap_err();
        let message = error.to_string();
        assert!(
            message.contains("my.toml with 2000 pinion teeth"),
            "{message}"
        );
        assert!(message.contains("pair.gear_ratio"), "{message}");
    }

    /// The paper's radii and helix angle are frozen; those that a size fixes must not stay frozen.
    #[test]
    fn dimensions_replace_the_campaign_s_and_are_named_in_errors() {
        let paper = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        let dimensions = Dimensions {
            face_width_mm: Some(17.0),
            helix_angle_deg: Some(12.0),
            rack: Some(gear::Rack::C),
            ..Dimensions::default()
        };
        let other = paper.with_size("paper.toml", [23, 25], dimensions).unwrap();
        let sections = other.gears().unwrap();
        assert_eq!(sections.pair.face_width_mm.each(), [17.0; 2]);
        let settings = sections.settings();
        assert_eq!(settings[2..6], [1.25, 1.25, 1.0, 1.0].map(Setting::Fixed));
        assert_eq!(settings[8..], [0.25, 0.25, 12.0].map(Setting::Fixed));
        let tilted = Dimensions {
            helix_angle_deg: Some(70.0),
            ..dimensions
        };
        let error = paper.with_size("paper.toml", [23, 25], tilted).unwrap_err();
        let message = error.to_string();
        for part in [
            "paper.toml with 23 and 25 teeth, face width 17 mm, helix angle 70°, rack iso-53-c",
            "bounds.helix_angle_deg",
        ] {
            assert!(message.contains(part), "{message}");
        }
    }
}
