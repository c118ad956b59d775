//! Tests of the whole: what no single crate can check. They live in `tests/`.
