//! The symbols of the pages: indices 1 and 2 are pinion and mate, as in ISO 21771, where the paper has p and r.

use crate::number::shortest;

/// A symbol with its meaning. Symbols are pairs of a letter and its index, which may be empty.
struct Symbol {
    /// The column of exported tables with these values; empty if there is none.
    column: &'static str,
    here: [&'static str; 2],
    in_paper: [&'static str; 2],
    meaning: &'static str,
    /// Empty for a pure number.
    unit: &'static str,
}

/// Number of variables in the paper.
const VARIABLES: usize = 11;
/// Number of further variables: the corrections of the flanks.
const CORRECTIONS: usize = 6;

/// The variables in the order of Equation (1), the corrections, then the computed quantities.
#[rustfmt::skip]
const SYMBOLS: [Symbol; VARIABLES + CORRECTIONS + 6] = [
    of("x_p", ["x", "1"], ["x", "p"], "profile shift coefficient of the pinion", ""),
    of("x_r", ["x", "2"], ["x", "r"], "profile shift coefficient of the mate", ""),
    of("ha0_p", ["haP", "01"], ["ha", "0p"], "addendum of the pinion’s tool, which cuts the root", "modules"),
    of("ha0_r", ["haP", "02"], ["ha", "0r"], "addendum of the mate’s tool", "modules"),
    of("hf0_p", ["hfP", "01"], ["hf", "0p"], "dedendum of the pinion’s tool, which forms the tip", "modules"),
    of("hf0_r", ["hfP", "02"], ["hf", "0r"], "dedendum of the mate’s tool", "modules"),
    of("rho_a_p_mm", ["ρa", "1"], ["ρa", "p"], "radius of the pinion’s tip rounding", "mm"),
    of("rho_a_r_mm", ["ρa", "2"], ["ρa", "r"], "radius of the mate’s tip rounding", "mm"),
    of("rho_f_p_mm", ["ρf", "1"], ["ρf", "p"], "radius of the pinion’s root fillet", "mm"),
    of("rho_f_r_mm", ["ρf", "2"], ["ρf", "r"], "radius of the mate’s root fillet", "mm"),
    of("beta_deg", ["β", ""], ["β", "0"], "helix angle at the reference cylinder", "°"),
    of("tip_relief_p_um", ["Cαa", "1"], NONE, "tip relief of the pinion, normal to the flank", "µm"),
    of("tip_relief_r_um", ["Cαa", "2"], NONE, "tip relief of the mate, normal to the flank", "µm"),
    of("tip_relief_length_p_mm", ["LCαa", "1"], NONE, "length of the pinion’s tip relief along the path of contact", "mm"),
    of("tip_relief_length_r_mm", ["LCαa", "2"], NONE, "length of the mate’s tip relief along the path of contact", "mm"),
    of("crowning_um", ["C", "β"], NONE, "crowning of both flanks together, at the ends of the face", "µm"),
    of("helix_slope_um", ["C", "Hβ"], NONE, "helix slope of both flanks together, over the face", "µm"),
    of("contact_ratio", ["ε", "γ"], ["r", "c"], "total contact ratio: how many teeth are in contact on average", ""),
    of("specific_sliding", ["ζ", ""], ["g", "s"], "greatest specific sliding", ""),
    of("root_stress_mpa", ["σ", "vm"], ["σ", "vm"], "greatest stress at the tooth roots", "MPa"),
    of("hertz_pressure_mpa", ["p", "H"], ["F", ""], "greatest contact pressure, by Hertz’s theory", "MPa"),
    of("", ["STE", ""], ["STE", ""], "static transmission error, along the line of action", "µm"),
    of("delta_ste_um", ["ΔSTE", ""], ["ΔSTE", ""], "peak-to-peak value of the STE over a mesh period", "µm"),
];

/// The paper has no corrections.
const NONE: [&str; 2] = ["–", ""];

const fn of(
    column: &'static str,
    here: [&'static str; 2],
    in_paper: [&'static str; 2],
    meaning: &'static str,
    unit: &'static str,
) -> Symbol {
    Symbol {
        column,
        here,
        in_paper,
        meaning,
        unit,
    }
}

/// The report's name of a variable of a gear pair, with its unit if that is part of the column's name;
/// `column` is its name in exported tables. Other names stay as they are.
#[must_use]
pub fn symbol(column: &str) -> String {
    let variables = &SYMBOLS[..VARIABLES + CORRECTIONS];
    let known = variables.iter().find(|one| one.column == column);
    let Some(known) = known else {
        return column.to_owned();
    };
    match known.unit {
        "mm" | "µm" | "°" => format!("{} ({})", text(known.here), known.unit),
        _ => text(known.here),
    }
}

/// The variables of a design in one line; `values` are in the order of Equation (1).
pub(crate) fn design(values: &[f64; VARIABLES]) -> String {
    let named = SYMBOLS.iter().zip(values).map(|(symbol, value)| {
        let number = shortest(*value, 0..=4);
        let unit = match symbol.unit {
            "mm" => " mm",
            "°" => "°",
            _ => "",
        };
        format!("{} {number}{unit}", text(symbol.here))
    });
    named.collect::<Vec<_>>().join(", ")
}

/// A row of the key to the symbols; symbols are markup.
pub(crate) struct KeyRow {
    pub(crate) symbol: String,
    pub(crate) in_paper: String,
    /// The column of exported tables; empty if there is none.
    pub(crate) column: &'static str,
    pub(crate) meaning: &'static str,
    pub(crate) unit: &'static str,
}

/// The key to the symbols that a page uses.
pub(crate) fn key(page: &str) -> Vec<KeyRow> {
    let is_used = |symbol: &&Symbol| {
        [markup(symbol.here), text(symbol.here)]
            .iter()
            .any(|form| page.contains(form))
    };
    let row = |symbol: &Symbol| KeyRow {
        symbol: markup(symbol.here),
        in_paper: markup(symbol.in_paper),
        column: symbol.column,
        meaning: symbol.meaning,
        unit: symbol.unit,
    };
    SYMBOLS.iter().filter(is_used).map(row).collect()
}

/// A symbol as markup; abbreviations stay upright.
fn markup([letter, index]: [&str; 2]) -> String {
    match index {
        "" if letter.len() > 1 => letter.to_owned(),
        "" => format!("<var>{letter}</var>"),
        _ => format!("<var>{letter}</var><sub>{index}</sub>"),
    }
}

/// A symbol within text: digits of the index are lowered, other indices follow a low line.
fn text([letter, index]: [&str; 2]) -> String {
    let lowered = |digit: char| char::from_u32(0x2080 + digit.to_digit(10)?);
    let digits: Option<String> = index.chars().map(lowered).collect();
    match digits {
        Some(digits) => format!("{letter}{digits}"),
        None => format!("{letter}_{index}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variables_are_told_by_symbol_and_others_keep_their_names() {
        assert_eq!(symbol("x_p"), "x₁");
        assert_eq!(symbol("ha0_r"), "haP₀₂");
        assert_eq!(symbol("rho_f_p_mm"), "ρf₁ (mm)");
        assert_eq!(symbol("tip_relief_length_r_mm"), "LCαa₂ (mm)");
        assert_eq!(symbol("helix_slope_um"), "C_Hβ (µm)");
        assert_eq!(symbol("hertz_pressure_mpa"), "hertz_pressure_mpa");
        let mut values = [0.5; VARIABLES];
        values[0] = -0.028;
        values[10] = 30.0;
        let line = design(&values);
        assert!(line.starts_with("x₁ −0.028, x₂ 0.5, haP₀₁ 0.5"), "{line}");
        assert!(line.ends_with("ρf₂ 0.5 mm, β 30°"), "{line}");
    }

    #[test]
    fn the_key_has_what_the_page_has() {
        assert!(key("<p>No symbol.</p>").is_empty());
        let rows = key("<p>x₂ and <var>p</var><sub>H</sub></p>");
        let found: Vec<_> = rows
            .iter()
            .map(|row| (&*row.in_paper, row.column))
            .collect();
        let expected = [
            ("<var>x</var><sub>r</sub>", "x_r"),
            ("<var>F</var>", "hertz_pressure_mpa"),
        ];
        assert_eq!(found, expected);
    }
}
