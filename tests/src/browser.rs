//! A headless Chromium that shows one page, driven through the pipe of its DevTools protocol
//! (<https://chromedevtools.github.io/devtools-protocol/>).

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::PATIENCE;

/// Names of the browser, beginning with Debian's.
const NAMES: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// A browser with one page.
pub struct Browser {
    child: Child,
    send: ChildStdin,
    receive: BufReader<ChildStdout>,
    /// The id of the page's session; empty before it is attached.
    session: String,
    last: u64,
    /// The page's complaints: uncaught exceptions, errors on the console, and the browser's own
    /// messages there, such as refused or failed requests.
    pub complaints: Vec<String>,
    _profile: TempDir,
}

impl Browser {
    /// Starts a browser; `None` if none is installed.
    ///
    /// # Panics
    ///
    /// The browser does not start.
    #[must_use]
    pub fn start() -> Option<Self> {
        let path = std::env::var_os("PATH")?;
        let is_installed = |name: &&str| {
            std::env::split_paths(&path).any(|folder| Path::new(&folder).join(name).exists())
        };
        let name = NAMES.into_iter().find(is_installed)?;
        let profile = tempfile::tempdir().expect("a temporary folder");
        // The browser reads from descriptor 3 and writes to 4.
        let mut command = Command::new("sh");
        command.args([
            "-c",
            "exec \"$@\" 3<&0 4>&1 </dev/null >/dev/null",
            "sh",
            name,
        ]);
        command.args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-dev-shm-usage",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--remote-debugging-pipe",
        ]);
        command.arg(format!("--user-data-dir={}", profile.path().display()));
        command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null());
        let mut child = command.spawn().expect("sh starts");
        let send = child.stdin.take().expect("it is captured");
        let receive = BufReader::new(child.stdout.take().expect("it is captured"));
        let mut browser = Self {
            child,
            send,
            receive,
            session: String::new(),
            last: 0,
            complaints: Vec::new(),
            _profile: profile,
        };
        let target = browser.call("Target.createTarget", &json!({ "url": "about:blank" }));
        let attach = json!({ "targetId": target["targetId"], "flatten": true });
        let attached = browser.call("Target.attachToTarget", &attach);
        browser.session = attached["sessionId"]
            .as_str()
            .expect("a session")
            .to_owned();
        for domain in ["Page", "Runtime", "Log"] {
            browser.call(&format!("{domain}.enable"), &json!({}));
        }
        Some(browser)
    }

    /// Calls a method of the protocol and returns its result.
    ///
    /// # Panics
    ///
    /// The call fails, or the browser ends.
    pub fn call(&mut self, method: &str, parameters: &Value) -> Value {
        self.last += 1;
        let mut message = json!({ "id": self.last, "method": method, "params": parameters });
        if !self.session.is_empty() {
            message["sessionId"] = self.session.as_str().into();
        }
        let mut text = message.to_string();
        text.push('\0');
        self.send
            .write_all(text.as_bytes())
            .expect("the browser listens");
        loop {
            let mut answer = Vec::new();
            let read = self.receive.read_until(0, &mut answer);
            assert!(
                read.is_ok_and(|read| read > 0),
                "the browser ended at {method}"
            );
            answer.pop();
            let mut answer: Value = serde_json::from_slice(&answer).expect("messages are JSON");
            if answer["id"] == self.last {
                assert!(answer["error"].is_null(), "{method} {parameters}: {answer}");
                return answer["result"].take();
            }
            self.note(&answer);
        }
    }

    fn note(&mut self, event: &Value) {
        let of = &event["params"];
        let complaint = match event["method"].as_str() {
            Some("Runtime.exceptionThrown") => &of["exceptionDetails"],
            Some("Runtime.consoleAPICalled") if of["type"] == "error" => &of["args"],
            Some("Log.entryAdded") if of["entry"]["level"] == "error" => &of["entry"]["text"],
            _ => return,
        };
        self.complaints.push(complaint.to_string());
    }

    /// Opens an address and waits until the page is loaded.
    pub fn open(&mut self, url: &str) {
        self.call("Page.navigate", &json!({ "url": url }));
        self.wait_for("document.readyState === 'complete'");
    }

    /// The value of an expression in the page.
    ///
    /// # Panics
    ///
    /// The expression throws.
    pub fn value(&mut self, expression: &str) -> Value {
        let asked =
            json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let mut answer = self.call("Runtime.evaluate", &asked);
        assert!(
            answer["exceptionDetails"].is_null(),
            "{expression}: {answer}"
        );
        answer["result"]["value"].take()
    }

    /// Waits until an expression is true in the page.
    ///
    /// # Panics
    ///
    /// The condition does not hold in time.
    pub fn wait_for(&mut self, expression: &str) {
        let since = Instant::now();
        while self.value(expression) != true {
            assert!(
                since.elapsed() < PATIENCE,
                "waiting in vain for {expression} in\n{}",
                self.value("document.body.innerText")
            );
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Sets the size of the window in pixels.
    pub fn resize(&mut self, width: u32, height: u32) {
        let size = json!({
            "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false,
        });
        self.call("Emulation.setDeviceMetricsOverride", &size);
    }

    /// Presses the Tab key.
    pub fn press_tab(&mut self) {
        for kind in ["rawKeyDown", "keyUp"] {
            let key = json!({
                "type": kind, "key": "Tab", "code": "Tab", "windowsVirtualKeyCode": 9,
            });
            self.call("Input.dispatchKeyEvent", &key);
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
