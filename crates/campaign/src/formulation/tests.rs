use super::*;

fn problem() -> Problem {
    Problem::new(Campaign::parse("paper.toml", Campaign::PAPER).unwrap())
}

fn of(criteria: GearCriteria) -> Criteria {
    criteria.into()
}

fn good() -> GearCriteria {
    GearCriteria {
        contact_ratio: 1.5,
        specific_sliding: 1.5,
        hertz_pressure_mpa: 1200.0,
        root_stress_mpa: 600.0,
        clearance_mm: [0.5, 0.0],
        flank_margin_mm: [0.1, 0.1],
        normal_module_mm: 4.0,
    }
}

#[test]
fn the_violation_is_the_bracket_of_equation_5_plus_interference_in_modules() {
    let problem = problem();
    assert_eq!(problem.violation(&of(good())), 0.0);
    let bad = GearCriteria {
        contact_ratio: 1.0,
        specific_sliding: 3.0,
        root_stress_mpa: 1078.0,
        hertz_pressure_mpa: 3100.0,
        clearance_mm: [-1.0, 0.5],
        ..good()
    };
    // (1 − 1/1.25) + (3/2 − 1) + (1078/980 − 1) + (3100/1550 − 1) + 1/4
    let expected = 0.2 + 0.5 + 0.1 + 1.0 + 0.25;
    assert!((problem.violation(&of(bad)) - expected).abs() < 1e-12);
    assert!(
        (problem.penalty().unwrap().objective(2.0, 0.3) - (2.0 / 0.5 + 10.0 * 0.3)).abs() < 1e-12
    );
}

#[test]
fn limits_themselves_are_not_allowed_but_touching_teeth_are() {
    let problem = problem();
    assert!(problem.is_feasible(&of(good())));
    assert!(!problem.is_feasible(&of(GearCriteria {
        specific_sliding: 2.0,
        ..good()
    })));
    assert!(!problem.is_feasible(&of(GearCriteria {
        contact_ratio: 1.25,
        ..good()
    })));
    assert!(!problem.is_feasible(&of(GearCriteria {
        root_stress_mpa: f64::NAN,
        ..good()
    })));
    assert!(!problem.is_feasible(&of(GearCriteria {
        flank_margin_mm: [0.1, -1e-12],
        ..good()
    })));
}

#[test]
fn the_unit_cube_covers_the_bounds_and_radii_follow_the_module() {
    let problem = problem();
    assert_eq!(
        problem.free_point(&[0.0; 6]),
        [-1.0, -1.0, 0.8, 0.8, 0.8, 0.8]
    );
    assert_eq!(
        problem.free_point(&[1.0; 6]),
        [2.0, 2.0, 1.7, 1.7, 1.7, 1.7]
    );
    let unit = [0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.0, 1.0, 0.0, 1.0, 1.0];
    let design = problem.gears().unwrap().full_point(&unit).unwrap();
    let variables = design.gears();
    let module = problem.gears().unwrap().pair(&design).map_or_else(
        |_| variables.tip_radius_mm[1],
        |pair| pair.geometry().normal_module,
    );
    assert!((variables.tip_radius_mm[1] / module - 1.0).abs() < 1e-12);
    assert!((variables.root_radius_mm[0] / module - 0.05).abs() < 1e-12);
    assert_eq!(variables.helix_angle_deg, 30.0);
}
