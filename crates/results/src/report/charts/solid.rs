//! The gear pair in axonometric view: outlines drawn out along helices.
//!
//! The view is parallel, from above the near end faces, and nothing lies in front of these. Within a layer of the face
//! width, a surface hides only surfaces that are farther from the viewer. The layers are therefore painted from the far
//! end to the near one, each in the order of depth, and the end faces last.

use super::HALF;
use super::gears::finite;
use crate::report::drawing::{GearDrawing, GearOutline};
use crate::report::error::Error;
use crate::report::svg::{Canvas, Picture, text_width};

/// Towards the viewer: x along the line of centres, z along the axes.
const VIEW: [f64; 3] = [-0.48, 0.46, 0.747];
const LIGHT: [f64; 3] = [-0.35, 0.85, 0.4];
/// Shades of a gear's surfaces, dark to light.
const SHADES: usize = 3;
/// Wanted rotation of a layer's far end against its near end, rad: about half a tooth's thickness.
const LAYER_TWIST: f64 = 0.04;
/// Points of an outline closer than this to the line without them are left out, px.
const TOLERANCE: f64 = 0.3;
const MARGIN: f64 = 10.0;
const TOP: f64 = 48.0;

type Point = [f64; 3];

/// Both gears in axonometric view.
///
/// # Errors
/// [`Error::NothingToDraw`] without outlines, a face width or a helix.
pub fn solid(drawing: &GearDrawing) -> Result<Picture, Error> {
    let nothing = |why| Error::NothingToDraw {
        chart: "axonometric view",
        why,
    };
    let gears = [finite(&drawing.pinion), finite(&drawing.mate)];
    let width = drawing.face_width_mm;
    let has_size = width.is_finite() && width > 0.0;
    if !has_size || drawing.twist_rad.iter().any(|twist| !twist.is_finite()) {
        return Err(nothing("the face width or the helix is not known"));
    }
    let frame = Frame::around(&gears, width).ok_or_else(|| nothing("there is no outline"))?;
    let twist = drawing.twist_rad.map(f64::abs);
    let layers = ((twist[0].max(twist[1]) / LAYER_TWIST).ceil() as usize).clamp(1, 12);

    let mut surfaces: Vec<Surface> = Vec::new();
    let mut faces = Vec::new();
    for (gear, (outline, twist)) in gears.iter().zip(drawing.twist_rad).enumerate() {
        let points = coarse(&outline.outline, TOLERANCE / frame.scale);
        let turned = |k: usize| {
            let share = k as f64 / layers as f64;
            turned(&points, outline.centre, twist * share, -width * share)
        };
        let ends: Vec<Vec<Point>> = (0..=layers).map(turned).collect();
        for layer in 0..layers {
            let (near, far) = (&ends[layer], &ends[layer + 1]);
            surfaces.extend((0..points.len()).filter_map(|i| {
                let next = (i + 1) % points.len();
                let corners = [far[i], far[next], near[next], near[i]];
                Surface::seen(&frame, corners, gear, layer)
            }));
        }
        faces.push(ends[0].iter().map(|p| frame.place(*p)).collect::<Vec<_>>());
    }
    surfaces.sort_by(|a, b| b.layer.cmp(&a.layer).then(a.depth.total_cmp(&b.depth)));

    let mut canvas = Canvas::new();
    for alike in surfaces.chunk_by(|a, b| (a.gear, a.shade) == (b.gear, b.shade)) {
        let class = format!("solid g{}{}", alike[0].gear, alike[0].shade);
        let areas: Vec<Vec<[f64; 2]>> = alike.iter().map(|s| s.corners.to_vec()).collect();
        canvas.areas(&areas, &class);
    }
    for (gear, face) in faces.into_iter().enumerate() {
        canvas.areas(&[face], &format!("solid g{gear}e"));
    }
    canvas.heading([MARGIN, MARGIN + 9.0], "The gear pair, axonometric view");
    let mut at = [MARGIN, MARGIN + 27.0];
    for (gear, name) in ["pinion", "mate"].into_iter().enumerate() {
        canvas.rect(
            [at[0], at[1] - 9.0],
            [at[0] + 26.0, at[1] + 1.0],
            &format!("solid g{gear}e"),
        );
        canvas.label([at[0] + 31.0, at[1]], name);
        at[0] += 44.0 + text_width(name);
    }
    Ok(canvas.finish(
        HALF[0],
        HALF[1],
        "The gears in mesh, axonometric view of both gears with their helical teeth",
    ))
}

/// A part of a tooth's surface that faces the viewer.
struct Surface {
    corners: [[f64; 2]; 4],
    gear: usize,
    /// The layer's number, from the near end.
    layer: usize,
    depth: f64,
    shade: usize,
}

impl Surface {
    /// `None` for a surface that faces away. The corners run anticlockwise, seen from outside.
    fn seen(frame: &Frame, corners: [Point; 4], gear: usize, layer: usize) -> Option<Self> {
        let [a, b, c, d] = corners;
        let normal = cross(minus(c, a), minus(d, b));
        let length = dot(normal, normal).sqrt();
        if length == 0.0 || dot(normal, VIEW) <= 0.0 {
            return None;
        }
        // From 0, away from the light, to 1.
        let light = 0.5 + 0.5 * dot(normal, LIGHT) / (length * dot(LIGHT, LIGHT).sqrt());
        Some(Self {
            corners: corners.map(|p| frame.place(p)),
            gear,
            layer,
            depth: corners.iter().map(|p| dot(*p, VIEW)).sum(),
            shade: ((light * SHADES as f64) as usize).min(SHADES - 1),
        })
    }
}

/// The projection of points in space onto the picture.
struct Frame {
    right: Point,
    up: Point,
    scale: f64,
    origin: [f64; 2],
}

impl Frame {
    /// The frame in which both gears fill the picture; `None` without any outline.
    fn around(gears: &[GearOutline; 2], width: f64) -> Option<Self> {
        let right = [VIEW[2], 0.0, -VIEW[0]];
        let right = right.map(|v| v / dot(right, right).sqrt());
        let mut frame = Self {
            right,
            up: cross(VIEW, right),
            scale: 1.0,
            origin: [0.0; 2],
        };
        let points = gears.iter().flat_map(|gear| &gear.outline);
        let ends = points.flat_map(|&[x, y]| [[x, y, 0.0], [x, y, -width]]);
        let seen: Vec<[f64; 2]> = ends.map(|p| frame.place(p)).collect();
        if gears.iter().any(|gear| gear.outline.len() < 3) {
            return None;
        }
        let edge = |i: usize, pick: fn(f64, f64) -> f64| seen.iter().map(|p| p[i]).reduce(pick);
        let (low, high) = (
            [edge(0, f64::min)?, edge(1, f64::min)?],
            [edge(0, f64::max)?, edge(1, f64::max)?],
        );
        let room = [HALF[0] - 2.0 * MARGIN, HALF[1] - TOP - MARGIN];
        let scale = (room[0] / (high[0] - low[0])).min(room[1] / (high[1] - low[1]));
        if !scale.is_finite() {
            return None;
        }
        frame.scale = scale;
        let middle = [0, 1].map(|i| 0.5 * scale * (low[i] + high[i]));
        frame.origin = [0.5 * HALF[0] - middle[0], TOP + 0.5 * room[1] - middle[1]];
        Some(frame)
    }

    fn place(&self, p: Point) -> [f64; 2] {
        [
            self.origin[0] + self.scale * dot(p, self.right),
            self.origin[1] - self.scale * dot(p, self.up),
        ]
    }
}

/// The outline turned about its centre, at the place `z` along the axis.
fn turned(points: &[[f64; 2]], centre: [f64; 2], angle: f64, z: f64) -> Vec<Point> {
    let (sin, cos) = angle.sin_cos();
    let turn = |p: &[f64; 2]| {
        let (x, y) = (p[0] - centre[0], p[1] - centre[1]);
        [
            centre[0] + x * cos - y * sin,
            centre[1] + x * sin + y * cos,
            z,
        ]
    };
    points.iter().map(turn).collect()
}

/// The outline, anticlockwise, without points from which the line through the others stays within `tolerance`.
fn coarse(points: &[[f64; 2]], tolerance: f64) -> Vec<[f64; 2]> {
    let mut kept = Vec::new();
    let mut start = 0;
    for end in 1..points.len() {
        let is_far = |p: &[f64; 2]| distance(*p, points[start], points[end]) > tolerance;
        if end == start + 1 || !points[start + 1..end].iter().any(is_far) {
            continue;
        }
        kept.push(points[start]);
        start = end - 1;
    }
    kept.extend(points.get(start));
    kept.extend(points.last().filter(|_| start + 1 < points.len()));
    let corners = (0..kept.len()).map(|i| (kept[i], kept[(i + 1) % kept.len()]));
    let area: f64 = corners.map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum();
    if area < 0.0 {
        kept.reverse();
    }
    kept
}

/// From a point to the segment between two others.
fn distance(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (d, e) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let length = d[0] * d[0] + d[1] * d[1];
    let t = if length > 0.0 {
        ((d[0] * e[0] + d[1] * e[1]) / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (e[0] - t * d[0]).hypot(e[1] - t * d[1])
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: Point, b: Point) -> Point {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_a_straight_line_are_left_out() {
        let square = [
            [0.0, 0.0],
            [0.5, 0.0],
            [1.0, 0.0],
            [1.0, 1.0],
            [0.4, 1.01],
            [0.0, 1.0],
        ];
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        assert_eq!(coarse(&square, 0.05), corners);
        let mut backwards = square;
        backwards.reverse();
        assert_eq!(coarse(&backwards, 0.05).len(), 4);
    }

    /// A block of which the viewer sees the top, the left side and the near end, and nothing else.
    #[test]
    fn surfaces_that_face_away_are_not_drawn() {
        let gear = |x: f64| GearOutline {
            outline: vec![[x, 0.0], [x + 10.0, 0.0], [x + 10.0, 10.0], [x, 10.0]],
            centre: [x + 5.0, 5.0],
            pitch_radius_mm: None,
            base_radius_mm: None,
        };
        let gears = [gear(0.0), gear(20.0)];
        let frame = Frame::around(&gears, 4.0).unwrap();
        let near = turned(&gears[0].outline, gears[0].centre, 0.0, 0.0);
        let far = turned(&gears[0].outline, gears[0].centre, 0.0, -4.0);
        let seen: Vec<usize> = (0..4)
            .filter(|&i| {
                let next = (i + 1) % 4;
                let corners = [far[i], far[next], near[next], near[i]];
                Surface::seen(&frame, corners, 0, 0).is_some()
            })
            .collect();
        // The edges run along the bottom, the right, the top and the left.
        assert_eq!(seen, [2, 3]);
        let [x, y] = frame.place([20.0, 10.0, 0.0]);
        assert!((0.0..=HALF[0]).contains(&x) && (TOP..=HALF[1]).contains(&y));
    }
}
