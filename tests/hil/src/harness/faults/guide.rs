//! The guided calibration on live devices: told by lines and on the LCD, led by keys and trigger, ended in every way.

use std::{
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail, ensure};
use bowwave_hil::protocol::AgentCommand;

use super::{CaseResult, FaultRow, SpecialCase, computer::off, unit};
use crate::{
    bench::{Configured, HilBench, configuration},
    guest::Pending,
    lcd::Plate,
};

/// Folder of configuration and calibration.
const FOLDER: &str = "/run/hil/etc";
/// Where keys go in.
const KEYS: &str = "/run/hil/keys";
/// File of its output.
const SAID: &str = "/run/hil/said";
/// Where it keeps what it gathers.
const DATA: &str = "/run/hil/gathered";
/// Longest wait for the next thing it says, and for all of it.
const PATIENCE: Duration = Duration::from_secs(60);
const TOGETHER: Duration = Duration::from_secs(400);
/// Between two pulls.
const APART: Duration = Duration::from_millis(1500);
pub fn rows() -> Vec<FaultRow> {
    vec![
        FaultRow::Own(SpecialCase {
            number: "W",
            fault: "Guided calibration on live devices",
            injected: "camera and unit unplugged while it gathers",
            code: "-",
            target: "says what to do, goes on, tells a result; nothing is saved unasked",
            run: guided,
        }),
        FaultRow::Own(SpecialCase {
            number: "Wq",
            fault: "Guided calibration ended early",
            injected: "SIGTERM while it gathers, by a folder that cannot be written",
            code: "-",
            target: "the calibration is as it was, nothing else is left",
            run: ended,
        }),
    ]
}

/// The program while it runs.
struct GuestWizard {
    pending: Pending,
    /// So much of what it says was looked at.
    seen: usize,
}

impl GuestWizard {
    /// Starts it in the trainer's place, with the trainer's compiled shaders.
    fn start(bench: &mut HilBench, arguments: &str) -> Result<Self> {
        bench.machine.guest.shell(&format!("rm -f {KEYS} {SAID}; mkfifo {KEYS}"))?;
        // Of a machine as slow as this one IMU LATE would be said all the time.
        let text = configuration(&Configured::default())
            .replace("packet_jitter_ms_max = 30", "packet_jitter_ms_max = 800");
        bench.machine.guest.call(AgentCommand::Write { path: format!("{FOLDER}/guided.toml"), text })?;
        let line = format!(
            "cd / && GALLIVM_PERF=nopt MESA_SHADER_CACHE_DIR=/var/cache/bowwave CACHE_DIRECTORY=/var/cache/bowwave \
             exec bowwave calibrate wizard --config {FOLDER}/guided.toml {arguments} <>{KEYS} >{SAID} 2>&1"
        );
        let argv = ["/bin/sh", "-c", &line].map(str::to_owned).to_vec();
        let timeout_ms = TOGETHER.as_millis() as u64;
        let pending = bench.machine.guest.send(AgentCommand::Run { argv, timeout_ms })?;
        Ok(Self { pending, seen: 0 })
    }

    fn said(bench: &mut HilBench) -> Result<String> {
        bench.machine.guest.shell(&format!("cat {SAID} 2>/dev/null; true"))
    }

    /// Waits until it says these words after those that were waited for before; all that it said between.
    fn says(&mut self, bench: &mut HilBench, words: &str) -> Result<String> {
        let until = Instant::now() + PATIENCE;
        loop {
            let said = Self::said(bench)?;
            let news = said.get(self.seen..).unwrap_or_default();
            if let Some(at) = news.find(words) {
                self.seen += at + words.len();
                return Ok(news[..at].to_owned());
            }
            if Instant::now() > until {
                bail!("the wizard does not say '{words}', but: {news}");
            }
            thread::sleep(Duration::from_millis(200));
        }
    }

    fn key(bench: &mut HilBench, key: &str) -> Result<()> {
        bench.machine.guest.shell(&format!("echo '{key}' >{KEYS}")).map(|_| ())
    }

    /// Pulls the trigger, a while after what was done before: a pull at once would belong to that. These pulls are none of the trainer's,
    /// which the journal of hits must hold.
    fn pull(bench: &mut HilBench) -> Result<()> {
        thread::sleep(APART);
        let steps = vec![(0, true), (150_000, false)];
        bench.machine.guest.call(AgentCommand::Pull { line: 0, steps }).map(|_| ())
    }

    /// Waits for its end; its exit code.
    fn ends(self) -> Result<i64> {
        self.pending.answer(PATIENCE)?["code"].as_i64().context("an exit code")
    }
}

impl HilBench {
    /// Waits until the LCD shows a page of the guide, one that tells of a problem where that is asked for, and keeps it. Nobody else shows
    /// anything: the trainer is off, and what is to be done has the green shape of READY.
    fn guide(&self, problem: bool, name: &str) -> Result<()> {
        let shown =
            self.lcd(Instant::now(), PATIENCE, name, |p, told| p == Plate::Ready && (told || !problem));
        self.keep_picture(name);
        shown.map(|_| ())
    }

    fn listed(&mut self) -> Result<String> {
        self.machine
            .guest
            .shell(&format!("cd {FOLDER} && ls -A -I guided.toml && sha256sum calibration.toml"))
    }
}

fn guided(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    off(bench)?;
    bench.lcd(Instant::now(), PATIENCE, "nothing", |p, _| p == Plate::Black)?;
    let before = bench.listed()?;
    let mut wizard = GuestWizard::start(bench, &format!("--data {DATA}"))?;
    let note = (|| -> Result<String> {
        wizard.says(bench, "== Calibrate\n")?;
        let note = moved(bench, &mut wizard)?;
        GuestWizard::key(bench, "q")?;
        wizard.says(bench, "-> Ended")?;
        Ok(note)
    })();
    if note.is_err() {
        drop(bench.machine.guest.shell("kill $(pidof bowwave)"));
    }
    let code = wizard.ends()?;
    let said = GuestWizard::said(bench)?;
    std::fs::write(bench.out.join("wizard.txt"), &said).context("wizard.txt")?;
    let note = note?;
    let after = bench.listed()?;
    ensure!(before == after, "before: {before}; after: {after}");
    // Nothing was saved, which its exit code says.
    let gathered = bench.machine.guest.shell(&format!("ls {DATA}; rm -r {DATA}"))?;
    let named = said.lines().filter(|l| l.starts_with("what was gathered is kept: bowwave calibrate "));
    let recordings = named.count();
    ensure!(
        recordings == 1 && gathered.lines().count() == 1,
        "{recordings} recordings are named: {gathered}"
    );
    Ok(CaseResult {
        lcd: "guide".into(),
        met: code == 1,
        note: format!("{note}; exit code {code}"),
        ..CaseResult::default()
    })
}

/// Camera and unit are gathered from, unplugged and plugged again.
fn moved(bench: &mut HilBench, wizard: &mut GuestWizard) -> Result<String> {
    bench.guide(false, "row-W-choose")?;
    GuestWizard::key(bench, "2")?;
    wizard.says(bench, "> 2 inertial unit to camera")?;
    GuestWizard::pull(bench)?;
    wizard.says(bench, "-> Swing the gun left and right, up and down")?;
    wizard.says(bench, " s, horizon in ")?;
    bench.guide(false, "row-W-gather")?;
    bench.camera("unplug")?;
    wizard.says(bench, "!! CAMERA LOST: CHECK THE ")?;
    bench.guide(true, "row-W-camera")?;
    bench.camera("plug 0")?;
    wizard.says(bench, "(well again)")?;
    unit::unplug(bench)?;
    wizard.says(bench, "!! IMU LOST: CHECK THE ")?;
    unit::plug(bench)?;
    wizard.says(bench, "(well again)")?;
    wizard.says(bench, "   elevation: ")?;
    bench.guide(false, "row-W-gauges")?;
    GuestWizard::pull(bench)?;
    // Whether such small pictures and so late packets are good enough is no question here: it is not saved.
    let told = wizard.says(bench, "-> Press Enter to ")?;
    GuestWizard::key(bench, "b")?;
    GuestWizard::key(bench, "b")?;
    wizard.says(bench, "== Calibrate\n")?;
    let verdict = told.lines().skip_while(|l| !matches!(*l, "   FAIL" | "   PASS")).nth(1);
    Ok(format!("movement: {}", verdict.context("no result was told")?.trim()))
}

/// Nobody says where recordings go, and the folder it runs in cannot be written.
fn ended(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    off(bench)?;
    let before = bench.listed()?;
    let mut wizard = GuestWizard::start(bench, "imu --data /proc/bowwave")?;
    let told = wizard.says(bench, "cannot make the folder /proc/bowwave");
    let refused = wizard.ends()?;
    told?;
    let mut wizard = GuestWizard::start(bench, "imu --data /sys")?;
    let gathers = wizard.says(bench, " s, horizon in ");
    bench.machine.guest.shell("kill $(pidof bowwave)")?;
    let told = wizard.says(bench, "-> Ended");
    let code = wizard.ends()?;
    let said = GuestWizard::said(bench)?;
    std::fs::write(bench.out.join("wizard-ended.txt"), &said).context("wizard-ended.txt")?;
    gathers?;
    told?;
    let after = bench.listed()?;
    ensure!(before == after, "before: {before}; after: {after}");
    ensure!(said.contains("what is gathered is not kept"), "it does not say that nothing is kept: {said}");
    let note = format!("exit code {refused} for a folder that cannot be made, {code} after SIGTERM");
    Ok(CaseResult { lcd: "guide".into(), met: (refused, code) == (1, 1), note, ..CaseResult::default() })
}
