//! What the configuration was before a `mgw motor` that does not end by itself: killed it takes
//! nothing back, so it leaves a file, and the next one finds it by the configuration that it meets.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::{fs, io};

use crate::config::{self, Configuration};

const HEADING: &str = "\
# The configuration of a motor gateway before `mgw motor` changed it for its own time. That command was
# ended halfway: `mgw config apply FILE` makes the configuration what it was.
";

/// The files of one command: one for each configuration that the gateway may have meanwhile.
pub struct Unfinished {
    /// Nothing where the user has no place for what programs remember.
    directory: Option<PathBuf>,
    files: Vec<PathBuf>,
}

impl Unfinished {
    /// Without files yet; they go to `mgw/unfinished` where this user's programs keep their state.
    pub fn new() -> Self {
        let directory = dirs::state_dir().or_else(dirs::data_local_dir);
        let directory = directory.map(|directory| directory.join("mgw").join("unfinished"));
        Self { directory, files: Vec::new() }
    }

    /// The file with what was before a gateway had the configuration `running`, if it has that from
    /// a command that was ended halfway.
    pub fn before(&self, running: &Configuration) -> Option<PathBuf> {
        self.file_of(running).filter(|file| file.exists())
    }

    /// The gateway has another configuration than `before` by now, as its user wanted.
    pub fn forget(&self, before: &Configuration) {
        if let Some(file) = self.file_of(before) {
            let _ = fs::remove_file(file);
        }
    }

    /// From here on the gateway may have `meanwhile`, where it shall have `after` in the end.
    pub fn expect(&mut self, meanwhile: &Configuration, after: &Configuration) -> io::Result<()> {
        let Some(file) = self.file_of(meanwhile).filter(|_| rows(meanwhile) != rows(after)) else {
            return Ok(());
        };
        fs::create_dir_all(file.parent().unwrap_or(&file))?;
        fs::write(&file, config::dump_with(after, HEADING, &BTreeMap::new(), true))?;
        self.files.push(file);
        Ok(())
    }

    /// The gateway has `running`, and no other that was expected.
    pub fn reached(&mut self, running: &Configuration) {
        let file = self.file_of(running);
        for other in self.files.extract_if(.., |other| Some(&*other) != file.as_ref()) {
            // One that stays is found only by the configuration that it is of.
            let _ = fs::remove_file(other);
        }
    }

    /// The gateway has none of what was expected.
    pub fn end(&mut self) {
        for file in self.files.drain(..) {
            let _ = fs::remove_file(file);
        }
    }

    fn file_of(&self, configuration: &Configuration) -> Option<PathBuf> {
        let mut hasher = DefaultHasher::new();
        rows(configuration).hash(&mut hasher);
        let name = format!("{:016x}.toml", hasher.finish());
        self.directory.as_ref().map(|directory| directory.join(name))
    }
}

/// The buses and axes as text.
fn rows(configuration: &Configuration) -> String {
    let Configuration { buses, axes, .. } = configuration.clone();
    config::dump(&Configuration { buses, axes, ..Configuration::default() })
}

/// What is said of a file that was found.
pub fn unfinished_text(file: &Path) -> String {
    format!(
        "a `mgw motor` that was ended halfway left this configuration, unless it is meant so. What was \
            before: `mgw config apply {}`",
        file.display()
    )
}
