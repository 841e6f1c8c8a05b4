//! The formats of pictures: what draws them, and their text without a font of the system.

use std::error::Error;
use std::path::Path;
use std::sync::OnceLock;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::{FontStyle, register_font};

use crate::failure::Failure;

/// Bytes of a pixel: red, green, blue.
const PIXEL: usize = 3;

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

/// Something that can be drawn.
pub trait Drawing {
    /// Draws it.
    ///
    /// # Errors
    /// It does not fit, or what draws has failed.
    fn draw<B: DrawingBackend>(&self, on: &DrawingArea<B, Shift>) -> Result<(), Box<dyn Error>>
    where
        B::ErrorType: 'static;
}

/// The bytes of the file of a picture of this size.
///
/// # Errors
/// It cannot be drawn.
pub fn picture(
    format: Format,
    (width, height): (u32, u32),
    drawing: &impl Drawing,
) -> Result<Vec<u8>, Box<dyn Error>> {
    has_font()?;
    match format {
        Format::Svg => {
            let mut text = String::new();
            let root = SVGBackend::with_string(&mut text, (width, height)).into_drawing_area();
            drawing.draw(&root)?;
            root.present()?;
            drop(root);
            Ok(text.into_bytes())
        }
        Format::Png => {
            let count = usize::try_from(u64::from(width) * u64::from(height))?;
            let mut pixels = vec![0; count.checked_mul(PIXEL).ok_or("it is too large")?];
            let root = BitMapBackend::with_buffer(&mut pixels, (width, height)).into_drawing_area();
            drawing.draw(&root)?;
            root.present()?;
            drop(root);
            png(width, height, &pixels)
        }
    }
}

fn png(width: u32, height: u32, pixels: &[u8]) -> Result<Vec<u8>, Box<dyn Error>> {
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
