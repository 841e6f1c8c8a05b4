//! A firmware in a file, and a board that has room for it.

use std::cell::RefCell;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

use firmware_image::{Header, NO_KEY, version};
use mgw_sim::images::{ImageSlots, image};
use mgw_sim::{BOARD, World};

/// A file that is there as long as this is.
pub struct ImageFile(String);

impl ImageFile {
    /// A firmware of this version for the simulated board, which starts anew with room for it, as
    /// after a loss of power.
    pub fn new(world: &RefCell<World>, number: &str) -> Result<Self, String> {
        static FILES: AtomicUsize = AtomicUsize::new(0);
        let file = FILES.fetch_add(1, Ordering::Relaxed);
        let name = format!("mgw-image-{}-{file}.bin", std::process::id());
        let path: PathBuf = std::env::temp_dir().join(name);
        let bytes = image(&Header::new(version(number), BOARD.name, NO_KEY), &[0xC3; 3_000]);
        std::fs::write(&path, bytes).map_err(|error| error.to_string())?;
        world.borrow_mut().set_images(ImageSlots::new(&BOARD));
        Ok(Self(path.to_str().ok_or("a path that is text")?.to_owned()))
    }

    /// Where it is.
    pub fn path(&self) -> &str {
        &self.0
    }
}

impl Drop for ImageFile {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}
