//! The wish that all threads end.

use std::{
    sync::{Condvar, Mutex, PoisonError},
    time::Duration,
};

use crate::locked;

/// The wish that all threads end, which wakes those that wait.
#[derive(Default)]
pub(crate) struct Stop {
    asked: Mutex<bool>,
    changed: Condvar,
}

impl Stop {
    pub(crate) fn ask(&self) {
        *locked(&self.asked) = true;
        self.changed.notify_all();
    }

    pub(crate) fn is_asked(&self) -> bool {
        *locked(&self.asked)
    }

    /// Waits so long, or until it is asked for.
    pub(crate) fn wait(&self, time: Duration) {
        let asked = locked(&self.asked);
        let _ =
            self.changed.wait_timeout_while(asked, time, |asked| !*asked).map_err(PoisonError::into_inner);
    }
}
