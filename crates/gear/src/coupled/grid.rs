//! Strips of the face, and the cells that they cut from the contact lines of a phase.

use crate::beyond::TipSeparation;
use crate::geometry::Geometry;
use crate::path::{Path, Place};

/// A strip of the face across which a contact line has one force.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Strip {
    /// Middle of the strip, mm from the leading end of the face.
    pub(crate) middle: f64,
    /// Length of a contact line in the strip, mm.
    pub(crate) line: f64,
}

/// A piece of a contact line that may carry load.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cell {
    /// Number of the tooth pair; larger for one that is ahead.
    pub(crate) line: i64,
    pub(crate) strip: usize,
    /// Place of contact along the line of action, which may lie beyond the path's ends.
    pub(crate) s: f64,
    /// The nearest place on the path, where compliance and profile are taken.
    pub(crate) place: Place,
    /// Gap of the tip corner beyond the path, mm.
    pub(crate) separation: f64,
}

/// Strips as wide as a whole number of phase steps, or a whole part of one: then cells pass the ends
/// of the path alike at every phase, and the STE has no ripple of the grid. A gear of `phases` phases gets
/// about phases (1/3 + ε_β/2) of them. A spur gear whose gap is the same all along the face needs
/// one.
pub(crate) fn strips(geometry: &Geometry, phases: usize, has_lead_gap: bool) -> Vec<Strip> {
    let b = geometry.face_width;
    let phases = phases as f64;
    let per_width = geometry.eps_beta * phases;
    let wanted = phases / 3.0 + 0.5 * per_width;
    let width = if geometry.beta_b == 0.0 {
        if has_lead_gap { b / wanted.ceil() } else { b }
    } else {
        // The width over which a line advances by one phase step.
        let step = b / per_width;
        let ratio = per_width / wanted;
        if ratio >= 1.0 {
            step * ratio.round()
        } else {
            step / (1.0 / ratio).round()
        }
    };
    let mut edges: Vec<f64> = (0..)
        .map(|k| width * f64::from(k))
        .take_while(|z| *z < b * (1.0 - 1e-9))
        .collect();
    // A sliver at the end joins its neighbour.
    if edges.len() > 1 && edges.last().is_some_and(|last| b - last < 0.3 * width) {
        edges.pop();
    }
    edges.push(b);
    edges
        .windows(2)
        .map(|edge| Strip {
            middle: 0.5 * (edge[0] + edge[1]),
            line: (edge[1] - edge[0]) / geometry.beta_b.cos(),
        })
        .collect()
}

/// The cells at the phase `phi`, mm, in the order of lines and strips.
pub(crate) fn cells(
    geometry: &Geometry,
    path: &Path,
    beyond: &TipSeparation,
    strips: &[Strip],
    phi: f64,
) -> Vec<Cell> {
    let (s_in, s_out, p) = (geometry.s_in, geometry.s_out, geometry.base_pitch);
    let (least, most) = (s_in - beyond.reach[0], s_out + beyond.reach[1]);
    let slope = geometry.beta_b.tan();
    let first = ((least - s_in - phi) / p).floor() as i64;
    let last = ((most - s_in - phi + geometry.face_width * slope) / p).ceil() as i64;
    let mut cells = Vec::new();
    for line in first..=last {
        let end = s_in + phi + line as f64 * p;
        for (strip, at) in strips.iter().enumerate() {
            let s = end - at.middle * slope;
            if s < least || s > most {
                continue;
            }
            cells.push(Cell {
                line,
                strip,
                s,
                place: path.place(s.clamp(s_in, s_out)),
                separation: beyond.gap(s_in - s, s - s_out),
            });
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::general;
    use crate::input::{PairInput, Size};

    fn geometry(face_width: f64, helix_angle_deg: f64) -> Geometry {
        let input = PairInput {
            teeth: [24, 32],
            size: Size::NormalModule(3.0),
            helix_angle: helix_angle_deg.to_radians(),
            face_width: [face_width; 2],
            ..general::plain()
        };
        Geometry::new(&input).unwrap()
    }

    #[test]
    fn strips_cover_the_face_and_step_with_the_phases() {
        for (width, angle) in [
            (6.0, 20.0),
            (27.6, 20.0),
            (80.0, 30.0),
            (9.0, 8.0),
            (20.0, 1.0),
        ] {
            let geometry = geometry(width, angle);
            let strips = strips(&geometry, 24, false);
            let line: f64 = strips.iter().map(|strip| strip.line).sum();
            assert!((line * geometry.beta_b.cos() - width).abs() < 1e-9);
            // Phase steps to a strip, or strips to a phase step.
            let step = geometry.base_pitch / 24.0;
            let along = strips[0].line * geometry.beta_b.sin();
            let ratio = (along / step).max(step / along);
            assert!(
                (ratio - ratio.round()).abs() < 1e-9,
                "{width} mm at {angle}°: {ratio}"
            );
        }
        assert_eq!(strips(&geometry(20.0, 0.0), 24, false).len(), 1);
        assert_eq!(strips(&geometry(20.0, 0.0), 24, true).len(), 8);
    }
}
