//! Skills of gunners.

/// Numbers of a gunner. Sources beside each are tables of human performance; where they give a range, an expert has its better end and a
/// novice its worse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Skill {
    /// Multiplies the rate at which boats are detected: 1 is that of published sweep widths.
    pub search: f64,
    /// From a decision to the hand, seconds (choice reaction: Hick-Hyman, Luce 1986: .35 to .7).
    pub reaction_s: f64,
    /// From a target to the first aimed round, seconds (engagement times of crews: 1.5 to 4).
    pub first_shot_s: f64,
    /// For a turn of 30 degrees to another target, seconds (1.2 to 3.5).
    pub shift_s: f64,
    /// Time that it takes to say what a boat is, seconds.
    pub identify_s: f64,
    /// Share of boats that are called what they are not.
    pub misjudges: f64,
    /// Delay between eye and hand, seconds (crossover model: McRuer and Jex 1967: .15 to .3).
    pub delay_s: f64,
    /// Crossover frequency, rad/s (the same: 2 to 5).
    pub crossover: f64,
    /// Aim about the point that is aimed at in a burst on a still ship, one standard deviation along each axis, mrad (12.7 mm on a
    /// pintle: 2 to 8).
    pub aim_mrad: f64,
    /// The same that is added by a ship under way in sea 2, mrad (4 to 15 together).
    pub sea_mrad: f64,
    /// Share of the lead by which it is misjudged (.15 to .5).
    pub lead_error: f64,
    /// Share of the range by which it is misjudged (.15 to .5).
    pub range_error: f64,
    /// Share of what a burst was seen to miss by that the next one corrects.
    pub corrects: f64,
    /// Rounds of a burst.
    pub burst: u32,
    /// Pause between bursts, seconds.
    pub pause_s: f64,
    /// Range beyond which no round is fired, metres.
    pub fires_within_m: f64,
    /// Angle aside of the line of fire within which no boat may be that is not known as hostile, mrad: a boat's length and two standard
    /// deviations of the aim at 300 m for one who looks what is behind the target.
    pub clearance_mrad: f64,
    /// Time that a stoppage takes to clear, seconds.
    pub clear_s: f64,
}

impl Skill {
    /// A sailor on the first day.
    pub const NOVICE: Self = Self {
        search: 0.6,
        reaction_s: 0.7,
        first_shot_s: 4.0,
        shift_s: 3.5,
        identify_s: 6.0,
        misjudges: 0.12,
        delay_s: 0.3,
        crossover: 2.2,
        aim_mrad: 6.0,
        sea_mrad: 8.0,
        lead_error: 0.5,
        range_error: 0.5,
        corrects: 0.35,
        burst: 12,
        pause_s: 1.5,
        fires_within_m: 900.0,
        clearance_mrad: 8.0,
        clear_s: 6.0,
    };
    /// One who has been trained.
    pub const TRAINED: Self = Self {
        search: 1.0,
        reaction_s: 0.45,
        first_shot_s: 2.5,
        shift_s: 2.0,
        identify_s: 3.5,
        misjudges: 0.04,
        delay_s: 0.2,
        crossover: 3.5,
        aim_mrad: 4.0,
        sea_mrad: 5.0,
        lead_error: 0.25,
        range_error: 0.25,
        corrects: 0.6,
        burst: 8,
        pause_s: 1.0,
        fires_within_m: 800.0,
        clearance_mrad: 25.0,
        clear_s: 3.5,
    };
    /// An instructor.
    pub const EXPERT: Self = Self {
        search: 1.4,
        reaction_s: 0.35,
        first_shot_s: 1.5,
        shift_s: 1.2,
        identify_s: 2.0,
        misjudges: 0.01,
        delay_s: 0.15,
        crossover: 4.5,
        aim_mrad: 2.0,
        sea_mrad: 2.5,
        lead_error: 0.15,
        range_error: 0.15,
        corrects: 0.8,
        burst: 6,
        pause_s: 0.7,
        fires_within_m: 800.0,
        clearance_mrad: 35.0,
        clear_s: 2.0,
    };

    /// All, by the names that the command line has.
    pub const NAMED: [(&'static str, Self); 3] =
        [("novice", Self::NOVICE), ("trained", Self::TRAINED), ("expert", Self::EXPERT)];

    /// The one of a name, with its name.
    pub fn named(name: &str) -> Option<(&'static str, Self)> {
        Self::NAMED.into_iter().find(|(known, _)| *known == name)
    }
}
