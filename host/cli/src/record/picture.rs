//! The formats of pictures: what draws them, and their text without a font of the system.

use std::error::Error;
use std::path::Path;
use std::sync::OnceLock;

use plotters::style::{FontStyle, register_font};

use crate::failure::Failure;

/// Bytes of a pixel: red, green, blue.
pub const PIXEL: usize = 3;

/// Why a picture could not be drawn.
pub fn not_drawn(error: &dyn Error) -> Failure {
    Failure::not_measured(format!("the picture cannot be drawn ({error})"))
}

/// How a picture is written down.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Lines and text, which scale.
    Svg,
    /// Pixels.
    Png,
}

impl Format {
    /// By the end of a file's name.
    ///
    /// # Errors
    /// It is that of no picture that is made here.
    pub fn of(path: &Path) -> Result<Self, Failure> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        match extension.as_str() {
            "svg" => Ok(Self::Svg),
            "png" => Ok(Self::Png),
            _ => Err(Failure::Usage(format!(
                "{}: pictures are SVG or PNG; name a file that ends in .svg or .png",
                path.display()
            ))),
        }
    }
}

/// A picture of pixels as a file.
pub fn png(width: u32, height: u32, pixels: &[u8]) -> Result<Vec<u8>, Box<dyn Error>> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(file)
}

/// Gives plotters the font that this program carries: none of the system is looked for.
pub fn has_font() -> Result<(), &'static str> {
    static REGISTERED: OnceLock<bool> = OnceLock::new();
    let register =
        || register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular()).is_ok();
    REGISTERED.get_or_init(register).then_some(()).ok_or("the font cannot be read")
}
