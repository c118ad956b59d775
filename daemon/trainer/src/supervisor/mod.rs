//! Who watches: faults and their lines in the log, the computer itself, systemd, and starts that end badly.

mod fault_log;
mod health;
mod load;
mod notify;
mod pulse;
mod starts;

pub use fault_log::FaultLog;
pub use health::{Health, HealthSettings, WallTime};
pub use load::LoadWatch;
pub use notify::Notifier;
pub use pulse::Pulse;
pub use starts::{CrashLoopGuard, Mode};
