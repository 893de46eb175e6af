//! The common cause of similar failures.

/// Maximum length of a cause in bytes. The common part of similar errors is at the beginning.
const LONGEST: usize = 200;

/// Folders whose entries have random names.
const TEMPORARY: [&str; 3] = ["/tmp", "/var/tmp", "/dev/shm"];
/// The beginnings of random names in other folders.
const PREFIXES: [&str; 3] = ["tmp", ".tmp", "pitchline-"];

/// The error's first line without the parts that differ between failures of the same cause. Numbers, addresses and
/// random names become `#`, and the middle folders of a path become `…`.
pub(crate) fn cause(error: &str) -> String {
    let mut cause = without_names(&without_folders(first_line(error)));
    cause.truncate(cause.floor_char_boundary(LONGEST));
    cause
}

pub(crate) fn first_line(error: &str) -> &str {
    error.lines().next().unwrap_or_default()
}

/// The text with short paths: `/tmp/pitchline-aB3x9/run-17` becomes `/tmp/…/run-17`.
fn without_folders(text: &str) -> String {
    let ends = |c: char| c.is_whitespace() || "\"'`()[]{}<>,;:=|".contains(c);
    text.split_inclusive(ends)
        .map(|part| {
            let path = part.trim_end_matches(|c| ends(c) || c == '.' || c == '/');
            shortened(path) + &part[path.len()..]
        })
        .collect()
}

/// An absolute path without its middle. Any other text stays as it is.
fn shortened(path: &str) -> String {
    let temporary = TEMPORARY.iter().find_map(|folder| {
        let rest = path.strip_prefix(folder)?.strip_prefix('/')?;
        Some((*folder, rest))
    });
    let split = || {
        let (first, rest) = path.strip_prefix('/')?.split_once('/')?;
        Some((&path[..=first.len()], rest))
    };
    let Some((folder, rest)) = temporary.or_else(split) else {
        return path.to_owned();
    };
    let (middle, name) = match rest.rsplit_once('/') {
        Some((_, name)) => ("…/", name),
        None => ("", rest),
    };
    let is_entry = temporary.is_some() && middle.is_empty();
    if is_entry || PREFIXES.iter().any(|prefix| name.starts_with(prefix)) {
        return format!("{folder}/{middle}#");
    }
    format!("{folder}/{middle}{name}")
}

/// The text with `#` instead of numbers and random names.
fn without_names(text: &str) -> String {
    let mut shown = String::new();
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let word = run(rest, |c| c.is_ascii_alphanumeric());
        let name = uuid(rest).or_else(|| is_random(word).then_some(word.len()));
        let length = if let Some(length) = name.or_else(|| number(rest)) {
            shown.push('#');
            length
        } else {
            // "ISO 1328" and "ISO21771" stay readable as "ISO #" and "ISO#".
            let letters = run(rest, |c| c.is_ascii_alphabetic());
            let length = letters.len().max(c.len_utf8());
            shown.push_str(&rest[..length]);
            length
        };
        rest = &rest[length..];
    }
    shown
}

/// The longest prefix whose characters all satisfy `is_inside`.
fn run(text: &str, is_inside: impl Fn(char) -> bool) -> &str {
    let end = text.find(|c| !is_inside(c)).unwrap_or(text.len());
    &text[..end]
}

/// Whether a word is an address, a hexadecimal string, or an irregular mix of letters and digits.
fn is_random(word: &str) -> bool {
    let is_hex = |text: &str| text.bytes().all(|byte| byte.is_ascii_hexdigit());
    if let Some(address) = word.strip_prefix("0x") {
        return !address.is_empty() && is_hex(address);
    }
    let pairs = || word.bytes().zip(word.bytes().skip(1));
    let changes = pairs().filter(|(a, b)| a.is_ascii_digit() != b.is_ascii_digit());
    let changes = changes.count();
    // "Inconel718" is a name, "aBcDe7" is not.
    let is_mixed_case = || pairs().any(|(a, b)| a.is_ascii_lowercase() && b.is_ascii_uppercase());
    match changes {
        0 => word.len() >= 16 && is_hex(word),
        _ if word.len() >= 8 && is_hex(word) => true,
        1 => word.len() >= 5 && is_mixed_case(),
        _ => word.len() >= 5,
    }
}

/// The length of the UUID at the beginning of a text.
fn uuid(text: &str) -> Option<usize> {
    let id = run(text, |c| c.is_ascii_hexdigit() || c == '-');
    let lengths = id.split('-').map(str::len);
    lengths.eq([8, 4, 4, 4, 12]).then_some(id.len())
}

/// The length of the number at the beginning of a text. "1.25" is one number, but the full stop in
/// "sample 3." ends the sentence.
fn number(text: &str) -> Option<usize> {
    let digits = |at: usize| run(&text[at..], |c| c.is_ascii_digit()).len();
    let mut length = digits(0);
    if length == 0 {
        return None;
    }
    while text[length..].starts_with('.') && digits(length + 1) > 0 {
        length += 1 + digits(length + 1);
    }
    if text[length..].starts_with(['e', 'E']) {
        let sign = usize::from(text[length + 1..].starts_with(['-', '+']));
        let exponent = digits(length + 1 + sign);
        if exponent > 0 {
            length += 1 + sign + exponent;
        }
    }
    Some(length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_has_no_numbers_and_no_second_line() {
        assert_eq!(
            cause("the pinion's tip radius 12.50 mm exceeds -3 mm in sample 17.\r\nat mesh 3"),
            "the pinion's tip radius # mm exceeds -# mm in sample #."
        );
        assert_eq!(cause("1..2 é 3.x 1.5e-3, 2E10 3e"), "#..# é #.x #, # #e");
        assert_eq!(cause(""), "");
        assert_eq!(cause("\nsecond"), "");
    }

    #[test]
    fn random_names_and_addresses_are_no_part_of_a_cause() {
        for (one, other, shown) in [
            (
                "cannot open /tmp/pitchline-aB3x9f/run-17: no space",
                "cannot open /tmp/pitchline-QwErTy/run-3: no space",
                "cannot open /tmp/…/run-#: no space",
            ),
            (
                "cannot open '/scratch/ann/job.12/tmpab_1.dat'",
                "cannot open '/scratch/bob/job.7/tmpqwerty.dat'",
                "cannot open '/scratch/…/#'",
            ),
            (
                "[Errno 28] in /tmp/tmpqk3v_1x0.",
                "[Errno 28] in /tmp/xyzzy.",
                "[Errno #] in /tmp/#.",
            ),
            (
                "segfault at 0x7ffdc0a1b2c8 ip 0xdeadbeef",
                "segfault at 0x10 ip 0xabc",
                "segfault at # ip #",
            ),
            (
                "job 01234567-89ab-cdef-0123-456789abcdef failed",
                "job deadbeef-dead-beef-dead-beefdeadbeef failed",
                "job # failed",
            ),
            (
                "commit 9fceb02d0ae598e95dc970b74767f19372d61af8",
                "commit abcdefabcdefabcdefabcdefabcdefabcdefabcd",
                "commit #",
            ),
            ("mesh x7K2pQ torn", "mesh aBcDe7 torn", "mesh # torn"),
        ] {
            assert_eq!(cause(one), shown);
            assert_eq!(cause(other), shown);
        }
    }

    #[test]
    fn words_and_short_paths_stay_readable() {
        for (error, shown) in [
            ("ISO21771 is not utf8", "ISO# is not utf#"),
            (
                "FileNotFoundError: Inconel718",
                "FileNotFoundError: Inconel#",
            ),
            ("420 N/mm² and/or 3/4", "# N/mm² and/or #/#"),
            ("/usr/bin is no file", "/usr/bin is no file"),
            (
                "sh: 1: /no/such/solver: not found",
                "sh: #: /no/…/solver: not found",
            ),
            (
                "/opt/mesh.dat and /opt/grid.dat",
                "/opt/mesh.dat and /opt/grid.dat",
            ),
        ] {
            assert_eq!(cause(error), shown);
        }
    }

    #[test]
    fn a_long_cause_is_cut_between_characters() {
        let cause = cause(&"é".repeat(1000));
        assert_eq!(cause, "é".repeat(LONGEST / 2));
    }
}
