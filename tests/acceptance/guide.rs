//! The user's guide: its commands run, its links lead somewhere, and its reference is that of the code.
//!
//! The line that opens a fenced block of a page says what the block is:
//!
//! | block | what the test does |
//! |---|---|
//! | `console` | runs the commands behind `$ ` in a shell, in the page's folder, and looks for the other lines in what they print; `…` stands for anything |
//! | `console exit=N` | the same; the last command ends with this exit code |
//! | `console needs=A,B` | the same, where the programs, Python modules or R packages (`r:A`) are installed |
//! | `console not-run` | nothing; the line before it is a comment with the reason |
//! | `LANGUAGE file=NAME` | writes the file, which the line before the block names |
//! | `toml merge=NAME` | puts the sections in the place of those of the file, and checks the campaign |
//! | `text` | nothing |
//!
//! A page has one folder, with the repository's `campaigns` in it, and its blocks follow one another. Port 7400 of a
//! page stands for a free one. Pages that begin with the campaign that `init` writes share one run of it.

mod reference;

use std::collections::BTreeSet;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use acceptance::{Sandbox, free_address, programs, root, skipped};

/// Time limit of a block: many times its usual time, for busy machines.
const SECONDS: &str = "600";
/// The commands with which many pages begin. One page runs them; the others have the store of one run, and write its
/// report.
const BEGIN: &str =
    "$ coordinator init my.toml\n$ coordinator run my.toml --db my.db --out my-report\n";

fn pages() -> PathBuf {
    root().join("docs/guide/src")
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// A fenced block of a page.
struct Block {
    /// The page and the line that opens the block, for messages.
    place: String,
    /// The words after the fence.
    words: Vec<String>,
    /// The last line before the block that is not empty.
    before: String,
    lines: Vec<String>,
}

impl Block {
    fn has(&self, word: &str) -> bool {
        self.words.iter().any(|of_block| of_block == word)
    }

    /// The value of `key=value`.
    fn value(&self, key: &str) -> Option<&str> {
        let mut words = self.words.iter();
        words.find_map(|word| word.strip_prefix(key)?.strip_prefix('='))
    }

    fn text(&self) -> String {
        self.lines.iter().map(|line| format!("{line}\n")).collect()
    }
}

/// The fenced blocks of a page, in their order.
fn blocks(page: &str, text: &str) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut before = String::new();
    let mut lines = text.lines().enumerate();
    while let Some((number, line)) = lines.next() {
        let Some(words) = line.strip_prefix("```") else {
            if !line.trim().is_empty() {
                line.clone_into(&mut before);
            }
            continue;
        };
        let place = format!("{page}, line {}", number + 1);
        let inside: Vec<String> = lines
            .by_ref()
            .map(|(_, line)| line.to_owned())
            .take_while(|line| line != "```")
            .collect();
        blocks.push(Block {
            place,
            words: words.split_whitespace().map(str::to_owned).collect(),
            before: std::mem::take(&mut before),
            lines: inside,
        });
    }
    blocks
}

/// The commands of a console block as a script, and the lines that it must print.
fn script(block: &Block, port: u16) -> (String, Vec<&str>) {
    let (mut script, mut printed) = (String::new(), Vec::new());
    let mut continues = false;
    for line in &block.lines {
        let command = match (continues, line.strip_prefix("$ ")) {
            (true, _) => line.as_str(),
            (false, Some(command)) => command,
            (false, None) => {
                printed.push(line.trim());
                continue;
            }
        };
        script += command;
        script.push('\n');
        continues = command.ends_with('\\');
    }
    (script.replace(":7400", &format!(":{port}")), printed)
}

/// Whether a printed line is the one of the page, in which `…` stands for anything.
fn agrees(shown: &str, printed: &str) -> bool {
    let mut parts = shown.split('…').map(str::trim);
    let first = parts.next().unwrap_or_default();
    let Some(mut rest) = printed.trim().strip_prefix(first) else {
        return false;
    };
    let parts: Vec<&str> = parts.collect();
    let Some((last, between)) = parts.split_last() else {
        return rest.is_empty();
    };
    for part in between {
        let Some(at) = rest.find(part) else {
            return false;
        };
        rest = &rest[at + part.len()..];
    }
    rest.ends_with(last)
}

/// The first line of `shown` that is not in `printed` after those before it.
fn missing<'a>(shown: &[&'a str], printed: &str) -> Option<&'a str> {
    let mut lines = printed.lines();
    let wanted = shown.iter().filter(|line| !line.is_empty());
    wanted
        .copied()
        .find(|shown| !lines.any(|line| agrees(shown, line)))
}

/// Whether a program, a Python module or, with `r:` before it, an R package of this name is installed.
fn is_installed(name: &str) -> bool {
    let test = match name.strip_prefix("r:") {
        Some(package) => format!("Rscript -e 'library({package})'"),
        None => format!("command -v {name} || python3 -c 'import {name}'"),
    };
    let status = Command::new("sh")
        .args(["-c", &test])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    status.is_ok_and(|status| status.success())
}

/// Runs a script in the folder of a page; its exit code, and all that it printed.
fn run(sandbox: &Sandbox, script: &str) -> (Option<i32>, String) {
    let path = std::env::var("PATH").unwrap_or_default();
    let log = sandbox.path(".printed");
    let out = File::create(&log).expect("the folder can be written");
    let errors = out.try_clone().expect("a file has two handles");
    let mut child = Command::new("timeout")
        .args([SECONDS, "sh", "-e", "-c", script])
        .current_dir(sandbox.path(""))
        .env("PATH", format!("{}:{path}", programs().display()))
        .env("XDG_STATE_HOME", sandbox.path("state"))
        .env("PITCHLINE_LOG", "warn")
        .env("COLUMNS", "120")
        .stdin(Stdio::null())
        .stdout(out)
        .stderr(errors)
        .spawn()
        .expect("timeout runs");
    let status = child.wait().expect("the script can be waited for");
    // A script that failed may leave a coordinator behind. The group is the one that timeout makes.
    let group = format!("-{}", child.id());
    let _ = Command::new("kill")
        .args(["-KILL", "--", &group])
        .stderr(Stdio::null())
        .status();
    let printed = std::fs::read(&log).expect("the log can be read");
    (
        status.code(),
        String::from_utf8_lossy(&printed).into_owned(),
    )
}

/// The lines of a TOML file by section: the part before the first one, then each with its header.
fn sections(text: &str) -> Vec<String> {
    let mut sections = vec![String::new()];
    for line in text.lines() {
        if line.starts_with('[') {
            sections.push(String::new());
        }
        let last = sections.last_mut().expect("there is one");
        *last += line;
        last.push('\n');
    }
    sections
}

/// The header of a section, without the rest of its line.
fn header(section: &str) -> &str {
    section.split(']').next().unwrap_or_default()
}

/// `text` with the sections of `changes` in the place of its own, and new ones at its end.
fn merged(text: &str, changes: &str) -> String {
    let mut all = sections(text);
    let mut changes = sections(changes);
    let preamble = changes.remove(0);
    assert!(preamble.trim().is_empty(), "not in a section: {preamble}");
    // Several sections of one list take the place of the whole list.
    let count = |one: &String| {
        changes
            .iter()
            .filter(|other| header(other) == header(one))
            .count()
    };
    let (lists, changes): (Vec<_>, Vec<_>) = changes.iter().partition(|one| count(one) > 1);
    all.retain(|held| lists.iter().all(|list| header(list) != header(held)));
    for change in changes {
        match all.iter_mut().find(|held| header(held) == header(change)) {
            Some(held) => held.clone_from(change),
            None => all.push(change.clone()),
        }
    }
    all.extend(lists.into_iter().cloned());
    all.concat()
}

fn check(sandbox: &Sandbox, block: &Block, port: u16) {
    let place = &block.place;
    if let Some(name) = block.value("file") {
        assert!(
            block.before.contains(name),
            "{place}: the text does not name {name}"
        );
        sandbox.write(name, &block.text());
        return;
    }
    if let Some(name) = block.value("merge") {
        let text = merged(&read(&sandbox.path(name)), &block.text());
        sandbox.write(name, &text);
        let (code, printed) = run(sandbox, &format!("coordinator check {name}"));
        assert_eq!(code, Some(0), "{place}: {printed}");
        return;
    }
    match block.words.first().map(String::as_str) {
        Some("text") => return,
        Some("console") => {}
        other => panic!("{place}: a block of {other:?} is neither written nor run"),
    }
    if block.has("not-run") {
        let reason = block.before.strip_prefix("<!-- not run: ");
        assert!(reason.is_some(), "{place}: no reason why it is not run");
        return;
    }
    let needs = block
        .value("needs")
        .into_iter()
        .flat_map(|all| all.split(','));
    if let Some(lacking) = needs.into_iter().find(|name| !is_installed(name)) {
        skipped(&format!("{place}: {lacking} is not installed"));
        return;
    }
    let (script, shown) = script(block, port);
    assert!(!script.is_empty(), "{place}: no line begins with $");
    let (code, printed) = run(sandbox, &script);
    let expected = block.value("exit").map_or(Ok(0), str::parse);
    assert_eq!(
        code,
        Some(expected.expect("a number")),
        "{place}: {printed}"
    );
    if let Some(line) = missing(&shown, &printed) {
        panic!("{place}: {line:?} was not printed, or not there:\n{printed}");
    }
}

/// The page without the parts that the reference test compares.
fn written_by_hand(text: &str) -> String {
    let mut parts = text.split(reference::BEGIN);
    let mut kept = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        kept += part.split_once(reference::END).map_or("", |(_, rest)| rest);
    }
    kept
}

/// The store of the pair that `init` writes, with which many pages begin.
fn store_of_the_pair() -> &'static [u8] {
    static STORE: OnceLock<Vec<u8>> = OnceLock::new();
    STORE.get_or_init(|| {
        let sandbox = Sandbox::new();
        let (code, printed) = run(&sandbox, &BEGIN.replace("$ ", ""));
        assert_eq!(code, Some(0), "{printed}");
        std::fs::read(sandbox.path("my.db")).expect("a store")
    })
}

/// Runs the blocks of a page.
fn follow(page: &str) {
    let sandbox = Sandbox::new();
    let campaigns = root().join("campaigns").canonicalize().expect("a folder");
    std::os::unix::fs::symlink(campaigns, sandbox.path("campaigns")).expect("a link");
    let text = written_by_hand(&read(&pages().join(page)));
    // The page's own run of the same campaign finds it finished.
    if page != "start.md" && text.contains(BEGIN) {
        std::fs::write(sandbox.path("my.db"), store_of_the_pair()).expect("a store");
    }
    let port = free_address().port();
    for block in blocks(page, &text) {
        check(&sandbox, &block, port);
    }
}

macro_rules! pages_run {
    ($($name:ident $page:literal)+) => {
        $(#[test] fn $name() { follow($page); })+
        const RUN: &[&str] = &[$($page),+];
    };
}

pages_run! {
    start "start.md"
    accuracy "accuracy.md"
    campaign_file "campaign-file.md"
    commands "commands.md"
    enrichment "enrichment.md"
    exit_codes "exit-codes.md"
    failures "failures.md"
    gear_details "gear-details.md"
    gears "gears.md"
    growing "growing.md"
    kriging "kriging.md"
    known_designs "known-designs.md"
    limits "limits.md"
    machines "machines.md"
    models "models.md"
    pair "pair.md"
    paper "paper.md"
    program_failures "program-failures.md"
    programs_in_detail "programs.md"
    python "python.md"
    report "report.md"
    robust "robust.md"
    security "security.md"
    simulator "simulator.md"
    store "store.md"
    studies "studies.md"
    scale "scale.md"
    shards "shards.md"
    tables "tables.md"
    um_bridge "um-bridge.md"
    watching "watching.md"
    workers "workers.md"
}

/// The files in a folder and its folders that end with `.md`.
fn documents(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    paths
        .flat_map(|path| match path.extension() {
            Some(kind) if kind == "md" => vec![path],
            None if path.is_dir() => documents(&path),
            _ => Vec::new(),
        })
        .collect()
}

/// The targets of the links of a document, those of other sites left out.
fn links(text: &str) -> impl Iterator<Item = &str> {
    let targets = text.split("](").skip(1);
    targets
        .filter_map(|rest| Some(rest.split_once(')')?.0))
        .filter(|target| !target.contains("://"))
}

/// The anchor of a heading in links, as mdBook and GitHub make it.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().chars().filter_map(|c| match c {
        ' ' => Some('-'),
        '-' | '_' => Some(c),
        _ => c.is_alphanumeric().then_some(c),
    });
    kept.collect::<String>().to_lowercase()
}

fn has_anchor(text: &str, wanted: &str) -> bool {
    let headings = text.lines().filter(|line| line.starts_with('#'));
    headings
        .map(|line| anchor(line.trim_start_matches('#')))
        .any(|anchor| anchor == wanted)
}

#[test]
fn links_lead_somewhere() {
    let mut all = documents(&root().join("docs"));
    all.extend(documents(&root().join("deploy")));
    all.extend(documents(&root().join("campaigns")));
    all.extend(["README.md", "CONTRIBUTING.md", "CHANGELOG.md"].map(|name| root().join(name)));
    let mut broken = Vec::new();
    for document in &all {
        let text = read(document);
        for link in links(&text) {
            let (file, wanted) = link.split_once('#').unwrap_or((link, ""));
            let target = match file {
                "" => document.clone(),
                file => document.parent().expect("a folder").join(file),
            };
            let leads =
                target.exists() && (wanted.is_empty() || has_anchor(&read(&target), wanted));
            if !leads {
                broken.push(format!("{}: {link}", document.display()));
            }
        }
    }
    assert_eq!(broken, [""; 0]);
}

#[test]
fn every_program_that_measures_a_claim_exists() {
    let claims = read(&root().join("docs/claims.md"));
    let commands = claims.lines().filter(|line| line.starts_with("$ cargo "));
    let mut count = 0;
    for command in commands {
        let words: Vec<&str> = command.split_whitespace().collect();
        let after = |flag: &str| {
            let place = words.iter().position(|word| *word == flag)?;
            words.get(place + 1).copied()
        };
        let krate = after("-p").expect("a crate");
        let folder = match krate {
            "acceptance" => root().join("tests"),
            krate => root().join("crates").join(krate),
        };
        let kinds = [
            ("--example", "examples"),
            ("--bench", "benches"),
            ("--bin", "src/bin"),
        ];
        let named = kinds
            .iter()
            .find_map(|(flag, folder)| Some(format!("{folder}/{}", after(flag)?)));
        let sources = match named {
            Some(path) => [format!("{path}.rs"), format!("{path}/main.rs")],
            None => ["src/lib.rs".to_owned(), "src/main.rs".to_owned()],
        };
        let exists = sources.iter().any(|source| folder.join(source).exists());
        assert!(exists, "{command}: none of {sources:?}");
        count += 1;
    }
    assert!(count > 15, "{count} commands");
}

#[test]
fn every_page_is_in_the_contents_and_is_run() {
    let contents = read(&pages().join("SUMMARY.md"));
    let linked: BTreeSet<&str> = links(&contents)
        .filter(|link| !link.contains('/'))
        .collect();
    let run: BTreeSet<&str> = RUN.iter().copied().collect();
    assert_eq!(linked, run);
    let mut files: BTreeSet<String> = documents(&pages())
        .iter()
        .filter_map(|path| Some(path.file_name()?.to_str()?.to_owned()))
        .collect();
    files.remove("SUMMARY.md");
    assert_eq!(files, run.iter().map(|page| (*page).to_owned()).collect());
}

#[test]
fn the_checks_of_the_guide_find_mistakes() {
    assert!(agrees("all … core-seconds", "all      1.5 core-seconds"));
    assert!(agrees("a … c … e", "a b c d e") && !agrees("a … c … e", "a b e"));
    assert!(agrees("done", " done ") && !agrees("done", "done so far"));
    assert_eq!(missing(&["b", "a"], "a\nb\n"), Some("a"));
    assert_eq!(missing(&["a", "…", "b"], "a\nx\nb\n"), None);
    assert_eq!(
        merged("x = 1\n[a]\ny = 2\n", "[a] # b\ny = 3\n[b]\n"),
        "x = 1\n[a] # b\ny = 3\n[b]\n"
    );
    assert_eq!(anchor(" What `fit` says: two"), "what-fit-says-two");
    let page = "text\n```console exit=3\n$ a:7400 \\\nb\nprinted\n```\n";
    let found = blocks("page", page);
    assert_eq!((found.len(), found[0].value("exit")), (1, Some("3")));
    assert_eq!(
        script(&found[0], 9),
        ("a:9 \\\nb\n".to_owned(), vec!["printed"])
    );
    let sandbox = Sandbox::new();
    assert_eq!(run(&sandbox, "false\ntrue\n").0, Some(1));
    assert_eq!(
        run(&sandbox, "echo x >&2; exit 4\n"),
        (Some(4), "x\n".to_owned())
    );
}
