//! One gear pair with its contact: compliance and the unworn analysis.

use std::ops::Deref;
use std::sync::{Arc, OnceLock};

use crate::analysis::{Analysis, UM, pressures};
use crate::corrections::Corrections;
use crate::coupled::SingularCompliance;
use crate::error::{Error, Infeasibility};
use crate::input::{Discretisation, PairInput};
use crate::mesh::Mesh;
use crate::unloaded::UnloadedPair;
use crate::unworn::UnwornContact;

/// A gear pair with its contact and unworn analysis. It has all that an [`UnloadedPair`] has.
#[derive(Debug, Clone)]
pub struct Pair {
    unloaded: UnloadedPair,
    pub(crate) mesh: Arc<Mesh>,
    /// Load per length of contact line for which the compliance holds, N/mm, at all nodes.
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
    /// Whether it was made for gaps along the face that the pair does not have.
    has_strips: bool,
    mesh: Arc<Mesh>,
}

impl UnloadedPair {
    /// Solves the contact of the unworn flanks.
    ///
    /// # Errors
    /// [`Infeasibility::ContactUnresolved`], with the tooth model `coupled` only.
    pub fn load(self) -> Result<Pair, Infeasibility> {
        Pair::of(self)
    }
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

    /// As [`new`](Self::new) for flanks with [`Corrections`], which are part of every analysis and every sample of the
    /// pair, "unworn" ones included.
    ///
    /// # Errors
    /// As [`new`](Self::new), and [`Error::Input`] when a correction is out of its domain or when
    /// more than 100 pairs of teeth of a crowned pair touch at a time.
    pub fn with_corrections(
        input: &PairInput,
        corrections: &Corrections,
        disc: &Discretisation,
    ) -> Result<Self, Error> {
        Ok(UnloadedPair::new(input, corrections, disc)?.load()?)
    }

    fn of(unloaded: UnloadedPair) -> Result<Self, Infeasibility> {
        let path = unloaded.path();
        let corrections = unloaded.corrections();
        let relief: Vec<f64> = path
            .nodes()
            .iter()
            .map(|&s| corrections.relief_at(unloaded.geometry(), s))
            .collect();
        let UnwornContact {
            mesh,
            load,
            extremes,
            scratch,
        } = UnwornContact::solve(&unloaded, path, &relief)?;
        let is_zero_gap = !corrections.has_relief();
        let carried = mesh.greatest_load(&relief, &scratch, extremes.max, is_zero_gap);
        let (input, geometry) = (unloaded.input(), unloaded.geometry());
        let pressure = pressures(input, geometry, mesh.frame.path.nodes(), &carried);
        let unworn = Analysis::new(geometry, &mesh, &scratch, extremes, 0.0, &pressure);
        Ok(Self {
            unloaded,
            mesh: Arc::new(mesh),
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
    pub(crate) fn mesh_of(
        &self,
        gap: &[f64],
        may_tilt: bool,
    ) -> Result<Arc<Mesh>, SingularCompliance> {
        let geometry = self.geometry();
        // A spur mesh whose gap is the same all along the face has one cell per line, and needs strips if gaps vary
        // along the face. All other meshes have strips already.
        let needs_strips =
            may_tilt && geometry.beta_b == 0.0 && self.corrections().lead(geometry).is_even();
        if !self.mesh.is_coupled() || gap == self.relief && !needs_strips {
            return Ok(Arc::clone(&self.mesh));
        }
        if let Some(worn) = self.worn.get()
            && worn.gap == gap
            && worn.has_strips == needs_strips
        {
            return Ok(Arc::clone(&worn.mesh));
        }
        let mesh = Arc::new(if needs_strips {
            Mesh::coupled(&self.unloaded, self.mesh.frame.path.clone(), gap, true)?
        } else {
            self.mesh.with_gap(&self.unloaded, gap)?
        });
        // A mesh that is already stored stays.
        let _ = self.worn.set(WornMesh {
            gap: gap.to_vec(),
            has_strips: needs_strips,
            mesh: Arc::clone(&mesh),
        });
        Ok(mesh)
    }

    /// Single pair stiffness at the pitch point (or at the end of the path nearest to it), per mm
    /// of face and in the transverse section, N/(mm·µm).
    #[must_use]
    pub fn pitch_stiffness(&self) -> f64 {
        let geometry = self.geometry();
        geometry.beta_b.cos() / self.compliance(geometry.s_pitch) / UM
    }

    /// Compliance q of the pair per length of contact line at `s`, mm per N/mm, under the load
    /// that the unworn pair carries there. `s` is clamped to the path of contact.
    #[must_use]
    pub fn compliance(&self, s: f64) -> f64 {
        let s = s.clamp(self.geometry().s_in, self.geometry().s_out);
        let load = self.mesh.frame.path.place(s).of(&self.load);
        self.compliance_under(s, load)
    }

    /// Compliance q of the pair per length of contact line at `s` under the line load `load`,
    /// N/mm; mm per N/mm. Only `weber-banaschek` and `coupled` depend on the load.
    #[must_use]
    pub fn compliance_under(&self, s: f64, load: f64) -> f64 {
        let geometry = self.geometry();
        let node = &self.nodes(&[s.clamp(geometry.s_in, geometry.s_out)])[0];
        node.teeth + self.contact(&node.touching, load)
    }

    /// Places on the path of contact, mm from the pinion's base tangent point, for which
    /// [`pressure`](Self::pressure) is known.
    #[must_use]
    pub fn path(&self) -> &[f64] {
        self.mesh.frame.path.nodes()
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

    /// The pair before its contact was solved.
    pub(crate) const fn unloaded(&self) -> &UnloadedPair {
        &self.unloaded
    }

    /// Transverse transmission error in µm for a normal deflection in mm.
    pub(crate) fn to_ste_um(&self, delta: f64) -> f64 {
        delta / self.geometry().beta_b.cos() * UM
    }
}

impl Deref for Pair {
    type Target = UnloadedPair;

    fn deref(&self) -> &UnloadedPair {
        &self.unloaded
    }
}
