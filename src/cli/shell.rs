//! `viola completions` and `viola man`: files for shells and for `man`.

use super::output;
use anyhow::{Context, Result};
use clap::{Args, Command};
use clap_complete::Shell;
use std::io::Write;
use std::path::PathBuf;

#[derive(Args)]
pub struct CompletionsArguments {
    /// Shell that reads them, for example `source <(viola completions bash)`.
    shell: Shell,
}

#[derive(Args)]
pub struct ManArguments {
    /// Folder for a page for each command: viola.1, viola-align.1, ...
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub fn completions(arguments: &CompletionsArguments, program: &Command) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut program.clone(), "viola", &mut script);
    print(&script)
}

pub fn man(arguments: &ManArguments, program: &Command) -> Result<()> {
    match &arguments.out {
        Some(folder) => {
            output::folder(folder)?;
            clap_mangen::generate_to(program.clone(), folder)
                .with_context(|| format!("cannot write {}", folder.display()))
        }
        None => {
            let mut page = Vec::new();
            clap_mangen::Man::new(program.clone()).render(&mut page)?;
            print(&page)
        }
    }
}

/// Prints a text; without a reader it ends as `println!` does.
pub(super) fn print(text: &[u8]) -> Result<()> {
    match std::io::stdout().write_all(text) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        done => done.context("cannot print"),
    }
}
