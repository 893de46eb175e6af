use super::*;

fn campaign() -> Campaign {
    let mut campaign = Campaign::parse("wear.toml", Campaign::WEAR).unwrap();
    campaign.optimise.evaluations = 300;
    campaign.optimise.restart_at = Some(150);
    campaign.optimise.starts = 1;
    campaign.sampling.samples_per_design = 8;
    campaign.verify.samples = Some(60);
    campaign.verify.half_width = None;
    campaign
}

fn range(teeth: &str, ratio_tolerance: f64) -> Range {
    Range {
        teeth: teeth.parse().unwrap(),
        ratio_tolerance,
        modules_mm: Vec::new(),
        face_widths_mm: Vec::new(),
        helix_angles_deg: Vec::new(),
        racks: Vec::new(),
    }
}

/// The ratio is 1.1: 20 teeth have a mate with 22, and with 5 % those with 21 to 23.
#[test]
fn mates_are_within_the_tolerance_of_the_ratio() {
    let teeth = |range: Range| -> Vec<[u32; 2]> {
        let sizes = range.sizes("wear.toml", &campaign()).unwrap();
        sizes.iter().map(|size| size.teeth).collect()
    };
    assert_eq!(teeth(range("20", 0.0)), [[20, 22]]);
    assert_eq!(teeth(range("20", 0.05)), [[20, 21], [20, 22], [20, 23]]);
    let none = range("21", 0.001).sizes("wear.toml", &campaign());
    assert!(none.unwrap_err().to_string().contains("--ratio-tolerance"));
    let of_module = Range {
        modules_mm: vec![3.0],
        ..range("20", 0.0)
    };
    let error = of_module.sizes("wear.toml", &campaign()).unwrap_err();
    assert!(error.to_string().contains("--modules"), "{error}");
}

/// Two widths, two angles and two racks are eight sizes of each pair of teeth.
fn listed() -> Range {
    Range {
        face_widths_mm: vec![15.0, 25.0],
        helix_angles_deg: vec![10.0, 20.0],
        racks: vec![gear::Rack::A, gear::Rack::C],
        ..range("20", 0.0)
    }
}

#[test]
fn listed_dimensions_are_combined_and_their_number_is_limited() {
    let sizes = listed().sizes("wear.toml", &campaign()).unwrap();
    assert_eq!(sizes.len(), 8);
    let last = sizes.last().unwrap();
    let sections = last.campaign.gears().unwrap();
    assert_eq!(sections.pair.face_width_mm.each(), [25.0; 2]);
    assert_eq!(sections.bounds.rack, Some(gear::Rack::C));
    assert_eq!(last.dimensions.helix_angle_deg, Some(20.0));
    let many = Range {
        face_widths_mm: vec![20.0; 1001],
        helix_angles_deg: vec![10.0, 20.0],
        ..range("20", 0.0)
    };
    let error = many.sizes("wear.toml", &campaign()).unwrap_err();
    assert!(error.to_string().contains("more than 2000"), "{error}");
}

#[test]
fn listed_dimensions_have_columns_and_are_in_the_pair_files() {
    let campaign = campaign();
    let sizes = listed().sizes("wear.toml", &campaign).unwrap();
    let ranked = run(sizes, 1).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let document = write_tables(folder.path(), &campaign, &ranked).unwrap();
    let csv = String::from_utf8(document.tables[0].1.csv().unwrap()).unwrap();
    let head = "teeth_p,teeth_r,normal_module_mm,face_width_mm,helix_angle_deg,rack,x_p,";
    assert!(csv.starts_with(head), "{csv}");
    assert_eq!(csv.matches(",iso-53-c,").count(), 4);
    assert!(
        document
            .page
            .contains("face width, mm | helix angle, ° | rack |")
    );
    let text = std::fs::read_to_string(folder.path().join("pair-1.toml")).unwrap();
    let file = PairFile::parse("pair-1.toml", &text).unwrap();
    let best = ranked[0].size.dimensions;
    assert_eq!(Some(file.pair.face_width_mm.common()), best.face_width_mm);
    assert_eq!(Some(file.pair.helix_angle_deg), best.helix_angle_deg);
    assert_eq!(
        file.pair.tool_addendum,
        Some([best.rack.unwrap().addendum(); 2])
    );
}

#[test]
fn sizes_are_ranked_by_what_verification_says() {
    let campaign = campaign();
    let sizes = range("19..=21", 0.03).sizes("wear.toml", &campaign);
    let sizes = sizes.unwrap();
    let count = sizes.len();
    let ranked = run(sizes.clone(), 2).unwrap();
    assert_eq!(ranked, run(sizes, 2).unwrap());
    assert_eq!(ranked.len(), count);
    let verified: Vec<f64> = ranked
        .iter()
        .filter_map(|one| Some(one.verified?.value))
        .collect();
    assert_eq!(verified.len(), 2, "the best two are verified");
    assert!(verified[0] <= verified[1]);
    let folder = tempfile::tempdir().unwrap();
    let document = write_tables(folder.path(), &campaign, &ranked).unwrap();
    assert_eq!(document.tables[0].1.rows.len(), count);
    let text = std::fs::read_to_string(folder.path().join("pair-1.toml")).unwrap();
    let file = PairFile::parse("pair-1.toml", &text).unwrap();
    assert_eq!(file.pair.teeth, ranked[0].size.teeth);
    assert!(!folder.path().join("pair-3.toml").exists());
    for one in &ranked {
        let problem = Problem::new(one.size.campaign.clone());
        let mut found = one.best.iter();
        assert!(found.all(|found| problem.is_feasible(&found.criteria)));
    }
}

#[test]
fn doubts_about_verified_designs_stand_on_the_page_with_their_pairs() {
    let page = |torque: &str| {
        let text = Campaign::WEAR.replace("pinion_torque_nm = 200.0", torque);
        let campaign = Campaign {
            optimise: campaign().optimise,
            verify: campaign().verify,
            ..Campaign::parse("wear.toml", &text).unwrap()
        };
        let sizes = range("19..=21", 0.03).sizes("wear.toml", &campaign);
        let ranked = run(sizes.unwrap(), 2).unwrap();
        let folder = tempfile::tempdir().unwrap();
        write_tables(folder.path(), &campaign, &ranked)
            .unwrap()
            .page
    };
    let slight = page("pinion_torque_nm = 0.2");
    assert!(
        slight.contains("> Warning, pair 1: load.pinion_torque_nm is 0.2 N·m: its line load"),
        "{slight}"
    );
    let sound = page("pinion_torque_nm = 200.0");
    assert!(!sound.contains("F_t/b"), "{sound}");
}
