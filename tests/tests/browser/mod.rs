//! A headless Chromium, driven through its driver. Where there is none, that is said, and tests that need it judge nothing.

#![allow(dead_code, reason = "each test file uses some of it")]

use std::{
    net::TcpListener,
    path::Path,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use fantoccini::{Client, ClientBuilder, Locator, wd::WebDriverCompatibleCommand};
use hyper_util::client::legacy::connect::HttpConnector;
use serde_json::{Value, json};
use tokio::runtime::Runtime;

/// axe-core, as `SOURCES.md` names it.
pub const AXE: &str = include_str!("axe.min.js");

/// A browser with one page open.
pub struct Browser {
    runtime: Runtime,
    client: Client,
    driver: Child,
}

impl Browser {
    /// Opens a page from the disk; `None` where there is no browser.
    pub fn open(page: &Path) -> Option<Self> {
        let browser = Self::start()?;
        browser.open_file(page);
        Some(browser)
    }

    /// Without a page; `None` where there is no browser.
    pub fn start() -> Option<Self> {
        let port = TcpListener::bind("127.0.0.1:0").and_then(|l| l.local_addr()).expect("a free port").port();
        let driver = Command::new("chromedriver")
            .args([format!("--port={port}"), "--silent".to_owned()])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        let Ok(driver) = driver else {
            assert!(std::env::var_os("BOWWAVE_BROWSER").is_none(), "chromedriver does not start");
            eprintln!("no chromedriver: the pages are not looked at in a browser; ./check setup installs it");
            return None;
        };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
        let client = runtime.block_on(connect(port));
        Some(Self { runtime, client, driver })
    }

    /// Opens a page from the disk.
    pub fn open_file(&self, page: &Path) {
        let page = page.canonicalize().expect("the page is there");
        self.visit(&format!("file://{}", page.display()));
    }

    /// Opens a page by its address.
    pub fn visit(&self, address: &str) {
        self.runtime.block_on(self.client.goto(address)).expect("it opens");
        self.wait("return typeof bowwave === 'object'");
    }

    /// Serious and critical findings of axe-core in the page: the rule, its help and the elements.
    pub fn axe(&self) -> Vec<String> {
        const RUN: &str = "const done = arguments[arguments.length - 1];
            axe.run(document, { resultTypes: ['violations'] }).then(
                (found) => done(found.violations
                    .filter((v) => v.impact === 'serious' || v.impact === 'critical')
                    .map((v) => `${v.impact} ${v.id}: ${v.help}: ${v.nodes.map((n) => `${n.target} (${n.any.map((c) => c.message)})`).join('; ')}`)),
                (error) => done([`axe-core fails: ${error}`]));";
        self.run(AXE);
        let found = self.runtime.block_on(self.client.execute_async(RUN, Vec::new())).expect("axe-core runs");
        let found = found.as_array().expect("a list of findings").iter();
        found.map(|words| words.as_str().unwrap_or_default().to_owned()).collect()
    }

    /// Runs a script in the page and gives what it returns.
    pub fn run(&self, script: &str) -> Value {
        self.runtime
            .block_on(self.client.execute(script, Vec::new()))
            .unwrap_or_else(|e| panic!("{script}: {e}"))
    }

    /// The same, a number.
    pub fn number(&self, script: &str) -> f64 {
        let value = self.run(script);
        value.as_f64().unwrap_or_else(|| panic!("{script} gave {value}"))
    }

    /// Waits until a script gives true.
    pub fn wait(&self, script: &str) {
        self.wait_within(script, Duration::from_secs(60));
    }

    /// The same, where a trainer has to be started first.
    pub fn wait_long(&self, script: &str) {
        self.wait_within(script, Duration::from_secs(300));
    }

    fn wait_within(&self, script: &str, time: Duration) {
        let until = Instant::now() + time;
        while self.run(script) != Value::Bool(true) {
            assert!(Instant::now() < until, "in vain: {script}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Clicks on an element.
    pub fn click(&self, css: &str) {
        self.runtime.block_on(async {
            self.client.find(Locator::Css(css)).await.expect("the element").click().await.expect("a click");
        });
    }

    /// Presses keys on an element.
    pub fn keys(&self, css: &str, keys: &str) {
        self.runtime.block_on(async {
            self.client
                .find(Locator::Css(css))
                .await
                .expect("the element")
                .send_keys(keys)
                .await
                .expect("keys");
        });
    }

    /// Text of an element.
    pub fn text(&self, css: &str) -> String {
        self.runtime.block_on(async {
            self.client.find(Locator::Css(css)).await.expect("the element").text().await.expect("its text")
        })
    }

    /// Errors on the console since this was last asked: of scripts, of what could not be loaded or was refused.
    pub fn errors(&self) -> Vec<String> {
        let log = self.runtime.block_on(self.client.issue_cmd(ConsoleLog)).expect("the console's log");
        let lines = log.as_array().into_iter().flatten();
        lines.filter(|line| line["level"] == "SEVERE").map(Value::to_string).collect()
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.runtime.block_on(self.client.clone().close());
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}

/// The console's log, which the driver of Chromium has.
#[derive(Debug)]
struct ConsoleLog;

impl WebDriverCompatibleCommand for ConsoleLog {
    fn endpoint(&self, base: &url::Url, session: Option<&str>) -> Result<url::Url, url::ParseError> {
        base.join(&format!("session/{}/se/log", session.unwrap_or_default()))
    }

    fn method_and_body(&self, _: &url::Url) -> (http::Method, Option<String>) {
        (http::Method::POST, Some(r#"{"type":"browser"}"#.to_owned()))
    }
}

async fn connect(port: u16) -> Client {
    let options = json!({
        "args": ["--headless=new", "--no-sandbox", "--window-size=1600,1000", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
    });
    let mut capabilities = serde_json::Map::new();
    capabilities.insert("goog:chromeOptions".to_owned(), options);
    capabilities.insert("goog:loggingPrefs".to_owned(), json!({ "browser": "ALL" }));
    let until = Instant::now() + Duration::from_secs(60);
    loop {
        let mut builder = ClientBuilder::new(HttpConnector::new());
        let found =
            builder.capabilities(capabilities.clone()).connect(&format!("http://127.0.0.1:{port}")).await;
        match found {
            Ok(client) => return client,
            Err(e) => assert!(Instant::now() < until, "chromedriver does not answer: {e}"),
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}
