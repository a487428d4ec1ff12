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
    text.strip_prefix("error: ").unwrap_or(&text).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_would_obey_is_spelled_out() {
        assert_eq!(printable("a\u{1b}[2Jb\r\n\u{9b}é \\"), "a\\u{1b}[2Jb\\r\\n\\u{9b}é \\");
        assert_eq!(printable(&"x".repeat(MOST + 1)), "x".repeat(MOST) + "...");
    }
}
