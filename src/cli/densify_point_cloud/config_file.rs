//! `DensifyPointCloud.cfg`: options in a file, one `name = value` per line, `#` comments.

use super::args::GENERIC;
use super::tokens::{Known, Typed};
use std::ffi::OsString;
use std::path::Path;

/// The options in the file at `path` that the command line did not give; nothing when there is no such file.
///
/// # Errors
/// One line with file and line number: unreadable file, a line that is no assignment, an option that is
/// unknown, given twice, or for the command line only.
pub(crate) fn read(path: &Path, known: &[Known]) -> Result<Vec<Typed>, String> {
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(format!("{}: cannot read: {error}", path.display())),
    };
    parse(&String::from_utf8_lossy(&bytes), known).map_err(|what| format!("{}: {what}", path.display()))
}

fn parse(text: &str, known: &[Known]) -> Result<Vec<Typed>, String> {
    let mut typed: Vec<Typed> = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let at = |what: String| format!("line {}: {what}", i + 1);
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let Some((name, value)) = line.split_once('=') else {
            return Err(at(format!("'{line}' is not of the form 'option = value'")));
        };
        let (name, value) = (name.trim(), value.trim());
        let option = known.iter().find(|k| k.long == name && !GENERIC.contains(&name));
        let Some(option) = option else {
            return Err(at(format!("unrecognised option '{name}'")));
        };
        if typed.iter().any(|(earlier, _)| earlier == name) {
            return Err(at(format!("option '{name}' cannot be specified more than once")));
        }
        if option.takes_value {
            typed.push((option.long.clone(), Some(OsString::from(value))));
        } else if crate::cli::values::boolean(value).map_err(|e| at(format!("option '{name}': {e}")))? {
            typed.push((option.long.clone(), None));
        }
    }
    Ok(typed)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known() -> Vec<Known> {
        crate::cli::densify_point_cloud::args::known()
    }

    #[test]
    fn assignments_comments_and_flags() {
        let text = "# comment\n\niters = 4 # four\nsplit-by-class=yes\ncolor-by-label = 0\nmask-path = a b\n";
        let typed = parse(text, &known()).unwrap();
        assert_eq!(
            typed,
            [
                ("iters".to_owned(), Some("4".into())),
                ("split-by-class".to_owned(), None),
                ("mask-path".to_owned(), Some("a b".into())),
            ]
        );
    }

    #[test]
    fn mistakes_name_line_and_option() {
        for (text, expected) in [
            ("\nverbosity = 1", "line 2: unrecognised option 'verbosity'"),
            ("nope = 1", "line 1: unrecognised option 'nope'"),
            ("ite = 1", "line 1: unrecognised option 'ite'"),
            ("iters", "line 1: 'iters' is not of the form 'option = value'"),
            ("iters = 1\niters = 2", "line 2: option 'iters' cannot be specified more than once"),
        ] {
            assert_eq!(parse(text, &known()).unwrap_err(), expected);
        }
    }

    #[test]
    fn a_missing_file_is_no_error() {
        assert_eq!(read(Path::new("/nonexistent/x.cfg"), &known()), Ok(Vec::new()));
    }
}
