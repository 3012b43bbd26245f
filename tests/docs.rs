//! The documentation names only what exists: functions, files, links, commands and their options.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Names that look like a path of the repository and are none.
const NOT_IN_THE_REPOSITORY: &[&str] = &[
    // iceoryx2 services.
    "skein/downlink",
    "skein/uplink/<shard>",
    "skein/record",
    "skein/watch",
    // Columns of a table.
    "bytes/s",
    "false/h",
    "frames/s",
    "frames/drone",
    // Files of the reader's own program.
    "src/main.rs",
    "swirl.toml",
    // Folders and files that a command writes.
    "runs/",
    "failures/drone-N.txt",
    "plots/",
    "plots/bending.svg",
    "plots/disturbance.svg",
    "plots/flight.svg",
    "plots/metrics.svg",
    "reproduction/report.html",
    "events.jsonl",
    "flight.spool",
    "formation.csv",
    "gain.csv",
    "messages.csv",
    "messages.parquet",
    "ratios.csv",
    "rows.jsonl",
    "runs.csv",
    "runs.parquet",
    "trace.parquet",
    "manifest.json",
    "processes.json",
    "report.html",
    "reproduction.json",
    "results.csv",
    "run.mcap",
    "scenario.json",
    "summary.json",
    "trace.csv",
];

/// Names that look like a type of the sources and are none.
const NOT_TYPES: &[&str] = &["Host", "Origin"];

/// Names that look like a constant of the sources and are variables of the environment.
const ENVIRONMENT: &[&str] = &["PROPTEST_CASES", "XDG_RUNTIME_DIR"];

/// What a page may write instead of the beginning of a longer path.
const SHORT_FORMS: &[(&str, &str)] = &[("paper/", "runtime/tests/paper/")];

/// Endings by which a name without a folder is known to be a file's.
const FILE_ENDINGS: &[&str] = &[".rs", ".toml", ".md", ".json", ".jsonl", ".csv", ".html", ".mcap", ".spool", ".sh"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// A page of the documentation.
struct Page {
    /// Relative to the root.
    name: String,
    text: String,
}

impl Page {
    fn read_all() -> Vec<Self> {
        let front = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md"].map(str::to_owned);
        let docs = fs::read_dir(root().join("docs")).unwrap();
        let docs = docs.map(|entry| format!("docs/{}", entry.unwrap().file_name().to_str().unwrap()));
        let mut names: Vec<String> = front.into_iter().chain(docs.filter(|name| name.ends_with(".md"))).collect();
        names.sort();
        names.into_iter().map(|name| Self { text: fs::read_to_string(root().join(&name)).unwrap(), name }).collect()
    }

    /// Lines of prose, and lines of code between fences.
    fn lines(&self) -> (Vec<&str>, Vec<&str>) {
        let (mut prose, mut code, mut fenced) = (Vec::new(), Vec::new(), false);
        for line in self.text.lines() {
            if line.trim_start().starts_with("```") {
                fenced = !fenced;
            } else if fenced {
                code.push(line);
            } else {
                prose.push(line);
            }
        }
        (prose, code)
    }

    /// What stands between backticks in the prose. A span may run over a line's end.
    fn spans(&self) -> Vec<String> {
        let prose = self.lines().0.join("\n");
        let in_paragraph = |paragraph: &str| {
            let parts = paragraph.split('`').skip(1).step_by(2);
            parts.map(|part| part.split_whitespace().collect::<Vec<_>>().join(" ")).collect::<Vec<_>>()
        };
        prose.split("\n\n").flat_map(in_paragraph).collect()
    }

    /// The command lines of `skein` that the page shows, without the program's name.
    fn commands(&self) -> Vec<String> {
        let spans = self.spans();
        let code = self.lines().1;
        let shown = spans.iter().map(String::as_str).chain(code.iter().flat_map(|line| line.split(" & ")));
        let starts = ["skein ", "cargo run --release -- "];
        let command = |text: &str| {
            let text = text.trim().split(" #").next().unwrap_or_default();
            starts.iter().find_map(|start| text.strip_prefix(start)).map(|rest| rest.trim().to_owned())
        };
        shown.filter_map(command).collect()
    }

    /// Targets of the page's links and pictures.
    fn links(&self) -> Vec<String> {
        let prose = self.lines().0.join("\n");
        let targets = prose.split("](").skip(1).filter_map(|rest| rest.split(')').next());
        targets.map(str::to_owned).collect()
    }

    /// The anchors of the page's headings, as GitHub makes them.
    fn anchors(&self) -> BTreeSet<String> {
        let headings = self.text.lines().filter(|line| line.starts_with('#'));
        let anchor = |line: &str| {
            let kept = |c: &char| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_');
            line.trim_start_matches('#')
                .trim()
                .to_lowercase()
                .chars()
                .filter(kept)
                .collect::<String>()
                .replace(' ', "-")
        };
        headings.map(anchor).collect()
    }
}

/// The types of the sources, each with its functions, constants, fields and variants; and the modules with their functions.
struct Sources {
    members: BTreeMap<String, BTreeSet<String>>,
    constants: BTreeSet<String>,
    /// Names of all files, without folders.
    files: BTreeSet<String>,
}

impl Sources {
    fn read() -> Self {
        let mut sources = Self { members: BTreeMap::new(), constants: BTreeSet::new(), files: BTreeSet::new() };
        sources.walk(&root());
        sources
    }

    fn walk(&mut self, folder: &Path) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_str().unwrap().to_owned();
            let skipped =
                name.starts_with('.') || ["target", "runs", "sweeps", "reproduction"].contains(&name.as_str());
            if path.is_dir() {
                if !skipped {
                    self.walk(&path);
                }
                continue;
            }
            if let Some(module) = name.strip_suffix(".rs") {
                let text = fs::read_to_string(&path).unwrap();
                let folder = folder.file_name().unwrap().to_str().unwrap();
                self.index_module(if module == "mod" { folder } else { module }, &text);
                self.index(&text);
                let constants = text.lines().filter(|line| line.contains("const ")).map(|line| identifier(bare(line)));
                self.constants.extend(constants.map(str::to_owned));
            }
            self.files.insert(name);
        }
    }

    /// Takes in the functions of a module that belong to no type.
    fn index_module(&mut self, module: &str, text: &str) {
        let heads = text.lines().filter(|line| !line.starts_with([' ', '/']) && line.contains("fn "));
        let names = heads.map(|line| identifier(bare(line)).to_owned());
        self.members.entry(module.to_owned()).or_default().extend(names);
    }

    /// Takes in the items of one formatted file: an item's block ends at the first `}` that is indented as far as its head.
    fn index(&mut self, text: &str) {
        let mut open: Option<(String, String)> = None;
        for line in text.lines() {
            let indent = &line[..line.len() - line.trim_start().len()];
            if let Some((end, name)) = &open {
                if line == end {
                    open = None;
                    continue;
                }
                if let Some(member) = member(line) {
                    self.members.entry(name.clone()).or_default().insert(member.to_owned());
                }
            } else if let Some(name) = type_of(line) {
                self.members.entry(name.to_owned()).or_default();
                if line.ends_with('{') {
                    open = Some((format!("{indent}}}"), name.to_owned()));
                }
            }
        }
    }

    fn has(&self, of: &str, member: &str) -> bool {
        self.members.get(of).is_some_and(|members| members.contains(member))
    }
}

/// The identifier at the beginning of a text.
fn identifier(text: &str) -> &str {
    let end = text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
    &text[..end]
}

/// A line without its visibility and qualifiers.
fn bare(line: &str) -> &str {
    let mut rest = line.trim_start();
    if let Some(scoped) = rest.strip_prefix("pub(") {
        rest = scoped.split_once(") ").map_or("", |(_, rest)| rest);
    }
    while let Some(shorter) =
        ["pub ", "const fn ", "unsafe fn ", "async fn "].iter().find_map(|word| rest.strip_prefix(word))
    {
        rest = shorter;
    }
    rest.strip_prefix("fn ").or_else(|| rest.strip_prefix("const ")).unwrap_or(rest)
}

/// The type that a line declares or implements.
fn type_of(line: &str) -> Option<&str> {
    let mut rest = line.trim_start();
    if let Some(scoped) = rest.strip_prefix("pub(") {
        rest = scoped.split_once(") ")?.1;
    }
    rest = rest.strip_prefix("pub ").unwrap_or(rest);
    rest = rest.strip_prefix("unsafe ").unwrap_or(rest);
    if let Some(declared) = ["struct ", "enum ", "trait ", "type "].iter().find_map(|word| rest.strip_prefix(word)) {
        return Some(identifier(declared));
    }
    let implemented = rest.strip_prefix("impl")?;
    let implemented = without_generics(implemented).trim_start();
    let name = implemented.split_once(" for ").map_or(implemented, |(_, name)| name);
    Some(identifier(name.trim_start().rsplit_once("::").map_or(name.trim_start(), |(_, last)| last)))
}

/// What follows the generic parameters after `impl`.
fn without_generics(text: &str) -> &str {
    if !text.starts_with('<') {
        return text;
    }
    let mut depth = 0;
    for (place, letter) in text.char_indices() {
        match letter {
            '<' => depth += 1,
            '>' if !text[..place].ends_with('-') => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return &text[place + 1..];
        }
    }
    text
}

/// The function, constant, field or variant that a line in a type's block may declare.
fn member(line: &str) -> Option<&str> {
    let name = identifier(bare(line));
    (!name.is_empty()).then_some(name)
}

/// Whether a span is `Type::member` or `module::function`, perhaps with arguments; the two names.
fn owner_and_member(span: &str) -> Option<(&str, &str)> {
    let (of, rest) = span.split_once("::")?;
    let (member, rest) = rest.split_at(identifier(rest).len());
    let named = !of.is_empty() && identifier(of) == of && !member.is_empty();
    (named && (rest.is_empty() || rest.starts_with('('))).then_some((of, member))
}

/// Whether a span is meant as the name of a type: `CamelCase`.
fn is_type(span: &str) -> bool {
    let mut letters = span.chars();
    letters.next().is_some_and(|c| c.is_ascii_uppercase())
        && letters.next().is_some_and(|c| c.is_ascii_lowercase())
        && letters.all(|c| c.is_ascii_alphanumeric())
}

/// Whether a span is meant as the name of a constant: `SEVERAL_WORDS`.
fn is_constant(span: &str) -> bool {
    let plain = |c: char| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_';
    span.contains('_') && span.starts_with(|c: char| c.is_ascii_uppercase()) && span.chars().all(plain)
}

/// Whether a span is meant as a path of the repository.
fn is_path(span: &str) -> bool {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-./<>".contains(c);
    let plainly = span.chars().all(plain) && !span.starts_with(['/', '-', '.', '<']);
    let ratio = span.split('/').all(|part| part.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit()));
    let file = FILE_ENDINGS.iter().any(|ending| span.len() > ending.len() && span.ends_with(ending));
    plainly && !ratio && (file || (span.contains('/') && span.chars().any(|c| c.is_ascii_lowercase())))
}

fn path_exists(span: &str, sources: &Sources) -> bool {
    let long = SHORT_FORMS.iter().find_map(|(short, long)| Some(format!("{long}{}", span.strip_prefix(short)?)));
    let bare_file = !span.contains('/') && sources.files.contains(span);
    bare_file || NOT_IN_THE_REPOSITORY.contains(&span) || root().join(long.as_deref().unwrap_or(span)).exists()
}

/// What a page names in backticks and is nowhere.
fn stale_names(page: &Page, sources: &Sources) -> Vec<String> {
    let mut stale = Vec::new();
    for span in page.spans() {
        let missing = match owner_and_member(&span) {
            // A module of one of the crates.
            Some((of, module)) if of.starts_with("skein_") => !sources.members.contains_key(module),
            Some((of, member)) => !sources.has(of, member),
            None if is_type(&span) => !NOT_TYPES.contains(&span.as_str()) && !sources.members.contains_key(&span),
            None if is_constant(&span) => !ENVIRONMENT.contains(&span.as_str()) && !sources.constants.contains(&span),
            None => is_path(&span) && !path_exists(&span, sources),
        };
        if missing {
            stale.push(format!("{}: `{span}`", page.name));
        }
    }
    stale
}

fn stale_links(page: &Page) -> Vec<String> {
    let folder = root().join(&page.name).parent().unwrap().to_owned();
    let resolves = |target: &str| {
        let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
        let file = if path.is_empty() { root().join(&page.name) } else { folder.join(path) };
        if anchor.is_empty() || !path.ends_with(".md") && !path.is_empty() {
            return file.exists();
        }
        let there = fs::read_to_string(&file).map(|text| Page { name: String::new(), text });
        there.is_ok_and(|there| there.anchors().contains(anchor))
    };
    let own = page.links().into_iter().filter(|target| !target.contains("://") && !target.starts_with("mailto:"));
    own.filter(|target| !resolves(target)).map(|target| format!("{}: ({target})", page.name)).collect()
}

/// The help of commands, asked for once each.
#[derive(Default)]
struct Helps(BTreeMap<String, Option<String>>);

impl Helps {
    /// The help of a command; `None` if there is no such command.
    fn of(&mut self, verbs: &[&str]) -> Option<String> {
        let ask = || {
            let output = Command::new(env!("CARGO_BIN_EXE_skein")).args(verbs).arg("--help").output().unwrap();
            output.status.success().then(|| String::from_utf8(output.stdout).unwrap())
        };
        self.0.entry(verbs.join(" ")).or_insert_with(ask).clone()
    }

    /// What is wrong with a command line.
    fn fault(&mut self, line: &str) -> Option<String> {
        let words: Vec<&str> = line.split_whitespace().collect();
        let is_verb = |word: &&&str| word.chars().all(|c| c.is_ascii_lowercase() || c == '-') && !word.starts_with('-');
        let verb: Vec<&str> = words.first().filter(is_verb).into_iter().copied().collect();
        let Some(mut help) = self.of(&verb) else { return Some(format!("no command `{}`", verb.join(" "))) };
        if let Some(second) = words.get(1).filter(is_verb).filter(|_| !verb.is_empty() && help.contains("Commands:")) {
            let both = [verb[0], second];
            let Some(of_both) = self.of(&both) else { return Some(format!("no command `{}`", both.join(" "))) };
            help += &of_both;
        }
        let options = words.iter().filter(|word| word.starts_with("--") && word.len() > 2);
        let name = |word: &&str| word.split('=').next().unwrap_or_default().to_owned();
        let known = |option: &String| help.split(|c: char| !c.is_alphanumeric() && c != '-').any(|word| word == option);
        options.map(name).find(|option| !known(option)).map(|option| format!("no option `{option}` in `{line}`"))
    }
}

#[test]
fn every_function_and_file_named_in_the_documentation_exists() {
    let sources = Sources::read();
    let stale: Vec<String> = Page::read_all().iter().flat_map(|page| stale_names(page, &sources)).collect();
    assert!(stale.is_empty(), "the documentation names what does not exist:\n{}", stale.join("\n"));
}

#[test]
fn every_relative_link_resolves() {
    let stale: Vec<String> = Page::read_all().iter().flat_map(stale_links).collect();
    assert!(stale.is_empty(), "these links lead nowhere:\n{}", stale.join("\n"));
}

#[test]
fn every_command_line_names_a_command_and_options_that_exist() {
    let mut helps = Helps::default();
    let mut wrong = Vec::new();
    for page in Page::read_all() {
        for line in page.commands() {
            wrong.extend(helps.fault(&line).map(|fault| format!("{}: {fault}", page.name)));
        }
    }
    assert!(wrong.is_empty(), "these command lines do not work:\n{}", wrong.join("\n"));
}

#[test]
fn a_stale_name_is_found() {
    let text = "See `World::no_such_function`, `NoSuchType`, `NO_SUCH_CONSTANT`, `world/src/no_such_file.rs`, `World::downlink` and `world/src/world.rs`.\n\n\
                A [link](docs/no-such-page.md), an [anchor](docs/radio.md#no-such-heading), a [good one](docs/radio.md#rules).\n\n\
                `skein fly`, `skein run X --no-such-option`, `skein bench nothing`, `skein run X --seed 3`.\n";
    let page = Page { name: "README.md".to_owned(), text: text.to_owned() };
    let names = stale_names(&page, &Sources::read());
    assert_eq!(
        names,
        [
            "README.md: `World::no_such_function`",
            "README.md: `NoSuchType`",
            "README.md: `NO_SUCH_CONSTANT`",
            "README.md: `world/src/no_such_file.rs`"
        ]
    );
    let links = stale_links(&page);
    assert_eq!(links, ["README.md: (docs/no-such-page.md)", "README.md: (docs/radio.md#no-such-heading)"]);
    let mut helps = Helps::default();
    let faults: Vec<String> = page.commands().iter().filter_map(|line| helps.fault(line)).collect();
    let option = "no option `--no-such-option` in `run X --no-such-option`";
    assert_eq!(faults, ["no command `fly`", option, "no command `bench nothing`"]);
}
