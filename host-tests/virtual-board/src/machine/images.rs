//! Where the images lie that the loader exchanges.

use std::ops::Range;

use super::Builder;

/// The parts of the flash that an update touches, as the image itself says: its linker divides the
/// flash (`src/board/*_layout.x`).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageAreas {
    /// What runs.
    pub active: Range<u64>,
    /// The other image, and a page more.
    pub update: Range<u64>,
    /// Which is to run, and how far their exchange has come.
    pub state: Range<u64>,
}

impl ImageAreas {
    /// All of them.
    pub fn all(&self) -> [Range<u64>; 3] {
        [self.active.clone(), self.update.clone(), self.state.clone()]
    }
}

impl Builder {
    /// Where the images lie.
    /// Panics if the image takes no other.
    pub fn image_areas(&self) -> ImageAreas {
        let area = |name: &str| {
            let [from, to] = ["start", "end"].map(|end| {
                let symbol = format!("_{name}_{end}");
                self.symbols.get(&symbol).unwrap_or_else(|error| panic!("{error}"))
            });
            from..to
        };
        ImageAreas { active: area("active"), update: area("update"), state: area("state") }
    }
}
