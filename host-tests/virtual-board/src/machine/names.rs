//! The functions and the static memory of an image, found by their paths in the source.

use object::{Object, ObjectSymbol};

/// A function or a static of the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Named {
    /// Its first byte.
    pub address: u64,
    /// Its length in bytes.
    pub size: u64,
}

/// The symbols of an image, by their mangled names.
#[derive(Debug, Clone, Default)]
pub(crate) struct Names(Vec<(String, Named)>);

impl Names {
    /// Of an ELF file.
    /// Fails if it is none.
    pub(crate) fn read(file: &[u8]) -> Result<Self, object::Error> {
        let file = object::File::parse(file)?;
        let named = |symbol: object::Symbol<'_, '_>| {
            // The compiler's own tables begin with a dot.
            let has_a_place = |name: &&str| symbol.size() > 0 && !name.starts_with('.');
            let name = symbol.name().ok().filter(has_a_place)?.to_owned();
            // The lowest bit of a function's address says that it is Thumb code; no static here is
            // odd.
            Some((name, Named { address: symbol.address() & !1, size: symbol.size() }))
        };
        Ok(Self(file.symbols().filter_map(named).collect()))
    }

    /// What has that path: `motor_gateway::tasks::can::can::POOL`. A name that is not mangled is
    /// its own path.
    /// Panics if nothing has it, or more than one thing.
    pub(crate) fn get(&self, path: &str) -> Named {
        let mut found = self.all(path);
        found.sort_by_key(|named| named.address);
        found.dedup();
        match found[..] {
            [named] => named,
            [] => panic!("the image has no {path}"),
            _ => panic!("the image has {} of {path}", found.len()),
        }
    }

    /// Everything that has that path: a generic function is there once for each of its types.
    pub(crate) fn all(&self, path: &str) -> Vec<Named> {
        let mangled = mangled(path);
        let is = |name: &str| {
            // In the mangling of old a hash of seventeen characters follows, and then the end; in
            // the new one anything.
            name == path
                || name.split_once(&mangled).is_some_and(|(_, rest)| {
                    !rest.starts_with(|c: char| c.is_ascii_digit()) || rest.starts_with("17h")
                })
        };
        self.0.iter().filter(|(name, _)| is(name)).map(|(_, named)| *named).collect()
    }
}

/// The path of a mangled name, as far as the old mangling tells it; other names as they are.
pub(crate) fn path(name: &str) -> String {
    let Some(mut rest) = name.strip_prefix("_ZN") else { return name.to_owned() };
    let mut parts = Vec::new();
    while let Some(digits) = rest.find(|c: char| !c.is_ascii_digit()).filter(|digits| *digits > 0) {
        let part = rest[..digits].parse().ok().and_then(|length: usize| {
            rest.get(digits..digits + length).zip(rest.get(digits + length..))
        });
        let Some((part, behind)) = part else { break };
        rest = behind;
        parts.push(part);
    }
    // The last is the hash.
    parts.pop();
    parts.join("::")
}

/// Both manglings write each part of a path with its length before it.
pub(crate) fn mangled(path: &str) -> String {
    path.split("::").map(|part| format!("{}{part}", part.len())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_has_its_path() {
        assert_eq!(
            path("_ZN13motor_gateway5tasks3can17h0123456789abcdefE"),
            "motor_gateway::tasks::can"
        );
        assert_eq!(path("HardFault"), "HardFault");
    }

    #[test]
    fn a_path_is_found_in_both_manglings() {
        let named = |address| Named { address, size: 4 };
        let names = Names(vec![
            ("_ZN13motor_gateway5tasks3can3can4POOL17h0123456789abcdefE".to_owned(), named(4)),
            (
                "_ZN13motor_gateway5tasks3can3can4POOL6nested17h0123456789abcdefE".to_owned(),
                named(8),
            ),
            ("_RNvNtNtCs123_13motor_gateway5tasks4host4POOL".to_owned(), named(12)),
            ("HardFault".to_owned(), named(16)),
        ]);
        assert_eq!(names.get("motor_gateway::tasks::can::can::POOL"), named(4));
        assert_eq!(names.get("motor_gateway::tasks::host::POOL"), named(12));
        assert_eq!(names.get("HardFault"), named(16));
        assert_eq!(names.all("motor_gateway::tasks::rs485"), []);
    }
}
