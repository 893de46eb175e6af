use stats::{Error, SequentialRule, VarianceFormula, percentile_variance, samples_needed};

fn rule(precision: f64, batch: usize, most: usize) -> SequentialRule {
    SequentialRule {
        precision,
        batch,
        most,
        z: stats::EXACT_Z90,
        variance: VarianceFormula::Exact,
    }
}

#[test]
fn the_number_is_the_smallest_that_suffices() {
    let rule = SequentialRule {
        z: stats::PAPER_Z90,
        variance: VarianceFormula::Taylor,
        ..rule(0.2, 10, 10_000)
    };
    // From 60 on, one step reaches the goal.
    let more = samples_needed(60, 1.3, &rule).unwrap();
    assert!(more > 10 && more < 60, "{more}");
    let error = |k: usize| percentile_variance(1.3 * 1.3, k, 1.28).unwrap().sqrt();
    assert!(error(60 + more) <= 0.2 && error(60 + more - 1) > 0.2);
    assert_eq!(samples_needed(60 + more, 1.3, &rule).unwrap(), 0);
}

#[test]
fn batches_are_bounded() {
    let rule = rule(0.01, 25, 400);
    assert_eq!(samples_needed(0, f64::NAN, &rule), Ok(25));
    assert_eq!(samples_needed(10, 0.0, &rule), Ok(15));
    // At most as many again, and never beyond `most`.
    assert_eq!(samples_needed(25, 1.0, &rule), Ok(25));
    assert_eq!(samples_needed(100, 1.0, &rule), Ok(100));
    assert_eq!(samples_needed(390, 1.0, &rule), Ok(10));
    assert_eq!(samples_needed(400, 1.0, &rule), Ok(0));
    assert_eq!(samples_needed(500, 1.0, &rule), Ok(0));
    // Without scatter nothing is needed; the smallest need is still a whole batch.
    assert_eq!(samples_needed(25, 0.0, &rule), Ok(0));
    let near = SequentialRule {
        precision: 0.2,
        ..rule
    };
    assert_eq!(samples_needed(44, 1.0, &near), Ok(25));
    // A `most` below the batch takes precedence.
    let small = SequentialRule { most: 8, ..rule };
    assert_eq!(samples_needed(0, 0.0, &small), Ok(8));
    assert_eq!(samples_needed(8, 0.0, &small), Ok(0));
    for precision in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let rule = SequentialRule { precision, ..rule };
        assert!(matches!(
            samples_needed(30, 1.0, &rule),
            Err(Error::OutOfRange { .. })
        ));
    }
    assert!(samples_needed(30, f64::NAN, &rule).is_err());
}
