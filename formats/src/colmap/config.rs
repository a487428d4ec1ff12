//! Which images the dense stage estimates and fuses (`patch-match.cfg`, `fusion.cfg`).

use crate::{Error, Result};

/// Sources chosen where the file gives no number.
const DEFAULT_SOURCES: u32 = 20;

/// An image to be estimated.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PatchMatchEntry {
    /// Name of the reference image, relative to the image folder.
    pub image: String,
    /// What it is matched with.
    pub sources: PatchMatchSources,
}

/// The source images of a reference image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PatchMatchSources {
    /// `__auto__, n`: the n images that share most points.
    Auto(u32),
    /// `__all__`: all other images.
    All,
    /// These images.
    Named(Vec<String>),
}

/// Reads the text of a `patch-match.cfg`.
///
/// # Errors
/// [`Error::Format`] for a reference image without a line of sources or a number that is none.
pub fn parse_patch_match_config(text: &str) -> Result<Vec<PatchMatchEntry>> {
    let mut lines = entries(text);
    let mut out = Vec::new();
    while let Some((number, image)) = lines.next() {
        let Some((_, sources)) = lines.next() else {
            return Err(broken(number, format!("no line of sources follows image \"{image}\"")));
        };
        let mut words = sources.split([',', ';']).map(str::trim).filter(|w| !w.is_empty());
        let sources = match words.clone().next() {
            Some("__all__") => PatchMatchSources::All,
            Some("__auto__") => match words.nth(1) {
                None => PatchMatchSources::Auto(DEFAULT_SOURCES),
                Some(n) => PatchMatchSources::Auto(
                    n.parse()
                        .map_err(|_| broken(number + 1, format!("\"{n}\" is not a number of sources")))?,
                ),
            },
            _ => PatchMatchSources::Named(words.map(str::to_owned).collect()),
        };
        out.push(PatchMatchEntry { image: image.to_owned(), sources });
    }
    Ok(out)
}

/// The text of a `patch-match.cfg`.
pub fn patch_match_config(entries: &[PatchMatchEntry]) -> String {
    let sources = |s: &PatchMatchSources| match s {
        PatchMatchSources::Auto(n) => format!("__auto__, {n}"),
        PatchMatchSources::All => "__all__".to_owned(),
        PatchMatchSources::Named(names) => names.join(", "),
    };
    entries.iter().map(|e| format!("{}\n{}\n", e.image, sources(&e.sources))).collect()
}

/// Reads the text of a `fusion.cfg`: one image name per line.
pub fn parse_fusion_config(text: &str) -> Vec<String> {
    entries(text).map(|(_, name)| name.to_owned()).collect()
}

/// The text of a `fusion.cfg`.
pub fn fusion_config<S: AsRef<str>>(names: &[S]) -> String {
    names.iter().map(|name| format!("{}\n", name.as_ref())).collect()
}

/// Trimmed lines that are neither empty nor comments, with their numbers.
fn entries(text: &str) -> impl Iterator<Item = (u64, &str)> {
    (1..).zip(text.lines().map(str::trim)).filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

fn broken(line: u64, what: String) -> Error {
    Error::Format { offset: 0, field: format!("line {line}"), what }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_sources_is_understood_and_written_back() {
        let text = "# comment\n a/1.jpg \n__auto__, 7\n\n2.jpg\n__all__\r\n3.jpg\n1.jpg; 2.jpg,a b.jpg\n4.jpg\n__auto__\n";
        let parsed = parse_patch_match_config(text).unwrap();
        let named = |names: &[&str]| PatchMatchSources::Named(names.iter().map(|&n| n.to_owned()).collect());
        let expected = [
            ("a/1.jpg", PatchMatchSources::Auto(7)),
            ("2.jpg", PatchMatchSources::All),
            ("3.jpg", named(&["1.jpg", "2.jpg", "a b.jpg"])),
            ("4.jpg", PatchMatchSources::Auto(20)),
        ];
        let expected = expected.map(|(image, sources)| PatchMatchEntry { image: image.to_owned(), sources });
        assert_eq!(parsed, expected);
        assert_eq!(parse_patch_match_config(&patch_match_config(&parsed)).unwrap(), parsed);
        assert!(parse_patch_match_config("1.jpg\n").unwrap_err().to_string().contains("1.jpg"));
        assert!(parse_patch_match_config("1.jpg\n__auto__, x\n").is_err());
    }

    #[test]
    fn fusion_lists_are_one_name_per_line() {
        assert_eq!(parse_fusion_config("#x\n a.jpg\n\nb/c.jpg\n"), ["a.jpg", "b/c.jpg"]);
        assert_eq!(fusion_config(&["a.jpg", "b/c.jpg"]), "a.jpg\nb/c.jpg\n");
    }
}
