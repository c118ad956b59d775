//! Modes of a display: their exact timing, and which one is taken.

use std::fmt;

use bowwave_core::time::NS_PER_S;
use drm::control::{self, ModeFlags, ModeTypeFlags};

/// Size and timing of a display mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LcdMode {
    /// Visible width, pixels.
    pub width: u32,
    /// Visible height, pixels.
    pub height: u32,
    /// Pixel clock, kHz. Not zero.
    pub clock_khz: u32,
    /// Pixels of a line with its blanking. Not zero.
    pub h_total: u32,
    /// Lines of a picture with its blanking, each counted as often as it is scanned. Not zero.
    pub v_total: u32,
    /// Odd and even lines come in turn; each half has a vblank of its own.
    pub interlaced: bool,
    /// The display names this mode as its own.
    pub preferred: bool,
}

impl LcdMode {
    /// The kernel's mode, unless it states no timing (no pixel clock or no total size).
    pub(super) fn from_kernel(mode: &control::Mode) -> Option<Self> {
        let (width, height) = mode.size();
        let (h_total, v_total) = (u32::from(mode.hsync().2), u32::from(mode.vsync().2));
        let flags = mode.flags();
        let scans = u32::from(mode.vscan()).max(1) * if flags.contains(ModeFlags::DBLSCAN) { 2 } else { 1 };
        let usable = width > 0 && height > 0 && mode.clock() > 0 && h_total > 0 && v_total > 0;
        usable.then(|| Self {
            width: u32::from(width),
            height: u32::from(height),
            clock_khz: mode.clock(),
            h_total,
            v_total: v_total.saturating_mul(scans),
            interlaced: flags.contains(ModeFlags::INTERLACE),
            preferred: mode.mode_type().contains(ModeTypeFlags::PREFERRED),
        })
    }

    /// Nanoseconds from one vblank to the next, as the pixel clock has it, rounded.
    pub fn period_ns(&self) -> i64 {
        // At most 2^16 * 2^32 * 10^6: below 2^68, hence the wider type.
        let pixels = u128::from(self.h_total) * u128::from(self.v_total);
        let fields = if self.interlaced { 2 } else { 1 };
        let divisor = u128::from(self.clock_khz.max(1)) * fields;
        i64::try_from((pixels * 1_000_000 + divisor / 2) / divisor).unwrap_or(i64::MAX)
    }

    /// Vblanks in a second.
    pub fn refresh_hz(&self) -> f64 {
        NS_PER_S as f64 / self.period_ns().max(1) as f64
    }
}

#[cfg(test)]
impl LcdMode {
    /// The mode of a usual panel, for tests.
    pub(super) const PANEL: Self = Self {
        width: 800,
        height: 480,
        clock_khz: 33_300,
        h_total: 1056,
        v_total: 525,
        interlaced: false,
        preferred: true,
    };
}

impl fmt::Display for LcdMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let interlaced = if self.interlaced { "i" } else { "" };
        write!(f, "{}x{}{interlaced} at {:.2} Hz", self.width, self.height, self.refresh_hz())
    }
}

/// Which mode is wanted. What is left open follows the display's own preference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ModeWish {
    /// Width and height, pixels.
    pub size: Option<(u32, u32)>,
    /// Vblanks in a second.
    pub refresh_hz: Option<f64>,
}

impl ModeWish {
    /// The place of the best of `modes` for this wish: the wanted size where the display has it, otherwise its own; then
    /// progressive before interlaced, then the nearest rate. `None` only where there is no mode at all.
    pub(super) fn choose(&self, modes: &[LcdMode]) -> Option<usize> {
        /// Refresh rate that suits a trainer of 30 pictures a second: each picture stays for two vblanks.
        const USUAL_HZ: f64 = 60.0;
        let own = modes
            .iter()
            .find(|m| m.preferred)
            .or_else(|| modes.iter().find(|m| !m.interlaced))
            .or_else(|| modes.first())?;
        let size = self
            .size
            .filter(|size| modes.iter().any(|m| (m.width, m.height) == *size))
            .unwrap_or((own.width, own.height));
        let rank = |m: &LcdMode| {
            let off_hz = (m.refresh_hz() - self.refresh_hz.unwrap_or(USUAL_HZ)).abs();
            (m.interlaced, self.refresh_hz.is_none() && !m.preferred, off_hz)
        };
        modes
            .iter()
            .enumerate()
            .filter(|(_, m)| (m.width, m.height) == size)
            .min_by(|(_, a), (_, b)| {
                let (a, b) = (rank(a), rank(b));
                (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2))
            })
            .map(|(place, _)| place)
    }

    /// In what `mode` differs from the wish, for the status; `None` where it is what was asked for.
    pub(super) fn shortfall(&self, mode: &LcdMode) -> Option<String> {
        /// A mode whose rate is this near to the wanted one is what was asked for: 59.94 is sold as 60.
        const SAME_HZ: f64 = 0.5;
        let size = self.size.is_some_and(|size| size != (mode.width, mode.height));
        let rate = self.refresh_hz.is_some_and(|hz| (hz - mode.refresh_hz()).abs() > SAME_HZ);
        let wanted = match (self.size, self.refresh_hz) {
            (Some((w, h)), Some(hz)) => format!("{w}x{h} at {hz:.2} Hz"),
            (Some((w, h)), None) => format!("{w}x{h}"),
            (None, Some(hz)) => format!("{hz:.2} Hz"),
            (None, None) => return None,
        };
        (size || rate).then(|| {
            format!("the display has no mode of {wanted}, {mode} is used: name one that bowwave doctor lists")
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn mode(width: u32, height: u32, clock_khz: u32, h_total: u32, v_total: u32) -> LcdMode {
        LcdMode { width, height, clock_khz, h_total, v_total, interlaced: false, preferred: false }
    }

    /// A television's list (CTA-861): 1080p60, 1080p59.94, 1080i60, 720p60, 720p50, and a panel's own 800x480.
    fn list() -> Vec<LcdMode> {
        vec![
            LcdMode { preferred: true, ..mode(1920, 1080, 148_500, 2200, 1125) },
            mode(1920, 1080, 148_352, 2200, 1125),
            LcdMode { interlaced: true, ..mode(1920, 1080, 74_250, 2200, 1125) },
            mode(1280, 720, 74_250, 1650, 750),
            mode(1280, 720, 74_250, 1980, 750),
            mode(800, 480, 33_300, 1056, 525),
        ]
    }

    fn chosen(size: Option<(u32, u32)>, refresh_hz: Option<f64>) -> Option<usize> {
        ModeWish { size, refresh_hz }.choose(&list())
    }

    #[test]
    fn the_period_is_that_of_the_pixel_clock() {
        assert_eq!(list()[0].period_ns(), 16_666_667);
        assert_eq!(list()[2].period_ns(), 16_666_667, "a half picture has a vblank of its own");
        assert_eq!(list()[5].period_ns(), 16_648_649);
        assert!((list()[1].refresh_hz() - 59.94).abs() < 0.001);
        assert_eq!(list()[5].to_string(), "800x480 at 60.06 Hz");
    }

    #[test]
    fn an_open_wish_gets_the_displays_own_mode() {
        assert_eq!(chosen(None, None), Some(0));
        assert_eq!(ModeWish::default().shortfall(&list()[0]), None);
        assert_eq!(ModeWish::default().choose(&list()[2..]), Some(1), "progressive, where none is preferred");
        assert_eq!(ModeWish::default().choose(&[]), None);
    }

    #[test]
    fn a_wish_is_met_where_the_display_can() {
        assert_eq!(chosen(Some((800, 480)), None), Some(5));
        assert_eq!(chosen(Some((1280, 720)), None), Some(3), "60 Hz rather than 50 Hz");
        assert_eq!(chosen(Some((1280, 720)), Some(50.0)), Some(4));
        assert_eq!(chosen(None, Some(59.94)), Some(1));
    }

    #[test]
    fn a_wish_that_cannot_be_met_is_told() {
        let wish = ModeWish { size: Some((1024, 600)), refresh_hz: None };
        let place = wish.choose(&list()).expect("there are modes");
        let told = wish.shortfall(&list()[place]).expect("not what was asked for");
        assert!(told.contains("no mode of 1024x600, 1920x1080 at 60.00 Hz is used"), "{told}");
        let wish = ModeWish { size: Some((800, 480)), refresh_hz: Some(30.0) };
        assert!(wish.shortfall(&list()[5]).is_some());
        let wish = ModeWish { size: Some((800, 480)), refresh_hz: Some(60.0) };
        assert_eq!(wish.shortfall(&list()[5]), None, "60.06 Hz is 60 Hz");
    }

    proptest! {
        #[test]
        fn some_mode_is_always_taken(
            modes in prop::collection::vec(
                (1u32..5000, 1u32..5000, 1u32..600_000, 1u32..10_000, 1u32..10_000, any::<bool>(), any::<bool>()),
                1..20,
            ),
            size in prop::option::of((1u32..5000, 1u32..5000)),
            refresh_hz in prop::option::of(prop::num::f64::ANY),
        ) {
            let modes: Vec<_> = modes
                .into_iter()
                .map(|(w, h, clock, ht, vt, interlaced, preferred)| {
                    LcdMode { interlaced, preferred, ..mode(w, h, clock, ht, vt) }
                })
                .collect();
            let place = ModeWish { size, refresh_hz }.choose(&modes);
            prop_assert!(place.is_some_and(|p| p < modes.len()));
            prop_assert!(modes.iter().all(|m| m.period_ns() > 0));
        }
    }
}
