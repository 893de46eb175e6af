//! A formula of a design's variables, such as `0.01 * width`.

use exmex::{Express as _, FlatEx};

/// A formula of variables.
#[derive(Debug, Clone)]
pub(crate) struct Formula {
    expression: FlatEx<f64>,
    /// The indices of its variables among those of the design, in the order of the expression.
    variables: Vec<usize>,
}

impl Formula {
    /// Reads a formula of the variables with these names. The error says what would be right.
    pub(crate) fn parse(text: &str, variables: &[&str]) -> Result<Self, String> {
        let known = variables.join(", ");
        // The parser's own message shows its internals.
        let expression = FlatEx::parse(text).map_err(|_| {
            format!(
                "a formula of the variables {known}, such as \"0.1 * {}\"",
                variables.first().unwrap_or(&"x")
            )
        })?;
        let place = |name: &String| {
            let place = variables.iter().position(|variable| variable == name);
            place.ok_or_else(|| format!("a formula of the variables {known}; it has {name}"))
        };
        let names = expression.var_names();
        Ok(Self {
            variables: names.iter().map(place).collect::<Result<_, _>>()?,
            expression,
        })
    }

    /// The value of the formula for these values of the variables.
    pub(crate) fn at(&self, values: &[f64]) -> f64 {
        let own: Vec<f64> = self.variables.iter().map(|&place| values[place]).collect();
        // The number of values is that of the expression's variables.
        self.expression.eval(&own).unwrap_or(f64::NAN)
    }
}
