//! Designs of experiments at the edges of their sizes.

use doe::{
    Design, Method as Kind, Options, SOBOL_POINTS, check_enlarge, enlarge, maximin, random_lhs,
    sobol,
};
use results::report::Scale;

use crate::stability::outcome::{EntryError, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 4] = [
    Entry {
        id: "design-sizes",
        title: "Impossible sizes",
        input: "Numbers of points from 0 to 1 and above 100 000, 0 variables, 21 variables, efforts of −1, ∞ and NaN, a \
                Sobol sequence beyond its end",
        instead: "Each is refused with the range of possible values.",
        check: sizes,
        ..Entry::blank(Method::Designs)
    },
    Entry {
        id: "design-few-points",
        title: "Fewer points than variables",
        input: "2 and 5 points in 20 variables",
        instead: "The design is still a Latin hypercube, and the search still spreads its points.",
        check: few_points,
        ..Entry::blank(Method::Designs)
    },
    Entry {
        id: "design-grown-in-steps",
        title: "A design that grows in steps",
        input: "50 points in 4 variables, enlarged to 200 by one, by ten and by 150 points at a time",
        instead: "Every existing point is kept, so the points crowd. A single new point has one free stratum in each \
                  variable and no choice of place: add many points at a time.",
        check: grown,
        ..Entry::blank(Method::Designs)
    },
    Entry {
        id: "design-not-to-be-enlarged",
        title: "Designs that cannot be enlarged",
        input: "No more points than before, more than 100 000, a point outside the box or without a coordinate, an effort \
                of NaN, a point beside the Sobol sequence, the Sobol sequence of another seed",
        instead: "Each is refused before anything is changed, with the first bad point.",
        check: not_to_be_enlarged,
        ..Entry::blank(Method::Designs)
    },
];

fn quick() -> Options {
    Options {
        effort: 0.2,
        seed: 5,
    }
}

fn sizes(outcome: &mut Outcome) -> Result<(), EntryError> {
    for n in [0, 1, 100_001, usize::MAX] {
        let values = format!("{n} points");
        outcome.refused_with(maximin(n, 6, &quick()), "Points", &values);
        outcome.refused_with(random_lhs(n, 6, 0), "Points", &values);
    }
    for d in [0, 21, usize::MAX] {
        let values = format!("{d} variables");
        outcome.refused_with(maximin(10, d, &quick()), "Variables", &values);
        outcome.refused_with(random_lhs(10, d, 0), "Variables", &values);
    }
    for effort in [-1.0, f64::INFINITY, f64::NAN] {
        let options = Options { effort, ..quick() };
        let values = format!("effort is {effort}");
        outcome.refused_with(maximin(10, 2, &options), "Effort", &values);
    }
    outcome.refused_with(sobol(SOBOL_POINTS + 1, 3, 0), "SobolPoints", "65537 points");
    Ok(())
}

fn few_points(outcome: &mut Outcome) -> Result<(), EntryError> {
    for n in [2, 5] {
        let design = maximin(n, 20, &quick())?;
        outcome.holds(
            &format!("{n} points in 20 variables are a Latin hypercube"),
            design.is_latin(),
        );
        let random = random_lhs(n, 20, 5)?.min_distance();
        let gain = design.min_distance() / random;
        outcome.at_least(
            &format!("smallest distance over a random one’s, {n} points"),
            gain,
            "",
            1.0,
        );
    }
    Ok(())
}

fn grown(outcome: &mut Outcome) -> Result<(), EntryError> {
    let start = maximin(50, 4, &quick())?;
    let at_once = maximin(200, 4, &quick())?.min_distance();
    let mut curves = Vec::new();
    for (name, step) in [("by one", 1), ("by ten", 10), ("by 150", 150)] {
        let mut design = start.clone();
        let mut curve = vec![[50.0, design.min_distance()]];
        while design.n < 200 {
            design = enlarge(&design, design.n + step, &quick())?;
            curve.push([design.n as f64, design.min_distance()]);
        }
        let kept = design.points[..start.points.len()] == start.points;
        outcome.holds("the first 50 points are kept", kept);
        outcome.at_least(
            &format!("smallest distance over that of a design made at once, grown {name}"),
            design.min_distance() / at_once,
            "",
            0.2,
        );
        if step == 150 {
            outcome.holds(
                "grown by 150, every stratum holds one point",
                design.is_stratified(),
            );
        }
        curves.push((name, curve));
    }
    outcome.chart(
        "Smallest distance of a growing design",
        ("points", Scale::Linear),
        ("smallest distance", Scale::Linear),
        curves,
    );
    Ok(())
}

fn not_to_be_enlarged(outcome: &mut Outcome) -> Result<(), EntryError> {
    let design = maximin(20, 2, &quick())?;
    let to = |n| enlarge(&design, n, &quick());
    outcome.refused_with(
        to(20),
        "Shrinking",
        "20 points requested of a design that has 20",
    );
    outcome.refused_with(to(100_001), "Points", "100001 points");
    let endless = Options {
        effort: f64::NAN,
        ..quick()
    };
    outcome.refused_with(enlarge(&design, 40, &endless), "Effort", "NaN");
    for coordinate in [1.5, -0.1, f64::NAN] {
        let mut outside = design.clone();
        outside.points[7] = coordinate;
        let refusal = enlarge(&outside, 40, &quick());
        outcome.holds(
            "the check gives the same refusal as the enlargement",
            check_enlarge(&outside, 40).err() == refusal.as_ref().err().cloned(),
        );
        let values = format!("point 3 has {coordinate} in variable 1");
        outcome.refused_with(refusal, "Outside", &values);
    }
    let mut short = design.clone();
    short.points.pop();
    let values = "39 coordinates given for 20 points in 2 variables";
    outcome.refused_with(check_enlarge(&short, 40), "Coordinates", values);
    let is_accepted = check_enlarge(&design, 40).is_ok();
    outcome.holds("a whole design in the box passes the check", is_accepted);

    let sequence: Design = sobol(20, 2, 5)?;
    let check = |design: &Design, n, seed| Kind::Sobol.check_enlarge(design, n, seed);
    outcome.refused_with(check(&sequence, 40, 6), "OtherSequence", "point 0");
    let mut moved = sequence.clone();
    moved.points[7] += 1e-6;
    outcome.refused_with(check(&moved, 40, 5), "OtherSequence", "point 3");
    outcome.refused_with(check(&sequence, 65_537, 5), "SobolPoints", "65537 points");
    Ok(())
}
