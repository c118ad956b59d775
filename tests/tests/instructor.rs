//! The instructor's page in a browser, with a real trainer: an exercise is run from it, the trainer is killed and started again, and the run
//! is looked at afterwards.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod browser;
mod playing;

use std::{
    io::{BufRead as _, BufReader},
    path::PathBuf,
    process::{Child, Command, Stdio},
    time::Instant,
};

use bowwave_tests::{bowwave, expect_code, program};
use browser::Browser;
use playing::Playing;
use sha2::{Digest as _, Sha256};

/// The instructor's process, and the address of its page.
struct Serving {
    child: Child,
    address: String,
}

impl Serving {
    fn start(playing: &Playing) -> Self {
        let folder = playing.folder.path();
        let mut child = Command::new(program())
            .args(["instructor", "--bind", "127.0.0.1:0", "--without-token", "--socket"])
            .arg(playing.socket())
            .arg("--library")
            .arg(folder.join("library"))
            .arg("--tokens")
            .arg(folder.join("tokens"))
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let mut address = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut address).unwrap();
        assert!(address.starts_with("http://127.0.0.1:"), "{address:?}");
        Self { child, address: address.trim().to_owned() }
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Errors on a page's console, and what it has from other hosts.
fn faults(browser: &Browser, address: &str) -> Vec<String> {
    let elsewhere = browser.run(&format!(
        "return performance.getEntriesByType('resource').map((e) => e.name).filter((name) => !name.startsWith('{address}') && !/^(data|blob):/.test(name))"
    ));
    let elsewhere = elsewhere.as_array().unwrap().iter().map(|name| format!("from elsewhere: {name}"));
    browser.errors().into_iter().chain(elsewhere).collect()
}

fn axe_in_each_palette(browser: &Browser) -> Vec<String> {
    let mut found = Vec::new();
    for palette in ["day", "bright", "dusk", "night"] {
        let choose = "const theme = document.getElementById('theme'); theme.value = '@'; theme.dispatchEvent(new Event('change'))";
        browser.run(&choose.replace('@', palette));
        // Colours change over a tenth of a second.
        std::thread::sleep(std::time::Duration::from_millis(300));
        found.extend(browser.axe().into_iter().map(|words| format!("{palette}: {words}")));
    }
    found
}

/// Waits until an element's text has a part.
fn wait_for(browser: &Browser, css: &str, part: &str) {
    browser.wait(&format!("return document.querySelector('{css}').textContent.includes('{part}')"));
}

fn press(browser: &Browser, key: &str) {
    browser.keys("body", key);
}

#[test]
fn an_exercise_is_run_from_the_page_and_the_trainer_may_be_killed() {
    let Some(browser) = Browser::start() else { return };
    let mut playing = Playing::start();
    let serving = Serving::start(&playing);
    browser.visit(&serving.address);
    browser.wait_long("return bowwave.picture.count > 0");

    // Once the trainer runs: how long a page takes that is opened now. The figures are printed, since a test judges none.
    browser.visit(&serving.address);
    browser.wait("return bowwave.picture.count > 0");
    let first_ms = browser.number("return performance.getEntriesByName('first-picture')[0].startTime");
    browser.wait("return /^\\d+ ms behind$/.test(document.getElementById('delay').textContent)");
    println!("first picture {first_ms:.0} ms after navigation, then {}", browser.text("#delay"));
    assert_eq!(
        browser.run("return [bowwave.picture.canvas.width, bowwave.picture.canvas.height].join()"),
        "640,360"
    );
    wait_for(&browser, "#word", "PAUSED");

    run_exercise(&browser);
    println!("while it runs: {}", browser.text("#delay"));
    assert_eq!(axe_in_each_palette(&browser), Vec::<String>::new());
    assert_eq!(faults(&browser, &serving.address), Vec::<String>::new());

    // The trainer is killed, and started again: nobody touches the page.
    playing.kill();
    let killed = Instant::now();
    wait_for(&browser, "#strip", "Trainer lost");
    println!("the page says so {} ms after the trainer was killed", killed.elapsed().as_millis());
    let before = browser.number("return bowwave.picture.count");
    playing.start_again();
    let begun = Instant::now();
    browser.wait_long(&format!(
        "return document.getElementById('strip').hidden && bowwave.picture.count > {before}"
    ));
    println!("live again {:.1} s after the trainer was started", begun.elapsed().as_secs_f64());
    wait_for(&browser, "#holder", "you have control");

    review(&browser, &serving);
    // What the trainer's end brings is no error of the page.
    assert_eq!(faults(&browser, &serving.address), Vec::<String>::new());
    let page = made_review(&playing);
    browser.open_file(&page);
    assert_eq!(browser.axe(), Vec::<String>::new(), "the review");
}

/// Takes control, has the exercise go on, gives orders, and pauses it.
fn run_exercise(browser: &Browser) {
    browser.click("#session");
    browser.wait("return bowwave.state.name !== null");
    press(browser, "k");
    wait_for(browser, "#holder", "you have control");
    press(browser, "p");
    browser.wait(
        "return !bowwave.commands.isPaused && !/^0:00/.test(document.getElementById('clock').textContent)",
    );
    press(browser, "f");
    wait_for(browser, "#rules", "weapons free");
    press(browser, "t");
    wait_for(browser, "#rules", "weapons tight");
    let waiting = "return document.querySelectorAll('#reserve option').length";
    let reserve = browser.number(waiting);
    assert!(reserve > 0.0, "nobody waits");
    browser.click("#inject-form button");
    browser.wait(&format!("{waiting} < {reserve}"));
    browser.wait("return document.querySelectorAll('#score tr').length > 0");
    press(browser, "p");
    wait_for(browser, "#clock", "paused");
    browser.wait("return bowwave.commands.isPaused");
}

/// Opens the review of the first run as the page links it.
fn review(browser: &Browser, serving: &Serving) {
    browser.click("#runs-load");
    browser.wait("return document.querySelectorAll('#runs a').length > 0");
    let links = browser.run("return [...document.querySelectorAll('#runs a')].map((a) => a.href).join(' ')");
    let address = format!("{}review/1", serving.address);
    assert!(links.as_str().unwrap().split(' ').any(|link| link == address), "{links}");
    browser.visit(&address);
    browser.wait("return bowwave.run.times.length > 0");
}

fn made_review(playing: &Playing) -> PathBuf {
    let out = playing.folder.path().join("out");
    let made = bowwave(["review", out.to_str().unwrap(), "--run", "1"]);
    expect_code(&made, 0);
    PathBuf::from(String::from_utf8(made.stdout).unwrap().trim())
}

#[test]
fn axe_core_is_that_of_its_package() {
    let hash: String = Sha256::digest(browser::AXE).iter().map(|byte| format!("{byte:02x}")).collect();
    assert!(include_str!("browser/SOURCES.md").contains(&hash), "axe.min.js is {hash}");
}
