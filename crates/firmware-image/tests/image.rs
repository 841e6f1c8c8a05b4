//! The header's bytes, and images that are whole, damaged, signed and not.
//!
//! The bytes were put together by a program in Python that shares no code with ours; the signature
//! is that of OpenSSL 3.0 (`openssl dgst -sha512 -binary`, `openssl pkeyutl -sign -rawin`).

use firmware_image::{
    CHECKSUM, Check, FirmwareVersion, HEADER_OFFSET, Header, HeaderError, NO_KEY, Wrong, version,
};

const BOARD: &str = "nucleo-h743zi";
const VERSION: FirmwareVersion = FirmwareVersion { major: 0, minor: 2, patch: 300 };

/// Public key of the private key 00 01 02 … 1F.
#[rustfmt::skip]
const KEY: [u8; 32] = [
    0x03, 0xA1, 0x07, 0xBF, 0xF3, 0xCE, 0x10, 0xBE, 0x1D, 0x70, 0xDD, 0x18,
    0xE7, 0x4B, 0xC0, 0x99, 0x67, 0xE4, 0xD6, 0x30, 0x9B, 0xA5, 0x0D, 0x5F,
    0x1D, 0xDC, 0x86, 0x64, 0x12, 0x55, 0x31, 0xB8,
];

/// The header of version 0.2.300 for a NUCLEO-H743ZI with that key, of an image that ends with it.
#[rustfmt::skip]
const HEADER: [u8; 64] = [
    0x4D, 0x47, 0x57, 0x69, 0x40, 0x03, 0x00, 0x00, 0x01, 0x00, 0x00, 0x00,
    0x02, 0x00, 0x2C, 0x01, 0x6E, 0x75, 0x63, 0x6C, 0x65, 0x6F, 0x2D, 0x68,
    0x37, 0x34, 0x33, 0x7A, 0x69, 0x00, 0x00, 0x00, 0x03, 0xA1, 0x07, 0xBF,
    0xF3, 0xCE, 0x10, 0xBE, 0x1D, 0x70, 0xDD, 0x18, 0xE7, 0x4B, 0xC0, 0x99,
    0x67, 0xE4, 0xD6, 0x30, 0x9B, 0xA5, 0x0D, 0x5F, 0x1D, 0xDC, 0x86, 0x64,
    0x12, 0x55, 0x31, 0xB8,
];

/// Of zeros up to the header, and the header.
#[rustfmt::skip]
const SIGNATURE: [u8; 64] = [
    0x88, 0x1B, 0xC5, 0x2E, 0xBD, 0x4D, 0xD4, 0xF7, 0x4E, 0x30, 0x17, 0x60,
    0x8E, 0x59, 0xFC, 0xBD, 0xED, 0x61, 0x20, 0xFB, 0xA3, 0xC4, 0xE6, 0x28,
    0xE4, 0xE7, 0xC2, 0x72, 0x17, 0xD3, 0xA3, 0x68, 0x84, 0x00, 0x73, 0x10,
    0xD8, 0x8F, 0x67, 0x49, 0x36, 0xA6, 0x90, 0xBC, 0x5A, 0x1F, 0x91, 0x9C,
    0xCC, 0x31, 0x03, 0x36, 0x44, 0x6B, 0x8F, 0xF2, 0xB2, 0xA1, 0x67, 0xE2,
    0xBF, 0x75, 0x4A, 0x0B,
];

const IMAGE_CHECKSUM: u32 = 0x8408_6D27;

fn image() -> [u8; HEADER_OFFSET + 64] {
    let mut image = [0; HEADER_OFFSET + 64];
    image[HEADER_OFFSET..].copy_from_slice(&HEADER);
    image
}

/// What comes of an image that is read in pieces of so many bytes.
fn checked(image: &[u8], piece: usize, key: [u8; 32], signature: &[u8]) -> Result<(), Wrong> {
    let mut check = Check::new(key);
    image.chunks(piece).for_each(|bytes| check.update(bytes));
    check.finish(BOARD, VERSION, IMAGE_CHECKSUM, signature)
}

#[test]
fn the_header_has_its_bytes() {
    let header = Header::new(VERSION, BOARD, KEY).with_length(0x340);
    assert_eq!(header.to_bytes(), HEADER);
    assert_eq!(Header::read(&HEADER), Ok(header));
    assert_eq!((header.board(), header.has_key()), (BOARD, true));
    assert_eq!(Header::of_image(&image()), Ok(header));
    assert!(!Header::new(VERSION, BOARD, NO_KEY).has_key());
}

#[test]
fn what_is_no_header_is_told() {
    let mut other = HEADER;
    other[8] = 2;
    assert_eq!(Header::read(&other), Err(HeaderError::OtherLayout { layout: 2 }));
    other[0] = b'm';
    assert_eq!(Header::read(&other), Err(HeaderError::Missing));
    assert_eq!(Header::of_image(&[0; HEADER_OFFSET + 63]), Err(HeaderError::Missing));
    let long = Header::new(VERSION, "a name of more than sixteen bytes", NO_KEY);
    assert_eq!(long.board(), "a name of more t");
}

#[test]
fn the_version_of_a_package_is_read() {
    let [of, none] = [version("1.22.333-rc1+4"), version("x")];
    assert_eq!(of, FirmwareVersion { major: 1, minor: 22, patch: 333 });
    assert_eq!(none, FirmwareVersion { major: 0, minor: 0, patch: 0 });
    assert_eq!(version("70000.1.2.3").major, u16::MAX);
    assert!(version("0.2.0") > version("0.1.99"));
}

#[test]
fn a_whole_image_is_taken_in_pieces_of_any_size() {
    assert_eq!(CHECKSUM.checksum(&image()), IMAGE_CHECKSUM);
    for piece in [1, 7, 32, 128, 768, 4096] {
        assert_eq!(checked(&image(), piece, NO_KEY, &SIGNATURE), Ok(()), "{piece}");
        assert_eq!(checked(&image(), piece, KEY, &SIGNATURE), Ok(()), "{piece}");
    }
}

/// Who has not the other half of a key puts it into no board.
#[test]
fn where_the_running_image_has_no_key_that_of_the_new_one_counts() {
    assert_eq!(checked(&image(), 64, NO_KEY, &[]), Err(Wrong::NotSigned));
    assert_eq!(checked(&image(), 64, NO_KEY, &[1; 64]), Err(Wrong::NotSigned));
    let mut plain = image();
    plain[HEADER_OFFSET + 32..HEADER_OFFSET + 64].fill(0);
    for signature in [&[][..], &SIGNATURE] {
        let mut check = Check::new(NO_KEY);
        check.update(&plain);
        assert_eq!(check.finish(BOARD, VERSION, CHECKSUM.checksum(&plain), signature), Ok(()));
    }
}

#[test]
fn a_byte_that_differs_is_found_wherever_it_lies() {
    for at in 0..image().len() {
        let mut image = image();
        image[at] ^= 0x10;
        assert_eq!(checked(&image, 64, NO_KEY, &[]), Err(Wrong::Damaged), "{at}");
    }
    assert_eq!(checked(&image()[..800], 64, NO_KEY, &[]), Err(Wrong::Damaged));
}

#[test]
fn another_length_than_the_header_says_is_found() {
    let longer = [&image()[..], &[0xFF; 32]].concat();
    for (image, expected) in [(&longer[..], Err(Wrong::Damaged)), (&longer[..0x340], Ok(()))] {
        let mut check = Check::new(NO_KEY);
        check.update(image);
        let checksum = CHECKSUM.checksum(image);
        assert_eq!(check.finish(BOARD, VERSION, checksum, &SIGNATURE), expected);
    }
}

/// An image is sent in whole units, wherever in the last one it ends.
#[test]
fn an_image_ends_in_its_last_unit() {
    for (length, expected) in [
        (0x340, Err(Wrong::Damaged)),
        (0x341, Ok(())),
        (0x360, Ok(())),
        (0x361, Err(Wrong::Damaged)),
        (u32::MAX, Err(Wrong::Damaged)),
    ] {
        let mut image = [0xFF; HEADER_OFFSET + 96];
        let header = Header::new(VERSION, BOARD, NO_KEY).with_length(length).to_bytes();
        image[HEADER_OFFSET..HEADER_OFFSET + 64].copy_from_slice(&header);
        let mut check = Check::new(NO_KEY);
        check.update(&image);
        let checksum = CHECKSUM.checksum(&image);
        assert_eq!(check.finish(BOARD, VERSION, checksum, &[]), expected, "{length:#x}");
    }
}

#[test]
fn another_board_or_version_than_announced_is_found() {
    let read = || {
        let mut check = Check::new(NO_KEY);
        check.update(&image());
        check
    };
    let (checksum, older) = (IMAGE_CHECKSUM, FirmwareVersion { patch: 299, ..VERSION });
    assert_eq!(read().finish("nucleo-g474re", VERSION, checksum, &[]), Err(Wrong::Damaged));
    assert_eq!(read().finish(BOARD, older, checksum, &[]), Err(Wrong::Damaged));
}

#[test]
fn only_the_signature_of_the_key_is_taken() {
    let refused = Err(Wrong::NotSigned);
    assert_eq!(checked(&image(), 64, KEY, &[]), refused);
    assert_eq!(checked(&image(), 64, KEY, &SIGNATURE[..63]), refused);
    assert_eq!(checked(&image(), 64, KEY, &[0; 64]), refused);
    for at in 0..SIGNATURE.len() {
        let mut signature = SIGNATURE;
        signature[at] ^= 1;
        assert_eq!(checked(&image(), 64, KEY, &signature), refused, "{at}");
    }
    let mut other = KEY;
    other[0] ^= 1;
    assert_eq!(checked(&image(), 64, other, &SIGNATURE), refused);
    assert_eq!(checked(&image(), 64, [0xFF; 32], &SIGNATURE), refused);
}
