//! A part of what is tried at many places: `PART=2/8` in the environment tries the second of eight.

/// Which part.
#[derive(Debug, Clone, Copy)]
pub struct Part {
    /// From 1 on.
    pub number: usize,
    pub of: usize,
}

impl Part {
    /// The one that the environment names, else all.
    pub fn chosen() -> Self {
        let text = std::env::var("PART").unwrap_or_else(|_| "1/1".to_owned());
        let (number, of) = text.split_once('/').expect("PART=2/8");
        let [number, of] = [number, of].map(|text| text.parse().expect("PART=2/8"));
        assert!((1..=of).contains(&number), "PART=2/8");
        Self { number, of }
    }

    /// Whether the place of this number is in it.
    pub fn has(self, place: usize) -> bool {
        place % self.of + 1 == self.number
    }
}

/// The places that are in the chosen part; one where there are fewer places than parts.
pub fn part_of<T>(places: impl IntoIterator<Item = T>) -> impl Iterator<Item = T> {
    let places: Vec<T> = places.into_iter().collect();
    let Part { number, of } = Part::chosen();
    let of = of.min(places.len());
    let part = Part { number: (number - 1) % of + 1, of };
    places.into_iter().enumerate().filter_map(move |(at, place)| part.has(at).then_some(place))
}
