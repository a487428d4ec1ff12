//! Splits a command line into options and values by the rules of boost::program_options.

use std::ffi::{OsStr, OsString};

/// An option that may be typed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Known {
    /// Long name without dashes.
    pub(crate) long: String,
    /// Short name.
    pub(crate) short: Option<char>,
    /// Whether a value follows.
    pub(crate) takes_value: bool,
    /// Whether OpenMVS has it too: when a prefix fits several, OpenMVS's options go first.
    pub(crate) openmvs: bool,
}

/// An option that was typed: its long name and value. Flags have no value.
pub(crate) type Typed = (String, Option<OsString>);

/// Options in the order typed. Values without a name belong to `positional`.
///
/// # Errors
/// One line that names the option.
pub(crate) fn split(args: &[OsString], known: &[Known], positional: &str) -> Result<Vec<Typed>, String> {
    let mut typed: Vec<Typed> = Vec::new();
    let mut rest = args.iter().peekable();
    let mut only_positional = false;
    while let Some(arg) = rest.next() {
        let text = arg.to_string_lossy();
        if only_positional || !text.starts_with('-') || text == "-" {
            typed.push((positional.to_owned(), Some(arg.clone())));
            continue;
        }
        if text == "--" {
            only_positional = true;
            continue;
        }
        let (option, attached) = match text.strip_prefix("--") {
            Some(name) => long_option(arg, name, known)?,
            None => short_option(arg, &text, known)?,
        };
        let value = match (option.takes_value, attached) {
            (false, None) => None,
            (false, Some(_)) => {
                return Err(format!("option '--{}' does not take any arguments", option.long));
            }
            (true, Some(value)) => Some(value),
            (true, None) => match rest.next_if(|next| !is_option(next, known)) {
                Some(value) => Some(value.clone()),
                None => {
                    return Err(format!("the required argument for option '--{}' is missing", option.long));
                }
            },
        };
        typed.push((option.long.clone(), value));
    }
    once_each(&typed)?;
    Ok(typed)
}

fn once_each(typed: &[Typed]) -> Result<(), String> {
    for (i, (name, _)) in typed.iter().enumerate() {
        if typed[..i].iter().any(|(earlier, _)| earlier == name) {
            return Err(format!("option '--{name}' cannot be specified more than once"));
        }
    }
    Ok(())
}

/// The option that `name` names: itself, or the only one that starts so.
///
/// # Errors
/// No option or several start so.
pub(crate) fn find<'a>(name: &str, known: &'a [Known]) -> Result<&'a Known, String> {
    if let Some(exact) = known.iter().find(|k| k.long == name) {
        return Ok(exact);
    }
    for openmvs in [true, false] {
        let fitting: Vec<&Known> = known
            .iter()
            .filter(|k| k.openmvs == openmvs && !name.is_empty() && k.long.starts_with(name))
            .collect();
        match fitting.as_slice() {
            [] => {}
            [one] => return Ok(one),
            many => {
                let names: Vec<String> = many.iter().map(|k| format!("'--{}'", k.long)).collect();
                return Err(format!("option '--{name}' is ambiguous and matches {}", names.join(", ")));
            }
        }
    }
    Err(format!("unrecognised option '--{name}'"))
}

fn long_option<'a>(
    arg: &OsStr,
    name: &str,
    known: &'a [Known],
) -> Result<(&'a Known, Option<OsString>), String> {
    match name.split_once('=') {
        None => Ok((find(name, known)?, None)),
        Some((name, "")) => {
            let option = find(name, known)?;
            Err(format!(
                "the argument for option '--{}' should follow immediately after the equal sign",
                option.long
            ))
        }
        Some((name, _)) => Ok((find(name, known)?, Some(after(arg, "--".len() + name.len() + 1)?))),
    }
}

fn short_option<'a>(
    arg: &OsStr,
    text: &str,
    known: &'a [Known],
) -> Result<(&'a Known, Option<OsString>), String> {
    let letter = text.chars().nth(1).unwrap_or('-');
    let option = known
        .iter()
        .find(|k| k.short == Some(letter))
        .ok_or_else(|| format!("unrecognised option '{text}'"))?;
    let start = 1 + letter.len_utf8();
    let attached = if text.len() > start { Some(after(arg, start)?) } else { None };
    Ok((option, attached))
}

/// Whether `next` can only be an option, so that it is not taken as a value: `-5` and `-x=1` are values.
fn is_option(next: &OsStr, known: &[Known]) -> bool {
    let text = next.to_string_lossy();
    match text.strip_prefix("--") {
        Some(name) => {
            let name = name.split_once('=').map_or(name, |(name, _)| name);
            known.iter().any(|k| k.long == name)
        }
        None => text.strip_prefix('-').is_some_and(|letter| {
            let mut letters = letter.chars();
            let first = letters.next();
            letters.next().is_none() && known.iter().any(|k| k.short.is_some() && k.short == first)
        }),
    }
}

/// The part of `arg` from byte `start`; the bytes before are ASCII or valid text.
fn after(arg: &OsStr, start: usize) -> Result<OsString, String> {
    if let Some(text) = arg.to_str() {
        return Ok(OsString::from(&text[start..]));
    }
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;
        Ok(OsStr::from_bytes(&arg.as_bytes()[start..]).to_owned())
    }
    #[cfg(not(unix))]
    Err(format!("'{}' is not valid Unicode: pass the value as an argument of its own", arg.to_string_lossy()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known() -> Vec<Known> {
        let option = |long: &str, short, takes_value, openmvs| Known {
            long: long.to_owned(),
            short,
            takes_value,
            openmvs,
        };
        vec![
            option("help", Some('h'), false, true),
            option("working-folder", Some('w'), true, true),
            option("input-file", Some('i'), true, true),
            option("config-file", Some('c'), true, true),
            option("number-views", None, true, true),
            option("number-views-fuse", None, true, true),
            option("fusion-mode", None, true, true),
            option("color-by-label", None, false, false),
            option("classes", None, true, false),
            option("class-table", None, true, false),
        ]
    }

    fn parse(args: &[&str]) -> Result<Vec<(String, Option<String>)>, String> {
        let args: Vec<OsString> = args.iter().map(OsString::from).collect();
        let typed = split(&args, &known(), "input-file")?;
        Ok(typed.into_iter().map(|(n, v)| (n, v.map(|v| v.into_string().unwrap()))).collect())
    }

    fn one(args: &[&str]) -> (String, Option<String>) {
        let typed = parse(args).unwrap();
        assert_eq!(typed.len(), 1, "{typed:?}");
        typed.into_iter().next().unwrap()
    }

    #[test]
    fn values_are_attached_or_follow() {
        let expected = ("working-folder".to_owned(), Some("d".to_owned()));
        for args in [
            &["--working-folder", "d"][..],
            &["--working-folder=d"],
            &["-w", "d"],
            &["-wd"],
            &["--work", "d"],
            &["--w=d"],
        ] {
            assert_eq!(one(args), expected, "{args:?}");
        }
    }

    #[test]
    fn negative_numbers_are_values() {
        for args in [&["--fusion-mode", "-1"][..], &["--fusion-mode=-1"], &["--fus", "-1"]] {
            assert_eq!(one(args).1.as_deref(), Some("-1"), "{args:?}");
        }
    }

    #[test]
    fn quotes_and_equal_signs_stay_in_values() {
        assert_eq!(one(&["-w", "\"a b\""]).1.as_deref(), Some("\"a b\""));
        assert_eq!(one(&["--working-folder=a=b"]).1.as_deref(), Some("a=b"));
    }

    #[test]
    fn the_positional_argument_is_the_input_once() {
        assert_eq!(one(&["s.mvs"]), ("input-file".into(), Some("s.mvs".into())));
        assert_eq!(one(&["--", "--odd"]), ("input-file".into(), Some("--odd".into())));
        for twice in [&["a", "b"][..], &["-i", "a", "b"]] {
            assert_eq!(
                parse(twice).unwrap_err(),
                "option '--input-file' cannot be specified more than once",
                "{twice:?}"
            );
        }
    }

    #[test]
    fn an_exact_name_beats_longer_ones_and_openmvs_beats_ours() {
        assert_eq!(one(&["--number-views", "3"]).0, "number-views");
        assert_eq!(one(&["--number-views-f", "3"]).0, "number-views-fuse");
        assert_eq!(one(&["--co", "x"]).0, "config-file");
        assert_eq!(one(&["--col"]).0, "color-by-label");
        assert_eq!(
            parse(&["--number", "3"]).unwrap_err(),
            "option '--number' is ambiguous and matches '--number-views', '--number-views-fuse'"
        );
        assert_eq!(
            parse(&["--class", "3"]).unwrap_err(),
            "option '--class' is ambiguous and matches '--classes', '--class-table'"
        );
    }

    #[test]
    fn mistakes_name_the_option() {
        assert_eq!(parse(&["--nope", "1"]).unwrap_err(), "unrecognised option '--nope'");
        assert_eq!(parse(&["-z"]).unwrap_err(), "unrecognised option '-z'");
        assert_eq!(
            parse(&["-w"]).unwrap_err(),
            "the required argument for option '--working-folder' is missing"
        );
        assert_eq!(
            parse(&["--fusion-mode", "--number-views", "2"]).unwrap_err(),
            "the required argument for option '--fusion-mode' is missing"
        );
        assert_eq!(parse(&["--help=1"]).unwrap_err(), "option '--help' does not take any arguments");
        assert!(parse(&["--fusion-mode="]).unwrap_err().contains("'--fusion-mode'"));
    }
}
