//! The report: its tables are the CSV files, and the page works in a browser, by keyboard, narrow and wide.

use super::browser::Browser;
use super::{gdpt, names, text};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;

/// A small study, made once.
fn report() -> PathBuf {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a private folder");
        let arguments = [
            "study",
            "builtin:cornell-box",
            "--size",
            "48x36",
            "--spp",
            "1,4,16",
            "--reference-spp",
            "1024",
            "--rounds",
            "2",
            "--max-depth",
            "5",
            "-q",
            "-o",
            "report",
        ];
        let output = gdpt(folder.path(), &arguments);
        assert!(output.status.success() && output.stderr.is_empty(), "{}", text(&output.stderr));
        folder
    });
    folder.path().join("report")
}

fn read(name: &str) -> String {
    fs::read_to_string(report().join(name)).expect("written")
}

/// The lines of a CSV file; no cell of a study needs quotes.
fn csv(name: &str) -> Vec<Vec<String>> {
    let text = read(name);
    assert!(!text.contains('"'), "{name} has quotes");
    text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

/// What stands between two marks, every time.
fn between<'a>(text: &'a str, open: &str, close: &str) -> Vec<&'a str> {
    text.split(open).skip(1).map(|rest| rest.split(close).next().unwrap_or_default()).collect()
}

/// The cells of the tables in the page, by the file each is also in.
fn tables(html: &str) -> BTreeMap<String, Vec<Vec<String>>> {
    let cell = |text: &str| {
        let text = text.split('>').next_back().unwrap_or_default();
        [("&#60;", "<"), ("&#62;", ">"), ("&#34;", "\""), ("&#39;", "'"), ("&#38;", "&")]
            .iter()
            .fold(text.to_owned(), |text, (escaped, plain)| text.replace(escaped, plain))
    };
    let table = |text: &str| {
        let name = text.split('"').next().unwrap_or_default().to_owned();
        let rows = between(text, "<tr>", "</tr>");
        let row = |row: &&str| row.split("</t").filter(|c| c.contains("<t")).map(cell).collect();
        (name, rows.iter().map(row).collect())
    };
    between(html, "<table data-csv=\"", "</table>").into_iter().map(table).collect()
}

#[test]
fn numbers_in_the_page_are_those_of_the_csv_files() {
    let html = read("index.html");
    let tables = tables(&html);
    assert_eq!(
        tables.keys().collect::<Vec<_>>(),
        ["methods.csv", "results.csv", "scenes.csv", "summary.csv"]
    );
    for (name, shown) in &tables {
        let mut file = csv(name);
        if name != "summary.csv" {
            // One scene: the page has its name above the table.
            let scenes: Vec<String> = file.iter_mut().map(|row| row.remove(0)).collect();
            assert!(scenes[0] == "scene" && scenes[1..].iter().all(|s| s == "cornell-box"), "{name}");
        }
        assert_eq!(shown, &file, "{name}");
    }
    let results = &tables["results.csv"];
    // The header, path tracing at four numbers of samples, two reconstructions at least at three.
    assert!(results.len() >= 1 + 4 + 2 * 3, "{results:?}");
    let column = |name: &str| results[0].iter().position(|h| h == name).expect("a column");
    let value = |method: &str, spp: &str, name: &str| -> f64 {
        let row = results.iter().find(|r| r[0] == method && r[1] == spp).expect("a row");
        row[column(name)].parse().expect("a number")
    };
    let (few, many) = (value("PT", "1", "rel_mse"), value("PT", "16", "rel_mse"));
    assert!(many < 0.3 * few, "path tracing: {few} with 1 sample, {many} with 16");
    assert_eq!((value("PT", "4", "gain_equal_spp"), value("PT", "4", "gain_equal_time")), (1.0, 1.0));
    let gain = value("PT", "16", "rel_mse") / value("G-PT l2", "16", "rel_mse");
    let said = value("G-PT l2", "16", "gain_equal_spp");
    assert!(gain > 2.0 && (said / gain - 1.0).abs() < 2e-3, "{gain}, the table says {said}");
    assert!(value("PT", "64", "flip") < value("PT", "1", "flip"));
    assert_eq!(csv("alpha.csv").len(), 1 + 17);
    assert_eq!(csv("spectra.csv").len(), 1 + 23);
}

#[test]
fn the_folder_has_what_is_promised_and_the_page_needs_nothing_else() {
    let files =
        ["alpha.csv", "index.html", "methods.csv", "results.csv", "scenes.csv", "spectra.csv", "summary.csv"];
    assert_eq!(names(&report()), files);
    let html = read("index.html");
    for source in between(&html, "src=\"", "\"") {
        assert!(source.starts_with("data:image/png;base64,"), "{}", &source[..source.len().min(60)]);
    }
    let elsewhere = |mark: &str| between(&html, mark, "\"").into_iter().any(|v| !v.starts_with('#'));
    assert!(!elsewhere("href=\"") && !html.contains("url(") && !html.contains("@import"));
    assert_eq!(between(&html, "<svg", "</svg>").len(), 5);
}

/// Where the pictures of the page go, for people to look at.
fn shots() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("study");
    fs::create_dir_all(&folder).expect("writable");
    folder
}

#[test]
fn the_page_works_in_a_browser() {
    let Some(mut browser) = Browser::start() else {
        println!("skipped: no Chromium; ./setup --browser installs it, CHROMIUM names another one");
        return;
    };
    let page = report().join("index.html");
    for (width, dark, name) in [(390, false, "phone"), (390, true, "phone-dark"), (1280, false, "wide")] {
        browser.view(width, 900, dark);
        browser.open(&page);
        // Nothing but tables may be wider than the window, and these scroll by themselves.
        let over = browser.evaluate("document.documentElement.scrollWidth");
        assert!(over.as_u64().is_some_and(|w| w <= u64::from(width)), "{name}: {over} wide");
        let ink = browser.evaluate("getComputedStyle(document.querySelector('.chart text')).fill");
        let light = ink.as_str().is_some_and(|i| i.contains("230"));
        assert_eq!(light, dark, "{name}: text of charts is {ink}");
        browser.screenshot(&shots().join(format!("{name}.png")));
    }
    check_parts(&mut browser);
    check_keyboard(&mut browser);
    assert!(browser.faults.is_empty(), "{:?}", browser.faults);
}

/// Every picture is there, every chart has curves, everything has words for who does not see it.
fn check_parts(browser: &mut Browser) {
    let images = browser.evaluate(
        "Promise.all([...document.images].map(i => i.decode())).then(() => document.images.length)",
    );
    assert!(images.as_u64().is_some_and(|n| n > 20), "{images} images");
    let broken = "[...document.images].filter(i => !i.complete || i.naturalWidth === 0 || !i.alt).length";
    assert_eq!(browser.evaluate(broken), 0, "images that are broken or have no alternative text");
    let flat = "[...document.querySelectorAll('.chart')].filter(c => !c.getAttribute('aria-label') || \
                c.querySelectorAll('svg circle').length < 6 || c.querySelectorAll('svg polyline').length < 3).length";
    assert_eq!(browser.evaluate(flat), 0, "charts without curves or words");
    let mute = "[...document.querySelectorAll('input, select')].filter(e => e.labels.length === 0).length";
    assert_eq!(browser.evaluate(mute), 0, "controls without a label");
    assert_eq!(browser.evaluate("document.querySelectorAll('h1').length"), 1);
}

/// The wipe: reached by Tab, moved by arrows, its images chosen by keys.
fn check_keyboard(browser: &mut Browser) {
    browser.evaluate("document.activeElement.blur()");
    let mut reached = Vec::new();
    for _ in 0..40 {
        browser.press("Tab");
        let active =
            browser.evaluate("document.activeElement.className || document.activeElement.type || ''");
        reached.push(active.as_str().unwrap_or_default().to_owned());
        if reached.last().is_some_and(|r| r == "range") {
            break;
        }
        if reached.last().is_some_and(|r| r == "left") {
            check_choice(browser);
        }
    }
    assert!(
        reached.iter().any(|r| r == "right") && reached.last().is_some_and(|r| r == "range"),
        "{reached:?}"
    );
    let state = "[document.activeElement.value, document.querySelector('.over').style.clipPath, \
                 document.activeElement.getAttribute('aria-valuetext').slice(0, 4)].join(' ')";
    assert_eq!(browser.evaluate(state), "50 inset(0px 50% 0px 0px) 50 %");
    for _ in 0..3 {
        browser.press("ArrowRight");
    }
    assert_eq!(browser.evaluate(state), "53 inset(0px 47% 0px 0px) 53 %");
    browser.press("End");
    assert_eq!(browser.evaluate("document.activeElement.value"), "100");
    browser.press("Home");
    assert_eq!(browser.evaluate("document.querySelector('.over').style.clipPath"), "inset(0px 100% 0px 0px)");
}

/// Another image by key: the one over the other becomes that of the list.
fn check_choice(browser: &mut Browser) {
    let state = "[document.querySelector('.left').selectedIndex, \
                 document.querySelector('.over').src === \
                 document.getElementById(document.querySelector('.left').value).src]";
    let before = browser.evaluate(state);
    browser.press("ArrowDown");
    let after = browser.evaluate(state);
    let index = |v: &serde_json::Value| v[0].as_u64().expect("an index");
    assert!(index(&after) == index(&before) + 1, "{before} {after}");
    assert!(before[1] == true && after[1] == true, "the image is not the chosen one");
}
