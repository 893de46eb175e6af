//! Places of loads on a tooth, and the displacement at one for a load at another.
//!
//! Reference: C. Weber, K. Banaschek, *Formänderung und Profilrücknahme bei gerad- und schrägverzahnten Rädern*,
//! Vieweg 1953.

/// The quantities of a load's place on the tooth from which the compliance follows, for one load or for two; with lists
/// as `T`, those of many places.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Station<T = f64> {
    pub(crate) cos_alpha_f: T,
    pub(crate) tan_alpha_f: T,
    /// Height at which the load line crosses the tooth axis, mm.
    pub(crate) y: T,
    /// That height above the root circle's end, in thicknesses of the root.
    pub(crate) u: T,
    /// M1, M2 about that height, and ∫ dy/(2x) up to it.
    pub(crate) m1: T,
    pub(crate) m2: T,
    pub(crate) n0: T,
}

impl<T> Station<T> {
    /// The station whose quantities are `f` of those of this one and of `other`.
    #[inline(always)]
    pub(crate) fn zip<'a, U, V>(
        &'a self,
        other: &'a Station<U>,
        f: impl Fn(&'a T, &'a U) -> V,
    ) -> Station<V> {
        Station {
            cos_alpha_f: f(&self.cos_alpha_f, &other.cos_alpha_f),
            tan_alpha_f: f(&self.tan_alpha_f, &other.tan_alpha_f),
            y: f(&self.y, &other.y),
            u: f(&self.u, &other.u),
            m1: f(&self.m1, &other.m1),
            m2: f(&self.m2, &other.m2),
            n0: f(&self.n0, &other.n0),
        }
    }

    /// The station whose quantities are `f` of those of this one.
    #[inline(always)]
    pub(crate) fn map<'a, V>(&'a self, f: impl Fn(&'a T) -> V) -> Station<V> {
        self.zip(self, |value, _| f(value))
    }
}

impl Station<Vec<f64>> {
    /// Appends a station to the lists.
    pub(crate) fn push(&mut self, station: &Station) {
        self.cos_alpha_f.push(station.cos_alpha_f);
        self.tan_alpha_f.push(station.tan_alpha_f);
        self.y.push(station.y);
        self.u.push(station.u);
        self.m1.push(station.m1);
        self.m2.push(station.m2);
        self.n0.push(station.n0);
    }
}

/// Displacement at one station for a load at another, per line load and times Young's modulus: bending, and
/// the rest of Weber and Banaschek's terms. The formula for one place holds for two if every product of
/// the place with itself becomes one of both places, and bending is integrated up to the lower one.
#[inline(always)]
pub(crate) fn influence(a: &Station, b: &Station, nu: f64) -> [f64; 2] {
    const PI: f64 = std::f64::consts::PI;
    // Values instead of references let loops over stations use the vector units.
    let is_lower = a.y < b.y;
    let low = |of_a: f64, of_b: f64| if is_lower { of_a } else { of_b };
    let (m1, m2, n0) = (low(a.m1, b.m1), low(a.m2, b.m2), low(a.n0, b.n0));
    let bending = 12.0 * (1.0 - nu * nu) * (m2 + (a.y - b.y).abs() * m1);
    let tan2 = a.tan_alpha_f * b.tan_alpha_f;
    let shear = (2.4 * (1.0 + nu) + (1.0 - nu * nu) * tan2) * n0;
    let foundation = (18.0 / PI) * (1.0 - nu * nu) * a.u * b.u
        + (1.0 - 2.0 * nu) * (1.0 + nu) * (a.u + b.u)
        + (4.8 / PI) * (1.0 - nu * nu) * (1.0 + (1.0 - nu) / 2.4 * tan2);
    let along = a.cos_alpha_f * b.cos_alpha_f;
    [along * bending, along * (shear + foundation)]
}
