//! The charts as files of their own, and data that charts often break on.

use problem::Approach;

use super::data::plausible;
use super::markup::{check, element_count};
use results::report::*;

/// All coordinates of the path commands, circles and texts of a picture.
fn coordinates(svg: &str) -> Vec<f64> {
    let attributes = [" d=\"", " cx=\"", " cy=\"", " x=\"", " y=\"", " points=\""];
    attributes
        .iter()
        .flat_map(|name| svg.split(name).skip(1))
        .map(|rest| rest.split('"').next().unwrap())
        .flat_map(|value| value.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-')))
        .filter(|number| !number.is_empty())
        .map(|number| {
            number
                .parse()
                .unwrap_or_else(|_| panic!("{number} in a coordinate"))
        })
        .collect()
}

/// A well-formed picture whose every coordinate lies in its view box.
fn check_picture(svg: &str) {
    check(svg);
    assert!(svg.starts_with("<svg xmlns=\"http://www.w3.org/2000/svg\""));
    assert!(svg.contains("role=\"img\"") && svg.contains("<title>") && svg.contains("<style>"));
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
    let size = svg
        .split("viewBox=\"0 0 ")
        .nth(1)
        .unwrap()
        .split(' ')
        .next()
        .unwrap();
    let size: f64 = size.parse().unwrap();
    for value in coordinates(svg) {
        assert!(
            (-0.1..=size + 0.1).contains(&value),
            "{value} is outside the picture"
        );
    }
}

#[test]
fn every_chart_is_a_picture_of_its_own() {
    let report = plausible();
    let data = report.gears.unwrap();
    let optimum = &data.illustrations[&Approach::Nominal];
    let pictures = [
        charts::wear(data.wear.as_ref().unwrap(), charts::FULL).unwrap(),
        charts::responses(
            &data.doe,
            None,
            "P90",
            Response::Unworn,
            Response::Percentile,
            charts::Extent::Full,
        )
        .unwrap(),
        charts::responses(
            &data.doe,
            None,
            "P90",
            Response::Unworn,
            Response::Percentile,
            charts::Extent::Logarithmic,
        )
        .unwrap(),
        charts::responses(
            &data.doe,
            None,
            "P90",
            Response::Archard,
            Response::Percentile,
            charts::Extent::Zoom,
        )
        .unwrap(),
        charts::leave_one_out(&report.snapshot.model.unwrap().0, "µm").unwrap(),
        charts::convergence("Without wear", &data.runs[&Approach::Nominal]).unwrap(),
        charts::gears(&optimum.drawing).unwrap(),
        charts::ste(&optimum.ste).unwrap(),
        charts::solid(&optimum.drawing).unwrap(),
        charts::contact(optimum.contact.as_ref().unwrap()).unwrap(),
    ];
    for picture in &pictures {
        check_picture(&picture.standalone());
    }
}

#[test]
fn a_scatter_plot_has_one_dot_per_design_at_a_dozen_bytes_each() {
    let data = plausible().gears.unwrap();
    let svg = charts::responses(
        &data.doe,
        None,
        "P90",
        Response::Unworn,
        Response::Archard,
        charts::Extent::Full,
    )
    .unwrap()
    .standalone();
    assert_eq!(svg.matches("h0").count(), data.doe.len());
    assert!(
        svg.len() < 16 * data.doe.len() + 6000,
        "{} bytes",
        svg.len()
    );
}

#[test]
fn a_zoom_shows_part_of_the_designs() {
    let data = plausible().gears.unwrap();
    let dots = |extent| {
        let svg = charts::responses(
            &data.doe,
            None,
            "P90",
            Response::Archard,
            Response::Percentile,
            extent,
        )
        .unwrap()
        .standalone();
        svg.matches("h0").count()
    };
    let (all, part) = (dots(charts::Extent::Full), dots(charts::Extent::Zoom));
    // A fifth of each coordinate, strongly correlated, and the axes end on round values beyond.
    assert!(part > all / 8 && part < all / 2, "{part} of {all}");
}

#[test]
fn points_that_cannot_be_shown_are_skipped() {
    let point = |a, b| DoePoint {
        delta_ste_um: a,
        delta_ste_archard_um: b,
        measure_um: b,
    };
    let doe = [
        point(1.0, 2.0),
        point(f64::NAN, 2.0),
        point(2.0, f64::INFINITY),
        point(-1.0, 3.0),
        point(0.0, 3.0),
        point(f64::MAX, 3.0),
    ];
    let dots = |extent| {
        let chart = charts::responses(
            &doe,
            None,
            "P90",
            Response::Unworn,
            Response::Archard,
            extent,
        );
        let svg = chart.unwrap().standalone();
        check_picture(&svg);
        svg.matches("h0").count()
    };
    assert_eq!(dots(charts::Extent::Full), 3);
    assert_eq!(dots(charts::Extent::Logarithmic), 1);
    assert!(matches!(
        charts::responses(
            &doe[1..3],
            None,
            "P90",
            Response::Unworn,
            Response::Archard,
            charts::Extent::Full
        ),
        Err(Error::NothingToDraw { .. })
    ));
}

#[test]
fn awkward_ranges_still_give_pictures() {
    for values in [
        [0.0, 0.0],
        [5.0, 5.0],
        [1e-12, 1e-9],
        [1e12, 3e12],
        [-4.0, 1e5],
        [1.0, 1.0 + 1e-14],
    ] {
        let curves = SteCurves {
            phase: vec![0.0, 1.0],
            unworn_um: values.to_vec(),
            worn_um: Vec::new(),
            delta_um: [values[1] - values[0], 0.0],
        };
        check_picture(&charts::ste(&curves).unwrap().standalone());
    }
}

#[test]
fn a_run_without_values_is_nothing_to_draw() {
    let mut runs = plausible().gears.unwrap().runs;
    let runs = runs.get_mut(&Approach::Nominal).unwrap();
    for run in &mut *runs {
        run.history = vec![(1, f64::INFINITY)];
        run.restarts = vec![1, 6000];
    }
    assert!(matches!(
        charts::convergence("one", runs),
        Err(Error::NothingToDraw { .. })
    ));
    runs[1].history = vec![(1, f64::INFINITY), (7, 3.0)];
    check_picture(&charts::convergence("one", runs).unwrap().standalone());
}

#[test]
fn gears_are_drawn_to_one_scale_in_both_directions() {
    // A square of 8 mm about the pitch point of two gears 100 mm apart.
    let drawing = GearDrawing {
        pinion: GearOutline {
            outline: vec![[46.0, -4.0], [54.0, -4.0], [54.0, 4.0], [46.0, 4.0]],
            centre: [0.0, 0.0],
            pitch_radius_mm: Some(50.0),
            base_radius_mm: None,
        },
        mate: GearOutline {
            outline: Vec::new(),
            centre: [100.0, 0.0],
            pitch_radius_mm: Some(50.0),
            base_radius_mm: Some(f64::NAN),
        },
        line_of_action: None,
        face_width_mm: 10.0,
        twist_rad: [0.0; 2],
        relief: None,
    };
    let svg = charts::gears(&drawing).unwrap().standalone();
    check_picture(&svg);
    let outlines: Vec<&str> = svg.split("class=\"curve s0\" d=\"").skip(1).collect();
    // The outline comes first, its legend sample second.
    let corners = coordinates(&format!(" d=\"{}", outlines[0].split('>').next().unwrap()));
    let (x, y): (Vec<f64>, Vec<f64>) = corners.chunks(2).map(|c| (c[0], c[1])).unzip();
    let extent = |v: &[f64]| {
        v.iter().copied().fold(f64::MIN, f64::max) - v.iter().copied().fold(f64::MAX, f64::min)
    };
    // 460 px show 2 · 0.17 · 100 mm; coordinates are rounded to a tenth of a pixel.
    let expected = 8.0 * 460.0 / 34.0;
    assert!((extent(&x) - expected).abs() < 0.21, "{}", extent(&x));
    assert!((extent(&y) - expected).abs() < 0.21, "{}", extent(&y));
    assert_eq!(element_count(&svg, "svg"), 1);
}

/// At true scale a relief of some µm is thinner than a line.
#[test]
fn a_tip_relief_is_drawn_magnified_and_says_so() {
    let of_relief = |amount_um: f64| {
        let relief = gear::TipRelief {
            amount: 1e-3 * amount_um,
            length: 2.0,
            shape: gear::ReliefShape::Linear,
        };
        let corrections =
            gear::Corrections::default().with_tip_relief(gear::Member::Pinion, relief);
        let campaign = problem::Campaign::parse("paper.toml", problem::Campaign::PAPER).unwrap();
        let settings = campaign.gears().unwrap();
        let design = problem::Design::new(paper::PRINTED[0].variables.to_vec());
        let file = problem::PairFile::of_design(settings, &design);
        let grid = gear::Discretisation::of(file.pair.tooth_model);
        let pair = gear::Pair::with_corrections(&file.to_gear(), &corrections, &grid).unwrap();
        (drawing(&pair), pair)
    };
    let (drawn, pair) = of_relief(20.0);
    let relief = drawn.relief.as_ref().unwrap();
    let teeth = pair.geometry().teeth.map(|teeth| teeth as usize);
    // Both flanks of every tooth of the pinion, and none of the mate.
    assert_eq!(relief.flanks.each_ref().map(Vec::len), [2 * teeth[0], 0]);
    let picture = charts::gears(&drawn).unwrap().standalone();
    check_picture(&picture);
    assert!(picture.contains(&format!("tip relief × {}", relief.factor)));
    let none = charts::gears(&of_relief(0.0).0).unwrap().standalone();
    assert!(!none.contains("tip relief"));
}

#[test]
fn gears_far_from_the_contact_or_without_outline_are_nothing_to_draw() {
    let gear = |x: f64, outline: Vec<[f64; 2]>| GearOutline {
        outline,
        centre: [x, 0.0],
        pitch_radius_mm: None,
        base_radius_mm: None,
    };
    let far = GearDrawing {
        pinion: gear(0.0, vec![[-50.0, 0.0], [-50.0, 1.0]]),
        mate: gear(100.0, Vec::new()),
        line_of_action: None,
        face_width_mm: 10.0,
        twist_rad: [0.0; 2],
        relief: None,
    };
    assert!(matches!(
        charts::gears(&far),
        Err(Error::NothingToDraw { .. })
    ));
    let none = GearDrawing {
        pinion: gear(0.0, vec![[f64::NAN, 0.0]]),
        ..far
    };
    assert!(matches!(
        charts::gears(&none),
        Err(Error::NothingToDraw { .. })
    ));
}

#[test]
fn a_contact_pattern_leaves_blank_what_carries_no_load() {
    let data = plausible().gears.unwrap();
    let optimum = &data.illustrations[&Approach::Nominal];
    let mut pattern = optimum.contact.clone().unwrap();
    let svg = charts::contact(&pattern).unwrap().standalone();
    let loaded = pattern.pressure_mpa.iter().flatten().filter(|p| **p > 0.0);
    let loaded = loaded.count();
    // The rectangles of the drawing cover the loaded places' share of the frame.
    let paths = svg.split("<path class=\"cell ").skip(1);
    let drawn = paths.map(|rest| rest.split("/>").next().unwrap());
    let corners = drawn.flat_map(|path| path.split('M').skip(1));
    let areas = corners.map(|corner| {
        let ends: Vec<f64> = corner
            .split(|c: char| !(c.is_ascii_digit() || c == '.'))
            .filter_map(|number| number.parse().ok())
            .collect();
        ((ends[2] - ends[0]) * (ends[3] - ends[1])).abs()
    });
    let covered: f64 = areas.sum();
    let frame = svg.split("class=\"frame\"").nth(1).unwrap();
    let size = ["width", "height"].map(|name| {
        let rest = frame.split(&format!("{name}=\"")).nth(1).unwrap();
        rest.split('"').next().unwrap().parse::<f64>().unwrap()
    });
    let share = covered / (size[0] * size[1]);
    assert!((share - loaded as f64 / 40.0).abs() < 0.01, "{share}");
    // The scale ends at the pair's greatest pressure, which lies between two places.
    assert!(svg.contains(">1450 MPa<"), "{svg}");
    // The same shades in the light and in the dark.
    assert!(
        !svg.split("prefers-color-scheme:dark")
            .nth(1)
            .unwrap()
            .contains(".q")
    );
    assert!(loaded < 40 && svg.contains(&format!("{:.0} % of the flank", 2.5 * loaded as f64)));
    pattern.pressure_mpa[3].pop();
    assert!(matches!(
        charts::contact(&pattern),
        Err(Error::LengthMismatch {
            expected: 5,
            found: 4,
            ..
        })
    ));
    pattern.pressure_mpa = vec![vec![0.0; 5]; 8];
    assert!(matches!(
        charts::contact(&pattern),
        Err(Error::NothingToDraw { .. })
    ));
}

#[test]
fn a_helix_shows_in_the_axonometric_view() {
    let data = plausible().gears.unwrap();
    let optimum = &data.illustrations[&Approach::Nominal];
    let mut drawing = optimum.drawing.clone();
    let helical = charts::solid(&drawing).unwrap().standalone();
    // Both near end faces, on top of everything else, and the legend's samples.
    assert_eq!(helical.matches("class=\"solid g0e\"").count(), 2);
    let walls = helical.rfind("class=\"solid g00\"").unwrap();
    assert!(walls < helical.find("class=\"solid g0e\"").unwrap());
    drawing.twist_rad = [0.0; 2];
    let spur = charts::solid(&drawing).unwrap().standalone();
    // Helical teeth are drawn in layers, spur teeth in one.
    assert!(
        spur.len() < helical.len(),
        "{} {}",
        spur.len(),
        helical.len()
    );
    drawing.face_width_mm = f64::NAN;
    assert!(matches!(
        charts::solid(&drawing),
        Err(Error::NothingToDraw { .. })
    ));
}
