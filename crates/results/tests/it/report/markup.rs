//! Just enough parsing to check our own markup.

/// Elements without an end tag in HTML.
const VOID: [&str; 3] = ["meta", "br", "link"];

/// Panics unless every element is closed in order, attributes are quoted, and no id occurs twice.
pub(crate) fn check(page: &str) {
    let mut open: Vec<&str> = Vec::new();
    let mut ids: Vec<&str> = Vec::new();
    let mut rest = page;
    while let Some(start) = rest.find('<') {
        let tag = &rest[start + 1..];
        let end = tag.find('>').expect("a tag without an end");
        let (tag, after) = (&tag[..end], &tag[end + 1..]);
        rest = after;
        if tag.starts_with('!') {
            continue;
        }
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "wrong end tag before {:.80}", rest);
            continue;
        }
        assert!(!tag.contains('<'), "a stray < in {tag}");
        assert_eq!(tag.matches('"').count() % 2, 0, "an open quote in {tag}");
        let name = tag.split([' ', '/']).next().unwrap();
        if let Some(id) = tag.split(" id=\"").nth(1) {
            let id = id.split('"').next().unwrap();
            assert!(!ids.contains(&id), "two elements named {id}");
            ids.push(id);
        }
        if !tag.ends_with('/') && !VOID.contains(&name) {
            open.push(name);
        }
        if name == "style" {
            rest = &rest[rest.find("</style>").expect("a style without an end")..];
        }
    }
    assert!(open.is_empty(), "never closed: {open:?}");
    for entity in page.split('&').skip(1) {
        let name: String = entity.chars().take_while(|c| *c != ';').take(8).collect();
        let known =
            ["amp", "lt", "gt", "quot", "nbsp"].contains(&name.as_str()) || name.starts_with('#');
        assert!(known, "a bare ampersand before {:.20}", entity);
    }
}

/// How often an element occurs.
pub(crate) fn element_count(page: &str, name: &str) -> usize {
    page.matches(&format!("<{name} ")).count() + page.matches(&format!("<{name}>")).count()
}

/// The text of a page, elements replaced by single spaces; style and charts are left out.
pub(crate) fn text(page: &str) -> String {
    let mut out = String::new();
    let mut rest = page;
    while let Some(start) = rest.find('<') {
        out.push_str(&rest[..start]);
        out.push(' ');
        rest = &rest[start..];
        let stop = ["style", "svg"]
            .iter()
            .find(|name| rest[1..].starts_with(**name))
            .map_or(0, |name| {
                rest.find(&format!("</{name}>")).expect("an end tag")
            });
        rest = &rest[stop..];
        rest = &rest[rest.find('>').expect("a tag without an end") + 1..];
    }
    out.split([' ', '\n'])
        .filter(|word| !word.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}
