//! The mesh of one pair: its contact lines, their stiffness, and the deflection δ over a mesh period.
//!
//! One of four calculations shares out the load of a phase: slices of straight flanks (`slices`), of
//! crowned ones (`crowned`), whole teeth (`whole_face`), or coupled cells (`coupled`).

use crate::balance::{Extremes, Frame};
use crate::corrections::Lead;
use crate::coupled::{self, CoupledCells, SingularCompliance};
use crate::crowned::{CrownedBalance, Piece};
use crate::path::{Path, Window};
use crate::periodic::PeriodicFunction;
use crate::slices::{self, SliceBalance, Slices};
use crate::unloaded::UnloadedPair;
use crate::whole_face::{self, WholeFace, WholeFaceBalance};

/// The contact of one pair.
#[derive(Debug, Clone)]
pub(crate) struct Mesh {
    pub(crate) frame: Frame,
    contact: Contact,
}

/// The calculation that shares out the load.
#[derive(Debug, Clone)]
enum Contact {
    /// Slices, with the gap of the corrections along the face.
    Slices(Slices, Lead),
    WholeFace(WholeFace),
    Coupled(CoupledCells),
}

/// Working memory of a solution, reused from sample to sample.
#[derive(Debug, Clone, Default)]
pub(crate) struct Scratch {
    slices: slices::Memory,
    pieces: Vec<Piece>,
    springs: whole_face::Memory,
    cells: coupled::Memory,
    /// Gap at all nodes.
    gap: Vec<f64>,
    /// δ at each phase.
    pub(crate) delta: Vec<f64>,
}

impl Mesh {
    /// The mesh of thin slices. `stiffness` is 1/q at the nodes; `target` is F_bt w/b.
    pub(crate) fn slices(path: Path, stiffness: Vec<f64>, target: f64, lead: Lead) -> Self {
        Self {
            contact: Contact::Slices(Slices::new(&path, &stiffness), lead),
            frame: Frame {
                path,
                stiffness,
                target,
            },
        }
    }

    /// The mesh of whole teeth, for a path with [`Touch::Middle`](crate::path::Touch). `beams` is
    /// 1/Q_B at the nodes and `hertz` Q_H, mm per N/mm; `target` is F_bt/b.
    pub(crate) fn whole_face(path: Path, beams: Vec<f64>, hertz: f64, target: f64) -> Self {
        Self {
            contact: Contact::WholeFace(WholeFace::new(&path, &beams, hertz)),
            frame: Frame {
                path,
                stiffness: beams,
                target,
            },
        }
    }

    /// The mesh of coupled cells for the gap `gap` at the nodes, mm. `has_lead_gap`: gaps may vary along the
    /// face.
    pub(crate) fn coupled(
        pair: &UnloadedPair,
        path: Path,
        gap: &[f64],
        has_lead_gap: bool,
    ) -> Result<Self, SingularCompliance> {
        let nodes = pair.nodes(&path.s);
        let coupled = CoupledCells::new(pair, &path, &nodes, gap, has_lead_gap)?;
        Ok(Self {
            contact: Contact::Coupled(coupled),
            frame: Frame {
                path,
                stiffness: Vec::new(),
                target: f64::NAN,
            },
        })
    }

    /// The mesh with the stiffness that belongs to the gap `gap` at the nodes, mm. It differs only for coupled cells.
    pub(crate) fn with_gap(
        &self,
        pair: &UnloadedPair,
        gap: &[f64],
    ) -> Result<Self, SingularCompliance> {
        let Contact::Coupled(coupled) = &self.contact else {
            return Ok(self.clone());
        };
        Ok(Self {
            frame: self.frame.clone(),
            contact: Contact::Coupled(coupled.with_gap(pair, gap)?),
        })
    }

    /// Whether the mesh is one of coupled cells.
    pub(crate) const fn is_coupled(&self) -> bool {
        matches!(self.contact, Contact::Coupled(_))
    }

    /// Solves δ for the gap `g` at the nodes, at every phase, and refines its extremes; see
    /// [`Frame::extremes`].
    pub(crate) fn solve(&self, g: &[f64], scratch: &mut Scratch) -> Extremes {
        self.solve_tilted(g, 0.0, scratch)
    }

    /// As [`solve`](Self::solve) for flanks whose gap has a further `slope` along the face, mm. The
    /// mean of δ is then that of a gap that is zero at one end of the face. Whole teeth do not know
    /// where on the face they touch, and are left alone.
    pub(crate) fn solve_tilted(&self, g: &[f64], slope: f64, scratch: &mut Scratch) -> Extremes {
        let Scratch {
            slices,
            pieces,
            springs,
            cells,
            gap,
            delta,
        } = scratch;
        let frame = &self.frame;
        match &self.contact {
            Contact::Slices(sums, lead) => {
                let g = frame.path.gap_beyond(g, gap);
                let lead = lead.tilted(slope);
                let has_sums = lead.is_even() || lead.crowning == 0.0 && frame.path.has_lines();
                if has_sums {
                    let mut balance = SliceBalance::new(frame, sums, g, lead.slope, slices);
                    return frame.extremes(&mut balance, delta);
                }
                let mut balance = CrownedBalance {
                    frame,
                    lead,
                    g,
                    pieces,
                };
                frame.extremes(&mut balance, delta)
            }
            Contact::Coupled(coupled) => coupled.solve(g, slope, cells, delta),
            Contact::WholeFace(teeth) => frame.extremes(
                &mut WholeFaceBalance {
                    frame,
                    teeth,
                    g,
                    memory: springs,
                },
                delta,
            ),
        }
    }

    /// δ at any phase, if no gap keeps the flanks apart and contact ends with the path; NaN for coupled cells, which
    /// are solved at their phases only.
    pub(crate) fn unworn(&self, phi: f64, windows: &mut Vec<Window>) -> f64 {
        let phi = phi.rem_euclid(self.frame.path.base_pitch);
        match &self.contact {
            Contact::Slices(sums, _) => sums.unworn(&self.frame, phi, windows),
            Contact::WholeFace(teeth) => teeth.unworn(&self.frame, phi),
            Contact::Coupled(_) => f64::NAN,
        }
    }

    /// The greatest load per length of contact line at each node over the mesh period, N/mm, for the
    /// gap `g` whose solution is in `scratch`. `peak` is the greatest δ, mm.
    ///
    /// `is_zero_gap`: the gap at the nodes is zero, so that δ between the phases is computed instead of
    /// interpolated.
    pub(crate) fn greatest_load(
        &self,
        g: &[f64],
        scratch: &Scratch,
        peak: f64,
        is_zero_gap: bool,
    ) -> Vec<f64> {
        let path = &self.frame.path;
        let mut windows = Vec::new();
        let mut exact = |phi: f64| self.unworn(phi, &mut windows);
        let (lead, at): (Lead, Option<&mut dyn FnMut(f64) -> f64>) = match &self.contact {
            Contact::Coupled(coupled) => {
                return coupled.greatest_load(&scratch.cells, &self.frame.path.s);
            }
            Contact::WholeFace(teeth) => {
                return teeth.greatest_load(&self.frame, g, &scratch.delta, is_zero_gap);
            }
            Contact::Slices(_, lead) if is_zero_gap && lead.is_even() && !path.goes_beyond() => {
                (*lead, Some(&mut exact))
            }
            Contact::Slices(_, lead) => (*lead, None),
        };
        let greatest = if path.window >= path.base_pitch && lead.is_even() {
            vec![peak; path.nodes().len()]
        } else {
            let function = PeriodicFunction {
                phases: &path.phases,
                values: &scratch.delta,
                period: path.base_pitch,
            };
            path.greatest_in_contact(&function, path.window, lead, at)
        };
        let closed = greatest
            .iter()
            .zip(g)
            .map(|(delta, g)| (delta - g).max(0.0));
        closed
            .zip(path.at_nodes(&self.frame.stiffness))
            .map(|(closed, c)| closed * c)
            .collect()
    }

    /// The load per length of contact line at each node when it is touched at the place `across` of the face,
    /// from 0 to 1, in N/mm, for the gap `g` whose solution is in `scratch`.
    pub(crate) fn load_across(&self, g: &[f64], scratch: &Scratch, across: f64) -> Vec<f64> {
        let path = &self.frame.path;
        // The load of a place from the line's front end, δ, the gap and the stiffness.
        let load: &dyn Fn(f64, f64, f64, f64) -> f64 = match &self.contact {
            Contact::Coupled(coupled) => {
                return coupled.load_across(&scratch.cells, across, &path.s);
            }
            Contact::WholeFace(teeth) => &|end, delta, _, _| teeth.load(&self.frame, g, end, delta),
            Contact::Slices(_, lead) => {
                &|_, delta, gap, stiffness| (delta - gap - lead.gap(across)).max(0.0) * stiffness
            }
        };
        let function = PeriodicFunction {
            phases: &path.phases,
            values: &scratch.delta,
            period: path.base_pitch,
        };
        let mut before = 0;
        let stiffness = path.at_nodes(&self.frame.stiffness);
        let nodes = path.nodes().iter().zip(g).zip(stiffness);
        nodes
            .map(|((s, &gap), &stiffness)| {
                let end = s - path.start + across * path.window;
                load(end, function.between(end, &mut before), gap, stiffness)
            })
            .collect()
    }
}
