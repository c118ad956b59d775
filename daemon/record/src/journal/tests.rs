//! Failures that need smaller bounds than the defaults.
