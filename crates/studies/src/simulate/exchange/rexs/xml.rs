//! The components, attributes and relations of a REXS file.

use anyhow::Context as _;
use roxmltree::Node;

use super::{NONE, STRESS};

/// The units of a quantity, each with its size in the first one. Values are read in the first unit.
pub(super) type Units = &'static [(&'static str, f64)];

pub(super) const LENGTH: Units = &[("mm", 1.0), ("um", 1e-3), ("m", 1e3)];
pub(super) const ANGLE: Units = &[("deg", 1.0), ("rad", 180.0 / std::f64::consts::PI)];
pub(super) const TORQUE: Units = &[("N m", 1.0)];
pub(super) const PRESSURE: Units = &[(STRESS, 1.0)];
pub(super) const NUMBER: Units = &[(NONE, 1.0)];

/// The components and relations of a file.
#[derive(Clone, Copy)]
pub(super) struct Components<'a> {
    pub(super) root: Node<'a, 'a>,
}

/// A component in words.
pub(super) fn named(component: Node<'_, '_>) -> String {
    let [kind, name, id] =
        ["type", "name", "id"].map(|key| component.attribute(key).unwrap_or_default());
    format!("{kind} {name:?} (component {id})")
}

/// The attribute of a component.
fn attribute<'a>(component: Node<'a, 'a>, id: &str) -> Option<Node<'a, 'a>> {
    let mut attributes = component.children();
    attributes.find(|one| one.has_tag_name("attribute") && one.attribute("id") == Some(id))
}

/// The text of an attribute.
pub(super) fn text<'a>(component: Node<'a, 'a>, id: &str) -> Option<&'a str> {
    attribute(component, id)?.text().map(str::trim)
}

/// The number of an attribute in the first of these units; `None` if the component has none.
pub(super) fn number(
    component: Node<'_, '_>,
    id: &str,
    units: Units,
) -> anyhow::Result<Option<f64>> {
    let Some(found) = attribute(component, id) else {
        return Ok(None);
    };
    let unit = found.attribute("unit").unwrap_or(NONE);
    let size = units.iter().find(|(name, _)| *name == unit);
    let (_, size) = size.with_context(|| {
        let known: Vec<&str> = units.iter().map(|(name, _)| *name).collect();
        format!(
            "{}: {id} is in {unit:?}, but must be in {}",
            named(component),
            known.join(" or ")
        )
    })?;
    let written = found.text().unwrap_or_default().trim();
    let value: Option<f64> = written.parse().ok().filter(|value: &f64| value.is_finite());
    let value = value.with_context(|| {
        format!(
            "{}: {id} is {written:?}, but must be a number",
            named(component)
        )
    })?;
    Ok(Some(value * size))
}

/// As [`number`], for an attribute that must be there.
pub(super) fn required(component: Node<'_, '_>, id: &str, units: Units) -> anyhow::Result<f64> {
    number(component, id, units)?
        .with_context(|| format!("{} lacks the attribute {id}", named(component)))
}

impl<'a> Components<'a> {
    pub(super) fn list(self, list: &'static str) -> impl Iterator<Item = Node<'a, 'a>> {
        let lists = self
            .root
            .children()
            .filter(move |one| one.has_tag_name(list));
        lists
            .flat_map(|list| list.children())
            .filter(Node::is_element)
    }

    fn component(self, id: &str) -> Option<Node<'a, 'a>> {
        self.list("components")
            .find(|one| one.attribute("id") == Some(id))
    }

    pub(super) fn of_kind(self, kind: &'static str) -> Vec<Node<'a, 'a>> {
        let components = self.list("components");
        components
            .filter(|one| one.attribute("type") == Some(kind))
            .collect()
    }

    /// The components with the role `role` in the relations of type `kind` that also have `known`, a role and its
    /// component.
    pub(super) fn related(
        self,
        kind: &str,
        known: (&str, Node<'a, 'a>),
        role: &str,
    ) -> Vec<Node<'a, 'a>> {
        let relations = self.list("relations");
        let of_kind = relations.filter(|one| one.attribute("type") == Some(kind));
        let has_known = |relation: &Node<'a, 'a>| {
            relation.children().any(|one| {
                one.attribute("role") == Some(known.0)
                    && one.attribute("id") == known.1.attribute("id")
            })
        };
        of_kind
            .filter(has_known)
            .flat_map(|relation| relation.children())
            .filter(|one| one.attribute("role") == Some(role))
            .filter_map(|one| self.component(one.attribute("id")?))
            .collect()
    }
}
