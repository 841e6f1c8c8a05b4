//! What an image says of itself: who compiled it, and the memory it takes before it runs.

use object::{Object, ObjectSection, SectionFlags, SectionKind, elf};

/// Where compilers and linkers leave their names.
const NAMES: &str = ".comment";
/// How the Rust compiler's begins.
const RUSTC: &str = "rustc ";

/// The section of the flight recorder's memory.
const FLIGHT_RECORDER: &str = ".flight";

/// Facts of an ELF file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ImageFacts {
    /// The compiler, as it names itself.
    pub(super) compiler: String,
    /// Bytes of flash.
    pub(super) flash: u64,
    /// Bytes of RAM that are taken before the program runs, without the stack and the memory of the
    /// flight recorder, which is all that its region has.
    pub(super) static_ram: u64,
}

impl ImageFacts {
    /// Of an ELF file.
    /// Fails in words if it is none or names no Rust compiler.
    pub(super) fn read(file: &[u8]) -> Result<Self, String> {
        let file = object::File::parse(file).map_err(|error| error.to_string())?;
        let (mut flash, mut static_ram) = (0, 0);
        for section in file.sections() {
            let SectionFlags::Elf { sh_flags } = section.flags() else {
                return Err("no ELF file".to_owned());
            };
            if sh_flags & u64::from(elf::SHF_ALLOC) == 0 {
                continue;
            }
            // What is written at run time and has a value from the start takes both.
            if section.kind() != SectionKind::UninitializedData {
                flash += section.size();
            }
            let is_recorder = section.name() == Ok(FLIGHT_RECORDER);
            if sh_flags & u64::from(elf::SHF_WRITE) != 0 && !is_recorder {
                static_ram += section.size();
            }
        }
        Ok(Self { compiler: compiler(&file)?, flash, static_ram })
    }
}

/// Every Rust compiler that is named; different ones may have built the program and the core
/// library.
fn compiler(file: &object::File<'_>) -> Result<String, String> {
    let missing = || "the image names no Rust compiler".to_owned();
    let section = file.section_by_name(NAMES).ok_or_else(missing)?;
    let names = section.data().map_err(|error| error.to_string())?;
    let names = names.split(|byte| *byte == 0).map(String::from_utf8_lossy);
    let mut compilers: Vec<_> =
        names.filter(|name| name.starts_with(RUSTC)).map(|name| name.into_owned()).collect();
    compilers.sort();
    compilers.dedup();
    if compilers.is_empty() { Err(missing()) } else { Ok(compilers.join(" and ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_image_names_its_compiler_and_fits_its_part() {
        let path = crate::machine::image_path().unwrap();
        let facts = ImageFacts::read(&std::fs::read(path).unwrap()).unwrap();
        assert!(facts.compiler.starts_with("rustc version 1."), "{facts:?}");
        assert!((10_000..1_048_576).contains(&facts.flash), "1 MiB of flash: {facts:?}");
        assert!((1_000..524_288).contains(&facts.static_ram), "512 KiB of RAM: {facts:?}");
    }

    #[test]
    fn what_is_no_elf_file_is_refused() {
        assert!(ImageFacts::read(b"\x7fELF and then something else").is_err());
    }
}
