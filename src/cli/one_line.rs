//! Messages in one line, fit for a terminal.

/// Longest message, in characters.
const MOST: usize = 4000;

/// `text` with its control characters, which may come from a file, spelled out, and cut where it is too long.
pub(crate) fn printable(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for (i, c) in text.chars().enumerate() {
        match c {
            _ if i == MOST => {
                out.push_str("...");
                break;
            }
            c if c.is_control() => out.extend(c.escape_debug()),
            c => out.push(c),
        }
    }
    out
}

/// The message of `error` without usage and pointers to help.
pub(crate) fn one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let parts: Vec<&str> = text
        .lines()
        .take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more information"))
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .collect();
    let text = parts.join(" ");
    plainer(text.strip_prefix("error: ").unwrap_or(&text))
}

/// The same with the tips of the reader of options as questions, and its words for numbers as ours.
fn plainer(text: &str) -> String {
    // It proposes to pass "-2" as a file name.
    let text = text.split(" tip: to pass ").next().unwrap_or_default();
    let similar = [
        " tip: a similar argument exists: ",
        " tip: a similar subcommand exists: ",
        " tip: a similar value exists: ",
    ];
    let question = similar.iter().find_map(|tip| {
        let (before, name) = text.split_once(tip)?;
        Some(format!("{before}; did you mean {}?", name.trim_matches('\'')))
    });
    let text = question.unwrap_or_else(|| text.to_owned());
    text.replace(": invalid digit found in string", ": give a whole number, not below 0")
        .replace(": invalid float literal", ": give a number")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_are_asked_about_and_numbers_explained() {
        let command = || {
            clap::Command::new("p")
                .arg(clap::arg!(--quality <Q>))
                .arg(clap::arg!(--threads <N>).value_parser(clap::value_parser!(u32)))
        };
        let said = |words: &[&str]| one_line(&command().try_get_matches_from(words).unwrap_err());
        assert_eq!(
            said(&["p", "--qualty", "x"]),
            "unexpected argument '--qualty' found; did you mean --quality?"
        );
        assert_eq!(said(&["p", "--threads", "-2"]), "unexpected argument '-2' found");
        let number = "invalid value 'x' for '--threads <N>': give a whole number, not below 0";
        assert_eq!(said(&["p", "--threads", "x"]), number);
    }

    #[test]
    fn what_a_terminal_would_obey_is_spelled_out() {
        assert_eq!(printable("a\u{1b}[2Jb\r\n\u{9b}é \\"), "a\\u{1b}[2Jb\\r\\n\\u{9b}é \\");
        assert_eq!(printable(&"x".repeat(MOST + 1)), "x".repeat(MOST) + "...");
    }
}
