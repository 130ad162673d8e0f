//! `finalgather completions` and `finalgather man`: what a shell needs to know of the tool.

use std::path::PathBuf;

use clap::Command;
use clap_complete::Shell;
use finalgather::error::{Error, Result};
use finalgather::file::{check_writable, write_file};

use crate::report;

/// Print completions for a shell on stdout
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/completions.txt"))]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

/// Write manual pages, one for each command
#[derive(Debug, clap::Args)]
pub struct ManArgs {
    /// The folder to write to, such as ~/.local/share/man/man1
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

/// Returns the exit code.
pub fn complete(args: &CompletionsArgs, mut tool: Command) -> Result<u8> {
    let (mut script, name) = (Vec::new(), tool.get_name().to_owned());
    clap_complete::generate(args.shell, &mut tool, name, &mut script);
    report::print_bytes(&script).map(|()| 0)
}

/// Returns the exit code.
pub fn man(args: &ManArgs, mut tool: Command) -> Result<u8> {
    // It gives each command its full name.
    tool.build();
    let name = tool.get_name().to_owned();
    let commands = tool.get_subcommands().filter(|command| command.get_name() != "help").cloned();
    for command in [tool.clone()].into_iter().chain(commands) {
        let title = command.get_display_name().unwrap_or(&name).to_owned();
        let path = args.folder.join(format!("{title}.1"));
        check_writable(&path)?;
        let mut page = Vec::new();
        let rendered = clap_mangen::Man::new(command).title(title).render(&mut page);
        rendered.map_err(|error| Error::output(&path, error.to_string(), "report this"))?;
        write_file(&path, &page)?;
    }
    report::say(&format!("{}: manual pages written; read one by: man -l {0}/{name}.1", args.folder.display()));
    Ok(0)
}
