//! The documentation: every link leads somewhere, every command runs, every message of the troubleshooting page exists.

use crate::common::{self, Scratch, facade6};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All pages, relative to the repository.
fn pages() -> Vec<PathBuf> {
    let mut pages = vec![PathBuf::from("README.md"), PathBuf::from("CHANGELOG.md")];
    let mut folders = vec![PathBuf::from("docs"), PathBuf::from("compat-fixtures")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(root().join(&folder)).unwrap() {
            let path = folder.join(entry.unwrap().file_name());
            if root().join(&path).is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "md") {
                pages.push(path);
            }
        }
    }
    pages.sort();
    assert!(pages.len() > 20, "{pages:?}");
    pages
}

fn text(page: &Path) -> String {
    std::fs::read_to_string(root().join(page)).unwrap_or_else(|e| panic!("{}: {e}", page.display()))
}

/// A fenced block.
struct Block {
    /// Line of the page, from 1, that opens it.
    line: usize,
    /// What follows the opening fence.
    info: String,
    lines: Vec<String>,
}

/// The blocks of a page, and its other lines with their numbers.
fn taken_apart(text: &str) -> (Vec<Block>, Vec<(usize, &str)>) {
    let (mut blocks, mut prose) = (Vec::new(), Vec::new());
    let mut open: Option<Block> = None;
    for (i, line) in text.lines().enumerate() {
        let fence = line.trim_start().strip_prefix("```");
        match (&mut open, fence) {
            (None, Some(info)) => {
                open = Some(Block { line: i + 1, info: info.trim().to_owned(), lines: Vec::new() });
            }
            (None, None) => prose.push((i + 1, line)),
            (Some(_), Some("")) => blocks.extend(open.take()),
            (Some(block), _) => block.lines.push(line.to_owned()),
        }
    }
    assert!(open.is_none(), "a block is not closed");
    (blocks, prose)
}

/// A line without its code spans, in which brackets mean nothing.
fn without_code(line: &str) -> String {
    line.split('`').step_by(2).collect::<Vec<_>>().join("`")
}

/// What `[text](target)`, `![text](target)` and `src="target"` name in a line.
fn targets(line: &str) -> Vec<String> {
    let line = without_code(line);
    let mut found = Vec::new();
    for (mark, end) in [("](", ')'), ("src=\"", '"'), ("href=\"", '"')] {
        for rest in line.split(mark).skip(1) {
            let target = rest.split(end).next().unwrap_or_default();
            found.push(target.split_whitespace().next().unwrap_or_default().to_owned());
        }
    }
    found
}

/// The anchors of a page, as GitHub makes them of its headings.
fn anchors(page: &str) -> Vec<String> {
    let mut count: BTreeMap<String, usize> = BTreeMap::new();
    let (_, prose) = taken_apart(page);
    let headings = prose.iter().filter(|(_, line)| line.starts_with('#'));
    headings
        .map(|(_, line)| {
            let title = line.trim_start_matches('#').trim();
            let title: String = title
                .split("](")
                .enumerate()
                .map(
                    |(i, part)| {
                        if i == 0 { part } else { part.split_once(')').map_or(part, |(_, rest)| rest) }
                    },
                )
                .collect();
            let slug: String = title
                .to_lowercase()
                .chars()
                .filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'))
                .map(|c| if c == ' ' { '-' } else { c })
                .collect();
            let seen = count.entry(slug.clone()).or_default();
            *seen += 1;
            if *seen == 1 { slug } else { format!("{slug}-{}", *seen - 1) }
        })
        .collect()
}

#[test]
fn every_link_leads_somewhere() {
    let (mut problems, mut inside, mut outside) = (String::new(), 0, 0);
    for page in pages() {
        let own = text(&page);
        for (line, prose) in taken_apart(&own).1 {
            for target in targets(prose) {
                if ["http://", "https://", "mailto:"].iter().any(|scheme| target.starts_with(scheme)) {
                    outside += 1;
                    continue;
                }
                inside += 1;
                let (file, anchor) =
                    target.split_once('#').map_or((target.as_str(), None), |(f, a)| (f, Some(a)));
                let path = match file {
                    "" => root().join(&page),
                    _ => root().join(&page).parent().unwrap().join(file),
                };
                let mut tell = |what: &str| {
                    let _ = writeln!(problems, "{}:{line}: {target}: {what}", page.display());
                };
                if !path.exists() {
                    tell("there is no such file");
                } else if let Some(anchor) = anchor {
                    let there = std::fs::read_to_string(&path).unwrap_or_default();
                    if !anchors(&there).iter().any(|known| known == anchor) {
                        tell("there is no such heading");
                    }
                }
            }
        }
    }
    println!("{inside} links within the repository lead somewhere, {outside} to elsewhere are not followed");
    assert!(problems.is_empty(), "\n{problems}");
    assert!(inside > 100, "{inside}");
}

#[test]
fn every_picture_and_page_is_linked() {
    let mut linked: Vec<PathBuf> = Vec::new();
    for page in pages() {
        let own = text(&page);
        for (_, prose) in taken_apart(&own).1 {
            let files =
                targets(prose).into_iter().map(|t| t.split('#').next().unwrap_or_default().to_owned());
            linked.extend(files.filter_map(|f| root().join(&page).parent()?.join(f).canonicalize().ok()));
        }
    }
    let images = std::fs::read_dir(root().join("docs/images")).unwrap().map(|entry| entry.unwrap().path());
    let docs = pages().into_iter().filter(|page| page.starts_with("docs")).map(|page| root().join(page));
    let alone: Vec<PathBuf> =
        images.chain(docs).filter(|path| !linked.contains(&path.canonicalize().unwrap())).collect();
    assert!(alone.is_empty(), "no page links to {alone:?}");
}

/// The command of the README that runs this test.
const ITSELF: &str = "cargo test --release --workspace";

/// How a block is to be taken.
enum Treatment {
    /// Its commands run.
    Run,
    /// They do not, for this reason.
    Marked(String),
    /// They run, and their output is compared, in the tests of `compare`.
    Elsewhere,
    /// It holds no commands.
    NoCommands,
}

/// Words that begin commands. A block without a tag must not begin with one.
const PROGRAMS: &[&str] = &[
    "semvs",
    "cargo",
    "DensifyPointCloud",
    "docker",
    "colmap",
    "git",
    "cd",
    "formats",
    "SEMVS_FUZZ_RUNS",
    "$",
    "PATH",
];

fn treatment(page: &Path, block: &Block) -> Treatment {
    let place = format!("{}:{}", page.display(), block.line);
    let (tag, rest) = block.info.split_once(' ').unwrap_or((&block.info, ""));
    match tag {
        "sh" if rest.is_empty() => Treatment::Run,
        "sh" => match rest.strip_prefix("no-run: ") {
            Some(reason) if reason.split_whitespace().count() > 1 => Treatment::Marked(reason.to_owned()),
            _ => {
                panic!("{place}: ```{}: a command block is ```sh, or ```sh no-run: with a reason", block.info)
            }
        },
        "console" => {
            assert!(
                page.ends_with("regression-testing.md"),
                "{place}: console blocks are tested on that page alone"
            );
            Treatment::Elsewhere
        }
        "" => {
            let first = block.lines.first().map(String::as_str).unwrap_or_default();
            let word: String =
                first.chars().take_while(|c| c.is_alphanumeric() || "_$".contains(*c)).collect();
            assert!(
                !PROGRAMS.contains(&word.as_str()),
                "{place}: commands belong into a block with the tag sh"
            );
            Treatment::NoCommands
        }
        "toml" | "json" | "text" | "python" | "rust" | "math" | "yaml" | "dockerfile" => {
            Treatment::NoCommands
        }
        other => {
            panic!("{place}: ```{other}: what is this? Known are sh, console, toml, json, text, python, ...")
        }
    }
}

/// The commands of a block: lines, joined where they end in a backslash, without comments.
fn commands(block: &Block) -> Vec<String> {
    let joined = block.lines.join("\n").replace("\\\n", " ");
    let lines = joined.lines().map(|line| line.split(" # ").next().unwrap_or_default().trim().to_owned());
    lines.filter(|line| !line.is_empty() && !line.starts_with('#')).collect()
}

/// The folder that a page's commands run in, with the names that the pages use: `scene.mvs` with `images/` and `labels/`,
/// `depthmaps/`, COLMAP's `dense/` (also as `colmap/dense/`) with depth maps, `masks/`, `truth.ply`, and the repository's fixtures.
#[cfg(unix)]
fn workplace() -> Scratch {
    let scratch = Scratch::facade6();
    std::os::unix::fs::symlink(common::fixtures(), scratch.path("compat-fixtures")).unwrap();
    scratch.add_maps("post7", "depthmaps");
    let copy = |from: &Path, to: &str| {
        std::fs::create_dir_all(scratch.path(to)).unwrap();
        for entry in std::fs::read_dir(from).unwrap() {
            let entry = entry.unwrap();
            std::fs::copy(entry.path(), scratch.path(to).join(entry.file_name())).unwrap();
        }
    };
    for dense in ["dense", "colmap/dense"] {
        copy(&facade6().join("images"), &format!("{dense}/images"));
        copy(&facade6().join("colmap-4.2/binary"), &format!("{dense}/sparse"));
    }
    scratch.semvs("export dense --to colmap --depth-maps depthmaps -o dense").ok();
    std::fs::copy(facade6().join("truth/truth.ply"), scratch.path("truth.ply")).unwrap();
    // Masks: 0 where the label maps have their most frequent value, as tools for masking photographs write them.
    std::fs::create_dir_all(scratch.path("masks")).unwrap();
    for name in ["0003", "0004", "0005", "0006", "0012", "0013"] {
        let labels = image::open(facade6().join(format!("labels/{name}_l.png"))).unwrap().to_rgb8();
        let mask = image::GrayImage::from_fn(labels.width(), labels.height(), |x, y| {
            let sky = labels.get_pixel(x, y).0 == [255, 255, 0];
            image::Luma([if sky { 0 } else { 255 }])
        });
        mask.save(scratch.path(&format!("masks/{name}.mask.png"))).unwrap();
    }
    // Where OpenDroneMap has its undistorted images.
    copy(&facade6().join("images"), "odm/opensfm/undistorted/images");
    scratch.semvs("import dense -o odm/opensfm/undistorted/openmvs/scene.mvs --image-path odm/opensfm/undistorted/images").ok();
    scratch
}

/// Runs a command in a shell that finds the programs; `cargo run --release --` stands for `semvs`.
#[cfg(unix)]
fn run(scratch: &Scratch, command: &str) -> common::Outcome {
    let programs = Path::new(common::SEMVS).parent().unwrap().display().to_string();
    let path = std::env::var("PATH").unwrap_or_default();
    let command = command.replace("cargo run --release -- ", "semvs ");
    scratch.run_with("sh", &["-eu", "-c", &command], &[("PATH", &format!("{programs}:{path}"))])
}

/// Every command of every page runs and ends with exit code 0, page by page and in order, unless its block says why it does not.
#[cfg(unix)]
#[test]
fn every_command_runs() {
    let (mut problems, mut marked, mut ran) = (String::new(), Vec::new(), 0);
    let start = std::time::Instant::now();
    for page in pages() {
        let own = text(&page);
        let mut scratch = None;
        for block in taken_apart(&own).0 {
            match treatment(&page, &block) {
                Treatment::NoCommands | Treatment::Elsewhere => {}
                Treatment::Marked(reason) => {
                    marked.push(format!(
                        "{}:{}: {} not run: {reason}",
                        page.display(),
                        block.line,
                        commands(&block).len()
                    ));
                }
                Treatment::Run => {
                    for command in commands(&block) {
                        if command == ITSELF {
                            marked.push(format!(
                                "{}:{}: {command} is what runs this test",
                                page.display(),
                                block.line
                            ));
                            continue;
                        }
                        let began = std::time::Instant::now();
                        let outcome = run(scratch.get_or_insert_with(workplace), &command);
                        let seconds = began.elapsed().as_secs_f64();
                        println!("{}:{}: {seconds:.1} s: {command}", page.display(), block.line);
                        ran += 1;
                        if outcome.code != Some(0) {
                            let _ = writeln!(
                                problems,
                                "{}:{}: {command}\nends with {:?}:\n{}{}",
                                page.display(),
                                block.line,
                                outcome.code,
                                outcome.stdout,
                                outcome.stderr
                            );
                        }
                    }
                }
            }
        }
    }
    marked.iter().for_each(|line| println!("{line}"));
    println!(
        "{ran} commands ran in {:.0} s, {} blocks are marked",
        start.elapsed().as_secs_f64(),
        marked.len()
    );
    assert!(problems.is_empty(), "\n{problems}");
    assert!(ran > 40, "{ran}");
}

/// Options of other programs that pages name.
const FOREIGN: &[&str] = &[
    "--PatchMatchStereo",
    "--bench",
    "--end-with",
    "--min-num-features",
    "--name",
    "--open",
    "--palette",
    "--path",
    "--pc-quality",
    "--release",
    "--test",
];

/// Options and commands that are named within a text exist: the help texts and the page about options list them.
#[test]
fn every_option_and_command_that_is_named_exists() {
    let golden = std::fs::read_dir(root().join("tests/golden")).unwrap();
    let mut listed: String =
        golden.map(|entry| std::fs::read_to_string(entry.unwrap().path()).unwrap()).collect();
    listed.push_str(&text(Path::new("docs/reference/options.md")));
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '-';
    let options = |text: &str| -> Vec<String> {
        let starts = text.match_indices("--").filter(|(at, _)| !text[..*at].ends_with(is_part));
        let words = starts.map(|(at, _)| text[at..].chars().take_while(|c| is_part(*c)).collect::<String>());
        words.filter(|word| word.len() > 3).collect()
    };
    let known = options(&listed);
    let (mut problems, mut named) = (String::new(), 0);
    for page in pages() {
        let own = text(&page);
        for (line, prose) in taken_apart(&own).1 {
            for code in prose.split('`').skip(1).step_by(2) {
                let command = code.strip_prefix("semvs ").and_then(|rest| rest.split_whitespace().next());
                let command = command.filter(|word| word.chars().all(|c| c.is_ascii_lowercase()));
                for option in options(code) {
                    named += 1;
                    if !known.contains(&option) && !FOREIGN.contains(&option.as_str()) {
                        let _ = writeln!(problems, "{}:{line}: there is no {option}", page.display());
                    }
                }
                if let Some(command) = command
                    && !listed.contains(&format!("semvs {command} "))
                {
                    let _ = writeln!(problems, "{}:{line}: there is no command {command}", page.display());
                }
            }
        }
    }
    println!("{named} options are named and exist");
    assert!(problems.is_empty(), "\n{problems}");
    assert!(named > 300, "{named}");
}

/// The texts of all source files, with what is split over lines joined.
fn sources() -> String {
    let mut all = String::new();
    let mut folders = vec![root().join("src"), root().join("formats/src")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = std::fs::read_to_string(&path).unwrap();
                let mut parts = text.split("\\\n");
                all.push_str(parts.next().unwrap_or_default());
                parts.for_each(|part| all.push_str(part.trim_start()));
            }
        }
    }
    all.replace("\\\"", "\"").replace("{{", "{").replace("}}", "}")
}

/// A heading of the page is a message; `…` stands for what differs from case to case.
#[test]
fn the_messages_of_the_troubleshooting_page_exist() {
    let page = text(Path::new("docs/guide/troubleshooting.md"));
    let sources = sources();
    let messages: Vec<&str> =
        page.lines().filter_map(|line| line.strip_prefix("### `")?.strip_suffix('`')).collect();
    assert!(messages.len() >= 25, "{}", messages.len());
    for message in messages {
        let parts: Vec<&str> = message.split('…').map(str::trim).filter(|part| !part.is_empty()).collect();
        assert!(parts.iter().any(|part| part.len() >= 12), "{message}: too short to be found again");
        for part in parts {
            assert!(sources.contains(part), "no program says {part:?} of {message:?}");
        }
    }
}
