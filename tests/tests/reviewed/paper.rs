//! The page on paper.

use std::{fs, process::Command};

use bowwave_tests::{bowwave, expect_code, program, said};

use crate::reviewed;

#[test]
fn a_browser_prints_the_page() {
    let run = reviewed();
    let journal = run.page.parent().unwrap().to_str().unwrap();
    let folder = tempfile::tempdir().unwrap();
    if Command::new("chromium").arg("--version").output().is_err() {
        assert!(std::env::var_os("BOWWAVE_BROWSER").is_none(), "chromium does not start");
        eprintln!("no chromium: nothing is printed; ./check setup installs it");
        return;
    }
    // A name that means something in an address.
    let out = folder.path().join("a #1 %20?.pdf");
    expect_code(&bowwave(["review", journal, "--format", "pdf", "--out", out.to_str().unwrap()]), 0);
    let pdf = fs::read(&out).unwrap();
    assert!(pdf.starts_with(b"%PDF") && pdf.len() > 20_000, "{} bytes", pdf.len());
    let pages = pdf.windows(11).filter(|bytes| bytes == b"/Type /Page").count();
    assert!(pages >= 2, "{pages} pages");
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(left, [out], "nothing else is left");
}

#[test]
fn without_a_browser_that_is_said_with_what_to_install() {
    let run = reviewed();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run.pdf");
    let printing = |more: &[&str]| {
        let mut command = Command::new(program());
        command.env("PATH", folder.path()).arg("review").arg(run.page.parent().unwrap());
        let output = command.args(["--format", "pdf", "--out"]).arg(&out).args(more).output().unwrap();
        expect_code(&output, 1);
        said(&output)
    };
    let none = printing(&[]);
    assert!(none.contains("install Chromium") && none.contains("--browser"), "{none}");
    let failed = printing(&["--browser", "/bin/false"]);
    assert!(failed.contains("/bin/false could not print the page (exit status: 1)"), "{failed}");
    let idle = printing(&["--browser", "/bin/true"]);
    assert!(idle.contains("left no PDF"), "{idle}");
    let absent = printing(&["--browser", "no/such/browser"]);
    assert!(absent.contains("cannot start no/such/browser"), "{absent}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left");
}
