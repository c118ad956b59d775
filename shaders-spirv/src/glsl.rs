//! Numbers that shaders and host know by one name: they stand in `glsl/` and are read from there when the host is compiled.

/// Reflection methods and shadow levels.
pub const METHODS: &str = include_str!("../glsl/water_methods.glsl");
/// A drawn boat.
pub const BOAT: &str = include_str!("../glsl/boat_block.glsl");
/// Pools of light.
pub const POOL: &str = include_str!("../glsl/pool_block.glsl");
/// The Physics shader.
pub const PHYSICS: &str = include_str!("../glsl/water_physics.glsl");

/// The whole number that stands after `declaration` and "=" in a source, such as `const uint METHOD_FULL`. Fails to compile where there
/// is none.
#[allow(clippy::panic, reason = "it runs when the host is compiled")]
pub const fn number(source: &str, declaration: &str) -> u32 {
    let (source, wanted) = (source.as_bytes(), declaration.as_bytes());
    let mut at = 0;
    while at + wanted.len() < source.len() {
        if starts_with(source, at, wanted) {
            let mut digit = at + wanted.len();
            if starts_with(source, digit, b" = ") {
                digit += 3;
                let mut value = 0;
                let first = digit;
                while digit < source.len() && source[digit].is_ascii_digit() {
                    value = value * 10 + (source[digit] - b'0') as u32;
                    digit += 1;
                }
                assert!(digit > first, "no whole number stands there");
                return value;
            }
        }
        at += 1;
    }
    panic!("no such declaration")
}

const fn starts_with(text: &[u8], at: usize, start: &[u8]) -> bool {
    let mut i = 0;
    while i < start.len() {
        if at + i >= text.len() || text[at + i] != start[i] {
            return false;
        }
        i += 1;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_by_their_whole_name() {
        const SOURCE: &str = "const uint A_LONG = 7u;\nconst uint A = 12u;";
        assert_eq!((number(SOURCE, "const uint A"), number(SOURCE, "const uint A_LONG")), (12, 7));
        assert_eq!(number(METHODS, "const uint METHOD_BAKED"), 6);
    }
}
