//! Illuminating flares: candles under parachutes, each a function of time.

use glam::{DVec2, DVec3};

use crate::time::Time;

/// An illuminating flare.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlareSpec {
    /// Luminous intensity to all sides, candela.
    pub candela: f64,
    /// The place over which it is lit, world x and y, metres.
    pub place: DVec2,
    /// Height at which it is lit, metres over the sea.
    pub height_m: f64,
    /// Time that it burns, seconds.
    pub burns_s: f64,
    /// Speed at which it sinks under its parachute, m/s.
    pub falls_m_s: f64,
}

impl FlareSpec {
    /// A hand-fired illuminating rocket at `place`. Height and sink rate are those of the LSA code, 3.1 (IMO 1996: at least 300 m, at most 5 m/s);
    /// intensity and time are what makers give of white ones, 80,000 cd and 30 s.
    pub const fn rocket(place: DVec2) -> Self {
        Self { candela: 80_000.0, place, height_m: 300.0, burns_s: 30.0, falls_m_s: 5.0 }
    }
}

/// A flare that was lit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flare {
    /// Its kind.
    pub spec: FlareSpec,
    /// When it was lit.
    pub lit: Time,
    /// Velocity of the wind that carries it, world x and y, m/s.
    pub wind: DVec2,
}

impl Flare {
    /// Its place at a time, world, metres; `None` before it was lit, once it has burnt out, and in the water.
    pub fn at(&self, time: Time) -> Option<DVec3> {
        let since_s = self.since_s(time)?;
        let height_m = self.spec.height_m - self.spec.falls_m_s * since_s;
        (height_m > 0.0).then(|| (self.spec.place + self.wind * since_s).extend(height_m))
    }

    /// Its luminous intensity at a time, candela: it flares up within half a second and dies within two.
    pub fn candela(&self, time: Time) -> f64 {
        const RISES_S: f64 = 0.5;
        const DIES_S: f64 = 2.0;
        self.since_s(time).map_or(0.0, |since_s| {
            let rise = (since_s / RISES_S).min(1.0);
            let left = ((self.spec.burns_s - since_s) / DIES_S).min(1.0);
            self.spec.candela * rise * left
        })
    }

    /// Seconds since it was lit, while it burns.
    fn since_s(&self, time: Time) -> Option<f64> {
        Some(time.secs_since(self.lit)).filter(|since_s| (0.0..self.spec.burns_s).contains(since_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flare_drifts_sinks_and_goes_out() {
        let lit = Time::from_ns(7_000_000_000);
        let spec = FlareSpec::rocket(DVec2::new(100.0, 400.0));
        let flare = Flare { spec, lit, wind: DVec2::new(3.0, 0.0) };
        let after = |s: f64| lit.plus_secs(s);
        assert_eq!((flare.at(after(-0.1)), flare.candela(after(-0.1))), (None, 0.0));
        assert_eq!(flare.at(after(10.0)), Some(DVec3::new(130.0, 400.0, 250.0)));
        assert_eq!(flare.candela(after(10.0)), 80_000.0);
        assert!((flare.candela(after(29.0)) - 40_000.0).abs() < 1.0);
        assert_eq!((flare.at(after(30.1)), flare.candela(after(30.1))), (None, 0.0));
        let low = Flare { spec: FlareSpec { height_m: 20.0, ..spec }, ..flare };
        assert_eq!(low.at(after(5.0)), None, "it has come down");
    }
}
