use super::*;

fn refusal(change: (&str, &str)) -> String {
    let text = Campaign::PAPER.replacen(change.0, change.1, 1);
    assert_ne!(text, Campaign::PAPER, "the change must hit something");
    Campaign::parse("c.toml", &text).unwrap_err().to_string()
}

#[test]
fn a_campaign_is_extended_by_more_of_the_same_only() {
    let held = Campaign::parse("c.toml", Campaign::PAPER).unwrap();
    let mut larger = held.clone();
    larger.doe.designs += 100;
    larger.sampling.samples_per_design += 10;
    assert!(larger.extends(&held));
    assert!(!held.extends(&larger));
    larger.seed += 1;
    assert!(!larger.extends(&held), "other samples");
}

#[test]
fn the_kind_of_design_is_named_and_its_default_changes_no_digest() {
    let parse = |more: &str| {
        let text = Campaign::PAPER.replace("[doe]\n", &format!("[doe]\n{more}\n"));
        Campaign::parse("c.toml", &text).map_err(|error| error.to_string())
    };
    let absent = parse("").unwrap();
    assert_eq!(absent.doe.method, doe::Method::Maximin);
    assert_eq!(
        parse("method = \"maximin\"").unwrap().digest(),
        absent.digest()
    );
    for method in ["random", "sobol"] {
        let other = parse(&format!("method = {method:?}")).unwrap();
        assert_eq!(other.doe.method.to_string(), method);
        assert_ne!(other.digest(), absent.digest());
        assert_eq!(Campaign::from_json(&other.to_json()).unwrap(), other);
        // A campaign with another kind of design does not extend this one.
        assert!(!other.extends(&absent) && !absent.extends(&other));
        let mut larger = other.clone();
        larger.doe.designs += 1;
        assert!(larger.extends(&other));
    }
    let error = parse("method = \"lattice\"").unwrap_err();
    assert!(
        error.contains("line ")
            && error.contains("doe.method is \"lattice\", but must be one of \"random\""),
        "{error}"
    );
    let text = Campaign::PAPER.replace("designs = 3000", "method = \"sobol\"\ndesigns = 70000");
    let error = Campaign::parse("c.toml", &text).unwrap_err().to_string();
    assert!(error.contains("from 2 to 65536"), "{error}");
}

#[test]
fn the_kind_of_restarts_is_named() {
    let paper = Campaign::parse("c.toml", Campaign::PAPER).unwrap();
    let with = |lines: &str| {
        let (before, rest) = Campaign::PAPER.split_once("restarts = ").unwrap();
        let (_, after) = rest.split_once("starts = 3").unwrap();
        let text = format!("{before}{lines}\nstarts = 3{after}");
        Campaign::parse("c.toml", &text).map_err(|error| error.to_string())
    };
    let same = with("restarts = \"from-best\"\nrestart_at = 6000").unwrap();
    assert_eq!(same.digest(), paper.digest());
    let absent = with("").unwrap();
    assert_eq!(absent.optimise.restarts, cmaes::Restarts::Ipop);
    for name in ["ipop", "bipop"] {
        let other = with(&format!("restarts = {name:?}")).unwrap();
        assert_ne!(other.digest(), paper.digest());
        assert_eq!(Campaign::from_json(&other.to_json()).unwrap(), other);
        assert!(!other.extends(&paper) && !paper.extends(&other));
        let error = with(&format!("restarts = {name:?}\nrestart_at = 6000")).unwrap_err();
        let says = "optimise.restart_at is 6000, but must be absent";
        assert!(
            error.contains("c.toml, line ") && error.contains(says),
            "{error}"
        );
    }
    for (lines, says) in [
        ("restarts = \"from-best\"", "optimise.restart_at is missing"),
        (
            "restarts = \"from-best\"\nrestart_at = 12001",
            "a whole number from 1 to 12000",
        ),
        ("restart_at = 6000", "restarts is \"ipop\""),
        ("restarts = \"best\"", "optimise.restarts is \"best\""),
    ] {
        let error = with(lines).unwrap_err();
        assert!(error.contains(says), "{error}");
    }
}

#[test]
fn the_shipped_files_are_valid() {
    let paper = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
    assert_eq!(paper.gears().unwrap().pair.teeth(), [20, 22]);
    assert!(paper.warnings().is_empty());
    let wear = Campaign::parse("wear.toml", Campaign::WEAR).unwrap();
    assert!(wear.warnings().is_empty());
    let pair = Campaign::parse("pair.toml", Campaign::PAIR).unwrap();
    assert!(pair.warnings().is_empty());
    let named = |name| Campaign::parse("c.toml", &Campaign::pair_named(name)).unwrap();
    assert_eq!(named("gearbox-2").name, "gearbox-2");
    assert_eq!(named("no name").name, "pair");
    let quick = include_str!("../../../../../campaigns/quick.toml");
    let quick = Campaign::parse("quick.toml", quick).unwrap();
    assert_eq!(quick.doe.designs, 150);
    assert_ne!(paper.digest(), quick.digest());
}

#[test]
fn an_absent_flank_class_changes_no_digest_and_a_given_one_does() {
    let with = |section: &str| {
        let normal = "[sampling]\nestimator = \"normal\"\n";
        let text = Campaign::WEAR.replacen("[sampling]\n", normal, 1);
        Campaign::parse("c.toml", &format!("{text}\n{section}")).map_err(|error| error.to_string())
    };
    let perfect = with("").unwrap();
    assert!(!perfect.to_json().contains("manufacture"));
    let six = with("[manufacture]\nflank_class = 6\n").unwrap();
    assert_ne!(six.digest(), perfect.digest());
    assert_ne!(six.values_digest(), perfect.values_digest());
    assert_eq!(Campaign::from_json(&six.to_json()).unwrap(), six);
    assert!(!six.extends(&perfect) && !perfect.extends(&six));
    assert_eq!(
        six.changes_from(&perfect),
        [r#"manufacture: not given there, {"flank_class":6} here"#]
    );
    // A normal percentile is valid only with wear alone.
    assert!(perfect.warnings().is_empty());
    let warnings = six.warnings();
    assert!(
        warnings.len() == 1 && warnings[0].contains("estimator = \"chosen\""),
        "{warnings:?}"
    );
    let line = Campaign::WEAR.lines().count() + 4;
    for (class, what) in [
        ("0", "is 0,"),
        ("12", "is 12,"),
        ("-1", ""),
        ("5.0", ""),
        ("\"6\"", ""),
    ] {
        let error = with(&format!("[manufacture]\nflank_class = {class}\n")).unwrap_err();
        assert!(
            error.starts_with(&format!("c.toml, line {line}: ")),
            "{error}"
        );
        assert!(
            error.contains("flank_class") && error.contains(what),
            "{error}"
        );
    }
}

#[test]
fn a_law_of_wear_has_its_own_number() {
    let with = |wear: &str| {
        let text = Campaign::WEAR
            .lines()
            .filter(|line| !line.starts_with("law = ") && !line.starts_with("max_depth_um"))
            .fold(String::new(), |text, line| text + line + "\n");
        let text = text.replace("[wear]\n", &format!("[wear]\n{wear}\n"));
        Campaign::parse("c.toml", &text)
    };
    let archard = with("max_depth_um = 3.5").unwrap();
    let signed = with("coefficient_per_mpa = 2e-7").unwrap();
    let law = gear::WearLaw::Signed { coefficient: 2e-7 };
    assert_eq!(signed.gears().unwrap().wear.law, law);
    assert_eq!(Campaign::from_json(&signed.to_json()).unwrap(), signed);
    assert!(!signed.extends(&archard) && !archard.extends(&signed));
    for (wear, why) in [
        (
            "max_depth_um = 3.5\ncoefficient_per_mpa = 2e-7",
            "wear.coefficient_per_mpa is 2e-7, but must be absent beside max_depth_um",
        ),
        (
            "coefficient_per_mpa = -1e-7",
            "wear.coefficient_per_mpa is -1e-7",
        ),
        (
            "coefficient_per_mpa = nan",
            "wear.coefficient_per_mpa is nan",
        ),
        (
            "law = \"local\"\nmax_depth_um = 3.5",
            "wear.law is \"local\", but must be one of \"archard\", \"signed\", \"local-archard\"",
        ),
        (
            "law = \"signed\"\nmax_depth_um = 3.5",
            "wear.law is \"signed\", but must be \"archard\" or \"local-archard\" beside max_depth_um",
        ),
        (
            "law = \"local-archard\"\ncoefficient_per_mpa = 2e-7",
            "wear.law is \"local-archard\", but must be \"signed\" beside coefficient_per_mpa",
        ),
        (
            "law = \"archard\"\nwear_coefficient_mm2_per_n = 1e-9\npinion_cycles = 1e6",
            "wear.law is \"archard\", but must be \"local-archard\" beside \
             wear_coefficient_mm2_per_n",
        ),
        (
            "law = \"signed\"",
            "wear.coefficient_per_mpa is missing, but must be given with law = \"signed\"",
        ),
        (
            "wear_coefficient_mm2_per_n = 1e-9",
            "wear.pinion_cycles is missing, but must be given beside wear_coefficient_mm2_per_n",
        ),
        (
            "max_depth_um = 3.5\npinion_cycles = 1e6",
            "wear.pinion_cycles is 1000000.0, but must be absent without wear_coefficient_mm2_per_n",
        ),
        (
            "max_depth_um = 3.5\nwear_coefficient_mm2_per_n = 1e-9\npinion_cycles = 1e6",
            "wear.wear_coefficient_mm2_per_n is 1e-9, but must be absent beside max_depth_um",
        ),
        (
            "coefficient_per_mpa = 2e-7\nwear_coefficient_mm2_per_n = 1e-9\npinion_cycles = 1e6",
            "wear.wear_coefficient_mm2_per_n is 1e-9, but must be absent beside coefficient_per_mpa",
        ),
        (
            "wear_coefficient_mm2_per_n = 1e-2\npinion_cycles = 1e6",
            "wear.wear_coefficient_mm2_per_n is 0.01, but must be a number from 0 to 0.001 mm²/N",
        ),
        (
            "wear_coefficient_mm2_per_n = 1e-9\npinion_cycles = -1.0",
            "wear.pinion_cycles is -1.0, but must be a number from 0 to",
        ),
    ] {
        let error = with(wear).unwrap_err().to_string();
        assert!(error.contains(why), "{wear}: {error}");
        assert!(error.starts_with("c.toml, line "), "{wear}: {error}");
    }
    // The names are those of the laws that the numbers choose.
    let named = with("law = \"archard\"\nmax_depth_um = 3.5").unwrap();
    assert_eq!(named.digest(), archard.digest());
    let named = with("law = \"signed\"\ncoefficient_per_mpa = 2e-7").unwrap();
    assert_eq!(named.digest(), signed.digest());
}

#[test]
fn the_local_law_takes_a_depth_or_cycles() {
    let with = |wear: &str| {
        let text = Campaign::WEAR
            .lines()
            .filter(|line| !line.starts_with("max_depth_um"))
            .fold(String::new(), |text, line| text + line + "\n");
        let text = text.replace("[wear]\n", &format!("[wear]\n{wear}\n"));
        Campaign::parse("c.toml", &text).unwrap()
    };
    let archard = with("max_depth_um = 3.5");
    let deep = with("law = \"local-archard\"\nmax_depth_um = 3.5");
    let numbers = "wear_coefficient_mm2_per_n = 1e-9\npinion_cycles = 1e6";
    let worn = with(numbers);
    let named = with(&format!("law = \"local-archard\"\n{numbers}"));
    assert_eq!(named.digest(), worn.digest());
    for (campaign, amount) in [
        (&deep, gear::LocalAmount::MaxDepth { max_depth_um: 3.5 }),
        (
            &worn,
            gear::LocalAmount::Cycles {
                coefficient: 1e-9,
                pinion_cycles: 1e6,
            },
        ),
    ] {
        let law = gear::WearLaw::LocalArchard { amount };
        assert_eq!(campaign.gears().unwrap().wear.law, law);
        assert_eq!(&Campaign::from_json(&campaign.to_json()).unwrap(), campaign);
        assert!(!campaign.extends(&archard) && !archard.extends(campaign));
    }
    let warned = with("law = \"local-archard\"\nmax_depth_um = 3500.0");
    assert!(
        warned
            .warnings()
            .iter()
            .any(|w| w.starts_with("wear.max_depth_um is 3500 µm"))
    );
}

#[test]
fn whole_teeth_are_not_crowned() {
    let section = "\n[corrections]\ncrowning_um = [0.0, 5.0]\n";
    let error = Campaign::parse("c.toml", &format!("{}{section}", Campaign::PAPER));
    let error = error.unwrap_err().to_string();
    assert!(error.contains("corrections.crowning_um"), "{error}");
    Campaign::parse("c.toml", &format!("{}{section}", Campaign::WEAR)).unwrap();
}

#[test]
fn comments_and_layout_do_not_change_the_digest() {
    let stripped: String = Campaign::PAPER
        .lines()
        .map(|line| line.split('#').next().unwrap_or("").trim_end().to_owned() + "\n")
        .collect();
    let a = Campaign::parse("a", Campaign::PAPER).unwrap();
    let b = Campaign::parse("b", &stripped).unwrap();
    assert_eq!(a.digest(), b.digest());
    assert_eq!(Campaign::from_json(&a.to_json()).unwrap(), a);
}

#[test]
fn a_simulator_section_that_says_nothing_changes_no_digest() {
    let parse = |section: &str| {
        let text = format!("{}\n{section}", Campaign::PAPER);
        Campaign::parse(
            "c.toml",
            &text.replace("compare_with_paper = true", "compare_with_paper = false"),
        )
    };
    let absent = parse("").unwrap();
    let built_in = parse("[simulator]\nkind = \"built-in\"").unwrap();
    assert_eq!(absent.digest(), built_in.digest());
    let external = parse("[simulator]\nkind = \"external\"").unwrap();
    assert!(external.is_external());
    assert_ne!(absent.digest(), external.digest());
    // The place of the program does not make another campaign.
    let named = "[simulator]\nkind = \"external\"\ncommand = \"./solve\"\ntimeout_s = 5\nprocessors = 4\n\
                 environment = { MODE = \"batch\" }";
    let named = parse(named).unwrap();
    assert_eq!(named.digest(), external.digest());
    assert!(named.extends(&external) && external.extends(&named));
    assert_eq!(Campaign::from_json(&named.to_json()).unwrap(), named);
    let variables = named.simulator.environment();
    let pair = |name: &str, value: &str| (name.to_owned(), value.to_owned());
    assert_eq!(
        variables,
        [pair("OMP_NUM_THREADS", "4"), pair("MODE", "batch")]
    );
    assert_eq!(Campaign::from_json(&external.to_json()).unwrap(), external);
    for (section, why) in [
        (
            "[simulator]\nkind = \"magic\"",
            "simulator.kind is \"magic\"",
        ),
        (
            "[simulator]\nkind = \"external\"\nprobe_designs = 13",
            "from 0 to 12",
        ),
        (
            "[simulator]\nkind = \"built-in\"\nprobe_designs = 1",
            "\"external\" beside the other keys",
        ),
        (
            "[simulator]\nkind = \"external\"\ntemplate = \"a.in\"",
            "given together with result",
        ),
        (
            "[simulator]\nkind = \"external\"\ncommand = \" \"",
            "simulator.command",
        ),
        (
            "[simulator]\nkind = \"external\"\ntimeout_s = 0",
            "simulator.timeout_s is 0.0",
        ),
        (
            "[simulator]\nkind = \"external\"\nenvironment = { \"A B\" = \"1\" }",
            "letters, digits and underscores",
        ),
    ] {
        let error = parse(section).unwrap_err().to_string();
        assert!(error.contains(why), "{section}: {error}");
    }
    let text = format!("{}\n[simulator]\nkind = \"external\"", Campaign::PAPER);
    let error = Campaign::parse("c.toml", &text).unwrap_err().to_string();
    assert!(
        error.contains("report.compare_with_paper is true"),
        "{error}"
    );
}

#[test]
fn errors_name_file_line_key_and_what_would_be_right() {
    let message = refusal(("samples_per_design = 30", "samples_per_design = 3"));
    assert!(message.starts_with("c.toml, line "), "{message}");
    assert!(
        message.contains("sampling.samples_per_design is 3"),
        "{message}"
    );
    assert!(message.contains("from 4"), "{message}");
    let line: usize = message["c.toml, line ".len()..]
        .split(':')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    assert!(
        Campaign::PAPER
            .lines()
            .nth(line - 1)
            .unwrap()
            .starts_with("samples_per_design")
    );
}

#[test]
fn bad_values_are_refused_by_key() {
    for (from, to, key) in [
        ("designs = 3000", "designs = 1", "doe.designs"),
        ("designs = 3000", "dessigns = 3000", "dessigns"),
        (
            "designs = 3000",
            "designs = \"many\"",
            "designs: invalid type: string \"many\", expected a whole number",
        ),
        ("designs = 3000", "", "missing field `designs`"),
        (
            "profile_shift = [-1.0, 2.0]",
            "profile_shift = [2.0, -1.0]",
            "bounds.profile_shift",
        ),
        (
            "pinion_torque_nm = 200.0",
            "pinion_torque_nm = -1.0",
            "load.pinion_torque_nm",
        ),
        (
            "pinion_torque_nm = 200.0",
            "pinion_torque_nm = nan",
            "load.pinion_torque_nm",
        ),
        (
            "pinion_torque_nm = 200.0",
            "pinion_torque_nm = inf",
            "load.pinion_torque_nm",
        ),
        (
            "poisson_ratio = 0.29",
            "poisson_ratio = 0.5",
            "material.poisson_ratio",
        ),
        (
            "kernel = \"squared-exponential\"",
            "kernel = \"cubic\"",
            "wear.kernel",
        ),
        ("format = 1", "format = 2", "format is 2"),
        ("gear_ratio = 1.1 ", "gear_teeth = 3", "pair.gear_teeth"),
        (
            "gear_ratio = 1.1 ",
            "gear_ratio = 0.9 ",
            "pair.gear_ratio is 0.9, but must be u = z2/z1",
        ),
        (
            "gear_ratio = 1.1 ",
            "gear_teeth = -71",
            "pair.gear_teeth is -71, but must be a number of teeth from 4 to 2000; internal gears",
        ),
        (
            "designs = 3000",
            "designs = -3",
            "doe.designs is -3, but must be a whole number, zero or more",
        ),
        ("centre_distance_mm = 110.0", "", "pair.centre_distance_mm"),
        ("seed = 2009", "seed = -1", "seed"),
    ] {
        let message = refusal((from, to));
        assert!(message.contains(key), "{to}: {message}");
    }
}
