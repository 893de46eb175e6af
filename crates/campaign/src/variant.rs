//! Designs for studies, which may differ from the campaign's in more than the variables of its DoE.

use gear::Corrections;
use stats::streams::Purpose;

use crate::formulation::Design;
use crate::formulation::gears::Gears;

/// A design that may differ from its campaign in profile corrections, module or wear, with the key
/// of its random streams.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    /// The design.
    pub design: Design,
    /// Tip relief and crowning.
    pub corrections: Corrections,
    /// The normal module in mm; by default it follows from the campaign's centre distance.
    pub normal_module_mm: Option<f64>,
    /// Factors on the campaign's wear field.
    pub wear: WearFactors,
    /// The key of the random streams: sample i uses the stream (campaign's seed, purpose, number,
    /// i).
    pub stream: (Purpose, u64),
    /// Whether a variant that violates a constraint, with the contact pressure of worn flanks, is
    /// analysed but not sampled.
    pub feasible_only: bool,
}

/// Factors on the parameters of the wear field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WearFactors {
    /// Factor on the depth.
    pub depth: f64,
    /// Factor on the variance of the multiplier.
    pub variance: f64,
    /// Factor on the correlation range.
    pub range: f64,
}

impl WearFactors {
    /// The campaign's own wear field.
    pub const NONE: Self = Self {
        depth: 1.0,
        variance: 1.0,
        range: 1.0,
    };
}

impl Variant {
    /// The unchanged design of a campaign.
    #[must_use]
    pub fn new(design: Design, stream: (Purpose, u64)) -> Self {
        Self {
            design,
            corrections: Corrections::default(),
            normal_module_mm: None,
            wear: WearFactors::NONE,
            stream,
            feasible_only: false,
        }
    }

    /// Whether every simulator of the campaign can simulate the variant, because it differs in
    /// nothing.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.corrections == Corrections::default()
            && self.normal_module_mm.is_none()
            && self.wear == WearFactors::NONE
    }

    /// All numbers on which the variant's values depend.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = f64> {
        let relief = self.corrections.tip_relief.map(|relief| {
            relief.map_or([f64::NAN; 3], |relief| {
                let is_parabolic = relief.shape == gear::ReliefShape::Parabolic;
                [
                    relief.amount,
                    relief.length,
                    f64::from(u8::from(is_parabolic)),
                ]
            })
        });
        let (purpose, number) = self.stream;
        let name = [purpose as u64, number, u64::from(self.feasible_only)].map(f64::from_bits);
        let others = [
            self.corrections.crowning,
            self.normal_module_mm.unwrap_or(f64::NAN),
            self.wear.depth,
            self.wear.variance,
            self.wear.range,
        ];
        let variables = self.design.values().iter().copied();
        variables
            .chain(relief.into_iter().flatten())
            .chain(others)
            .chain(name)
    }
}

impl Gears {
    /// The geometry and compliance of a variant, and its wear field.
    ///
    /// # Errors
    ///
    /// The variant is not simulable.
    pub fn variant(&self, variant: &Variant) -> Result<(gear::Pair, gear::Wear), gear::Error> {
        let mut input = self.pair_input(&variant.design);
        if let Some(module) = variant.normal_module_mm {
            input.size = gear::Size::NormalModule(module);
        }
        let WearFactors {
            depth,
            variance,
            range,
        } = variant.wear;
        let mut wear = *self.wear();
        wear.law = wear.law.scaled(depth);
        wear.variance *= variance;
        wear.range *= range;
        let pair =
            gear::Pair::with_corrections(&input, &variant.corrections, self.discretisation())?;
        Ok((pair, wear))
    }
}
