//! One gear pair: geometry, compliance and the unworn analysis.

use std::sync::{Arc, OnceLock};

use crate::analysis::{Analysis, UM, pressures};
use crate::corrections::Corrections;
use crate::coupled::NotPositive;
use crate::elasticity::Elasticity;
use crate::error::{Error, Infeasible};
use crate::geometry::{Geometry, Interference, Sliding};
use crate::input::{Discretisation, InputError, Member, PairInput, ToothModel};
use crate::involute::tangent_length;
use crate::mesh::Mesh;
use crate::path::{Path, Touch};
use crate::tooth::Tooth;
use crate::unworn::UnwornContact;

/// A crowned pair's contact lines are integrated one by one, so their number is limited.
const MOST_CROWNED_PAIRS: f64 = 100.0;
/// Coupled cells of a wider face would be too many for the matrix that couples them.
const MOST_OVERLAP: f64 = 8.0;

/// A gear pair with its geometry, compliance and unworn analysis.
#[derive(Debug, Clone)]
pub struct Pair {
    input: PairInput,
    corrections: Corrections,
    geometry: Geometry,
    pub(crate) teeth: [Tooth; 2],
    pub(crate) mesh: Arc<Mesh>,
    base_force: f64,
    /// Load per length of contact line at the nodes for which the compliance holds, N/mm.
    load: Vec<f64>,
    /// Gap of the tip relief at the nodes, mm.
    pub(crate) relief: Vec<f64>,
    unworn: Analysis,
    /// Greatest unworn Hertz pressure at the nodes, MPa.
    pressure: Vec<f64>,
    /// The first mesh of worn flanks, which an analysis and the samples of the same wear share.
    worn: OnceLock<WornMesh>,
}

/// The coupled mesh of worn flanks.
#[derive(Debug, Clone)]
struct WornMesh {
    gap: Vec<f64>,
    may_tilt: bool,
    mesh: Arc<Mesh>,
}

impl Pair {
    /// Computes geometry, compliance and the unworn analysis of a pair without corrections.
    ///
    /// # Errors
    /// [`Error::Input`] when a number is not finite or out of its domain, [`Error::Infeasible`]
    /// when no such pair exists. Geometry is checked before anything costly is computed.
    pub fn new(input: &PairInput, disc: &Discretisation) -> Result<Self, Error> {
        Self::with_corrections(input, &Corrections::default(), disc)
    }

    /// As [`new`](Self::new) for flanks with tip relief and crowning, which are part of every
    /// analysis and every sample of the pair, "unworn" ones included. Tip relief costs nothing;
    /// crowning makes a new design about four times slower and a sample seventeen times.
    ///
    /// # Errors
    /// As [`new`](Self::new), and [`Error::Input`] when a correction is out of its domain or when
    /// more than 100 pairs of teeth of a crowned pair touch at a time.
    pub fn with_corrections(
        input: &PairInput,
        corrections: &Corrections,
        disc: &Discretisation,
    ) -> Result<Self, Error> {
        input.validate()?;
        disc.validate()?;
        corrections.validate()?;
        let geometry = Geometry::new(input)?;
        let whole_face = input.tooth_model == ToothModel::WholeFaceBeam;
        let along_face = [
            ("crowning", corrections.crowning),
            ("helix_slope", corrections.helix_slope),
            ("misalignment", corrections.misalignment),
        ];
        let refused = if geometry.contact_ratio > MOST_CROWNED_PAIRS {
            Some("zero for a pair whose contact ratio exceeds 100")
        } else if whole_face {
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
            return Err(Infeasible::ContactGap {
                eps_alpha: geometry.eps_alpha,
                eps_beta: geometry.eps_beta,
            }
            .into());
        }
        if input.tooth_model == ToothModel::Coupled && geometry.eps_beta > MOST_OVERLAP {
            return Err(InputError {
                field: "face_width",
                value: input.face_width,
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
        let mut soft = Vec::with_capacity(4);
        for member in Member::BOTH {
            let (low, high) = teeth[member.index()].load_range();
            for r in [low, high] {
                let tau = tangent_length(r, geometry.r_b[member.index()]);
                // The distance from a base tangent point is measured the same way from both ends.
                soft.push(geometry.tangent_length(member, tau));
            }
        }
        let marks = corrections.relief_starts(&geometry);
        let touch = match input.tooth_model {
            ToothModel::WholeFaceBeam => Touch::Middle,
            ToothModel::Coupled => Touch::Cells,
            _ => Touch::Everywhere,
        };
        let path = Path::new(&geometry, disc, touch, &soft, &marks);
        let relief: Vec<f64> = path
            .s
            .iter()
            .map(|&s| corrections.relief_at(&geometry, s))
            .collect();
        let elastic = Elasticity {
            input,
            geometry: &geometry,
            teeth: &teeth,
        };
        let contact = UnwornContact::solve(
            &elastic,
            path,
            base_force,
            &relief,
            corrections.lead(&geometry),
            false,
        )?;
        let UnwornContact {
            mesh,
            load,
            extremes,
            scratch,
        } = contact;
        let is_zero_gap = !corrections.has_relief();
        let carried = mesh.greatest_load(&relief, &scratch, extremes.max, is_zero_gap);
        let pressure = pressures(input, &geometry, &mesh.frame.path.s, &carried);
        let unworn = Analysis::new(&geometry, &mesh, &scratch, extremes, 0.0, &pressure);
        Ok(Self {
            input: input.clone(),
            corrections: *corrections,
            geometry,
            teeth,
            mesh: Arc::new(mesh),
            base_force,
            load,
            relief,
            unworn,
            pressure,
            worn: OnceLock::new(),
        })
    }

    /// The mesh for flanks with this gap at the nodes, mm: that of the pair but for coupled cells, whose
    /// contact has the approach that belongs to these flanks. `may_tilt`: the gap may vary along the face
    /// from sample to sample.
    pub(crate) fn mesh_of(&self, gap: &[f64], may_tilt: bool) -> Result<Arc<Mesh>, NotPositive> {
        if self.input.tooth_model != ToothModel::Coupled {
            return Ok(Arc::clone(&self.mesh));
        }
        // The cells of helical teeth always have a gap each.
        let may_tilt = may_tilt && self.geometry.beta_b == 0.0;
        if let Some(worn) = self.worn.get()
            && worn.gap == gap
            && worn.may_tilt == may_tilt
        {
            return Ok(Arc::clone(&worn.mesh));
        }
        let elastic = Elasticity {
            input: &self.input,
            geometry: &self.geometry,
            teeth: &self.teeth,
        };
        let (path, lead) = (
            self.mesh.frame.path.clone(),
            self.corrections.lead(&self.geometry),
        );
        let contact = UnwornContact::solve(&elastic, path, self.base_force, gap, lead, may_tilt)?;
        let mesh = Arc::new(contact.mesh);
        // A mesh that is kept already stays.
        let _ = self.worn.set(WornMesh {
            gap: gap.to_vec(),
            may_tilt,
            mesh: Arc::clone(&mesh),
        });
        Ok(mesh)
    }

    /// The input from which the pair was computed.
    #[must_use]
    pub const fn input(&self) -> &PairInput {
        &self.input
    }

    /// Tip relief and crowning.
    #[must_use]
    pub const fn corrections(&self) -> &Corrections {
        &self.corrections
    }

    /// Circles, path of contact and contact ratios.
    #[must_use]
    pub const fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// Specific sliding at both ends of the path that undercut leaves; its `max` is the criterion g_s.
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

    /// Single pair stiffness at the pitch point (or at the end of the path nearest to it), per mm
    /// of face and in the transverse section, N/(mm·µm).
    #[must_use]
    pub fn pitch_stiffness(&self) -> f64 {
        let s = self
            .geometry
            .s_pitch
            .clamp(self.geometry.s_in, self.geometry.s_out);
        self.geometry.beta_b.cos() / self.compliance(s) / UM
    }

    /// Compliance q of the pair per length of contact line at `s`, mm per N/mm, under the load
    /// that the unworn pair carries there. `s` is clamped to the path of contact.
    #[must_use]
    pub fn compliance(&self, s: f64) -> f64 {
        let s = s.clamp(self.geometry.s_in, self.geometry.s_out);
        let place = self.mesh.frame.path.place(s);
        let (w0, w1) = (self.load[place.cell], self.load[place.cell + 1]);
        self.compliance_under(s, w0 + place.u * (w1 - w0))
    }

    /// Compliance q of the pair per length of contact line at `s` under the line load `load`,
    /// N/mm; mm per N/mm. Only `weber-banaschek` depends on the load.
    #[must_use]
    pub fn compliance_under(&self, s: f64, load: f64) -> f64 {
        let elastic = Elasticity {
            input: &self.input,
            geometry: &self.geometry,
            teeth: &self.teeth,
        };
        let node = elastic.node(s.clamp(self.geometry.s_in, self.geometry.s_out));
        node.teeth + elastic.contact(&node, load)
    }

    /// Compliance of one gear's tooth and foundation, without contact, when it is touched at the
    /// transverse radius `r` mm of its flank; mm per N/mm. `r` is clamped to the flank.
    #[must_use]
    pub fn tooth_compliance(&self, member: Member, r: f64) -> f64 {
        let i = member.index();
        let tooth = &self.teeth[i];
        let r = r.clamp(self.geometry.r_b[i], self.geometry.r_a[i]);
        tooth.compliance(&tooth.load_at_radius(r))
    }

    /// Places on the path of contact, mm from the pinion's base tangent point, for which
    /// [`pressure`](Self::pressure) is known.
    #[must_use]
    pub fn path(&self) -> &[f64] {
        &self.mesh.frame.path.s
    }

    /// Greatest Hertz pressure over the mesh period of the unworn pair at each place of the
    /// [`path`](Self::path), MPa.
    #[must_use]
    pub fn pressure(&self) -> &[f64] {
        &self.pressure
    }

    /// The analysis of the unworn pair.
    #[must_use]
    pub fn unworn(&self) -> Analysis {
        self.unworn.clone()
    }

    /// Transverse transmission error in µm for a normal deflection in mm.
    pub(crate) fn to_ste_um(&self, delta: f64) -> f64 {
        delta / self.geometry.beta_b.cos() * UM
    }
}
