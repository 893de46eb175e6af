use std::f64::consts::PI;

use problem::PairFile;

use super::super::pair;
use super::super::tests::PAIR;
use super::*;

fn relieved() -> Pair {
    let relief = "[corrections]\ntip_relief_um = [8.0, 0.0]\ntip_relief_length_mm = [2.0, 2.0]\n";
    let text = format!("{PAIR}{relief}").replace("helix_angle_deg = 0.0", "helix_angle_deg = 20.0");
    pair(&PairFile::parse("p.toml", &text).unwrap(), 1).unwrap()
}

/// The points of a drawing's vertices.
fn vertices(dxf: &str) -> Vec<[f64; 2]> {
    let lines: Vec<&str> = dxf.lines().collect();
    let groups = lines.chunks(2).map(|group| (group[0], group[1]));
    let mut found = Vec::new();
    let mut is_vertex = false;
    for (code, value) in groups {
        match code {
            "0" => is_vertex = value == "VERTEX",
            "10" if is_vertex => found.push([value.parse().unwrap(), f64::NAN]),
            "20" if is_vertex => found.last_mut().unwrap()[1] = value.parse().unwrap(),
            _ => {}
        }
    }
    found
}

/// The area lies between those of the root and the tip circle, and is z times that of a tooth with its part of the
/// body.
#[test]
fn a_drawing_is_closed_and_has_the_gear_s_circles_and_area() {
    let pair = relieved();
    let g = pair.geometry();
    for member in Member::BOTH {
        let i = member.index();
        let text = dxf(&outline(&pair, member));
        assert!(text.contains("$INSUNITS\n70\n4\n") && text.ends_with("0\nEOF\n"));
        assert!(text.contains("POLYLINE\n8\nGEAR\n66\n1\n10\n0.0\n20\n0.0\n30\n0.0\n70\n1\n"));
        let points = vertices(&text);
        let next = points.iter().cycle().skip(1);
        let edges = points.iter().zip(next).take(points.len());
        let longest = edges.clone().map(|(a, b)| (b[0] - a[0]).hypot(b[1] - a[1]));
        assert!(
            longest.fold(0.0, f64::max) < g.normal_module,
            "the outline is open"
        );
        let doubled: f64 = edges.map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum();
        let area = 0.5 * doubled;
        let [root, tip] = [g.r_f[i], g.r_a[i]].map(|r| PI * r * r);
        assert!(area > root && area < tip, "{area} between {root} and {tip}");
        let radii = || points.iter().map(|[x, y]| x.hypot(*y));
        let (least, most) = (
            radii().fold(f64::INFINITY, f64::min),
            radii().fold(0.0, f64::max),
        );
        assert!((least - g.r_f[i]).abs() < 1e-6 && (most - g.r_a[i]).abs() < 1e-6);
        // Thickness at the reference circle, over the pitch there, and the share of the annulus that is filled are
        // near.
        let filled = (area - root) / (tip - root);
        assert!((0.4..0.6).contains(&filled), "{filled}");
    }
}

/// The normal distance between nominal and modified flank is the depth, in the transverse section over cos β_b.
#[test]
fn profiles_have_the_relief_along_the_normal_of_the_flank() {
    let pair = relieved();
    let g = pair.geometry();
    let points = gear::tooth_profile(&pair, Member::Pinion, POINTS);
    let on_flank = points.iter().filter(|point| point.roll_angle.is_some());
    let deepest = on_flank
        .clone()
        .map(|point| point.depth)
        .fold(0.0, f64::max);
    assert!((deepest - 0.008).abs() < 1e-12, "{deepest}");
    for point in on_flank {
        let tau = g.r_b[0] * point.roll_angle.unwrap();
        assert!((point.radius - g.r_b[0].hypot(tau)).abs() < 1e-9);
        let ([x, y], [u, v]) = (point.nominal, point.modified);
        let moved = (x - u).hypot(y - v);
        assert!((moved - point.depth / g.beta_b.cos()).abs() < 1e-12);
        // Along a tangent of the base circle, the modified point is as far from the foot as τ less the movement.
        assert!((g.r_b[0].hypot(tau - moved) - u.hypot(v)).abs() < 1e-9);
    }
    let csv = String::from_utf8(profiles(&pair).csv().unwrap()).unwrap();
    assert_eq!(
        csv.lines().count(),
        1 + points.len() + gear::tooth_profile(&pair, Member::Gear, POINTS).len()
    );
    assert!(csv.starts_with("gear,x_mm,y_mm,modified_x_mm,"));
}
