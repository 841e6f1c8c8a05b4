//! An image of the firmware in a file: an ELF file as the compiler writes it, or the bytes of the
//! flash.

use std::path::Path;

use firmware_image::{HEADER_OFFSET, HEADER_SIZE, Header, KEY_SIZE, NO_KEY, UNIT};
use object::Endianness;
use object::read::elf::{ElfFile32, ProgramHeader};

use crate::failure::Failure;
use crate::given;

/// Images begin at multiples of this many bytes in a flash.
const ALIGNMENT: usize = 0x400;
/// What an erased flash holds.
const ERASED: u8 = 0xFF;
/// No flash of a board is longer.
const LONGEST_FLASH: u64 = 8 << 20;
/// No file of an image is longer, with all that a debugger wants to know.
const LONGEST_FILE: u64 = 256 << 20;
/// How a file of text begins that holds a public key.
const PEM: &[u8] = b"-----BEGIN PUBLIC KEY";
/// What comes before the 32 bytes of an Ed25519 public key in DER (RFC 8410 §4).
const KEY_PREFIX: [u8; 12] =
    [0x30, 0x2a, 0x30, 0x05, 0x06, 0x03, 0x2b, 0x65, 0x70, 0x03, 0x21, 0x00];

/// What a board takes, and what it says of itself.
pub struct ImageFile {
    pub header: Header,
    pub bytes: Vec<u8>,
}

impl ImageFile {
    /// Reads the image of a file.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        Self::of(&read_file(path)?)
            .map_err(|why| Failure::Usage(format!("{} is no image: {why}", path.display())))
    }

    fn of(file: &[u8]) -> Result<Self, String> {
        let flash = match file.strip_prefix(b"\x7fELF") {
            Some(_) => loaded(file)?,
            None => file.to_vec(),
        };
        let mut begins = (0..flash.len()).step_by(ALIGNMENT);
        let found = begins.find_map(|at| Some((at, Header::of_image(&flash[at..]).ok()?)));
        let Some((at, header)) = found else {
            // The reason of the first one is the best there is.
            let why = Header::of_image(&flash).err().map_or_else(String::new, |e| e.to_string());
            return Err(why);
        };
        let mut bytes = flash[at..].to_vec();
        let length = usize::try_from(header.length).unwrap_or(usize::MAX);
        if length < HEADER_OFFSET + HEADER_SIZE {
            return Err(format!("its header says that it has {length} bytes, which none has"));
        }
        if bytes.len() < length {
            let text = "it was cut off: its header says that it has";
            return Err(format!("{text} {length} bytes, and it has {}", bytes.len()));
        }
        // Behind it lies what else is in the flash.
        bytes.truncate(length);
        bytes.resize(length.next_multiple_of(UNIT), ERASED);
        Ok(Self { header, bytes })
    }

    /// The same image with another key in its header.
    pub fn with_key(mut self, key: [u8; KEY_SIZE]) -> Self {
        self.header.key = key;
        let header = self.header.to_bytes();
        self.bytes[HEADER_OFFSET..HEADER_OFFSET + header.len()].copy_from_slice(&header);
        self
    }
}

/// What an ELF file puts into the flash, from its lowest address on.
fn loaded(file: &[u8]) -> Result<Vec<u8>, String> {
    let unread = |error: object::Error| format!("it is no ELF file of a board ({error})");
    let elf = ElfFile32::<Endianness>::parse(file).map_err(unread)?;
    let endian = elf.endian();
    let parts = elf
        .elf_program_headers()
        .iter()
        .filter(|part| part.p_type(endian) == object::elf::PT_LOAD && part.p_filesz(endian) > 0);
    let mut loads = Vec::new();
    for part in parts {
        let data = part.data(endian, file).map_err(|()| "a part of it is missing".to_owned())?;
        loads.push((u64::from(part.p_paddr(endian)), data));
    }
    let first = loads.iter().map(|(at, _)| *at).min().unwrap_or(0);
    let end = loads.iter().map(|(at, data)| at + data.len() as u64).max().unwrap_or(0);
    if end - first > LONGEST_FLASH {
        return Err(format!("its parts lie {} bytes apart", end - first));
    }
    let mut flash = vec![ERASED; usize::try_from(end - first).unwrap_or(0)];
    for (at, data) in loads {
        let at = usize::try_from(at - first).unwrap_or(0);
        flash[at..at + data.len()].copy_from_slice(data);
    }
    Ok(flash)
}

/// A public key: its 32 bytes, or DER as `openssl pkey -pubout -outform DER` writes it.
pub fn read_key(path: &Path) -> Result<[u8; KEY_SIZE], Failure> {
    let bytes = read_file(path)?;
    let key = bytes.strip_prefix(&KEY_PREFIX).unwrap_or(&bytes);
    let why = match <[u8; KEY_SIZE]>::try_from(key) {
        Ok(NO_KEY) => "zeros stand for no key".to_owned(),
        Ok(key) => return Ok(key),
        Err(_) if bytes.starts_with(PEM) => {
            "it is PEM, and DER is wanted: openssl pkey -pubin -outform DER".to_owned()
        }
        Err(_) => format!(
            "it has {} bytes, and a key has {KEY_SIZE}, or {} in DER, which begins otherwise for \
                other kinds of keys",
            bytes.len(),
            KEY_PREFIX.len() + KEY_SIZE
        ),
    };
    Err(Failure::Usage(format!("{} is no Ed25519 public key: {why}", path.display())))
}

/// The bytes of a file that may be an image.
pub fn read_file(path: &Path) -> Result<Vec<u8>, Failure> {
    let bytes = given::begin(path, LONGEST_FILE + 1)?;
    if bytes.len() as u64 <= LONGEST_FILE {
        return Ok(bytes);
    }
    let text = format!("{} is longer than {} MiB", path.display(), LONGEST_FILE >> 20);
    Err(Failure::Usage(text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use firmware_image::FirmwareVersion;

    const VERSION: FirmwareVersion = FirmwareVersion { major: 1, minor: 2, patch: 3 };

    /// A vector table and a header, as far as they count.
    fn image() -> Vec<u8> {
        let mut image = vec![0x11; HEADER_OFFSET];
        image.extend(header().to_bytes());
        image.extend([0x22; 5]);
        image
    }

    fn header() -> Header {
        let length = HEADER_OFFSET + HEADER_SIZE + 5;
        let header = Header::new(VERSION, "a-board", NO_KEY);
        header.with_length(u32::try_from(length).unwrap())
    }

    /// An ELF file (ELF-32, little-endian, for ARM) that loads these bytes to these addresses of
    /// the flash, and has a part that is only in memory.
    fn elf(parts: &[(u32, &[u8])]) -> Vec<u8> {
        let mut file = b"\x7fELF\x01\x01\x01".to_vec();
        file.resize(16, 0);
        file.extend([2, 0, 40, 0]);
        let count = u16::try_from(parts.len() + 1).unwrap();
        for word in [1, 0x0802_0001, 52, 0, 0x0500_0000] {
            file.extend(u32::to_le_bytes(word));
        }
        for half in [52, 32, count, 40, 0, 0] {
            file.extend(u16::to_le_bytes(half));
        }
        let mut at = 52 + 32 * u32::from(count);
        for (address, bytes) in parts {
            let length = u32::try_from(bytes.len()).unwrap();
            // What lies in memory elsewhere is loaded from the flash.
            for word in [1, at, 0x2000_0000, *address, length, length, 5, 4] {
                file.extend(u32::to_le_bytes(word));
            }
            at += length;
        }
        for word in [1, at, 0x2000_0000, 0x2000_0000, 0, 0x100, 6, 4] {
            file.extend(u32::to_le_bytes(word));
        }
        parts.iter().for_each(|(_, bytes)| file.extend(*bytes));
        file
    }

    fn read(file: &[u8]) -> (Header, Vec<u8>) {
        let ImageFile { header, bytes } = ImageFile::of(file).unwrap();
        (header, bytes)
    }

    #[test]
    fn an_elf_file_gives_what_it_loads_from_the_vector_table_on() {
        let image = image();
        let (first, rest) = image.split_at(600);
        let mut expected = image.clone();
        expected.extend([ERASED; 27]);
        assert_eq!(expected.len(), HEADER_OFFSET + HEADER_SIZE + UNIT);
        let header = header();
        // The parts in any order, and a loader before it that is not the image.
        let loader = [0x33; 40];
        for file in [
            elf(&[(0x0802_0000, &image)]),
            elf(&[(0x0802_0000 + 600, rest), (0x0802_0000, first)]),
            elf(&[(0x0800_0000, &loader), (0x0802_0000, first), (0x0802_0000 + 600, rest)]),
        ] {
            assert_eq!(read(&file), (header, expected.clone()));
        }
        // The bytes of the flash, with the loader and without.
        assert_eq!(read(&image), (header, expected.clone()));
        let mut flash = vec![ERASED; 0x2_0000];
        flash.extend(&image);
        assert_eq!(read(&flash), (header, expected.clone()));
        // What has been written out is read as it is, and so is what other things lie behind.
        assert_eq!(read(&expected), (header, expected.clone()));
        flash.resize(0x4_0000, ERASED);
        flash.truncate(0x2_0000 + expected.len());
        flash.extend([0x44; 5000]);
        assert_eq!(read(&flash), (header, expected));
    }

    #[test]
    fn what_is_no_image_is_told() {
        let refused = |file: &[u8]| ImageFile::of(file).err().unwrap();
        let no_header = "it has no header of the gateway's firmware";
        for file in [&[][..], &[0; 5000], &image()[1..], &elf(&[(0x0800_0000, &[0; 4000])])] {
            assert_eq!(refused(file), no_header);
        }
        let whole = elf(&[(0x0802_0000, &image())]);
        for length in [4, 30, 52, 90] {
            let text = refused(&whole[..length]);
            assert!(text.starts_with("it is no ELF file of a board"), "{length}: {text}");
        }
        assert_eq!(refused(&whole[..whole.len() - 1]), "a part of it is missing");
        let far = elf(&[(0x0800_0000, &[0; 8]), (0x9000_0000, &[0; 8])]);
        assert_eq!(refused(&far), "its parts lie 2281701384 bytes apart");
        for is in [832, 836] {
            let cut =
                format!("it was cut off: its header says that it has 837 bytes, and it has {is}");
            assert_eq!(refused(&image()[..is]), cut);
            assert_eq!(refused(&elf(&[(0x0802_0000, &image()[..is])])), cut);
        }
        for length in [0u32, 831] {
            let mut other = image();
            other[HEADER_OFFSET + 4..HEADER_OFFSET + 8].copy_from_slice(&length.to_le_bytes());
            let text = format!("its header says that it has {length} bytes, which none has");
            assert_eq!(refused(&other), text);
        }
        let mut other = image();
        other[HEADER_OFFSET + 8] = 7;
        assert_eq!(refused(&other), "its header has layout 7, and 1 is known here");
    }
}
