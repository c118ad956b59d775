//! Error against run time of every numerical part.
