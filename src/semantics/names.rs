//! Comparing class names as people type them.

/// The form in which names are compared: lower case, every run of spaces, `_` and `-` one `_`.
pub(crate) fn normalized(name: &str) -> String {
    let mut out = String::with_capacity(name.len());
    for c in name.trim().chars() {
        if c.is_whitespace() || c == '_' || c == '-' {
            if !out.ends_with('_') {
                out.push('_');
            }
        } else {
            out.extend(c.to_lowercase());
        }
    }
    out
}

/// The candidate with the fewest edits to `name`, if it takes few enough for a slip of the hand.
pub(crate) fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let name = normalized(name);
    let most = (name.chars().count() / 3).max(1);
    candidates
        .into_iter()
        .map(|candidate| (edit_distance(&name, &normalized(candidate)), candidate))
        .filter(|&(distance, _)| distance <= most)
        .min_by_key(|&(distance, _)| distance)
        .map(|(_, candidate)| candidate)
}

/// Insertions, deletions, substitutions and swaps of neighbours that turn `a` into `b` (optimal string alignment).
fn edit_distance(a: &str, b: &str) -> usize {
    let a: Vec<char> = a.chars().collect();
    let b: Vec<char> = b.chars().collect();
    let mut before_last = vec![0; b.len() + 1];
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 0..a.len() {
        let mut row = vec![i + 1; b.len() + 1];
        for j in 0..b.len() {
            let substituted = last[j] + usize::from(a[i] != b[j]);
            row[j + 1] = substituted.min(last[j + 1] + 1).min(row[j] + 1);
            if i > 0 && j > 0 && a[i] == b[j - 1] && a[i - 1] == b[j] {
                row[j + 1] = row[j + 1].min(before_last[j - 1] + 1);
            }
        }
        before_last = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn case_and_separators_do_not_matter() {
        assert_eq!(normalized(" Traffic  Light"), "traffic_light");
        assert_eq!(normalized("traffic-light"), normalized("TRAFFIC_LIGHT"));
        assert_ne!(normalized("car"), normalized("cart"));
    }

    #[test]
    fn edits_are_counted() {
        assert_eq!(edit_distance("window", "window"), 0);
        assert_eq!(edit_distance("widnow", "window"), 1);
        assert_eq!(edit_distance("windows", "window"), 1);
        assert_eq!(edit_distance("", "sky"), 3);
        assert_eq!(edit_distance("sky", "ski"), 1);
    }

    #[test]
    fn a_slip_has_a_suggestion_and_nonsense_has_none() {
        let names = ["building", "sky", "window"];
        assert_eq!(nearest("Buildng", names), Some("building"));
        assert_eq!(nearest("skies", names), None);
        assert_eq!(nearest("zebra", names), None);
    }
}
