//! `completions` and `share`: completions for shells, man pages, and schemas for editors.

use std::fs;
use std::path::Path;

use clap::CommandFactory as _;
use clap_complete::Shell;
use problem::Campaign;
use problem::file::PairFile;
use runner::exit::{self, ProgramError};

use super::output::{FileAccess, print_text};
use crate::arguments::Arguments;

/// The two programs, with a version that does not change with every build.
fn programs() -> [clap::Command; 2] {
    let worker = runner::worker::Arguments::command();
    [("coordinator", Arguments::command()), ("worker", worker)].map(|(name, program)| {
        program
            .name(name)
            .bin_name(name)
            .version(env!("CARGO_PKG_VERSION"))
    })
}

fn completed(shell: Shell, mut program: clap::Command) -> Vec<u8> {
    let name = program.get_name().to_owned();
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut program, name, &mut text);
    text
}

/// `coordinator completions`.
pub(super) fn completions(shell: Shell) -> Result<u8, ProgramError> {
    let texts = programs().map(|program| completed(shell, program));
    print_text(&String::from_utf8_lossy(&texts.concat()))?;
    Ok(exit::OK)
}

/// `coordinator share`.
pub(super) fn share(out: &Path) -> Result<u8, ProgramError> {
    let write = |name: String, text: &[u8]| {
        let path = out.join(name);
        let folder = path.parent().unwrap_or(out);
        let written = fs::create_dir_all(folder).and_then(|()| fs::write(&path, text));
        written.map_err(|source| FileAccess::new("write", &path, source))
    };
    for program in programs() {
        let name = program.get_name().to_owned();
        for (shell, place) in [
            (Shell::Bash, format!("bash-completion/completions/{name}")),
            (
                Shell::Fish,
                format!("fish/vendor_completions.d/{name}.fish"),
            ),
            (Shell::Zsh, format!("zsh/site-functions/_{name}")),
        ] {
            write(place, &completed(shell, program.clone()))?;
        }
        let mut whole = program.disable_help_subcommand(true);
        // Gives the commands their names, `coordinator-run` and so on.
        whole.build();
        let commands = whole.get_subcommands().filter(|one| !one.is_hide_set());
        for page in commands.chain([&whole]) {
            let name = page.get_display_name().unwrap_or(&name);
            let mut text = Vec::new();
            let rendered = clap_mangen::Man::new(page.clone()).render(&mut text);
            rendered.map_err(|source| FileAccess::new("write", out, source))?;
            write(format!("man/man1/{name}.1"), &text)?;
        }
    }
    for (name, schema) in [
        ("campaign", Campaign::schema()),
        ("pair", PairFile::schema()),
    ] {
        write(
            format!("pitchline/{name}.schema.json"),
            format!("{schema:#}\n").as_bytes(),
        )?;
    }
    Ok(exit::OK)
}
