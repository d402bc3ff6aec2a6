//! A headless Chromium, driven over its DevTools protocol: real key presses, a real layout, screenshots.

use base64::Engine;
use serde_json::{Value, json};
use std::fs;
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

/// Longest wait for the browser; the machine may be busy.
const PATIENCE: Duration = Duration::from_secs(120);

/// A browser with one page.
pub struct Browser {
    process: Child,
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    session: String,
    last: u64,
    /// Errors of the page's script and of its resources.
    pub faults: Vec<String>,
    _profile: TempDir,
}

/// The first Chromium there is.
fn program() -> Option<String> {
    let named = std::env::var("CHROMIUM").ok();
    let names = named.into_iter().chain(["chromium", "chromium-browser", "google-chrome"].map(String::from));
    let runs = |name: &String| {
        let version =
            Command::new(name).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        version.is_ok_and(|s| s.success())
    };
    names.into_iter().find(runs)
}

impl Browser {
    /// Starts one; `None` where there is no Chromium.
    pub fn start() -> Option<Self> {
        let profile = tempfile::tempdir().expect("a private folder");
        let process = Command::new(program()?)
            // Root has no sandbox; the page is our own.
            .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"])
            .args(["--no-first-run", "--remote-debugging-port=0"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg("about:blank")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("it ran before");
        let address = address(profile.path());
        let (socket, _) = tungstenite::connect(&address).expect("the browser listens");
        let session = String::new();
        let mut browser = Self { process, socket, session, last: 0, faults: Vec::new(), _profile: profile };
        let target = browser.call("Target.createTarget", json!({ "url": "about:blank" }));
        let attached = json!({ "targetId": target["targetId"], "flatten": true });
        let session = browser.call("Target.attachToTarget", attached);
        browser.session = session["sessionId"].as_str().expect("a session").to_owned();
        for domain in ["Page", "Runtime", "Log", "Network"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        Some(browser)
    }

    /// The next message; what it says of faults is kept.
    fn read(&mut self) -> Value {
        let message = self.socket.read().expect("the browser answers");
        let value: Value = serde_json::from_str(message.to_text().unwrap_or("null")).unwrap_or_default();
        match value["method"].as_str() {
            Some("Runtime.exceptionThrown" | "Log.entryAdded" | "Network.loadingFailed") => {
                self.faults.push(value.to_string());
            }
            Some("Network.requestWillBeSent") => {
                let url = value["params"]["request"]["url"].as_str().unwrap_or_default();
                if !url.starts_with("data:") && !url.starts_with("file:") {
                    self.faults.push(format!("asks for {url}"));
                }
            }
            _ => {}
        }
        value
    }

    /// Calls a method and waits for its result.
    pub fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.last += 1;
        let mut request = json!({ "id": self.last, "method": method, "params": parameters });
        if !self.session.is_empty() {
            request["sessionId"] = self.session.clone().into();
        }
        self.socket.send(Message::text(request.to_string())).expect("the browser listens");
        loop {
            let mut answer = self.read();
            if answer["id"] == self.last {
                assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
                return answer["result"].take();
            }
        }
    }

    /// Opens a file and waits until it is loaded.
    pub fn open(&mut self, file: &Path) {
        let path = fs::canonicalize(file).expect("it exists");
        self.call("Page.navigate", json!({ "url": format!("file://{}", path.display()) }));
        while self.read()["method"] != "Page.loadEventFired" {}
    }

    /// The value of an expression.
    pub fn evaluate(&mut self, expression: &str) -> Value {
        let parameters = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let mut answer = self.call("Runtime.evaluate", parameters);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].take()
    }

    /// Presses and releases a key, as a person does.
    pub fn press(&mut self, key: &str) {
        let code = match key {
            "Tab" => 9,
            "End" => 35,
            "Home" => 36,
            "ArrowRight" => 39,
            "ArrowDown" => 40,
            other => panic!("no code for the key {other}"),
        };
        for kind in ["rawKeyDown", "keyUp"] {
            let event = json!({ "type": kind, "key": key, "code": key, "windowsVirtualKeyCode": code });
            self.call("Input.dispatchKeyEvent", event);
        }
    }

    /// The size of the window, and whether the reader prefers dark pages.
    pub fn view(&mut self, width: u32, height: u32, dark: bool) {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600 });
        self.call("Emulation.setDeviceMetricsOverride", size);
        let scheme = if dark { "dark" } else { "light" };
        let feature = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        self.call("Emulation.setEmulatedMedia", feature);
    }

    /// Writes a picture of the whole page.
    pub fn screenshot(&mut self, file: &Path) {
        let shot = self.call("Page.captureScreenshot", json!({ "captureBeyondViewport": true }));
        let text = shot["data"].as_str().expect("a PNG");
        let bytes = base64::engine::general_purpose::STANDARD.decode(text).expect("base64");
        fs::write(file, bytes).expect("writable");
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _gone_already = self.process.kill().and_then(|()| self.process.wait());
    }
}

/// Where the browser listens: it writes port and path into its profile.
fn address(profile: &Path) -> String {
    let begin = Instant::now();
    loop {
        let text = fs::read_to_string(profile.join("DevToolsActivePort")).unwrap_or_default();
        if let Some((port, path)) = text.split_once('\n') {
            return format!("ws://127.0.0.1:{port}{}", path.trim());
        }
        assert!(begin.elapsed() < PATIENCE, "the browser does not start");
        std::thread::sleep(Duration::from_millis(50));
    }
}
