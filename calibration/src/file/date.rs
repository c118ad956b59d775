//! Calendar dates.

use std::fmt;

use jiff::{Timestamp, civil, tz::Offset};

const DAY_S: i64 = 86_400;

/// A day of the Gregorian calendar, in the years 1 to 9999.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Date(civil::Date);

impl Date {
    /// `None` where there is no such day, or the year is not within 1 to 9999.
    pub fn new(year: u16, month: u8, day: u8) -> Option<Self> {
        let [month, day] = [month, day].map(|part| i8::try_from(part).ok());
        Self::within(civil::Date::new(i16::try_from(year).ok()?, month?, day?).ok()?)
    }

    /// The UTC day that holds an instant `seconds` after 1970-01-01T00:00:00Z; `None` before year 1 or near the end of year 9999.
    pub fn from_unix_seconds(seconds: i64) -> Option<Self> {
        Self::within(Offset::UTC.to_datetime(Timestamp::from_second(seconds).ok()?).date())
    }

    fn within(date: civil::Date) -> Option<Self> {
        (date.year() >= 1).then_some(Self(date))
    }

    /// Days from `earlier` to this one; negative where that is the later one.
    pub fn days_since(self, earlier: Self) -> i64 {
        self.0.duration_since(earlier.0).as_secs() / DAY_S
    }
}

impl fmt::Display for Date {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::Date;

    #[test]
    fn leap_years_follow_the_gregorian_rule() {
        for (year, month, day, exists) in [
            (2024, 2, 29, true),
            (2026, 2, 29, false),
            (1900, 2, 29, false),
            (2000, 2, 29, true),
            (2026, 4, 31, false),
            (2026, 13, 1, false),
            (2026, 0, 1, false),
            (0, 1, 1, false),
        ] {
            assert_eq!(Date::new(year, month, day).is_some(), exists, "{year}-{month}-{day}");
        }
    }

    #[test]
    fn days_are_counted_over_leap_years() {
        let of = |days: i64| Date::from_unix_seconds(days * 86_400).unwrap();
        for days in (-700_000..2_000_000).step_by(97) {
            assert_eq!(of(days).days_since(of(3)), days - 3);
            assert_eq!(of(days + 1).days_since(of(days)), 1);
        }
    }

    #[test]
    fn unix_seconds_become_days() {
        for (seconds, text) in [
            (0, "1970-01-01"),
            (-1, "1969-12-31"),
            (951_782_399, "2000-02-28"),
            (951_782_400, "2000-02-29"),
            (1_795_219_200, "2026-11-21"),
        ] {
            assert_eq!(Date::from_unix_seconds(seconds).map(|d| d.to_string()).as_deref(), Some(text));
        }
        assert_eq!(Date::from_unix_seconds(i64::MAX), None);
        assert_eq!(Date::from_unix_seconds(i64::MIN), None);
    }
}
