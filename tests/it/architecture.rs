//! The shape of the code, checked: what may know what, and what a file is called.
//!
//! The order of the `mod` lines in `lib.rs` and in each `mod.rs` is the order of the flow. A file
//! may use what is declared above it and nothing else, so cycles cannot arise.
#![allow(clippy::unwrap_used)]

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

/// Rooms that must not know each other although the order would allow it: user, used.
const STRANGERS: [(&str, &str); 6] = [
    ("sim", "model"),
    ("model", "sim"),
    ("model", "closed_loop"),
    ("closed_loop", "model"),
    ("eval", "model"),
    ("eval", "sim"),
];

/// Names that say nothing of what a file holds.
const VAGUE: [&str; 8] = ["util", "utils", "helper", "helpers", "common", "misc", "base", "core"];

/// The modules of the crate: every one with its children in the order of their `mod` lines.
struct Tree(BTreeMap<Vec<String>, Vec<String>>);

impl Tree {
    fn read(source: &Path) -> Tree {
        let mut tree = Tree(BTreeMap::new());
        tree.add(Vec::new(), source, "lib.rs");
        tree
    }

    fn add(&mut self, module: Vec<String>, folder: &Path, file: &str) {
        let Ok(text) = fs::read_to_string(folder.join(file)) else {
            self.0.insert(module, Vec::new());
            return;
        };
        let children: Vec<String> = without_comments(&text)
            .lines()
            .filter_map(|line| {
                let line = line.trim();
                let line = line.strip_prefix("pub ").unwrap_or(line);
                Some(line.strip_prefix("mod ")?.strip_suffix(';')?.to_string())
            })
            .collect();
        for child in &children {
            let mut path = module.clone();
            path.push(child.clone());
            self.add(path, &folder.join(child), "mod.rs");
        }
        self.0.insert(module, children);
    }

    /// The module that a path leads into: its longest beginning that is one.
    fn module_of<'p>(&self, path: &'p [String]) -> &'p [String] {
        let known = |len: &usize| self.0.contains_key(&path[..*len]);
        &path[..(0..=path.len()).rev().find(known).unwrap_or(0)]
    }

    /// Why `user` may not use `used`, if it may not.
    fn objection(&self, user: &[String], used: &[String]) -> Option<String> {
        let used = self.module_of(used);
        let said = |why: &str| Some(format!("{} uses {}: {why}", user.join("::"), used.join("::")));
        let (Some(user_room), Some(used_room)) = (user.first(), used.first()) else {
            return None;
        };
        if STRANGERS.contains(&(user_room.as_str(), used_room.as_str())) {
            return said("these two do not know each other");
        }
        let fork = user.iter().zip(used).take_while(|(a, b)| a == b).count();
        if fork == user.len() {
            return None;
        }
        if fork == used.len() {
            return said("it is part of that");
        }
        let siblings = &self.0[&user[..fork]];
        let rank = |name: &String| siblings.iter().position(|sibling| sibling == name);
        (rank(&used[fork]) >= rank(&user[fork])).then(|| said("it is declared below").unwrap())
    }
}

/// The code of a file: doc links are no uses.
fn without_comments(text: &str) -> String {
    let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    code.collect::<Vec<_>>().join("\n")
}

/// All paths from the crate root that a file mentions; groups in braces are multiplied out.
fn paths_used(code: &str) -> Vec<Vec<String>> {
    let mut paths = Vec::new();
    for (at, root) in code.match_indices("crate::") {
        let is_word_end = !code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
        if is_word_end {
            let mut rest = &code[at + root.len()..];
            branch(&mut rest, &mut Vec::new(), &mut paths);
        }
    }
    paths
}

/// Read `a::b`, or a group of such, and leave `rest` behind it.
fn branch(rest: &mut &str, above: &mut Vec<String>, paths: &mut Vec<Vec<String>>) {
    let depth = above.len();
    loop {
        *rest = rest.trim_start();
        if let Some(group) = rest.strip_prefix('{') {
            *rest = group;
            loop {
                *rest = rest.trim_start_matches(|c: char| c.is_whitespace() || c == ',');
                match rest.strip_prefix('}') {
                    Some(behind) => break *rest = behind,
                    None if rest.is_empty() => break,
                    None => branch(rest, above, paths),
                }
            }
            break;
        }
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
        if end == 0 {
            // `*` or what is no path: skip a letter, so that the reading always goes on.
            paths.push(above.clone());
            *rest = rest.get(1..).unwrap_or_default();
            break;
        }
        above.push(rest[..end].to_string());
        *rest = &rest[end..];
        match rest.strip_prefix("::") {
            Some(deeper) => *rest = deeper,
            None => {
                paths.push(above.clone());
                break;
            }
        }
    }
    above.truncate(depth);
    if let Some(renamed) = rest.trim_start().strip_prefix("as ") {
        let end = renamed.find([',', '}', ';']).unwrap_or(renamed.len());
        *rest = &renamed[end..];
    }
}

fn source() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// All Rust files below a folder, sorted.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => found.extend(files(&path)),
            false if path.extension().is_some_and(|extension| extension == "rs") => {
                found.push(path);
            }
            false => {}
        }
    }
    found.sort();
    found
}

/// The module that a file of the library is; `None` for binaries.
fn module(file: &Path) -> Option<Vec<String>> {
    let relative = file.strip_prefix(source()).unwrap().with_extension("");
    let mut path: Vec<String> =
        relative.iter().map(|part| part.to_str().unwrap().to_string()).collect();
    if path[0] == "bin" {
        return None;
    }
    if ["lib", "mod"].contains(&path.last().unwrap().as_str()) {
        path.pop();
    }
    Some(path)
}

#[test]
fn a_file_uses_only_what_is_declared_above_it() {
    let tree = Tree::read(&source());
    let mut objections = Vec::new();
    for file in files(&source()) {
        let Some(user) = module(&file) else { continue };
        let code = without_comments(&fs::read_to_string(&file).unwrap());
        objections.extend(paths_used(&code).iter().filter_map(|used| tree.objection(&user, used)));
        // Unit tests stand below everything else in their file and may look at all of it.
        let without_tests = code.split("#[cfg(test)]").next().unwrap();
        if without_tests.contains("super::") {
            objections.push(format!("{} uses super::, write crate::", user.join("::")));
        }
    }
    assert!(objections.is_empty(), "against the flow of src/lib.rs:\n{}", objections.join("\n"));
}

#[test]
fn every_file_of_the_library_is_declared() {
    let tree = Tree::read(&source());
    for file in files(&source()) {
        if let Some(module) = module(&file) {
            assert!(tree.0.contains_key(&module), "{} is in no `mod` line", file.display());
        }
    }
}

#[test]
fn every_file_opens_by_saying_what_it_is_for() {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    for file in files(&source()).into_iter().chain(files(&tests)) {
        let text = fs::read_to_string(&file).unwrap();
        assert!(text.starts_with("//! "), "{} does not open with `//! `", file.display());
    }
}

#[test]
fn no_file_has_a_name_that_says_nothing() {
    for file in files(&source()) {
        let name = file.file_stem().unwrap().to_str().unwrap();
        assert!(!VAGUE.contains(&name), "{}: name it after what it holds", file.display());
    }
}

#[test]
fn groups_of_uses_are_multiplied_out() {
    let code = "use crate::{a::{b, c::d as e}, f, g::*};\nfn h() { crate::i::j::k(1) }";
    let paths: Vec<String> = paths_used(code).iter().map(|path| path.join("::")).collect();
    assert_eq!(paths, ["a::b", "a::c::d", "f", "g", "i::j::k"]);
}

#[test]
fn uses_against_the_flow_are_found() {
    let tree = |pairs: &[(&str, &str)]| {
        let split = |text: &str| -> Vec<String> {
            text.split_whitespace().map(ToString::to_string).collect()
        };
        Tree(pairs.iter().map(|(module, children)| (split(module), split(children))).collect())
    };
    let tree = tree(&[
        ("", "log model sim eval"),
        ("log", "reader cdr"),
        ("log reader", ""),
        ("log cdr", ""),
        ("model", ""),
        ("sim", ""),
        ("eval", ""),
    ]);
    let objects = |user: &str, used: &str| {
        let path = |text: &str| text.split("::").map(ToString::to_string).collect::<Vec<_>>();
        tree.objection(&path(user), &path(used)).is_some()
    };
    assert!(objects("log::reader", "log::cdr::decode"));
    assert!(!objects("log::cdr", "log::reader::Log"));
    assert!(objects("log::cdr", "model::Net"));
    assert!(!objects("model", "log::cdr::decode"));
    assert!(objects("sim", "model::Net"));
    assert!(objects("eval", "sim::Town"));
    assert!(!objects("eval", "log::Log"));
    assert!(objects("log::cdr", "log::Thing"));
    assert!(!objects("log", "log::cdr::decode"));
}
