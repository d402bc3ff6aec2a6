//! How far a render is: a bar with the time left on a terminal, plain lines or JSON lines elsewhere; on stderr.

use super::terminal;
use crate::render::Monitor;
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::collections::HashSet;
use std::io::IsTerminal;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// `--progress`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Style {
    /// A bar on a terminal, plain lines otherwise
    #[default]
    Auto,
    /// A bar with the time left
    Bar,
    /// A line every ten per cent, one a second at most
    Plain,
    /// A JSON object where a stage begins, and one a second: stage, done, total, seconds, seconds_left
    Json,
    /// Nothing
    None,
}

/// Tells the user.
pub struct Progress {
    style: Style,
    quiet: bool,
    bar: ProgressBar,
    state: Mutex<State>,
}

struct State {
    stage: String,
    begin: Instant,
    last: Instant,
    tenths: u64,
    said: HashSet<String>,
}

impl Progress {
    /// Silent but for errors where `quiet`.
    pub fn new(style: Style, quiet: bool) -> Self {
        let style = match style {
            _ if quiet => Style::None,
            Style::Auto if std::io::stderr().is_terminal() => Style::Bar,
            Style::Auto => Style::Plain,
            other => other,
        };
        let target =
            if style == Style::Bar { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(0), target);
        let template = "{msg:>11} [{bar:40}] {percent:>3} %  {elapsed} passed, {eta} left";
        bar.set_style(ProgressStyle::with_template(template).expect("the template is a constant"));
        let state = State {
            stage: String::new(),
            begin: Instant::now(),
            last: Instant::now(),
            tenths: 0,
            said: HashSet::new(),
        };
        Self { style, quiet, bar, state: Mutex::new(state) }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Says that `done` of `total` is done: in JSON once a second, in plain text where a further tenth is done and a
    /// second has passed.
    fn say(&self, done: u64, total: u64) {
        let mut state = self.state();
        let tenths = 10 * done / total.max(1);
        let is_news = self.style == Style::Json || tenths > state.tenths;
        if !is_news || state.last.elapsed() < Duration::from_secs(1) {
            return;
        }
        state.tenths = tenths;
        state.last = Instant::now();
        let passed = state.begin.elapsed().as_secs_f64();
        let left = passed * (total - done.min(total)) as f64 / done.max(1) as f64;
        terminal::line(&match self.style {
            Style::Json => serde_json::json!({
                "stage": state.stage, "done": done, "total": total, "seconds": passed, "seconds_left": left,
            })
            .to_string(),
            _ => format!("gdpt: {} {} %, {passed:.0} s passed, {left:.0} s left", state.stage, 10 * tenths),
        });
    }
}

impl Monitor for Progress {
    fn warn(&self, message: &str) {
        if !self.quiet && self.state().said.insert(message.to_owned()) {
            self.bar.suspend(|| terminal::warning(message));
        }
    }

    fn stage(&self, name: &str) {
        let mut state = self.state();
        state.stage = name.to_owned();
        state.begin = Instant::now();
        state.last = state.begin;
        state.tenths = 0;
        if self.style == Style::Json {
            terminal::line(&serde_json::json!({ "stage": name }).to_string());
        }
        self.bar.set_message(name.to_owned());
        self.bar.set_position(0);
        self.bar.reset_elapsed();
    }

    fn progress(&self, done: u64, total: u64) {
        match self.style {
            Style::None => {}
            Style::Bar => {
                self.bar.set_length(total);
                self.bar.set_position(done);
            }
            _ => self.say(done, total),
        }
    }
}
