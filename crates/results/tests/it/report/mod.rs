//! What a reader of the page relies on: it stands alone, it is well formed, it says what the data
//! say, and it says so when there are none.

mod charts;
mod data;
mod markup;

use data::{no_optima, nothing, optima, plausible, problem, verification};
use markup::{check, element_count};
use problem::formulation::Design;
use results::optima::Optima;
use results::report::*;
use stages::fitting::ModelSummary;
use stages::optima::Optimum;
use stages::verification::Verification;

/// A campaign in which nothing was found.
fn empty() -> Report {
    Report {
        snapshot: nothing(problem()),
        missing: Vec::new(),
        made: Vec::new(),
        slices: Vec::new(),
        scatter: Vec::new(),
        indices: Vec::new(),
        enrichment: None,
        gears: Some(GearFigures {
            paper: Some(PaperFigures::default()),
            ..GearFigures::default()
        }),
    }
}

/// The report of a campaign that is not the paper's.
fn without_paper(mut report: Report) -> Report {
    gears(&mut report).paper = None;
    report
}

fn gears(report: &mut Report) -> &mut GearFigures {
    report.gears.as_mut().unwrap()
}

fn of_paper(report: &mut Report) -> &mut PaperFigures {
    gears(report).paper.as_mut().unwrap()
}

fn model(report: &mut Report) -> &mut ModelSummary {
    &mut report.snapshot.model.as_mut().unwrap().0
}

fn set_optima(report: &mut Report, all: Vec<(Optimum, Option<Verification>)>) {
    report.snapshot.optima = Optima::new(&report.snapshot.problem, all);
}

#[test]
fn a_full_page_is_well_formed_and_shows_every_chart() {
    let page = render(&plausible()).unwrap().html;
    check(&page);
    // 3 convergence charts, 2 of the distribution, 2 of the enrichment, 5 charts of each of 4 designs, 4 of the paper's
    // start of an optimisation, wear, 2 + 2 scatter plots, kriging: leave-one-out, residuals, a slice.
    assert_eq!(element_count(&page, "svg"), 39);
    assert!(
        !page.contains("class=\"empty\""),
        "a part of a full report is missing"
    );
}

/// The data sheet stands before the charts of the recommended design, and nowhere else.
#[test]
fn the_recommended_design_has_a_data_sheet_and_every_page_a_block_to_sign() {
    let page = render(&plausible()).unwrap().html;
    let caption = "Data sheet of the recommended pair";
    assert_eq!(page.matches(caption).count(), 1);
    let after = page.split(caption).nth(1).unwrap();
    let part = after.split("<svg").next().unwrap();
    for row in [
        "base tangent length (span)",
        "<var>d</var><sub>Na</sub>",
        "tooth model",
    ] {
        assert!(part.contains(row), "{row}");
    }
    for page in [page, render(&empty()).unwrap().html] {
        assert!(page.contains("<dt>Signature</dt><dd></dd>"));
        assert!(page.contains(".sign-off{display:none}"));
    }
}

#[test]
fn a_negative_index_is_explained_where_there_is_one() {
    let sentence = "A negative index is the estimate of a small one";
    let mut report = plausible();
    for (first, is_explained) in [(0.31, false), (-0.004, false), (-0.03, true)] {
        report.indices[0].first = first;
        let page = render(&report).unwrap().html;
        check(&page);
        assert_eq!(page.contains(sentence), is_explained, "{first}");
    }
}

#[test]
fn an_empty_page_says_so_in_words() {
    let page = render(&empty()).unwrap().html;
    check(&page);
    assert_eq!(element_count(&page, "svg"), 0);
    for sentence in [
        "No approach has been run.",
        "No stage has recorded its cost.",
        "No optimiser run was recorded.",
        "The experiment has no simulable design",
        "No kriging model was fitted.",
        "The printed designs were not computed.",
    ] {
        assert!(page.contains(sentence), "missing: {sentence}");
    }
    assert!(!page.contains("NaN") && !page.contains("inf "));
}

#[test]
fn the_page_loads_nothing_and_runs_nothing() {
    let page = render(&plausible()).unwrap().html.to_lowercase();
    for forbidden in [
        "http:",
        "https:",
        "src=",
        "<script",
        "<link",
        "@import",
        "url(",
        "<iframe",
        "javascript:",
    ] {
        assert!(!page.contains(forbidden), "{forbidden}");
    }
    // Every link stays on the page, and its target exists.
    for link in page.split("href=\"").skip(1) {
        let target = link.split('"').next().unwrap();
        let name = target
            .strip_prefix('#')
            .expect("a link that leaves the page");
        assert!(page.contains(&format!("id=\"{name}\"")), "{target}");
    }
}

#[test]
fn equal_data_give_equal_bytes() {
    assert_eq!(render(&plausible()).unwrap(), render(&plausible()).unwrap());
}

#[test]
fn every_chart_is_a_file_of_its_own_with_its_data() {
    let rendered = render(&plausible()).unwrap();
    assert_eq!(rendered.charts.len(), 39);
    let names: std::collections::BTreeSet<&str> =
        rendered.charts.iter().map(|chart| &*chart.name).collect();
    assert_eq!(names.len(), 39, "{names:?}");
    for chart in &rendered.charts {
        assert!(chart.svg.starts_with("<svg xmlns="), "{}", chart.name);
    }
    let slice = rendered
        .charts
        .iter()
        .find(|chart| chart.name == "kriging-x_p");
    let csv = slice.and_then(|chart| chart.csv.as_ref()).unwrap();
    assert!(csv.starts_with("series,\"x₁\",\"model (µm)\"\n"), "{csv}");
    assert!(csv.contains("\"mean\",0.4,1.5\n"), "{csv}");
    // Few points stand in the page, too, for those who do not see the chart.
    assert!(markup::text(&rendered.html).contains("recommended 0.4000 1.500"));
}

#[test]
fn text_from_outside_is_escaped_everywhere() {
    const EVIL: &str = "<script>alert('x')</script>&\"";
    let mut data = plausible();
    let evil = || EVIL.to_owned();
    data.snapshot.campaign.name = evil();
    data.snapshot.campaign.program_version = evil();
    data.snapshot.samples_digest = evil();
    data.snapshot.criteria[2999].reason = Some(evil());
    data.made.push((evil(), evil()));
    data.snapshot.doubts.push(evil());
    model(&mut data).kernel = evil();
    model(&mut data).warnings = vec![evil()];
    data.indices[0].variable = evil();
    let mut all = optima();
    all[0].0.note = evil();
    all[1] = no_optima(EVIL).swap_remove(1);
    set_optima(&mut data, all);
    data.enrichment.as_mut().unwrap().stop = evil();
    let parts = gears(&mut data);
    parts.wear.as_mut().unwrap().subject = evil();
    let designs = &mut of_paper(&mut data).designs;
    designs[0].figures = Err(evil());
    if let Ok(figures) = &mut designs[1].figures {
        figures[0].note = evil();
    }
    let page = render(&data).unwrap().html;
    check(&page);
    assert!(!page.contains("<script"));
    // The title four times (twice in the head, in the heading, and in the block to sign), and once for each of the
    // others; the failed approach gives its reason in the table and in its own section, the warning of the model stands
    // beside it and in the notes, and the subject of the wear stands in the alternative text, the title and the caption
    // of its chart.
    assert_eq!(page.matches("alert(").count(), 23);
}

#[test]
fn numbers_reach_the_tables() {
    let page = render(&plausible()).unwrap().html;
    let text = markup::text(&page);
    for expected in [
        "2009",                               // seed
        "2175 (72.5 %); paper 2175 of 3000",  // simulable share
        "211\u{202f}584",                     // simulator calls
        "sample 209\u{202f}584 468 934",      // calls, wall and CPU time
        "all stages 211\u{202f}584 688 1367", // of all stages
        "5.24 5.82 0.45 0.41 5.90 6.34",      // Table 1, design 1, ours and the paper's alternating
        "0.012 0.010 0.11 0.10",              // Table 2, design 1
        "4.83",                               // Table 3
        "[0.49; 42.70]",                      // Table 3
        "2.59 2.42 3.18 3.03",                // Table 4, design 1
        "6.64 [6.58; 6.69]",                  // Table 5, without wear
        "▲ 2.284",                            // broken slip limit
        "▲ no",                               // so infeasible
        "▲ 0.030",                            // Lilliefors
        "0.874",                              // Q²
        "93.8 %",                             // coverage
        "1556 518 MPa ▲ −66.7 %",             // Figure 6, σ_vm
        "938 1051 MPa +12.0 %",               // Figure 7, F
        "notch factor outside its range of validity",
        "Not simulated: the store holds no sample of it",
    ] {
        assert!(text.contains(expected), "missing: {expected}");
    }
}

#[test]
fn the_headline_names_the_best_feasible_design_only() {
    // Archard's design has the lowest P90 of the synthetic data, but breaks the slip limit.
    let page = render(&plausible()).unwrap().html;
    assert!(page.contains("3.42 µm (95 % interval") && page.contains("“Best of the DoE”"));
    assert!(markup::text(&page).contains("261 MPa (16.8 %)"));
    let mut data = plausible();
    data.missing = vec!["75 of 120 designs sampled".to_owned()];
    let page = render(&data).unwrap().html;
    check(&page);
    assert!(page.contains("Unfinished: 75 of 120 designs sampled."));
    assert!(!markup::text(&page).contains("261 MPa"));
    let mut data = plausible();
    set_optima(&mut data, no_optima("stopped"));
    let page = render(&data).unwrap().html;
    check(&page);
    assert!(page.contains("No approach ended on a feasible design"));
    assert!(page.contains("This approach has no design: stopped"));
}

#[test]
fn other_campaigns_have_no_paper_columns() {
    let data = without_paper(plausible());
    let page = render(&data).unwrap().html;
    check(&page);
    let text = markup::text(&page);
    for absent in ["in the paper", "paper", "6.38", "42.70", "Figure 6"] {
        assert!(!text.contains(absent), "{absent}");
    }
}

/// The order in which parts begin, by what stands first in each.
fn places(page: &str, parts: &[&str]) -> Vec<usize> {
    let place = |part: &&str| page.find(*part).unwrap_or_else(|| panic!("no {part}"));
    parts.iter().map(place).collect()
}

#[test]
fn the_papers_tables_and_figures_come_in_its_order() {
    let page = render(&plausible()).unwrap().html;
    let parts = [
        "Figure 2 of the paper.",
        "Table 1 of the paper.",
        "Figure 3 of the paper.",
        "Table 2 of the paper.",
        "Table 3 of the paper.",
        "Figure 4 of the paper.",
        "Figure 5 of the paper.",
        "Table 4 of the paper.",
        "Figure 6 of the paper.",
        "Figure 7 of the paper.",
        "Figure 8 of the paper.",
        "Figure 9 of the paper.",
        "Figure 10 of the paper.",
        "Table 5 of the paper.",
    ];
    let places = places(&page, &parts);
    assert!(places.is_sorted(), "{places:?}");
    // What is printed with a figure stands beside the run's design.
    assert!(markup::text(&page).contains(
        "Figure 9 of the paper prints x₁ −0.028, x₂ 0.86, haP₀₁ 1.26, haP₀₂ 1.32, hfP₀₁ 1.2, hfP₀₂ 0.81, \
         ρa₁ 0.0003 mm, ρa₂ 0.19 mm, ρf₁ 0.64 mm, ρf₂ 0.23 mm, β 30°; ε_γ 1.62, ζ 2.00, σ_vm 631 MPa, \
         p_H 1115 MPa; ΔSTE with Archard’s wear 1.49 µm, P90 2.64 µm from 500 samples."
    ));
}

#[test]
fn other_campaigns_have_the_same_charts_and_no_empty_sections() {
    let of_paper = render(&plausible()).unwrap();
    let data = without_paper(plausible());
    let rendered = render(&data).unwrap();
    let names = |rendered: &ReportFiles| -> Vec<String> {
        let names = rendered.charts.iter().map(|chart| chart.name.clone());
        names.filter(|name| !name.starts_with("figure-6")).collect()
    };
    assert_eq!(names(&rendered), names(&of_paper));
    let page = render(&without_paper(empty())).unwrap().html;
    check(&page);
    let sections: Vec<&str> = page
        .split("<section id=\"")
        .skip(1)
        .filter_map(|rest| rest.split('"').next())
        .collect();
    assert_eq!(sections, ["summary", "campaign", "notes", "key"]);
}

#[test]
fn a_variable_of_the_recommended_design_at_a_bound_is_noted() {
    let page = |all| {
        let mut data = plausible();
        set_optima(&mut data, all);
        markup::text(&render(&data).unwrap().html)
    };
    let note = "The recommended design has x₁ = 2, at an end of its range from -1 to 2";
    assert!(!page(optima()).contains(note));
    let mut all = optima();
    for (optimum, _) in &mut all {
        let design = &mut optimum.found.as_mut().unwrap().design;
        let mut values = design.values().to_vec();
        values[0] = 2.0;
        *design = Design::new(values);
    }
    assert!(page(all).contains(note));
}

/// Beside the recommended design, before the campaign's settings.
#[test]
fn doubts_about_the_recommended_design_stand_in_the_summary() {
    let summary = |data: &Report| {
        let text = markup::text(&render(data).unwrap().html);
        text.split("What was put in").next().unwrap().to_owned()
    };
    let mut data = plausible();
    assert!(!summary(&data).contains("Reasons to doubt it"));
    gears(&mut data).doubts = vec!["the overlap ratio ε_β is 1.002".to_owned()];
    model(&mut data).coverage90 = 0.85;
    let summary = summary(&data);
    for expected in [
        "Reasons to doubt it The intervals of the kriging model are too narrow: 85.0 % of the observations",
        "90.0 % intervals: kriging.calibrate = true widens them.",
        "The overlap ratio ε_β is 1.002.",
    ] {
        assert!(summary.contains(expected), "{expected}: {summary}");
    }
}

#[test]
fn charts_of_a_design_name_it_and_say_what_they_show() {
    let page = render(&plausible()).unwrap().html;
    let labels: Vec<&str> = page
        .split("aria-label=\"")
        .skip(1)
        .filter_map(|rest| rest.split('"').next())
        .collect();
    let design = "Optimum of the approach “Without wear”, x₁ 0.49, x₂ 0.49,";
    let of_design = labels.iter().filter(|label| label.starts_with(design));
    assert_eq!(of_design.count(), 5);
    assert!(labels.iter().any(|label| {
        label.starts_with(design)
            && label
                .contains("Vertical: STE about its mean (µm). Shown: unworn: mean 7.40 µm, ΔSTE ")
    }));
    assert!(
        labels
            .iter()
            .any(|label| label.starts_with("Pinion flank of the optimum"))
    );
}

#[test]
fn the_key_explains_the_symbols_of_the_page() {
    let text = markup::text(&render(&plausible()).unwrap().html);
    let key = text
        .split("Symbols The symbols on this page")
        .nth(1)
        .unwrap();
    for row in [
        "x 1 x p x_p profile shift coefficient of the pinion",
        "hfP 02 hf 0r hf0_r dedendum of the mate’s tool modules",
        "p H F hertz_pressure_mpa greatest contact pressure, by Hertz’s theory MPa",
    ] {
        assert!(key.contains(row), "{row} in {key}");
    }
    assert!(!render(&empty()).unwrap().html.contains("rho_a_p_mm"));
}

#[test]
fn percentiles_have_the_decimals_that_their_intervals_need() {
    let mut data = plausible();
    let mut all = optima();
    all[0].1 = Some(verification(1.492, 0.0002));
    set_optima(&mut data, all);
    let text = markup::text(&render(&data).unwrap().html);
    assert!(text.contains("1.492 [1.489; 1.495]"), "{text}");
}

#[test]
fn values_that_are_not_finite_are_dashes() {
    let mut data = plausible();
    of_paper(&mut data).preliminary[0].mean_um = f64::NAN;
    let doe = &mut gears(&mut data).doe;
    doe.iter_mut().for_each(|p| p.measure_um = f64::NAN);
    data.snapshot.costs[0].cpu_seconds = f64::INFINITY;
    model(&mut data).q2 = f64::NEG_INFINITY;
    let mut all = optima();
    all[0].1 = None;
    if let Ok(found) = &mut all[0].0.found {
        found.criterion = f64::NAN;
    }
    set_optima(&mut data, all);
    let page = render(&data).unwrap().html;
    check(&page);
    for raw in ["NaN", ">inf<", "inf "] {
        let at = page
            .find(raw)
            .map(|at| &page[at.saturating_sub(80)..at + 20]);
        assert_eq!(at, None, "a raw float reached the page");
    }
    assert!(page.contains("Nothing to draw: no design has both responses."));
    assert!(markup::text(&page).contains("– 5.82"));
}

#[test]
fn the_enrichment_is_told_in_sentences() {
    let text = markup::text(&render(&plausible()).unwrap().html);
    for expected in [
        "4 rounds asked for 66 new designs and 30 times for additional samples",
        "2880 samples beside the 10\u{202f}500 of the DoE, 13\u{202f}380 in all. 2 of the points failed.",
        "predicts a P90 of 1.360 µm (95 % interval [1.345; 1.375])",
        "Verification samples give 1.350 µm, which lies within",
        "The enrichment has converged.",
    ] {
        assert!(text.contains(expected), "missing: {expected}");
    }
    let mut data = plausible();
    let enrichment = data.enrichment.as_mut().unwrap();
    enrichment.verified = Some(1.5);
    let page = render(&data).unwrap().html;
    assert!(page.contains("which lies outside"));
    // Before the first round, and where no model could be fitted.
    let enrichment = data.enrichment.as_mut().unwrap();
    enrichment.rounds.truncate(1);
    enrichment.rounds[0].predicted = f64::NAN;
    enrichment.rounds[0].expected_improvement = f64::NAN;
    check(&render(&data).unwrap().html);
    data.enrichment.as_mut().unwrap().rounds.clear();
    let page = render(&data).unwrap().html;
    check(&page);
    assert!(page.contains("No round has been decided yet."));
    data.enrichment = None;
    assert!(!render(&data).unwrap().html.contains("id=\"enrichment\""));
}

#[test]
fn lists_of_different_lengths_are_refused() {
    let mut data = plausible();
    gears(&mut data).wear.as_mut().unwrap().random_um[3].pop();
    let error = render(&data).unwrap_err();
    assert!(
        matches!(
            error,
            Error::LengthMismatch {
                expected: 161,
                found: 160,
                ..
            }
        ),
        "{error}"
    );
}
