//! Lets this crate's own tests find Embree's library, and hands what `embree4-sys` found on to dependents as
//! `DEP_EMBREE4_SAFE_LIB_DIR` and `DEP_EMBREE4_SAFE_VERSION`.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let lib_dir = std::env::var("DEP_EMBREE4_LIB_DIR").expect("embree4-sys sets lib_dir");
    let version = std::env::var("DEP_EMBREE4_VERSION").expect("embree4-sys sets version");
    if !lib_dir.is_empty() {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{lib_dir}");
    }
    println!("cargo::metadata=lib_dir={lib_dir}");
    println!("cargo::metadata=version={version}");
}
