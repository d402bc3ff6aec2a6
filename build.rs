//! Links every target of this package with the Embree that `ffi/embree4-sys` found, and stamps what decides the
//! image's last bits: the version of Embree's headers and the CPU features that were compiled in.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    // Where the loader looks for the library by itself there is nothing to add.
    let lib_dir = std::env::var("DEP_EMBREE4_SAFE_LIB_DIR").expect("embree4 sets lib_dir");
    if !lib_dir.is_empty() {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{lib_dir}");
    }
    // The denoiser's library is found where it was linked from; one of the system by the loader itself.
    println!("cargo::rerun-if-env-changed=OIDN_DIR");
    if let (Ok(_), Ok(folder)) = (std::env::var("CARGO_FEATURE_DENOISE"), std::env::var("OIDN_DIR")) {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{folder}/lib");
    }
    let version = std::env::var("DEP_EMBREE4_SAFE_VERSION").expect("embree4 sets version");
    println!("cargo::rustc-env=GDPT_EMBREE_HEADERS={version}");
    let features = std::env::var("CARGO_CFG_TARGET_FEATURE").unwrap_or_default();
    println!("cargo::rustc-env=GDPT_TARGET_FEATURES={features}");
}
