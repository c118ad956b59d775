//! The sea: scales of its state (two different ones), spectrum and waves.

/// Beaufort wind force, 0 to 12 (WMO-No. 306, code table 1100). What the thesis calls "sea state" 0-4 is this scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BeaufortForce(u8);

/// WMO sea state, 0 to 9 (WMO-No. 306, code table 3700): a class of significant wave height, not of wind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WmoSeaState(u8);

impl BeaufortForce {
    /// `None` above 12.
    pub fn new(force: u8) -> Option<Self> {
        (force <= 12).then_some(Self(force))
    }

    /// The number, 0 to 12.
    pub const fn get(self) -> u8 {
        self.0
    }
}

impl WmoSeaState {
    /// `None` above 9.
    pub fn new(state: u8) -> Option<Self> {
        (state <= 9).then_some(Self(state))
    }

    /// The number, 0 to 9.
    pub const fn get(self) -> u8 {
        self.0
    }
}
