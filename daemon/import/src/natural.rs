//! File names in the order that people expect: `frame2` before `frame10`.

use std::cmp::Ordering;

/// Compares two names, runs of digits by their value. Names that differ only in leading zeros are ordered by their bytes.
pub(crate) fn compare(a: &[u8], b: &[u8]) -> Ordering {
    let (mut left, mut right) = (a, b);
    loop {
        let (x, y) = (digits(left), digits(right));
        if !x.is_empty() && !y.is_empty() {
            let by_value = value(x).len().cmp(&value(y).len()).then_with(|| value(x).cmp(value(y)));
            if by_value != Ordering::Equal {
                return by_value;
            }
            (left, right) =
                (left.get(x.len()..).unwrap_or_default(), right.get(y.len()..).unwrap_or_default());
            continue;
        }
        match (left.split_first(), right.split_first()) {
            (Some((p, left_rest)), Some((q, right_rest))) if p == q => {
                (left, right) = (left_rest, right_rest)
            }
            (Some((p, _)), Some((q, _))) => return p.cmp(q),
            (None, None) => return a.cmp(b),
            (None, Some(_)) => return Ordering::Less,
            (Some(_), None) => return Ordering::Greater,
        }
    }
}

fn digits(name: &[u8]) -> &[u8] {
    let end = name.iter().position(|b| !b.is_ascii_digit()).unwrap_or(name.len());
    name.get(..end).unwrap_or_default()
}

fn value(digits: &[u8]) -> &[u8] {
    let start = digits.iter().position(|b| *b != b'0').unwrap_or(digits.len());
    digits.get(start..).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::compare;
    use proptest::{array::uniform3, collection::vec, prelude::*, sample::select};

    #[test]
    fn numbers_are_ordered_by_value() {
        let mut names =
            ["b1", "a10", "a2", "a02", "a", "a2b", "a2a", "a999999999999999999999999", "00000.jpg", "1.jpg"];
        names.sort_by(|a, b| compare(a.as_bytes(), b.as_bytes()));
        assert_eq!(
            names,
            ["00000.jpg", "1.jpg", "a", "a02", "a2", "a2a", "a2b", "a10", "a999999999999999999999999", "b1"]
        );
    }

    proptest! {
        #[test]
        fn it_is_an_order(names in uniform3(vec(select(&b"ab012"[..]), 0..=6))) {
            let [a, b, c] = names.each_ref().map(Vec::as_slice);
            prop_assert_eq!(compare(a, b), compare(b, a).reverse());
            prop_assert_eq!(compare(a, b).is_eq(), a == b);
            if compare(a, b).is_le() && compare(b, c).is_le() {
                prop_assert!(compare(a, c).is_le());
            }
        }
    }
}
