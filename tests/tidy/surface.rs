//! What other programs may use, written down, so that a change of it is a decision.
//!
//! Public items are recognised by their text, which the layout of rustfmt makes reliable: a line that begins with `pub`, up to
//! where its body begins, and the variants of public enumerations.

use super::{collect, report};
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The part of a line that says what an item is, without its body.
fn heading(text: &str) -> &str {
    let is_field = !["fn", "struct", "enum", "trait", "const", "type", "use", "mod"].iter().any(|word| {
        text.starts_with(&format!("pub {word} ")) || text.starts_with(&format!("pub const {word} "))
    });
    let end = match text.split(' ').nth(1) {
        Some("use") => text.find(';'),
        _ if is_field && text.starts_with("pub ") => None,
        _ => text.find(" {").or(text.find(" = ")).or(text.strip_suffix(';').map(str::len)),
    };
    text[..end.unwrap_or(text.len())].trim_end_matches([',', ';'])
}

/// The public items of a file before its tests and the hidden door, a line each, those of a block under what the block is of.
fn items(path: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines =
        text.lines().take_while(|line| !["#[cfg(test)]", "#[doc(hidden)]"].contains(&line.trim()));
    let mut found = Vec::new();
    // The outermost block that is open: what it is of, and whether its lines without `pub` are public, too.
    let mut block: Option<(String, bool)> = None;
    while let Some(line) = lines.next() {
        let text = line.trim();
        if text.starts_with("//") || text.starts_with('#') || text.is_empty() {
            continue;
        }
        if line == "}" {
            block = None;
            continue;
        }
        let is_outer = !line.starts_with(' ');
        let is_public = text.starts_with("pub ");
        let is_member = !is_outer && block.as_ref().is_some_and(|(_, open)| *open) && !text.starts_with('}');
        let begins_block = is_outer && (text.starts_with("impl") || is_public);
        let mut whole = text.to_owned();
        // Signatures of several lines.
        while (begins_block || is_public) && !whole.ends_with(['{', ';', ',', '}', ']', ')'])
            || whole.ends_with('(')
        {
            let Some(next) = lines.next() else { break };
            whole.push_str(if whole.ends_with('(') { "" } else { " " });
            whole.push_str(next.trim());
            while whole.ends_with(',') && whole.matches('(').count() > whole.matches(')').count() {
                let Some(next) = lines.next() else { break };
                whole = format!("{} {}", whole, next.trim());
            }
        }
        if is_public || (is_member && !is_outer) {
            let owner =
                block.as_ref().filter(|_| !is_outer).map_or(String::new(), |(name, _)| format!("{name}: "));
            found.push(format!("{owner}{}", heading(&whole)));
        }
        if begins_block && whole.ends_with('{') {
            let open = whole.starts_with("pub enum") || whole.starts_with("pub trait");
            block = Some((heading(&whole).trim_start_matches("pub ").to_owned(), open));
        }
    }
    found
}

/// The public items of all files, each file under its name.
fn surface(files: &[PathBuf]) -> String {
    let mut text = String::new();
    for path in files {
        let items = items(path);
        if !items.is_empty() {
            text.push_str(&format!(
                "# {}\n{}\n",
                path.strip_prefix(root()).unwrap().display(),
                items.join("\n")
            ));
        }
    }
    text
}

fn pinned(name: &str, text: &str) {
    let path = root().join("tests/golden").join(name);
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(&path, text).unwrap();
    }
    let expected = std::fs::read_to_string(&path).unwrap_or_default();
    let gone =
        expected.lines().filter(|line| !text.lines().any(|l| l == *line)).map(|line| format!("- {line}"));
    let new =
        text.lines().filter(|line| !expected.lines().any(|l| l == *line)).map(|line| format!("+ {line}"));
    let changes: Vec<String> = gone.chain(new).collect();
    let hint =
        format!("{name}: public items have changed; UPDATE_GOLDEN=1 accepts it, CHANGELOG.md must say so");
    report(&if text == expected { Vec::new() } else { [vec![hint], changes].concat() });
}

fn files_of(folder: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    collect(&root().join(folder), &mut files);
    files.retain(|path| !path.to_string_lossy().ends_with("tests.rs"));
    files.sort();
    files
}

#[test]
fn the_public_items_of_semvs_are_those_written_down() {
    let mut files = vec![root().join("src/lib.rs"), root().join("src/error.rs")];
    files.extend(files_of("src/library"));
    let text = surface(&files);
    // Two enumerations come from inside; they may get values, but not lose any.
    let text = format!("{text}# enumerations\n{:?}\n{:?}\n", qualities(), consistencies());
    assert!(text.contains("impl DepthMap: pub fn read(path: impl AsRef<Path>) -> Result<Self>\n"), "{text}");
    assert!(text.contains("enum Error: Invalid(String)\n"), "{text}");
    pinned("public-items.txt", &text);
}

fn qualities() -> [semvs::Quality; 3] {
    [semvs::Quality::Draft, semvs::Quality::Normal, semvs::Quality::High]
}

fn consistencies() -> [semvs::Consistency; 3] {
    [semvs::Consistency::Off, semvs::Consistency::Support, semvs::Consistency::Strict]
}

#[test]
fn the_public_items_of_semvs_formats_are_those_written_down() {
    pinned("public-items-formats.txt", &surface(&files_of("formats/src")));
}

/// Modules of the library are private but for one door, which is hidden from the documentation.
#[test]
fn the_library_has_one_hidden_door() {
    let text = std::fs::read_to_string(root().join("src/lib.rs")).unwrap();
    let modules: Vec<&str> = text.lines().filter(|line| line.starts_with("pub mod ")).collect();
    assert_eq!(modules, ["pub mod internals {"]);
    assert!(text.contains("#[doc(hidden)]\npub mod internals {"));
}
