//! Designs of experiments at the edges of their sizes.

use doe::{
    Design, Error, Method as Kind, Options, SOBOL_POINTS, enlarge, maximin, random_lhs, sobol,
};
use results::report::Scale;

use crate::stability::outcome::{Failed, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 4] = [
    Entry {
        id: "design-sizes",
        title: "Sizes that make no design",
        input: "1 point, 0 variables, 21 variables, an effort of NaN, a Sobol sequence beyond its end",
        instead: "Each is refused with what is possible.",
        check: sizes,
        ..Entry::blank(Method::Designs)
    },
    Entry {
        id: "design-few-points",
        title: "Fewer points than variables",
        input: "2 and 5 points in 20 variables",
        instead: "The design is a Latin hypercube all the same; the search keeps the best that it has.",
        check: few_points,
        ..Entry::blank(Method::Designs)
    },
    Entry {
        id: "design-grown-in-steps",
        title: "A design that grows in steps",
        input: "50 points in 4 variables, enlarged to 200 by one, by ten and by 150 points at a time",
        instead: "Every point that is there is kept, so the points crowd. A point that comes alone has one free stratum in \
                  each variable and so no choice: it is best to add many at a time.",
        check: grown,
        ..Entry::blank(Method::Designs)
    },
    Entry {
        id: "design-not-to-be-enlarged",
        title: "Designs that cannot be enlarged",
        input: "Fewer points than there are, a point outside the box, the Sobol sequence of another seed",
        instead: "Each is refused before anything is changed, with the point that is at fault.",
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

fn sizes(found: &mut Outcome) -> Result<(), Failed> {
    found.refused(maximin(1, 3, &quick()), "Points");
    found.refused(maximin(10, 0, &quick()), "Variables");
    found.refused(random_lhs(10, 21, 0), "Variables");
    let effort = f64::NAN;
    found.refused(maximin(10, 3, &Options { effort, ..quick() }), "Effort");
    found.refused(sobol(SOBOL_POINTS + 1, 3, 0), "SobolPoints");
    Ok(())
}

fn few_points(found: &mut Outcome) -> Result<(), Failed> {
    for n in [2, 5] {
        let design = maximin(n, 20, &quick())?;
        found.holds(
            &format!("{n} points in 20 variables are a Latin hypercube"),
            design.is_latin(),
        );
        let random = random_lhs(n, 20, 5)?.min_distance();
        let gain = design.min_distance() / random;
        found.at_least(
            &format!("smallest distance over a random one’s, {n} points"),
            gain,
            "",
            1.0,
        );
    }
    Ok(())
}

fn grown(found: &mut Outcome) -> Result<(), Failed> {
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
        found.holds("the first 50 points are kept", kept);
        found.at_least(
            &format!("smallest distance over that of a design made at once, grown {name}"),
            design.min_distance() / at_once,
            "",
            0.2,
        );
        if step == 150 {
            found.holds(
                "grown by 150, every stratum holds one point",
                design.is_stratified(),
            );
        }
        curves.push((name, curve));
    }
    found.chart(
        "Smallest distance of a growing design",
        ("points", Scale::Linear),
        ("smallest distance", Scale::Linear),
        curves,
    );
    Ok(())
}

fn not_to_be_enlarged(found: &mut Outcome) -> Result<(), Failed> {
    let design = maximin(20, 2, &quick())?;
    found.refused(enlarge(&design, 20, &quick()), "Shrinking");
    let mut outside = design.clone();
    outside.points[7] = 1.5;
    let error = enlarge(&outside, 30, &quick());
    let names_it = matches!(
        &error,
        Err(Error::Outside {
            point: 3,
            variable: 1,
            ..
        })
    );
    found.refused(error, "Outside");
    found.holds("the point and the variable are named", names_it);
    let other: Design = sobol(20, 2, 1)?;
    found.refused(Kind::Sobol.enlarge(&other, 30, &quick()), "OtherSequence");
    Ok(())
}
