//! The trainer's state in the protocol's words.

use bowwave_core::{
    fault::{DevicePart, Fault, Severity},
    frame::scene::{Hud, Status as Shown, StatusWords},
    geometry::heading_of,
    session::Session,
    world::{World, fleet::Fleet, weapon::WeaponState},
};
use bowwave_devices::clock::now;
use bowwave_link::{BoatState, DeviceLevel, DeviceState, GunState, Status, StatusLevel};

/// The state of a session whose source has those parts. What the port knows is left to it.
pub fn status_of(session: &Session, parts: &[DevicePart]) -> Status {
    let world = session.world();
    let hud = session.hud();
    let StatusWords { word, cause, action } = hud.status.words();
    Status {
        time_ns: now().ns(),
        scenario: session.scenario_name().to_owned(),
        clock_s: hud.clock_s,
        is_paused: world.clock().is_paused(),
        word: word.to_owned(),
        cause: cause.to_owned(),
        action: action.to_owned(),
        level: level(hud),
        rules: hud.rules,
        weapon: weapon(hud.weapon).to_owned(),
        rounds_left: hud.rounds_left,
        shots: hud.shots.into(),
        hits: hud.hits.into(),
        neutral_hits: hud.neutral_hits.into(),
        message: hud.message.as_deref().map(str::to_owned),
        devices: devices(session, parts),
        boats: boats(world),
        gun: gun(session),
        ..Status::default()
    }
}

const fn level(hud: &Hud) -> StatusLevel {
    match hud.status {
        Shown::NotScored { .. } | Shown::Fault { .. } => StatusLevel::Bad,
        Shown::NotChecked { .. } | Shown::Paused => StatusLevel::Attention,
        Shown::Ready | Shown::Hit { .. } | Shown::NeutralHit { .. } | Shown::Miss => match hud.warning {
            Some(_) => StatusLevel::Attention,
            None => StatusLevel::Good,
        },
    }
}

const fn weapon(state: WeaponState) -> &'static str {
    match state {
        WeaponState::Ready => "ready",
        WeaponState::Safe => "safe",
        WeaponState::Stoppage => "stoppage",
        WeaponState::Reloading => "reloading",
        WeaponState::Empty => "empty",
    }
}

fn devices(session: &Session, parts: &[DevicePart]) -> Vec<DeviceState> {
    let worst = |part: DevicePart| {
        // Of two that are equally severe the first is the one on the LCD.
        let about = session.faults().filter(move |fault| fault.part() == part);
        about.reduce(|a, b| if b.severity() > a.severity() { b } else { a })
    };
    let device = |part: DevicePart| {
        let state = |level, fault: Option<Fault>, cause: &str, action: &str| DeviceState {
            name: part.name().to_owned(),
            level,
            code: fault.map_or("", Fault::code).to_owned(),
            cause: cause.to_owned(),
            action: action.to_owned(),
        };
        let fault = worst(part);
        match fault {
            // What the LCD itself cannot say.
            Some(Fault::DisplayLost) => {
                state(DeviceLevel::Warning, fault, "NO LCD CONNECTED", "CHECK THE LCD'S CABLE")
            }
            Some(there) if there.severity() > Severity::Note => {
                let is_warning = there.severity() == Severity::Warning;
                let level = if is_warning { DeviceLevel::Warning } else { DeviceLevel::Fault };
                state(level, fault, there.cause(), there.action())
            }
            _ if parts.contains(&part) => state(DeviceLevel::Works, None, "works", ""),
            _ => state(DeviceLevel::Absent, None, "none configured", ""),
        }
    };
    DevicePart::ALL.into_iter().map(device).collect()
}

fn boats(world: &World) -> Vec<BoatState> {
    let Some(running) = world.running() else { return Vec::new() };
    let fleet = &running.fleet;
    let boat = |boat: usize| boat_state(fleet, boat, running.now.secs_since(running.start));
    (0..fleet.len()).filter_map(boat).collect()
}

fn boat_state(fleet: &Fleet, boat: usize, time_s: f64) -> Option<BoatState> {
    let history = fleet.history(boat)?;
    let state = history.state(time_s);
    let in_reserve = fleet.in_reserve(boat);
    Some(BoatState {
        name: fleet.name(boat).to_owned(),
        side: fleet.side(boat)?.name().to_owned(),
        east_m: state.position.x,
        north_m: state.position.y,
        heading_deg: state.heading.to_degrees().rem_euclid(360.0),
        speed_m_s: state.velocity().length(),
        swims: fleet.swims_at(boat, time_s),
        in_reserve,
        is_struck: history.first_hit_s().is_some(),
        crew: history.crew_state().filter(|_| !in_reserve).map(str::to_owned),
        length_m: history.hull().length_m,
    })
}

fn gun(session: &Session) -> Option<GunState> {
    let (bore, view) = session.gun()?;
    Some(GunState {
        bearing_deg: heading_of(bore.truncate()).to_degrees().rem_euclid(360.0),
        elevation_deg: bore.z.clamp(-1.0, 1.0).asin().to_degrees(),
        view_deg: view.to_degrees(),
    })
}
