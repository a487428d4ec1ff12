//! Rules about the source itself: who may import whom, how long files are, what may not be written.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may")]

mod common;
#[path = "tidy/surface.rs"]
mod surface;

use std::path::{Path, PathBuf};

/// Longest file, tests not counted.
const MAX_LINES: usize = 400;

/// Module, and the modules it may import besides itself, `error` and `progress`.
const IMPORTS: &[(&str, &[&str])] = &[
    ("geometry", &[]),
    ("scene", &["geometry"]),
    ("semantics", &["geometry", "scene"]),
    ("stereo", &["geometry", "scene", "semantics"]),
    ("depth_filter", &["geometry", "scene", "semantics"]),
    ("fusion", &["geometry", "scene", "semantics"]),
    ("evaluate", &["geometry", "scene", "semantics"]),
    ("cloud_filter", &["geometry", "scene"]),
    ("sub_scenes", &["geometry", "scene"]),
    ("store", &["geometry", "scene", "semantics"]),
    ("report", &["evaluate", "scene", "semantics"]),
    (
        "pipeline",
        &[
            "geometry",
            "scene",
            "semantics",
            "stereo",
            "depth_filter",
            "fusion",
            "evaluate",
            "cloud_filter",
            "sub_scenes",
            "store",
            "report",
        ],
    ),
    (
        "cli",
        &[
            "pipeline",
            "scene",
            "semantics",
            "stereo",
            "depth_filter",
            "fusion",
            "evaluate",
            "store",
            "report",
        ],
    ),
    (
        "library",
        &[
            "pipeline",
            "geometry",
            "scene",
            "semantics",
            "stereo",
            "depth_filter",
            "fusion",
            "store",
            "report",
        ],
    ),
    ("error", &[]),
    ("progress", &["scene"]),
];

/// What may not be written outside tests, and the modules that may.
const FORBIDDEN: &[(&str, &[&str])] = &[
    (".unwrap()", &[]),
    (".expect(", &[]),
    ("panic!(", &[]),
    ("todo!(", &[]),
    ("unimplemented!(", &[]),
    ("dbg!(", &[]),
    ("println!(", &[]),
    ("eprintln!(", &[]),
    ("unsafe {", &["stereo", "cli"]),
];

/// Modules that never touch a file, the clock, the environment or the console.
const PURE: &[&str] = &[
    "geometry",
    "scene",
    "semantics",
    "stereo",
    "depth_filter",
    "fusion",
    "evaluate",
    "cloud_filter",
    "sub_scenes",
];

/// What touches them.
const IMPURE: &[&str] =
    &["std::fs", "File::open", "File::create", "Instant::now", "SystemTime", "std::env", "stdout("];

struct Source {
    path: PathBuf,
    /// Module directly under `src/`; "formats" for that crate.
    module: String,
    /// Lines before the tests, comments emptied.
    code: Vec<String>,
}

fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = Vec::new();
    for (folder, fixed) in [(root.join("src"), None), (root.join("formats/src"), Some("formats"))] {
        let mut files = Vec::new();
        collect(&folder, &mut files);
        for path in files {
            let relative = path.strip_prefix(&folder).unwrap().to_path_buf();
            let is_test =
                |part: &std::ffi::OsStr| part == "tests" || part.to_string_lossy().ends_with("tests.rs");
            if relative.iter().any(is_test) {
                continue;
            }
            let first = relative.iter().next().unwrap().to_string_lossy().into_owned();
            let first = if first == "bin" { "main".to_owned() } else { first };
            let module = fixed.map_or(first.trim_end_matches(".rs").to_owned(), str::to_owned);
            let text = std::fs::read_to_string(&path).unwrap();
            let code = text
                .lines()
                .take_while(|line| line.trim() != "#[cfg(test)]")
                .map(|line| if line.trim_start().starts_with("//") { String::new() } else { line.to_owned() })
                .collect();
            found.push(Source { path, module, code });
        }
    }
    assert!(found.len() > 10);
    found
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
}

fn report(problems: &[String]) {
    assert!(problems.is_empty(), "\n{}\n", problems.join("\n"));
}

/// Names of the modules that a line of code takes from this crate.
fn imported(line: &str) -> Vec<String> {
    line.split("crate::")
        .skip(1)
        .flat_map(|rest| match rest.strip_prefix('{') {
            Some(list) => list.split('}').next().unwrap_or_default().split(',').collect(),
            None => vec![rest],
        })
        .map(|part| part.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>())
        .filter(|name| name.starts_with(char::is_lowercase))
        .collect()
}

#[test]
fn modules_import_only_what_the_table_allows() {
    let mut problems = Vec::new();
    for source in sources() {
        let Some((_, allowed)) = IMPORTS.iter().find(|(module, _)| *module == source.module) else {
            continue;
        };
        for (i, line) in source.code.iter().enumerate() {
            if line.trim_end().ends_with("crate::{") {
                problems.push(format!("{}:{}: a line per module, please", source.path.display(), i + 1));
            }
            for name in imported(line) {
                let known = IMPORTS.iter().any(|(module, _)| *module == name);
                let fine = name == source.module
                    || ["error", "progress"].contains(&name.as_str())
                    || allowed.contains(&name.as_str());
                if known && !fine {
                    problems.push(format!(
                        "{}:{}: {} imports {name}",
                        source.path.display(),
                        i + 1,
                        source.module
                    ));
                }
            }
        }
    }
    report(&problems);
}

#[test]
fn every_module_has_a_row_in_the_table() {
    let mut problems = Vec::new();
    for source in sources() {
        let module = source.module.as_str();
        if !["formats", "main", "lib"].contains(&module) && IMPORTS.iter().all(|(known, _)| *known != module)
        {
            problems.push(format!("{}: no row for {module}", source.path.display()));
        }
    }
    report(&problems);
}

fn page(name: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs").join(name)).unwrap()
}

#[test]
fn the_architecture_page_has_the_same_table() {
    let page = page("ARCHITECTURE.md");
    let cells = |line: &str| line.split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>();
    let rows: Vec<Vec<String>> = page.lines().filter(|line| line.starts_with("| ")).map(cells).collect();
    let mut problems = Vec::new();
    for (module, allowed) in
        IMPORTS.iter().filter(|(module, _)| !["cli", "library", "error", "progress"].contains(module))
    {
        let row = rows.iter().find(|row| row[1].split(", ").any(|name| name == *module));
        let stated = row.map(|row| row[2].as_str()).unwrap_or_default();
        let mut names: Vec<&str> =
            stated.split(", ").filter(|n| !["nothing", "formats"].contains(n)).collect();
        let mut allowed = allowed.to_vec();
        names.sort_unstable();
        allowed.sort_unstable();
        let all = stated == "all of these" && allowed.len() + 5 == IMPORTS.len();
        if names != allowed && !all {
            problems.push(format!(
                "docs/ARCHITECTURE.md: {module} may import {allowed:?}, the page says {stated:?}"
            ));
        }
    }
    report(&problems);
}

#[test]
fn the_architecture_page_knows_the_tree() {
    let page = page("ARCHITECTURE.md");
    let layout = page.split("```").nth(1).unwrap();
    let words: Vec<&str> = layout.split([' ', '\n']).filter(|word| !word.is_empty()).collect();
    let files = sources();
    let mut problems = Vec::new();
    for (module, _) in IMPORTS {
        if !words.contains(&format!("{module}/").as_str())
            && !words.contains(&format!("{module}.rs").as_str())
        {
            problems.push(format!("docs/ARCHITECTURE.md: no line for {module}"));
        }
    }
    let is_there = |word: &str| {
        let (word, root) = (word.trim_end_matches([',', ';']), Path::new(env!("CARGO_MANIFEST_DIR")));
        files.iter().any(|file| file.path.ends_with(word)) || root.join("formats").join(word).exists()
    };
    let tests = ["tidy.rs", "hostile.rs"];
    for word in words.iter().filter(|word| word.ends_with(".rs") && !tests.contains(word)) {
        if !is_there(word) {
            problems.push(format!("docs/ARCHITECTURE.md: there is no {word}"));
        }
    }
    // These two say of every file what it is for.
    for folder in ["src/pipeline", "src/cli"] {
        for file in files.iter().filter(|file| file.path.parent().unwrap().ends_with(folder)) {
            let name = file.path.file_name().unwrap().to_str().unwrap();
            if name != "mod.rs" && !words.contains(&name) {
                problems.push(format!("docs/ARCHITECTURE.md: no word about {folder}/{name}"));
            }
        }
    }
    report(&problems);
}

#[test]
fn files_are_short() {
    let problems: Vec<String> = sources()
        .iter()
        .filter(|source| source.code.len() > MAX_LINES)
        .map(|source| format!("{}: {} lines before the tests", source.path.display(), source.code.len()))
        .collect();
    report(&problems);
}

#[test]
fn nothing_forbidden_outside_tests() {
    let mut problems = Vec::new();
    for source in sources() {
        for (i, line) in source.code.iter().enumerate() {
            for (word, may) in FORBIDDEN {
                // A constant that cannot be computed does not compile.
                let is_constant = line.trim_start().starts_with("const ");
                if line.contains(word) && !is_constant && !may.contains(&source.module.as_str()) {
                    problems.push(format!("{}:{}: {word}", source.path.display(), i + 1));
                }
            }
            for word in IMPURE {
                if PURE.contains(&source.module.as_str()) && line.contains(word) {
                    problems.push(format!("{}:{}: {word}", source.path.display(), i + 1));
                }
            }
        }
    }
    report(&problems);
}

#[test]
fn every_option_of_the_drop_in_is_in_the_compatibility_page() {
    let page = page("COMPATIBILITY.md");
    let help = common::Scratch::new().run(common::DENSIFY, &["--help"]).stdout;
    let mut names: Vec<String> = help
        .lines()
        .filter_map(|line| {
            let at = line.find("--")?;
            let name: String =
                line[at + 2..].chars().take_while(|c| c.is_ascii_lowercase() || *c == '-').collect();
            line.starts_with("  -").then_some(name)
        })
        .collect();
    let hidden =
        ["mesh-file", "export-roi-file", "import-roi-file", "dense-config-file", "export-depth-maps-name"];
    names.extend(hidden.map(str::to_owned));
    assert!(names.len() > 45, "{names:?}");
    let problems: Vec<String> = names
        .iter()
        .filter(|name| !page.contains(&format!("`--{name}`")))
        .map(|name| format!("docs/COMPATIBILITY.md: no row for --{name}"))
        .collect();
    report(&problems);
}
