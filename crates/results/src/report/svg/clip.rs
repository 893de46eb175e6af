//! Cutting lines and areas at a rectangle, so that no picture needs a clip path (and its id).

/// A rectangle, in the coordinates of the points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Window {
    /// Least x and y.
    pub(crate) low: [f64; 2],
    /// Greatest x and y.
    pub(crate) high: [f64; 2],
}

impl Window {
    /// Whether the point lies in the rectangle or on its border.
    pub(crate) fn contains(&self, p: [f64; 2]) -> bool {
        (0..2).all(|i| self.low[i] <= p[i] && p[i] <= self.high[i])
    }

    /// The part of a segment inside the rectangle (Liang and Barsky's method).
    fn clip_segment(&self, a: [f64; 2], b: [f64; 2]) -> Option<([f64; 2], [f64; 2])> {
        let (mut t0, mut t1) = (0.0_f64, 1.0_f64);
        for i in 0..2 {
            let d = b[i] - a[i];
            if d == 0.0 {
                if a[i] < self.low[i] || a[i] > self.high[i] {
                    return None;
                }
                continue;
            }
            let (near, far) = ((self.low[i] - a[i]) / d, (self.high[i] - a[i]) / d);
            t0 = t0.max(near.min(far));
            t1 = t1.min(near.max(far));
        }
        let at = |t: f64| [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
        (t0 <= t1).then(|| {
            (
                if t0 == 0.0 { a } else { at(t0) },
                if t1 == 1.0 { b } else { at(t1) },
            )
        })
    }
}

/// The pieces of a polyline inside the window, in order.
pub(crate) fn clip_polyline(points: &[[f64; 2]], window: &Window) -> Vec<Vec<[f64; 2]>> {
    let mut pieces: Vec<Vec<[f64; 2]>> = Vec::new();
    // Whether the last piece ends at an uncut point, so that the next segment continues it.
    let mut open = false;
    for pair in points.windows(2) {
        let Some((a, b)) = window.clip_segment(pair[0], pair[1]) else {
            open = false;
            continue;
        };
        match pieces.last_mut() {
            Some(piece) if open && a == pair[0] => piece.push(b),
            _ => pieces.push(vec![a, b]),
        }
        open = b == pair[1];
    }
    pieces
}

/// The part of a filled polygon inside the window (Sutherland and Hodgman's method). Where the
/// polygon leaves and re-enters, the result runs along the window's border: right for a fill, not
/// for an outline.
pub(crate) fn clip_polygon(points: &[[f64; 2]], window: &Window) -> Vec<[f64; 2]> {
    let mut polygon = points.to_vec();
    for axis in 0..2 {
        for (bound, sign) in [(window.low[axis], 1.0), (window.high[axis], -1.0)] {
            let inside = |p: &[f64; 2]| sign * (p[axis] - bound) >= 0.0;
            let mut kept = Vec::with_capacity(polygon.len());
            for (i, b) in polygon.iter().enumerate() {
                let a = &polygon[if i == 0 { polygon.len() - 1 } else { i - 1 }];
                if inside(a) != inside(b) {
                    let t = (bound - a[axis]) / (b[axis] - a[axis]);
                    kept.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]);
                }
                if inside(b) {
                    kept.push(*b);
                }
            }
            polygon = kept;
        }
    }
    polygon
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Window = Window {
        low: [0.0, 0.0],
        high: [1.0, 1.0],
    };

    #[test]
    fn a_line_that_leaves_and_returns_gives_two_pieces() {
        let line = [[0.5, 0.5], [1.5, 0.5], [1.5, 0.8], [0.5, 0.8]];
        let pieces = clip_polyline(&line, &UNIT);
        assert_eq!(
            pieces,
            vec![vec![[0.5, 0.5], [1.0, 0.5]], vec![[1.0, 0.8], [0.5, 0.8]]]
        );
    }

    #[test]
    fn a_segment_across_the_whole_window_is_cut_on_both_sides() {
        let pieces = clip_polyline(&[[-1.0, 0.25], [2.0, 0.25]], &UNIT);
        assert_eq!(pieces.len(), 1);
        assert!((pieces[0][0][0]).abs() < 1e-15 && (pieces[0][1][0] - 1.0).abs() < 1e-15);
        assert!(clip_polyline(&[[-1.0, 2.0], [2.0, 2.0]], &UNIT).is_empty());
    }

    #[test]
    fn a_polygon_keeps_its_area_inside_the_window() {
        // A triangle of area 2 of which exactly the square's lower-left half lies inside.
        let polygon = clip_polygon(&[[-1.0, 0.0], [1.0, 0.0], [-1.0, 2.0]], &UNIT);
        let area: f64 = (0..polygon.len())
            .map(|i| {
                let (a, b) = (polygon[i], polygon[(i + 1) % polygon.len()]);
                0.5 * (a[0] * b[1] - b[0] * a[1])
            })
            .sum();
        assert!((area - 0.5).abs() < 1e-12, "{area}");
    }
}
