//! Values as people type them.

use std::path::{Component, Path, PathBuf};

/// 0/1, true/false, yes/no, on/off.
pub(crate) fn boolean(text: &str) -> Result<bool, String> {
    match text.to_ascii_lowercase().as_str() {
        "1" | "true" | "yes" | "on" => Ok(true),
        "0" | "false" | "no" | "off" => Ok(false),
        _ => Err("expected one of 0, 1, true, false, yes, no, on, off".to_owned()),
    }
}

/// A number of bytes: 4G, 512M, 1.5GiB.
pub(crate) fn bytes(text: &str) -> Result<u64, String> {
    let refusal = || "expected a number and a unit, 4G or 512M".to_owned();
    let text = text.trim().to_ascii_uppercase();
    let end = text.find(|c: char| !(c.is_ascii_digit() || c == '.')).ok_or_else(refusal)?;
    let shift = match text[end..].trim_start().trim_end_matches('B').trim_end_matches('I') {
        "K" => 10,
        "M" => 20,
        "G" => 30,
        "T" => 40,
        _ => return Err(refusal()),
    };
    let number: f64 = text[..end].parse().map_err(|_| refusal())?;
    let bytes =
        number * f64::from(1u32 << (shift % 30)) * if shift < 30 { 1.0 } else { f64::from(1u32 << 30) };
    if (1.0..1e18).contains(&bytes) { Ok(bytes as u64) } else { Err(refusal()) }
}

/// Two numbers separated by a comma.
pub(crate) fn range(text: &str) -> Result<(f32, f32), String> {
    let refusal = || "expected two numbers separated by a comma, 4,9.5".to_owned();
    let (low, high) = text.split_once(',').ok_or_else(refusal)?;
    let number = |text: &str| text.trim().parse().ok().filter(|v: &f32| v.is_finite()).ok_or_else(refusal);
    Ok((number(low)?, number(high)?))
}

/// Three finite numbers separated by commas.
pub(crate) fn offset(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|part| part.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    let offset = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
    offset.ok_or_else(|| "expected three numbers separated by commas, 500000,5200000,0".to_owned())
}

/// A path as OpenMVS's tools take it: surrounding double quotes are dropped, backslashes are slashes.
pub(crate) fn openmvs_path(typed: &Path) -> PathBuf {
    match typed.to_str() {
        Some(text) => PathBuf::from(text.trim_matches('"').replace('\\', "/")),
        None => typed.to_owned(),
    }
}

/// `path` as given when absolute, else under `base`; `.` and `a/..` are resolved by name.
pub(crate) fn under(base: &Path, path: &Path) -> PathBuf {
    simplify(&base.join(path))
}

fn simplify(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if matches!(out.components().next_back(), Some(Component::Normal(_))) => {
                out.pop();
            }
            other => out.push(other),
        }
    }
    if out.as_os_str().is_empty() { PathBuf::from(".") } else { out }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn booleans_have_four_spellings_each() {
        for (text, value) in [("1", true), ("TRUE", true), ("Yes", true), ("on", true)] {
            assert_eq!(boolean(text), Ok(value));
        }
        for text in ["0", "false", "no", "OFF"] {
            assert_eq!(boolean(text), Ok(false));
        }
        assert!(boolean("2").is_err());
        assert!(boolean("").is_err());
    }

    #[test]
    fn sizes_have_a_unit() {
        for (text, value) in
            [("4G", 4 << 30), ("512m", 512 << 20), ("1.5 GiB", 3 << 29), ("2TB", 2 << 40), ("64K", 65536)]
        {
            assert_eq!(bytes(text), Ok(value), "{text}");
        }
        for text in ["", "4", "G", "-4G", "4X", "1..5G", "0G", "nan", "9999999999T"] {
            assert!(bytes(text).is_err(), "{text}");
        }
    }

    #[test]
    fn offsets_are_three_numbers() {
        assert_eq!(offset("500000.5, -2,0"), Ok([500_000.5, -2.0, 0.0]));
        for text in ["", "1,2", "1,2,3,4", "1,2,x", "1,2,inf", "1 2 3"] {
            assert!(offset(text).is_err(), "{text}");
        }
    }

    #[test]
    fn ranges_are_two_numbers() {
        assert_eq!(range("4, 9.5"), Ok((4.0, 9.5)));
        for text in ["", "1", "1,2,3", "1,x", "1,inf"] {
            assert!(range(text).is_err(), "{text}");
        }
    }

    #[test]
    fn quotes_and_backslashes_are_cleaned() {
        assert_eq!(openmvs_path(Path::new("\"a\\b c\"")), Path::new("a/b c"));
    }

    #[test]
    fn relative_paths_go_under_the_working_folder() {
        assert_eq!(under(Path::new("/w"), Path::new("./a/../b.mvs")), Path::new("/w/b.mvs"));
        assert_eq!(under(Path::new("/w"), Path::new("/b.mvs")), Path::new("/b.mvs"));
        assert_eq!(under(Path::new(""), Path::new("./b.mvs")), Path::new("b.mvs"));
        assert_eq!(under(Path::new(""), Path::new("../b.mvs")), Path::new("../b.mvs"));
        assert_eq!(under(Path::new(""), Path::new("..")), Path::new(".."));
        assert_eq!(under(Path::new(""), Path::new(".")), Path::new("."));
    }
}
