//! A scenario's boats over time, without a picture.

use std::sync::Arc;

use bowwave_core::{
    model::{Model, ModelId},
    time::Time,
    world::{
        boats::CourseState,
        fleet::Fleet,
        scenario::{Scenario, Side},
    },
};

/// The track of one boat, once a second.
#[derive(Debug)]
pub struct Track {
    /// Its name.
    pub name: String,
    /// Whom it belongs to.
    pub side: Side,
    /// Its states at each second from the begin on.
    pub states: Vec<CourseState>,
    /// The states of its crew, each with the second at which it began; empty without a crew.
    pub crew: Vec<(usize, String)>,
}

impl Track {
    /// The nearest that it comes to the gun, metres, and when, seconds.
    pub fn nearest(&self) -> (f64, usize) {
        let ranges = self.states.iter().enumerate().map(|(s, state)| (state.position.length(), s));
        ranges.fold((f64::INFINITY, 0), |best, next| if next.0 < best.0 { next } else { best })
    }
}

/// The tracks of all boats of a fleet, as they become known.
#[derive(Debug, Default)]
pub struct TrackLog {
    tracks: Vec<Track>,
    noted: usize,
}

impl TrackLog {
    /// The second that is to be noted next, since the scenario began.
    pub const fn next_second(&self) -> usize {
        self.noted
    }

    /// Notes where the boats are at the next second, up to which the fleet was followed.
    pub fn note(&mut self, fleet: &Fleet) {
        if self.tracks.is_empty() {
            let track = |boat: usize| Track {
                name: fleet.name(boat).to_owned(),
                side: fleet.side(boat).unwrap_or(Side::Hostile),
                states: Vec::new(),
                crew: Vec::new(),
            };
            self.tracks = (0..fleet.len()).map(track).collect();
        }
        let second = self.noted;
        for (boat, track) in self.tracks.iter_mut().enumerate() {
            let Some(history) = fleet.history(boat) else { continue };
            track.states.push(history.state(second as f64));
            if let Some(state) = fleet.crew_state(boat)
                && track.crew.last().is_none_or(|(_, name)| name != state)
            {
                track.crew.push((second, state.to_owned()));
            }
        }
        self.noted += 1;
    }

    /// All tracks that were noted.
    pub fn tracks(self) -> Vec<Track> {
        self.tracks
    }
}

/// The tracks of all boats over so many seconds, while nobody fires.
pub fn tracks(scenario: &Scenario, models: Vec<Model>, of_boats: &[ModelId], seconds: f64) -> Vec<Track> {
    let start = Time::from_ns(0);
    let models: Arc<[Model]> = models.into();
    let mut fleet = Fleet::of_scenario(scenario, models, of_boats, start);
    let mut log = TrackLog::default();
    for second in 0..=seconds.ceil() as usize {
        fleet.follow(start.plus_secs(second as f64));
        log.note(&fleet);
    }
    log.tracks()
}
