//! Finds the installed Embree, generates bindings from its headers and links its library. Never downloads.
//!
//! Searched in this order: `EMBREE_DIR`, `.embree/` in the workspace's root (made by `./setup`), the system.
//! Dependents' build scripts read `DEP_EMBREE4_LIB_DIR` (empty where the loader finds the library by itself) and
//! `DEP_EMBREE4_VERSION` (of the headers).

use std::path::{Path, PathBuf};
use std::process::exit;

/// Since 4.3 hits carry the primitive of the instance; see the layout test.
const MINIMUM: [u32; 3] = [4, 3, 0];
const NAMES: [&str; 2] = ["libembree4.so", "libembree4.dylib"];

struct Embree {
    include: PathBuf,
    lib: PathBuf,
    version: [u32; 3],
    on_system: bool,
}

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=EMBREE_DIR");
    let embree = find().unwrap_or_else(|why| {
        eprintln!("error: {why}");
        eprintln!("Run ./setup in the root of the project; it installs what is missing. Or install Embree 4.3 or later");
        eprintln!("(Debian 13, Ubuntu 24.04: libembree-dev; Fedora: embree-devel; Arch, Homebrew: embree),");
        eprintln!("or set EMBREE_DIR to a folder with include/embree4/rtcore.h and lib/libembree4.so.");
        exit(1)
    });
    generate(&embree);
    println!("cargo::rustc-link-search=native={}", embree.lib.display());
    println!("cargo::rustc-link-lib=dylib=embree4");
    if !embree.on_system {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{}", embree.lib.display());
    }
    let rpath = if embree.on_system { Path::new("") } else { &embree.lib };
    println!("cargo::metadata=lib_dir={}", rpath.display());
    println!("cargo::metadata=version={}", dotted(embree.version));
    println!("cargo::rustc-env=EMBREE_INCLUDE_DIR={}", embree.include.display());
}

/// The first usable Embree, or why there is none.
fn find() -> Result<Embree, String> {
    if let Some(dir) = std::env::var_os("EMBREE_DIR").filter(|dir| !dir.is_empty()) {
        return look_in(Path::new(&dir), false);
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../.embree");
    if let Ok(root) = root.canonicalize() {
        return look_in(&root, false);
    }
    let mut reasons = Vec::new();
    for prefix in ["/usr", "/usr/local", "/opt/homebrew"] {
        match look_in(Path::new(prefix), true) {
            Ok(embree) => return Ok(embree),
            Err(why) => reasons.push(why),
        }
    }
    Err(format!("no usable Embree: EMBREE_DIR is not set, there is no .embree/, {}", reasons.join(", ")))
}

/// Embree under `prefix`, or why it is not usable.
fn look_in(prefix: &Path, on_system: bool) -> Result<Embree, String> {
    let include = prefix.join("include");
    let config = include.join("embree4/rtcore_config.h");
    let text = std::fs::read_to_string(&config).map_err(|_| format!("no {}", config.display()))?;
    let part = |name| {
        number_after(&text, name).ok_or_else(|| format!("{} does not define {name}", config.display()))
    };
    let version = [part("RTC_VERSION_MAJOR")?, part("RTC_VERSION_MINOR")?, part("RTC_VERSION_PATCH")?];
    if version < MINIMUM || version[0] != MINIMUM[0] {
        let (have, want) = (dotted(version), dotted(MINIMUM));
        return Err(format!("Embree in {} is {have}, needed is {want} or a later 4.x", prefix.display()));
    }
    let arch = std::env::var("CARGO_CFG_TARGET_ARCH").unwrap_or_default();
    let multiarch = format!("lib/{arch}-linux-gnu");
    let lib = ["lib", "lib64", &multiarch]
        .iter()
        .map(|dir| prefix.join(dir))
        .find(|dir| NAMES.iter().any(|name| dir.join(name).exists()))
        .ok_or_else(|| format!("no libembree4 under {}", prefix.display()))?;
    Ok(Embree { include, lib, version, on_system })
}

/// The number in the line `#define name number`.
fn number_after(text: &str, name: &str) -> Option<u32> {
    text.lines().find_map(|line| {
        let mut words = line.split_whitespace();
        let found = words.next() == Some("#define") && words.next() == Some(name);
        found.then(|| words.next()?.parse().ok())?
    })
}

fn dotted(version: [u32; 3]) -> String {
    version.map(|part| part.to_string()).join(".")
}

/// Writes `bindings.rs`, and tells the crate whether the headers have `rtcGetDeviceLastErrorMessage`.
fn generate(embree: &Embree) {
    let bindings = bindgen::Builder::default()
        .header_contents("embree.h", "#include <embree4/rtcore.h>\n")
        .clang_arg(format!("-I{}", embree.include.display()))
        .allowlist_item("(rtc|RTC).*")
        .prepend_enum_name(false)
        .derive_default(true)
        .generate_comments(false)
        .parse_callbacks(Box::new(bindgen::CargoCallbacks::new()))
        .generate();
    let bindings = bindings.unwrap_or_else(|why| {
        eprintln!("error: bindgen cannot read Embree's headers in {}: {why}", embree.include.display());
        exit(1)
    });
    println!("cargo::rustc-check-cfg=cfg(has_last_error_message)");
    if bindings.to_string().contains("fn rtcGetDeviceLastErrorMessage") {
        println!("cargo::rustc-cfg=has_last_error_message");
    }
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    bindings.write_to_file(out.join("bindings.rs")).expect("OUT_DIR is writable");
}
