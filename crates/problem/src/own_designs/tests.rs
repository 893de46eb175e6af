use super::*;
use crate::accuracy::CampaignFile;

const TEXT: &str = include_str!("../../../../campaigns/cantilever/campaign.toml");

/// The cantilever without its baseline.
fn with(doe: &str) -> Result<CampaignFile, String> {
    let text = TEXT.replacen("baseline = true", "", 1);
    let text = text.replacen("[doe]\n", &format!("[doe]\n{doe}\n"), 1);
    CampaignFile::parse("beam.toml", &text).map_err(|error| error.to_string())
}

#[test]
fn own_designs_are_read_from_the_file_or_a_table() {
    let own = with("points = [[2.0, 3.0], [1.5, 3.5]]").unwrap();
    let file = with("table = \"points.csv\"").unwrap();
    assert_eq!(file.campaign.doe.table.as_deref(), Some("points.csv"));
    let table = "thickness,area,width\n3, 6.0 ,2\n3.5,,1.5\n";
    let file = file.with_designs("points.csv", table).unwrap();
    assert_eq!(file.campaign, own.campaign);
    assert_eq!(
        CampaignFile::parse("again", &file.text).unwrap().campaign,
        own.campaign
    );
    assert_ne!(
        own.campaign.values_digest(),
        with("").unwrap().campaign.values_digest()
    );
}

#[test]
fn samples_of_own_designs_are_read_from_the_file_or_a_table() {
    let own = "points = [[2.0, 3.0], [1.5, 3.5]]\nsamples = [[[0.1], [0.2]]]";
    let own = with(own).unwrap();
    let samples = "table = \"points.csv\"\ntable_rows = \"samples\"";
    let file = with(samples).unwrap();
    let table = "width,thickness,displacement\n2,3,0.1\n1.5,3.5,\n2,3,0.2\n";
    let file = file.with_designs("points.csv", table).unwrap();
    assert_eq!(file.campaign, own.campaign);
    let text = &file.text;
    assert_eq!(
        CampaignFile::parse("again", text).unwrap().campaign,
        own.campaign
    );
    let problem = Problem::new(own.campaign);
    assert_eq!(problem.own_samples(0), [[0.1], [0.2]]);
    assert!(problem.own_samples(1).is_empty());
}

#[test]
fn responses_of_own_designs_are_read_from_the_file_or_a_table() {
    let own = "points = [[2.0, 3.0], [1.5, 3.5], [1.0, 3.0]]\nresponses = [[6.0], [], [3.0]]";
    let samples = format!("{own}\nsamples = [[[0.1], [0.2]]]");
    let of = |rows: &str, text: &str| {
        let file = with(&format!("table = \"points.csv\"\ntable_rows = \"{rows}\"")).unwrap();
        let file = file.with_designs("points.csv", text);
        file.map_err(|error| error.to_string())
    };
    let designs = "width,thickness,area\n2,3,6\n1.5,3.5,\n1,3,3\n";
    let file = of("responses", designs).unwrap();
    assert_eq!(file.campaign, with(own).unwrap().campaign);
    let text = &file.text;
    assert_eq!(
        CampaignFile::parse("again", text).unwrap().campaign,
        file.campaign
    );
    let problem = Problem::new(file.campaign);
    assert_eq!(problem.own_responses(0), Some(&[6.0][..]));
    assert_eq!(problem.own_responses(1), None);
    let rows = "width,thickness,displacement,area\n2,3,0.1,6\n1.5,3.5,,\n1,3,,3\n2,3,0.2,6\n";
    assert_eq!(
        of("samples", rows).unwrap().campaign,
        with(&samples).unwrap().campaign
    );
    for (rows, text, says) in [
        (
            "samples",
            "width,thickness,displacement,area\n2,3,0.1,6\n2,3,0.2,\n",
            "points.csv, line 3: area must be the same in all rows of a design",
        ),
        (
            "responses",
            "width,thickness\n2,3\n",
            "there is no column area in the header \"width,thickness\"; a table of designs has the columns width, thickness, area, separated by commas",
        ),
        (
            "responses",
            "width,thickness,area\n2,3,inf\n",
            "points.csv, line 2: area is inf",
        ),
    ] {
        let error = of(rows, text).unwrap_err();
        assert!(error.contains(says), "{error}");
    }
}

#[test]
fn what_is_wrong_with_responses_is_told_with_its_place() {
    for (responses, says) in [
        ("[[6.0, 1.0]]", "list 1: has 2 responses of a design, not 1"),
        ("[[], [6.0]]", "at most a list for each of doe.points, 1"),
    ] {
        let responses = format!("points = [[2.0, 3.0]]\nresponses = {responses}");
        let error = with(&responses).unwrap_err();
        assert!(
            error.contains(says) && error.contains("doe.responses"),
            "{error}"
        );
    }
    let gears = include_str!("../../../../campaigns/quick.toml");
    let (points, table) = (
        "points = [[",
        "table_rows = \"responses\"\ntable = \"t.csv\"",
    );
    let doe = |keys: &str| gears.replacen("[doe]\n", &format!("[doe]\n{keys}\n"), 1);
    assert!(!gears.contains(points));
    let file = CampaignFile::parse("g.toml", &doe(table)).unwrap();
    let error = file.with_designs("t.csv", "a\n1\n").unwrap_err();
    let error = error.to_string();
    assert!(
        error.contains("the built-in model computes the responses itself"),
        "{error}"
    );
}

#[test]
fn what_is_wrong_with_a_sample_is_told_with_its_place() {
    for (samples, says) in [
        (
            "[[[0.1, 0.2]]]",
            "list 1: displacement is one of 1 sampled responses, and the sample has 2",
        ),
        ("[[[nan]]]", "list 1: a sample has finite numbers"),
        ("[[[inf]]]", "list 1: a sample has finite numbers"),
        ("[[], [[0.1]]]", "at most a list for each of doe.points, 1"),
    ] {
        let error = with(&format!("points = [[2.0, 3.0]]\nsamples = {samples}")).unwrap_err();
        assert!(
            error.contains(says) && error.contains("doe.samples"),
            "{error}"
        );
    }
    let table = |text: &str| {
        let samples = "table = \"points.csv\"\ntable_rows = \"samples\"";
        let file = with(samples).unwrap();
        file.with_designs("points.csv", text)
            .unwrap_err()
            .to_string()
    };
    let error = table("width,thickness,displacement\n2,3,0.1\n2,3,much\n");
    assert!(
        error.contains("points.csv, line 3: displacement is \"much\""),
        "{error}"
    );
    let error = table("width,thickness,displacement\n2,3,0.1\n2,3,\n");
    assert!(error.contains("designs that differ"), "{error}");
    let error = table("width,thickness\n2,3\n");
    assert!(error.contains("; a table of designs has the columns width, thickness, displacement, separated by commas"), "{error}");
    let random = include_str!("../../../../campaigns/bracket/campaign.toml");
    let own = "[doe]\npoints = [[20.0, 30.0]]\nsamples = [[[1.0, 2.0, 3.0]]]\n";
    let random = random.replacen("[doe]", own, 1);
    let error = CampaignFile::parse("b.toml", &random)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("doe.samples is 1, but must be absent: the campaign itself draws"),
        "{error}"
    );
}

#[test]
fn what_is_wrong_with_a_design_is_told_with_its_place() {
    for (points, says) in [
        ("[[2.0, 9.0]]", "row 1: thickness is 9.0"),
        ("[[2.0, 3.0], [2.0]]", "rows of 2 numbers: width, thickness"),
        ("[[2.0, 3.0], [2.0, 3.0]]", "designs that differ"),
    ] {
        let error = with(&format!("points = {points}")).unwrap_err();
        assert!(
            error.contains(says) && error.contains("doe.points"),
            "{error}"
        );
    }
    for (table, says) in [
        (
            "width\n2\n",
            "points.csv, line 1: there is no column thickness",
        ),
        (
            "width,thickness\n2,3\n2,thin\n",
            "points.csv, line 3: thickness is \"thin\"",
        ),
        (
            "width,thickness\n2,3\n2,nan\n",
            "points.csv, line 3: thickness is NaN, but must be a number from",
        ),
    ] {
        let file = with("table = \"points.csv\"").unwrap();
        let error = file
            .with_designs("points.csv", table)
            .unwrap_err()
            .to_string();
        assert!(error.contains(says), "{error}");
    }
    let many: String = (0..41)
        .map(|i| format!("{},2\n", 1.0 + 0.01 * f64::from(i)))
        .collect();
    let file = with("table = \"points.csv\"").unwrap();
    let error = file.with_designs("points.csv", &format!("width,thickness\n{many}"));
    let error = error.unwrap_err().to_string();
    assert!(
        error.contains("points.csv, line 42: there are more designs"),
        "{error}"
    );
    let both = with("points = [[2.0, 3.0]]\ntable = \"points.csv\"").unwrap_err();
    assert!(both.contains("doe.table"), "{both}");
}

#[test]
fn a_row_of_another_value_of_a_fixed_variable_and_a_doubled_column_are_refused() {
    let campaign = include_str!("../../../../campaigns/cantilever/campaign.toml");
    let keys = "[doe]\ntable = \"t.csv\"\ntable_rows = \"samples\"\n";
    let thickness = "name = \"thickness\"\nunit = \"in\"\nlow = 1.0\n";
    let text = campaign.replacen("[doe]\n", keys, 1).replacen(
        &format!("{thickness}high = 4.0"),
        &format!("{thickness}high = 1.0"),
        1,
    );
    let read = |table: &str| {
        let file = CampaignFile::parse("c.toml", &text).unwrap();
        let file = file.with_designs("t.csv", table);
        file.map_err(|error| error.to_string())
    };
    let file = read("width,thickness,displacement\n2,1,0.1\n").unwrap();
    assert_eq!(file.campaign.doe.points, [[2.0]]);
    let error = read("width,thickness,displacement\n2,1,0.1\n2,3,0.1\n").unwrap_err();
    assert!(
        error.contains("line 3") && error.contains("thickness is 3, but the campaign has"),
        "{error}"
    );
    let error = read("width,displacement,displacement\n2,0.1,9\n").unwrap_err();
    assert!(
        error.contains("displacement is the name of two columns"),
        "{error}"
    );
}
