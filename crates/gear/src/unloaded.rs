//! A gear pair before its contact is solved.

use crate::beyond::TipSeparation;
use crate::corrections::Corrections;
use crate::error::{Error, Infeasibility};
use crate::geometry::{Geometry, Interference, Sliding};
use crate::input::{Discretisation, InputError, Member, PairInput, ToothModel};
use crate::involute::tangent_length;
use crate::path::{Path, Touch};
use crate::tooth::Tooth;

/// A crowned pair's contact lines are integrated one by one, so their number is limited.
const MOST_CROWNED_PAIRS: f64 = 100.0;
/// Coupled cells of a wider face would be too many for the matrix that couples them.
const MOST_OVERLAP: f64 = 8.0;

/// The geometry and the teeth of a gear pair, with the figures that need no contact: sliding, interference and
/// root stress. It costs a fraction of a [`Pair`](crate::Pair), and tells whether a design is worth one.
#[derive(Debug, Clone)]
pub struct UnloadedPair {
    input: PairInput,
    corrections: Corrections,
    disc: Discretisation,
    geometry: Geometry,
    pub(crate) teeth: [Tooth; 2],
    base_force: f64,
}

impl UnloadedPair {
    /// Computes the geometry of a pair and the outlines of its teeth. Geometry is checked before anything
    /// costly is computed.
    ///
    /// # Errors
    /// [`Error::Input`] when a number is not finite or out of its domain, or when more than 100 pairs of
    /// teeth of a crowned pair touch at a time; [`Error::Infeasible`] when no such pair exists.
    pub fn new(
        input: &PairInput,
        corrections: &Corrections,
        disc: &Discretisation,
    ) -> Result<Self, Error> {
        input.validate()?;
        disc.validate()?;
        corrections.validate()?;
        let geometry = Geometry::new(input)?;
        let along_face = [
            ("crowning", corrections.crowning),
            ("helix_slope", corrections.helix_slope),
            ("misalignment", corrections.misalignment),
        ];
        let refused = if geometry.contact_ratio > MOST_CROWNED_PAIRS {
            Some("zero for a pair whose contact ratio exceeds 100")
        } else if !input.tooth_model.knows_the_face() {
            Some("zero with the tooth model whole-face-beam, which has one gap for the whole face")
        } else {
            None
        };
        if let Some(expected) = refused {
            for (field, value) in along_face {
                if value != 0.0 {
                    return Err(InputError {
                        field,
                        value,
                        expected,
                    }
                    .into());
                }
            }
        }
        // A spur pair may hand over exactly at ε_α = 1; a helical one has then lost contact. An
        // empty path (ε_α ≤ 0) carries nothing, however large the overlap.
        let least = if input.helix_angle == 0.0 {
            1.0
        } else {
            1.0 + 1e-9
        };
        if geometry.contact_ratio < least || geometry.eps_alpha <= 0.0 {
            return Err(Infeasibility::ContactGap {
                eps_alpha: geometry.eps_alpha,
                eps_beta: geometry.eps_beta,
            }
            .into());
        }
        if input.tooth_model == ToothModel::Coupled && geometry.eps_beta > MOST_OVERLAP {
            return Err(InputError {
                field: "face_width",
                value: geometry.face_width,
                expected: "a face width whose overlap ratio is at most 8 with the tooth model coupled",
            }
            .into());
        }
        for member in Member::BOTH {
            let i = member.index();
            if let Some(hub) = input.hub_radius[i].filter(|hub| *hub >= geometry.r_f[i]) {
                return Err(InputError {
                    field: ["hub_radius[0]", "hub_radius[1]"][i],
                    value: hub,
                    expected: "a radius below the root circle",
                }
                .into());
            }
        }
        let teeth = [
            Tooth::new(input, &geometry, Member::Pinion)?,
            Tooth::new(input, &geometry, Member::Gear)?,
        ];
        let base_force = input.pinion_torque / geometry.r_b[0];
        Ok(Self {
            input: input.clone(),
            corrections: *corrections,
            disc: *disc,
            geometry,
            teeth,
            base_force,
        })
    }

    /// The same pair under another torque on the pinion, N·mm.
    pub(crate) fn under(mut self, pinion_torque: f64) -> Self {
        self.input.pinion_torque = pinion_torque;
        self.base_force = pinion_torque / self.geometry.r_b[0];
        self
    }

    /// The path of contact, with nodes where the compliance or a relief has a kink.
    pub(crate) fn path(&self) -> Path {
        let geometry = &self.geometry;
        let mut soft = Vec::with_capacity(4);
        for member in Member::BOTH {
            let (low, high) = self.teeth[member.index()].load_range();
            for r in [low, high] {
                let tau = tangent_length(r, geometry.r_b[member.index()]);
                // The distance from a base tangent point is measured the same way from both ends.
                soft.push(geometry.tangent_length(member, tau));
            }
        }
        let marks = self.corrections.relief_starts(geometry);
        let touch = match self.input.tooth_model {
            ToothModel::WholeFaceBeam => Touch::Middle,
            ToothModel::Coupled => Touch::Cells,
            _ => Touch::Everywhere,
        };
        // Coupled cells go beyond the path by themselves.
        let reaches = self.input.tooth_model == ToothModel::WeberBanaschek;
        let beyond = reaches.then(|| self.beyond());
        Path::new(geometry, &self.disc, touch, beyond.as_ref(), &soft, &marks)
    }

    /// The contact beyond both ends of the path.
    pub(crate) fn beyond(&self) -> TipSeparation {
        let modulus = self.input.mean_modulus();
        TipSeparation::new(&self.geometry, self.base_force, modulus)
    }

    /// The input from which the pair was computed.
    #[must_use]
    pub const fn input(&self) -> &PairInput {
        &self.input
    }

    /// The corrections of the flanks and the misalignment of the shafts.
    #[must_use]
    pub const fn corrections(&self) -> &Corrections {
        &self.corrections
    }

    /// Circles, path of contact and contact ratios.
    #[must_use]
    pub const fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// Specific sliding at both ends of the path that undercut leaves; its `max` is the criterion ζ.
    #[must_use]
    pub fn sliding(&self) -> Sliding {
        self.geometry.sliding()
    }

    /// The four quantities of "no teeth interference".
    #[must_use]
    pub fn interference(&self) -> Interference {
        self.geometry.interference()
    }

    /// Transverse base force F_bt = T1/r_b1, N.
    #[must_use]
    pub const fn base_force(&self) -> f64 {
        self.base_force
    }

    /// Compliance of one gear's tooth and foundation, without contact, when it is touched at the
    /// transverse radius `r` mm of its flank; mm per N/mm. `r` is clamped to the flank.
    #[must_use]
    pub fn tooth_compliance(&self, member: Member, r: f64) -> f64 {
        let i = member.index();
        let tooth = &self.teeth[i];
        let r = r.clamp(self.geometry.r_b[i], self.geometry.r_a[i]);
        tooth.compliances(&[tooth.load_at_radius(r)])[0]
    }
}
