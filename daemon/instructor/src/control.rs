//! Who has control: one session at a time.

use std::sync::Mutex;

use serde::Serialize;
use tokio::sync::watch;

use crate::{
    access::{SessionKey, Visitor},
    locked,
};

/// News of it for everybody.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub(crate) struct ControlNews {
    /// Name of the token that has it.
    pub(crate) holder: Option<String>,
}

/// Who has control.
pub(crate) struct Control {
    holder: Mutex<Option<Visitor>>,
    news: watch::Sender<ControlNews>,
}

impl Control {
    pub(crate) fn new() -> Self {
        Self { holder: Mutex::default(), news: watch::Sender::new(ControlNews::default()) }
    }

    pub(crate) fn news(&self) -> watch::Receiver<ControlNews> {
        self.news.subscribe()
    }

    /// Gives it to `visitor`: in words what all are shown; `None` where the visitor has it already.
    pub(crate) fn take(&self, visitor: &Visitor) -> Option<String> {
        let mut holder = locked(&self.holder);
        if holder.as_ref().is_some_and(|held| held.key == visitor.key) {
            return None;
        }
        let before = holder.replace(visitor.clone());
        self.news.send_replace(ControlNews { holder: Some(visitor.name.clone()) });
        Some(match before {
            Some(before) => format!("{} took control from {}", visitor.name, before.name),
            None => format!("{} has control", visitor.name),
        })
    }

    /// Takes it from `key`, if that has it: in words what all are shown.
    pub(crate) fn hand_back(&self, key: &SessionKey) -> Option<String> {
        let mut holder = locked(&self.holder);
        let name = holder.take_if(|held| held.key == *key)?.name;
        self.news.send_replace(ControlNews::default());
        Some(format!("{name} handed control back: nobody has it"))
    }

    /// Takes it from whoever fails a test: in words what all are shown.
    pub(crate) fn lapse(&self, holds: impl FnOnce(&SessionKey) -> bool) -> Option<String> {
        let mut holder = locked(&self.holder);
        let name = holder.take_if(|held| !holds(&held.key))?.name;
        self.news.send_replace(ControlNews::default());
        Some(format!("{name} is gone: nobody has control"))
    }

    /// Tests whether that session has it.
    pub(crate) fn is_held_by(&self, key: &SessionKey) -> bool {
        locked(&self.holder).as_ref().is_some_and(|held| held.key == *key)
    }

    /// Refuses whoever has no control, in words.
    pub(crate) fn check(&self, visitor: Option<&Visitor>) -> Result<(), String> {
        let Some(visitor) = visitor else {
            return Err("only who has control may do this: log in with a token, then take control".to_owned());
        };
        match locked(&self.holder).as_ref() {
            Some(held) if held.key == visitor.key => Ok(()),
            Some(held) => Err(format!("{} has control: take it first", held.name)),
            None => Err("nobody has control: take it first".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn visitor(name: &str, byte: u8) -> Visitor {
        Visitor { key: [byte; 32], name: name.to_owned() }
    }

    #[test]
    fn one_session_has_control_and_all_are_shown_who() {
        let (control, anna, boris) = (Control::new(), visitor("anna", 1), visitor("boris", 2));
        let news = control.news();
        assert!(control.check(None).unwrap_err().contains("log in"));
        assert!(control.check(Some(&anna)).unwrap_err().contains("nobody"));
        assert_eq!(control.take(&anna).unwrap(), "anna has control");
        assert_eq!(control.take(&anna), None);
        assert_eq!(control.check(Some(&anna)), Ok(()));
        assert!(control.check(Some(&boris)).unwrap_err().contains("anna has control"));
        // The same name is another session: a token on two devices.
        assert!(control.check(Some(&visitor("anna", 3))).is_err());
        assert_eq!(control.take(&boris).unwrap(), "boris took control from anna");
        assert_eq!(news.borrow().holder.as_deref(), Some("boris"));
        assert_eq!(control.hand_back(&anna.key), None);
        assert!(control.hand_back(&boris.key).unwrap().contains("boris"));
        assert_eq!(news.borrow().holder, None);
        control.take(&anna);
        assert_eq!(control.lapse(|_| true), None);
        assert!(control.lapse(|key| *key != anna.key).is_some() && !control.is_held_by(&anna.key));
    }
}
