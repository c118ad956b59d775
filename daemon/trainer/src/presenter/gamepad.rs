//! A gamepad on a desktop: the sticks turn a simulated gun, the right trigger fires, buttons are the trainee's acts.

use std::io::ErrorKind;

use bowwave_core::{
    act::{Act, DriveOrder},
    side::Side,
};
use evdev::{AbsoluteAxisCode, Device, EventSummary, InputEvent, KeyCode};

use super::window::Pressed;

/// Turn of a frame at the end of the left stick's way, and of the right one's, in widths of the picture: about 40 and 6 degrees a second.
const TURNS: [f64; 2] = [0.023, 0.0035];
/// Share of a stick's way about its middle that means nothing: worn ones do not come to rest in the middle.
const DEAD: f64 = 0.12;
/// Share of the right trigger's way at which it is pressed, and at which it is released again.
const PULLED: [f64; 2] = [0.5, 0.35];
/// Axes of the left stick: to the right and downwards.
const LEFT: [AbsoluteAxisCode; 2] = [AbsoluteAxisCode::ABS_X, AbsoluteAxisCode::ABS_Y];
/// Axes of the right stick, and of the right trigger, of gamepads that name them so.
const RIGHT: ([AbsoluteAxisCode; 2], AbsoluteAxisCode) =
    ([AbsoluteAxisCode::ABS_RX, AbsoluteAxisCode::ABS_RY], AbsoluteAxisCode::ABS_RZ);
/// The same of those that do not.
const PLAIN: ([AbsoluteAxisCode; 2], AbsoluteAxisCode) =
    ([AbsoluteAxisCode::ABS_Z, AbsoluteAxisCode::ABS_RZ], AbsoluteAxisCode::ABS_GAS);
/// Axes of the cross of four, and the orders to a driven boat at the lower and the upper end of each.
const CROSS: [(AbsoluteAxisCode, [DriveOrder; 2]); 2] = [
    (AbsoluteAxisCode::ABS_HAT0X, [DriveOrder::Port, DriveOrder::Starboard]),
    (AbsoluteAxisCode::ABS_HAT0Y, [DriveOrder::Ahead, DriveOrder::Astern]),
];
/// Maker whose driver names the left and the upper button by its own letters (X is BTN_NORTH there), not by where they lie.
const MICROSOFT: u16 = 0x045e;

/// Buttons of the trainee's acts, by where they lie.
pub const BUTTONS: [(KeyCode, Act); 8] = [
    (KeyCode::BTN_SOUTH, Act::Report),
    (KeyCode::BTN_EAST, Act::Identify(Side::Hostile)),
    (KeyCode::BTN_WEST, Act::Identify(Side::Neutral)),
    (KeyCode::BTN_NORTH, Act::Warn),
    (KeyCode::BTN_TL, Act::Reload),
    (KeyCode::BTN_SELECT, Act::Clear),
    (KeyCode::BTN_START, Act::Light),
    (KeyCode::BTN_THUMBL, Act::Drive(DriveOrder::Midships)),
];

/// A gamepad.
pub struct Gamepad {
    device: Device,
    pad: Pad,
}

impl Gamepad {
    /// The first one that is there and may be read.
    pub fn find() -> Option<Self> {
        let (path, device) = evdev::enumerate().find(|(_, device)| {
            let keys = device.supported_keys().is_some_and(|keys| keys.contains(KeyCode::BTN_SOUTH));
            keys && device
                .supported_absolute_axes()
                .is_some_and(|axes| axes.contains(AbsoluteAxisCode::ABS_X))
        })?;
        if let Err(e) = device.set_nonblocking(true) {
            log::warn!("the gamepad {} is not used: {e}", path.display());
            return None;
        }
        let mut pad = Pad { is_lettered: device.input_id().vendor() == MICROSOFT, ..Pad::default() };
        match device.get_absinfo() {
            Ok(axes) => axes.for_each(|(axis, info)| {
                pad.ranges.push((axis, [f64::from(info.minimum()), f64::from(info.maximum())]));
            }),
            Err(e) => log::warn!("the gamepad {} does not say how far its sticks go: {e}", path.display()),
        }
        log::info!("gamepad {} ({})", device.name().unwrap_or("without a name"), path.display());
        Some(Self { device, pad })
    }

    /// What was done with it since the last call; `None` once it is gone.
    pub fn poll(&mut self) -> Option<Vec<Pressed>> {
        let mut pressed = Vec::new();
        match self.device.fetch_events() {
            Ok(events) => pressed.extend(events.filter_map(|event| self.pad.take(event))),
            Err(e) if e.kind() == ErrorKind::WouldBlock => {}
            Err(e) => {
                log::warn!("the gamepad is gone: {e}");
                let release = self.pad.is_pulled.then_some(Pressed::Fire(false));
                self.pad = Pad::default();
                return release.map(|release| vec![release]);
            }
        }
        pressed.extend(self.pad.turn());
        Some(pressed)
    }
}

/// State of a gamepad.
#[derive(Debug, Default)]
struct Pad {
    /// Least and greatest value of each axis.
    ranges: Vec<(AbsoluteAxisCode, [f64; 2])>,
    /// Places of the sticks, -1 to 1 to the right and downwards.
    sticks: [[f64; 2]; 2],
    is_pulled: bool,
    /// Its left and upper button are named the other way round.
    is_lettered: bool,
}

impl Pad {
    /// Takes what the kernel says.
    fn take(&mut self, event: InputEvent) -> Option<Pressed> {
        match event.destructure() {
            EventSummary::Key(_, KeyCode::BTN_TR | KeyCode::BTN_TR2, value) if value < 2 => {
                self.pull(value == 1)
            }
            EventSummary::Key(_, key, 1) => {
                let key = match key {
                    KeyCode::BTN_NORTH if self.is_lettered => KeyCode::BTN_WEST,
                    KeyCode::BTN_WEST if self.is_lettered => KeyCode::BTN_NORTH,
                    key => key,
                };
                BUTTONS.into_iter().find(|(button, _)| *button == key).map(|(_, act)| Pressed::Act(act))
            }
            EventSummary::AbsoluteAxis(_, axis, value) => self.axis(axis, f64::from(value)),
            _ => None,
        }
    }

    fn axis(&mut self, axis: AbsoluteAxisCode, value: f64) -> Option<Pressed> {
        let (_, [least, most]) = *self.ranges.iter().find(|(known, _)| *known == axis)?;
        let share = ((value - least) / (most - least)).clamp(0.0, 1.0);
        if !share.is_finite() {
            return None;
        }
        let has = |axis: AbsoluteAxisCode| self.ranges.iter().any(|(known, _)| *known == axis);
        let (right, trigger) = if RIGHT.0.into_iter().all(has) { RIGHT } else { PLAIN };
        if let Some((_, [low, high])) = CROSS.into_iter().find(|(cross, _)| *cross == axis) {
            let order = if share < 0.25 { Some(low) } else { (share > 0.75).then_some(high) };
            return order.map(|order| Pressed::Act(Act::Drive(order)));
        }
        if axis == trigger {
            let [pull, release] = PULLED;
            return self.pull(share > if self.is_pulled { release } else { pull });
        }
        for (stick, axes) in self.sticks.iter_mut().zip([LEFT, right]) {
            for (place, code) in stick.iter_mut().zip(axes) {
                if code == axis {
                    *place = 2.0 * share - 1.0;
                }
            }
        }
        None
    }

    fn pull(&mut self, is_pulled: bool) -> Option<Pressed> {
        (std::mem::replace(&mut self.is_pulled, is_pulled) != is_pulled).then_some(Pressed::Fire(is_pulled))
    }

    /// Turn of a frame.
    fn turn(&self) -> Option<Pressed> {
        let mut turn = [0.0; 2];
        for (stick, most) in self.sticks.iter().zip(TURNS) {
            let far = stick[0].hypot(stick[1]);
            if far > DEAD {
                // Fine about the middle: by the square of the way.
                let rate = most * ((far.min(1.0) - DEAD) / (1.0 - DEAD)).powi(2) / far;
                turn[0] += stick[0] * rate;
                turn[1] -= stick[1] * rate;
            }
        }
        (turn != [0.0; 2]).then_some(Pressed::Turn(turn))
    }
}

#[cfg(test)]
mod tests {
    use evdev::EventType;

    use super::*;

    fn pad() -> Pad {
        let stick = [-32768.0, 32767.0];
        let axes = LEFT.into_iter().chain(RIGHT.0).map(|axis| (axis, stick));
        Pad { ranges: axes.chain([(AbsoluteAxisCode::ABS_RZ, [0.0, 1023.0])]).collect(), ..Pad::default() }
    }

    fn axis(code: AbsoluteAxisCode, value: i32) -> InputEvent {
        InputEvent::new(EventType::ABSOLUTE.0, code.0, value)
    }

    fn key(code: KeyCode, value: i32) -> InputEvent {
        InputEvent::new(EventType::KEY.0, code.0, value)
    }

    #[test]
    fn sticks_turn_the_gun_the_way_they_point_and_rest_in_the_middle() {
        let mut pad = pad();
        assert_eq!(pad.turn(), None);
        for (code, value, right, up) in [
            (AbsoluteAxisCode::ABS_X, 32767, TURNS[0], 0.0),
            (AbsoluteAxisCode::ABS_X, 2000, 0.0, 0.0),
            (AbsoluteAxisCode::ABS_X, 0, 0.0, 0.0),
            (AbsoluteAxisCode::ABS_Y, -32768, 0.0, TURNS[0]),
            (AbsoluteAxisCode::ABS_Y, 0, 0.0, 0.0),
            (AbsoluteAxisCode::ABS_RX, -32768, -TURNS[1], 0.0),
        ] {
            assert_eq!(pad.take(axis(code, value)), None);
            let turn = if let Some(Pressed::Turn(turn)) = pad.turn() { turn } else { [0.0; 2] };
            assert!(
                (turn[0] - right).abs() < 2e-4 && (turn[1] - up).abs() < 2e-4,
                "{code:?} {value}: {turn:?}"
            );
        }
    }

    #[test]
    fn the_cross_drives_a_boat_by_notches() {
        let mut pad = pad();
        pad.ranges.extend(CROSS.map(|(axis, _)| (axis, [-1.0, 1.0])));
        let mut press = |code, value| pad.take(axis(code, value));
        let order = |order| Some(Pressed::Act(Act::Drive(order)));
        assert_eq!(press(AbsoluteAxisCode::ABS_HAT0Y, -1), order(DriveOrder::Ahead));
        assert_eq!(press(AbsoluteAxisCode::ABS_HAT0Y, 0), None, "let go");
        assert_eq!(press(AbsoluteAxisCode::ABS_HAT0Y, 1), order(DriveOrder::Astern));
        assert_eq!(press(AbsoluteAxisCode::ABS_HAT0X, -1), order(DriveOrder::Port));
        assert_eq!(press(AbsoluteAxisCode::ABS_HAT0X, 1), order(DriveOrder::Starboard));
        assert_eq!(pad.take(key(KeyCode::BTN_THUMBL, 1)), order(DriveOrder::Midships));
        assert_eq!(pad.take(key(KeyCode::BTN_START, 1)), Some(Pressed::Act(Act::Light)));
    }

    #[test]
    fn a_right_stick_by_other_names_does_not_fire() {
        let axes = LEFT.into_iter().chain(PLAIN.0).map(|axis| (axis, [0.0, 255.0]));
        let mut plain = Pad { ranges: axes.collect(), ..Pad::default() };
        assert_eq!(plain.take(axis(AbsoluteAxisCode::ABS_RZ, 255)), None);
        assert!(matches!(plain.turn(), Some(Pressed::Turn([right, up])) if right == 0.0 && up < 0.0));
        let mut lettered = Pad { is_lettered: true, ..pad() };
        assert_eq!(
            lettered.take(key(KeyCode::BTN_NORTH, 1)),
            Some(Pressed::Act(Act::Identify(Side::Neutral)))
        );
    }

    #[test]
    fn the_trigger_fires_once_a_pull_and_buttons_are_acts() {
        let mut pad = pad();
        let pulled: Vec<_> =
            [0, 400, 600, 900, 500, 420, 300, 0].map(|v| pad.take(axis(AbsoluteAxisCode::ABS_RZ, v))).into();
        let fires: Vec<_> = pulled.into_iter().flatten().collect();
        assert_eq!(fires, [Pressed::Fire(true), Pressed::Fire(false)]);
        assert_eq!(pad.take(key(KeyCode::BTN_TR, 1)), Some(Pressed::Fire(true)));
        assert_eq!(pad.take(key(KeyCode::BTN_TR, 2)), None);
        assert_eq!(pad.take(key(KeyCode::BTN_TR, 0)), Some(Pressed::Fire(false)));
        assert_eq!(pad.take(key(KeyCode::BTN_NORTH, 1)), Some(Pressed::Act(Act::Warn)));
        assert_eq!(pad.take(key(KeyCode::BTN_NORTH, 0)), None);
        assert_eq!(pad.take(key(KeyCode::BTN_MODE, 1)), None);
        // An axis that the device did not tell of.
        assert_eq!(pad.take(axis(AbsoluteAxisCode::ABS_HAT0X, 1)), None);
    }
}
