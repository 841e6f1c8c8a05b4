//! `mgw image`

use serde_json::json;

use crate::args::ImageArgs;
use crate::failure::Failure;
use crate::image_file::{ImageFile, read_key};
use crate::output::Output;
use crate::written;

/// Says what an image is, and writes it out.
pub fn run(arguments: &ImageArgs, out: Output) -> Result<(), Failure> {
    let mut image = ImageFile::read(&arguments.file)?;
    if let Some(path) = &arguments.key {
        image = image.with_key(read_key(path)?);
    }
    let ImageFile { header, bytes } = &image;
    if let Some(path) = &arguments.output {
        written::write(path, bytes, true)?;
    }
    let key = if header.has_key() { "takes only images signed with its key" } else { "no key" };
    out.object(&json!({
        "board": header.board(), "version": header.version.to_string(), "length_bytes": bytes.len(),
        "has_key": header.has_key(),
    }))?;
    out.text(format!("board     {}", header.board()))?;
    out.text(format!("version   {}", header.version))?;
    out.text(format!("length    {} bytes", bytes.len()))?;
    out.text(format!("key       {key}"))
}
