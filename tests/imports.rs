//! No two files of a crate import each other in a circle. A parent module that imports from its child, and the child that
//! imports from the parent, are a circle too. What a module only re-exports counts as imported from where it is defined.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Crates without any circle.
const WITHOUT_CIRCLES: [&str; 6] = ["protocol", "leader", "pilot", "agent", "world", "bus"];

/// Circles that are allowed in the other crates: the crate, the files of the circle below `src`, and the reason.
const ALLOWED: &[(&str, &[&str], &str)] = &[];

/// A path of module or item names.
type Names = Vec<String>;

/// One source file of a crate.
struct Module {
    /// Below `src`.
    file: String,
    /// The module that the file is: empty for lib.rs and main.rs.
    path: Names,
    /// The code without comments and tests.
    code: String,
    /// Modules that the file declares.
    children: Vec<String>,
    /// What the file imports: the name in this module and the absolute path.
    imports: Vec<(String, Names)>,
    /// Every absolute path of this crate that the file names, imports included.
    mentions: Vec<Names>,
}

impl Module {
    fn read(src: &Path, path: &Path) -> Self {
        let file = path.strip_prefix(src).unwrap().to_str().unwrap().to_owned();
        let mut module: Names = file.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
        if ["lib", "main", "mod"].contains(&module.last().unwrap().as_str()) {
            module.pop();
        }
        let code = code(&fs::read_to_string(path).unwrap());
        let declared = |line: &str| {
            let name = line.trim().strip_suffix(';')?.rsplit_once("mod ")?.1.to_owned();
            name.chars().all(is_name).then_some(name)
        };
        let children = code.lines().filter_map(declared).collect();
        Self { file, path: module, code, children, imports: Vec::new(), mentions: Vec::new() }
    }

    /// Finds every path that begins with `crate`, `super`, `self` or a child module.
    fn find_mentions(&mut self) {
        let mut at = 0;
        while let Some(offset) = self.code[at..].find("::") {
            let end = at + offset;
            at = end + 2;
            let start = self.code[..end].rfind(|c| !is_name(c)).map_or(0, |before| before + 1);
            let first = &self.code[start..end];
            let known = ["crate", "super", "self"].contains(&first) || self.children.iter().any(|child| child == first);
            if !known || self.code[..start].ends_with("::") {
                continue;
            }
            let statement = self.code[..start].rsplit([';', '{', '}']).next().unwrap_or_default().trim();
            let imported = statement.ends_with("use");
            let exported = imported && statement.starts_with("pub");
            for (alias, path) in tree(&self.code[start..]) {
                let Some(absolute) = self.absolute(path) else { continue };
                if !exported || self.uses(&alias) {
                    self.mentions.push(absolute.clone());
                }
                if imported {
                    self.imports.push((alias, absolute));
                }
            }
        }
    }

    /// Whether the code outside of `use` statements names something.
    fn uses(&self, name: &str) -> bool {
        let statements =
            self.code.split_inclusive([';', '}']).filter(|text| !text.trim_start().starts_with("pub use "));
        statements.flat_map(|text| text.split(|c| !is_name(c))).any(|word| word == name)
    }

    /// A path as seen from the root of the crate.
    fn absolute(&self, path: Names) -> Option<Names> {
        let mut base = self.path.clone();
        let mut rest = path.as_slice();
        loop {
            match rest.first().map(String::as_str) {
                Some("crate") => base.clear(),
                Some("self") => {}
                Some("super") => _ = base.pop()?,
                _ => break,
            }
            rest = &rest[1..];
        }
        Some([&base, rest].concat())
    }

    fn defines(&self, name: &str) -> bool {
        ["fn", "struct", "enum", "trait", "type", "const", "static", "union", "mod"].iter().any(|keyword| {
            let definition = format!("{keyword} {name}");
            let mut found = self.code.match_indices(&definition);
            found.any(|(at, _)| !self.code[at + definition.len()..].starts_with(is_name))
        })
    }
}

fn is_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// The paths of a use tree at the beginning of a text, each with the name under which it is imported.
fn tree(text: &str) -> Vec<(String, Names)> {
    let mut prefix = Names::new();
    let mut rest = text.trim_start();
    loop {
        if let Some(list) = rest.strip_prefix('{') {
            let join = |(alias, path): (String, Names)| match &path[..] {
                [only] if only == "self" => {
                    (if alias == "self" { prefix[prefix.len() - 1].clone() } else { alias }, prefix.clone())
                }
                _ => (alias, [prefix.as_slice(), &path].concat()),
            };
            return branches(list).into_iter().flat_map(tree).map(join).collect();
        }
        let end = rest.find(|c| !is_name(c)).unwrap_or(rest.len());
        let name = if rest.starts_with('*') { "*" } else { &rest[..end] };
        if name.is_empty() {
            return Vec::new();
        }
        prefix.push(name.to_owned());
        let after = &rest[name.len()..];
        match after.strip_prefix("::") {
            Some(more) => rest = more.trim_start(),
            None => {
                let renamed = after.trim_start().strip_prefix("as ").map(|alias| alias.trim_start());
                let alias = renamed.map_or(prefix.last().unwrap().as_str(), |alias| {
                    &alias[..alias.find(|c| !is_name(c)).unwrap_or(alias.len())]
                });
                return vec![(alias.to_owned(), prefix)];
            }
        }
    }
}

/// The branches of a list up to its closing brace.
fn branches(list: &str) -> Vec<&str> {
    let (mut depth, mut start, mut found) = (0, 0, Vec::new());
    for (at, c) in list.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth > 0 => depth -= 1,
            ',' if depth > 0 => {}
            ',' | '}' => {
                found.push(&list[start..at]);
                start = at + 1;
                if c == '}' {
                    break;
                }
            }
            _ => {}
        }
    }
    found
}

/// A source text without comments and without what is compiled for tests only.
fn code(text: &str) -> String {
    let mut kept = String::new();
    let mut lines = text.lines().map(|line| line.split("//").next().unwrap_or_default());
    while let Some(line) = lines.next() {
        if line.trim() == "#[cfg(test)]" {
            let mut depth = 0i32;
            for line in lines.by_ref() {
                depth += line.matches('{').count() as i32 - line.matches('}').count() as i32;
                if depth <= 0 && (line.trim_end().ends_with(';') || line.trim_end().ends_with('}')) {
                    break;
                }
            }
            continue;
        }
        kept.push_str(line);
        kept.push('\n');
    }
    kept
}

/// The files of a crate, with a set of the files that each of them imports from.
struct Imports {
    modules: Vec<Module>,
    edges: Vec<BTreeSet<usize>>,
}

impl Imports {
    fn of(name: &str) -> Self {
        let src = root().join(name).join("src");
        let mut paths = Vec::new();
        sources(&src, &mut paths);
        paths.sort();
        let mut modules: Vec<Module> = paths.iter().map(|path| Module::read(&src, path)).collect();
        for module in &mut modules {
            module.find_mentions();
        }
        let mut imports = Self { modules, edges: Vec::new() };
        let sources_of = |module: &Module| module.mentions.iter().filter_map(|path| imports.file_of(path, 0)).collect();
        let mut edges: Vec<BTreeSet<usize>> = imports.modules.iter().map(sources_of).collect();
        for (file, edges) in edges.iter_mut().enumerate() {
            edges.remove(&file);
        }
        imports.edges = edges;
        imports
    }

    /// The file that defines what a path names.
    fn file_of(&self, path: &[String], depth: usize) -> Option<usize> {
        let is_prefix = |module: &&Module| path.starts_with(&module.path);
        let longest = self.modules.iter().filter(is_prefix).map(|module| module.path.len()).max()?;
        // A package with a library and a program has two roots. The one that imports or defines the item counts.
        let mut found = None;
        for (file, module) in self.modules.iter().enumerate().filter(|(_, module)| module.path == path[..longest]) {
            found = found.or(Some(file));
            let Some(name) = path.get(longest) else { return Some(file) };
            if module.defines(name) || depth > 8 {
                return Some(file);
            }
            let named = module.imports.iter().find(|(alias, _)| alias == name);
            if let Some((_, target)) = named.filter(|(_, target)| target != path) {
                return self.file_of(target, depth + 1).or(Some(file));
            }
            for (_, target) in module.imports.iter().filter(|(alias, _)| alias == "*") {
                let [globbed @ .., _] = target.as_slice() else { continue };
                let through = self.file_of(&[globbed, &path[longest..]].concat(), depth + 1);
                if let Some(through) = through.filter(|through| self.modules[*through].defines(name)) {
                    return Some(through);
                }
            }
        }
        found
    }

    /// The sets of files that import each other, directly or through others.
    fn circles(&self) -> Vec<BTreeSet<usize>> {
        let reached: Vec<BTreeSet<usize>> = (0..self.modules.len()).map(|file| self.reached_from(file)).collect();
        let circle = |file: usize| -> BTreeSet<usize> {
            reached[file].iter().copied().filter(|other| reached[*other].contains(&file)).collect()
        };
        let circles: BTreeSet<BTreeSet<usize>> = (0..self.modules.len()).map(circle).collect();
        circles.into_iter().filter(|circle| circle.len() > 1).collect()
    }

    fn reached_from(&self, file: usize) -> BTreeSet<usize> {
        let (mut reached, mut next) = (BTreeSet::new(), vec![file]);
        while let Some(file) = next.pop() {
            next.extend(self.edges[file].iter().filter(|other| reached.insert(**other)));
        }
        reached
    }

    fn names(&self, files: &BTreeSet<usize>) -> Vec<&str> {
        files.iter().map(|file| self.modules[*file].file.as_str()).collect()
    }

    /// The imports inside a circle, one per line.
    fn describe(&self, circle: &BTreeSet<usize>) -> String {
        let lines = circle.iter().map(|file| {
            let inside = self.edges[*file].intersection(circle).copied().collect();
            format!("  {} imports from {}\n", self.modules[*file].file, self.names(&inside).join(", "))
        });
        lines.collect()
    }
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// The source files below a folder, without those of tests.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.file_stem().is_some_and(|stem| stem == "tests" || stem == "testing") {
            continue;
        }
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// The folders of the workspace's crates.
fn crates() -> Vec<String> {
    let manifest = fs::read_to_string(root().join("Cargo.toml")).unwrap();
    let members = manifest.split_once("members = [").unwrap().1.split_once(']').unwrap().0;
    let names = members.split(',').map(|name| name.trim().trim_matches('"').to_owned());
    // An example is one file, or two.
    names.filter(|name| !name.is_empty() && !name.starts_with("examples/")).collect()
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let mut wrong = String::new();
    let mut unused: Vec<_> = ALLOWED.iter().collect();
    for name in crates() {
        let imports = Imports::of(&name);
        assert!(imports.edges.iter().any(|edges| !edges.is_empty()), "no imports were found in {name}");
        for circle in imports.circles() {
            let files = imports.names(&circle);
            let known = unused.iter().position(|(of, allowed, _)| *of == name && **allowed == files[..]);
            if known.map(|index| unused.swap_remove(index)).is_none() || WITHOUT_CIRCLES.contains(&name.as_str()) {
                wrong += &format!("{name}:\n{}", imports.describe(&circle));
            }
        }
    }
    assert!(wrong.is_empty(), "files import each other in a circle:\n{wrong}");
    assert!(unused.is_empty(), "allowed circles that do not exist: {unused:?}");
}

#[test]
fn a_use_tree_is_read_with_its_lists_and_names() {
    let found = tree("crate::a::{self, B, c::{D as E, f}, g::*};");
    let found: Vec<String> = found.iter().map(|(alias, path)| format!("{alias} {}", path.join("::"))).collect();
    assert_eq!(found, ["a crate::a", "B crate::a::B", "E crate::a::c::D", "f crate::a::c::f", "* crate::a::g::*"]);
}
