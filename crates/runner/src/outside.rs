//! Text from outside: what simulators, workers and machines say about themselves. It reaches logs,
//! tables and terminals, which control characters would upset.

/// Replaces control characters other than newlines and tabs by visible ones.
pub(crate) fn clean(text: &str) -> String {
    text.replace("\r\n", "\n").chars().map(visible).collect()
}

/// The text in one line: newlines become ⏎, tabs become spaces.
pub(crate) fn line(text: &str) -> String {
    let text = clean(text);
    let in_line = |c| match c {
        '\n' => '⏎',
        '\t' => ' ',
        c => c,
    };
    text.trim_end().chars().map(in_line).collect()
}

/// The text in at most `bytes` bytes: if it is longer, its beginning and its end.
pub(crate) fn shortened(text: &str, bytes: usize) -> String {
    const CUT: &str = " … ";
    if text.len() <= bytes {
        return text.to_owned();
    }
    let half = bytes.saturating_sub(CUT.len()) / 2;
    let start = &text[..text.floor_char_boundary(half)];
    let end = &text[text.ceil_char_boundary(text.len() - half)..];
    format!("{start}{CUT}{end}")
}

/// The name of a worker or a machine: one line of limited length.
pub(crate) fn name(text: &str) -> String {
    shortened(&line(text), 1 << 8)
}

/// The reason of a refusal: one line of limited length.
pub(crate) fn reason(text: &str) -> String {
    shortened(&line(text), 1 << 10)
}

fn visible(c: char) -> char {
    match c {
        '\n' | '\t' => c,
        // U+2400 to U+241F are pictures of the first 32 characters.
        '\0'..='\u{1f}' => char::from_u32(0x2400 + u32::from(c)).unwrap_or('\u{fffd}'),
        '\u{7f}' => '\u{2421}',
        // They change the direction or the lines of the text around them.
        '\u{80}'..='\u{9f}'
        | '\u{200e}'
        | '\u{200f}'
        | '\u{2028}'..='\u{202e}'
        | '\u{2066}'..='\u{2069}' => '\u{fffd}',
        c => c,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_become_visible() {
        let text = "\u{1b}[2J\u{7}50 %\r60 %\r\n\tend\u{7f}\u{9b}31m\u{202e}é ⏎\n";
        let seen = "␛[2J␇50 %␍60 %\n\tend␡\u{fffd}31m\u{fffd}é ⏎\n";
        assert_eq!(clean(text), seen);
        assert_eq!(line("a\r\nb\tc\u{1b}\n\n"), "a⏎b c␛");
        assert_eq!(line("node-7.example"), "node-7.example");
    }

    #[test]
    fn a_long_text_keeps_its_beginning_and_its_end() {
        assert_eq!(shortened("short", 5), "short");
        let long = format!("design-0: {}the cause", "é".repeat(1000));
        let kept = shortened(&long, 101);
        assert!(kept.len() <= 101, "{kept}");
        assert!(
            kept.starts_with("design-0: é") && kept.ends_with("éthe cause"),
            "{kept}"
        );
        for bytes in 0..20 {
            let kept = shortened("ééééééééééééé", bytes);
            assert!(kept.len() <= bytes.max(" … ".len()), "{bytes}: {kept}");
        }
    }
}
