//! The sandbox of URIs: what a scene file may name. Only regular files below the scene's own folder, and `data:`.
//!
//! Rejected, before anything is opened: absolute paths, schemes and drive letters, `..`, backslashes, control
//! characters, escapes that are not UTF-8. Rejected after links are resolved: what is not below the folder, and
//! what is not a regular file (folders, pipes, devices).

use crate::error::{Error, Result};
use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use std::fs::File;
use std::path::{Path, PathBuf};

/// What a URI stands for.
pub(super) enum Target<'a> {
    /// The undecoded payload of a `data:` URI, base64 or percent-encoded.
    Data { payload: &'a str, is_base64: bool },
    /// A relative path, decoded and free of tricks as text.
    File(PathBuf),
}

/// Why a URI does not lead to bytes.
pub(super) enum Refusal {
    /// It breaks the rules of the sandbox: the scene is rejected.
    Forbidden(String),
    /// There is no such file, or it cannot be read.
    Missing(PathBuf, String),
}

/// Sorts a URI, by its text alone.
pub(super) fn parse(uri: &str) -> std::result::Result<Target<'_>, String> {
    if let Some(data) = strip_data_scheme(uri) {
        let (header, payload) = data.split_once(',').ok_or("data: URI without a comma")?;
        let is_base64 = header.to_ascii_lowercase().ends_with(";base64");
        return Ok(Target::Data { payload, is_base64 });
    }
    if uri.is_empty() {
        return Err("empty URI".into());
    }
    let shown = uri.escape_default().to_string();
    let text = decode_percent(uri).and_then(|bytes| String::from_utf8(bytes).ok());
    let text = text.ok_or_else(|| format!("`{shown}` is not valid percent-encoded UTF-8"))?;
    if text.chars().any(|c| c.is_control()) {
        return Err(format!("`{shown}` holds a control character"));
    }
    if text.contains('\\') {
        return Err(format!("`{shown}` holds a backslash; separate folders by `/`"));
    }
    if text.starts_with('/') {
        return Err(format!("`{shown}` is absolute; only files beside the scene are read"));
    }
    if text.split('/').next().is_some_and(|first| first.contains(':')) {
        return Err(format!(
            "`{shown}` names a scheme or drive; only files beside the scene and data: are read"
        ));
    }
    if text.split('/').any(|segment| segment == "..") {
        return Err(format!("`{shown}` leaves the scene's folder; only files below it are read"));
    }
    Ok(Target::File(text.into()))
}

fn strip_data_scheme(uri: &str) -> Option<&str> {
    let scheme = uri.get(..5)?;
    if scheme.eq_ignore_ascii_case("data:") { uri.get(5..) } else { None }
}

/// Decodes %XX; `None` for a broken escape.
pub(super) fn decode_percent(text: &str) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len());
    let mut bytes = text.bytes();
    while let Some(byte) = bytes.next() {
        if byte == b'%' {
            let high = char::from(bytes.next()?).to_digit(16)?;
            let low = char::from(bytes.next()?).to_digit(16)?;
            out.push((high * 16 + low) as u8);
        } else {
            out.push(byte);
        }
    }
    Some(out)
}

/// Decodes a base64 payload; with or without padding, `None` where it is not base64.
pub(super) fn decode_base64(payload: &str) -> Option<Vec<u8>> {
    let config = GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true);
    GeneralPurpose::new(&alphabet::STANDARD, config).decode(payload).ok()
}

/// Opens a relative path below `folder`, which the text check passed; returns the file and its length.
pub(super) fn open_below(
    folder: &Path,
    relative: &Path,
) -> std::result::Result<(File, u64, PathBuf), Refusal> {
    let wanted = folder.join(relative);
    let missing = |e: std::io::Error| Refusal::Missing(wanted.clone(), reason(&e));
    let base = folder.canonicalize().map_err(missing)?;
    let real = wanted.canonicalize().map_err(missing)?;
    if !real.starts_with(&base) {
        return Err(Refusal::Forbidden(format!(
            "`{}` is a link that leaves the scene's folder; copy the file into it",
            relative.display()
        )));
    }
    // Before opening: opening a pipe would wait for its other end.
    let metadata = real.metadata().map_err(missing)?;
    if !metadata.is_file() {
        return Err(Refusal::Forbidden(format!("`{}` is not a regular file", relative.display())));
    }
    let file = File::open(&real).map_err(missing)?;
    Ok((file, metadata.len(), real))
}

/// The system's reason in words that do not repeat its number.
pub(super) fn reason(error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound => "no such file".into(),
        std::io::ErrorKind::PermissionDenied => "permission denied".into(),
        _ => error.to_string(),
    }
}

/// Reads an input file given by the user; refuses what is not a regular file.
pub(super) fn read_input(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let input = |what: String| Error::Input { path: path.into(), what };
    let metadata = path.metadata().map_err(|e| input(reason(&e)))?;
    if metadata.is_dir() {
        return Err(input("is a folder; give the file in it".into()));
    }
    if !metadata.is_file() {
        return Err(input("is not a regular file".into()));
    }
    if metadata.len() > limit {
        return Err(Error::OutOfMemory(format!(
            "{}: {} bytes are more than the memory limit of {limit}",
            path.display(),
            metadata.len()
        )));
    }
    std::fs::read(path).map_err(|e| input(reason(&e)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_file(uri: &str, expected: &str) -> bool {
        matches!(parse(uri), Ok(Target::File(p)) if p == Path::new(expected))
    }

    #[test]
    fn accepts_relative_paths_and_decodes_escapes() {
        assert!(is_file("a.bin", "a.bin"));
        assert!(is_file("textures/wood%20floor.png", "textures/wood floor.png"));
        assert!(is_file("./t%C3%A4fer.png", "./täfer.png"));
        assert!(is_file("a..b/..c", "a..b/..c"));
    }

    #[test]
    fn refuses_everything_that_could_leave_the_folder() {
        let bad = [
            "",
            "../x",
            "a/../../x",
            "a/..",
            "/etc/passwd",
            "//host/x",
            "file:x",
            "file:///x",
            "http://x/y",
            "%2e%2e/x",
            "%2E%2E%2Fx",
            "%2fetc",
            "a/%2e%2e/%2e%2e/x",
            "%FF",
            "%",
            "%4",
            "%zz",
            "a%00b",
            "a\0b",
            "C:\\x",
            "C:x",
            "..\\x",
            "a%5c..%5cx",
            "a\nb",
            "data:x",
        ];
        for uri in bad {
            assert!(parse(uri).is_err(), "{uri:?} was accepted");
        }
    }

    #[test]
    fn data_uris_decode_with_and_without_padding() {
        for uri in
            ["data:application/octet-stream;base64,AAECAw==", "data:;base64,AAECAw", "DATA:;BASE64,AAECAw=="]
        {
            let Ok(Target::Data { payload, is_base64: true }) = parse(uri) else {
                panic!("{uri} is not data")
            };
            assert_eq!(decode_base64(payload), Some(vec![0, 1, 2, 3]));
        }
        assert_eq!(decode_base64("A*=="), None);
    }
}
