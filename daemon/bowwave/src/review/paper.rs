//! A page on paper (PDF), printed by a browser without a window.

use std::{
    fs::{self, File},
    os::unix::fs::PermissionsExt as _,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail, ensure};
use bowwave_review::Document;

/// Programs that print, the first that is installed being taken.
const BROWSERS: [&str; 8] = [
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "microsoft-edge",
    "microsoft-edge-stable",
    "msedge",
];
/// Longer than this no page takes, not even with a software driver.
const PATIENCE: Duration = Duration::from_secs(120);
const POLL: Duration = Duration::from_millis(50);

/// Prints a page into a file. `browser` is used, or the first that is installed.
pub fn print(page: &Document, out: &Path, browser: Option<&Path>) -> Result<()> {
    let browser = match browser {
        Some(named) => named.to_owned(),
        None => installed().context(
            "no browser that prints is installed: install Chromium (Debian: apt-get install chromium), Google Chrome or Microsoft Edge, \
             or name one with --browser; or leave out --format pdf and print the page yourself",
        )?,
    };
    // Beside the result: browsers in a sandbox see the user's folders, and not always that of temporary files.
    let folder = match out.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    let cannot = || format!("cannot write in {}; check the folder and its permissions", folder.display());
    let folder = folder.canonicalize().with_context(cannot)?;
    let work = tempfile::Builder::new().prefix("bowwave-print-").tempdir_in(&folder).with_context(cannot)?;
    page.write(&work.path().join("page.html")).with_context(cannot)?;
    let printed = work.path().join("page.pdf");
    drive(&browser, work.path())?;
    let is_pdf = fs::read(&printed).is_ok_and(|bytes| bytes.starts_with(b"%PDF"));
    ensure!(is_pdf, "{} ended well, but left no PDF; name another browser with --browser", browser.display());
    fs::rename(&printed, out)
        .with_context(|| format!("cannot write {}; check the folder and its permissions", out.display()))
}

/// Has the browser print page.html in `work` to page.pdf there.
fn drive(browser: &Path, work: &Path) -> Result<()> {
    let log = work.join("log");
    let words =
        File::create(&log).with_context(|| format!("cannot write {}; check the disk", log.display()))?;
    let mut command = Command::new(browser);
    command.args(["--headless=new", "--disable-gpu", "--no-first-run", "--no-default-browser-check"]);
    command.args(["--disable-extensions", "--disable-background-networking", "--no-pdf-header-footer"]);
    // The page is this program's own and loads nothing; as root, browsers run without their sandbox or not at all.
    if rustix::process::geteuid().is_root() {
        command.arg("--no-sandbox");
    }
    command.arg(format!("--user-data-dir={}", work.join("profile").display()));
    command.arg(format!("--print-to-pdf={}", work.join("page.pdf").display()));
    command.arg(super::address::file_url(&work.join("page.html")).context("the folder's name is no UTF-8")?);
    command.current_dir(work).stdin(Stdio::null()).stdout(Stdio::null()).stderr(words);
    let mut child = command.spawn().with_context(|| {
        format!(
            "cannot start {}; install Chromium, Chrome or Edge, or name another with --browser",
            browser.display()
        )
    })?;
    let begun = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().context("cannot wait for the browser")? {
            break status;
        }
        if begun.elapsed() > PATIENCE {
            child.kill().and_then(|()| child.wait()).context("cannot end the browser")?;
            bail!(
                "{} has not printed the page in {} s; name another browser with --browser, or open the page and print it there",
                browser.display(),
                PATIENCE.as_secs()
            );
        }
        thread::sleep(POLL);
    };
    let said = fs::read(&log).unwrap_or_default();
    let said = String::from_utf8_lossy(&said);
    let why = said.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it gave no reason");
    ensure!(status.success(), "{} could not print the page ({status}): {why}", browser.display());
    Ok(())
}

/// The first of the browsers that lies in a folder of PATH.
fn installed() -> Option<PathBuf> {
    let folders: Vec<PathBuf> = std::env::split_paths(&std::env::var_os("PATH")?).collect();
    BROWSERS
        .iter()
        .flat_map(|name| folders.iter().map(move |folder| folder.join(name)))
        .find(|path| is_program(path))
}

fn is_program(path: &Path) -> bool {
    path.metadata().is_ok_and(|about| about.is_file() && about.permissions().mode() & 0o111 != 0)
}
