//! XML elements whose faults are told with file, element and line.

use std::{fs, path::Path, str::FromStr};

use roxmltree::{Document, Node, ParsingOptions};

use crate::error::{Error, Result};

/// Largest file that is read: the largest town of CARLA has 20 MB.
pub const MAX_BYTES: u64 = 256 << 20;

/// Most elements, texts and comments of a file.
const MAX_NODES: u32 = 16_000_000;

/// The text of an XML file.
///
/// # Errors
///
/// [`Error::Io`] if it cannot be read, [`Error::Map`] if it is too large or no UTF-8.
pub fn read_text(path: &Path) -> Result<String> {
    let bytes = fs::metadata(path).map_err(Error::io("read", path))?.len();
    if bytes > MAX_BYTES {
        let what = format!("file of {bytes} bytes, at most {MAX_BYTES} are read");
        return Err(fault(path, 1, "file", what, None));
    }
    let bytes = fs::read(path).map_err(Error::io("read", path))?;
    String::from_utf8(bytes).map_err(|error| {
        let before = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count() as u32;
        let hint = "save the file as UTF-8".to_string();
        fault(path, line, "file", "text that is not UTF-8".into(), Some(hint))
    })
}

/// Parse a text that was read from `path`.
///
/// # Errors
///
/// [`Error::Map`] with the line where the text is no well-formed XML.
pub fn parse<'text>(path: &Path, text: &'text str) -> Result<Document<'text>> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|error| {
        let hint = "the file is cut off or damaged: export or copy it again".to_string();
        // A text that ends too early has no place of its own.
        let line = match error {
            roxmltree::Error::UnexpectedEndOfStream | roxmltree::Error::UnclosedRootNode => {
                text.lines().count().max(1) as u32
            }
            _ => error.pos().row,
        };
        let element = last_tag(text, line).unwrap_or("file");
        fault(path, line, element, format!("no well-formed XML: {error}"), Some(hint))
    })
}

/// The last element that is opened or closed up to a line.
fn last_tag(text: &str, line: u32) -> Option<&str> {
    let end = text.split_inclusive('\n').take(line as usize).map(str::len).sum();
    let tags = text[..end].rsplit('<');
    let names = tags.map(|tag| {
        let tag = tag.trim_start_matches('/');
        tag.split(|c: char| c.is_whitespace() || "/>".contains(c)).next()
    });
    names.flatten().find(|name| name.starts_with(char::is_alphabetic))
}

fn fault(path: &Path, line: u32, element: &str, what: String, hint: Option<String>) -> Error {
    Error::Map { path: path.to_path_buf(), line, element: element.to_string(), what, hint }
}

/// An element and the file it is in.
#[derive(Clone, Copy, Debug)]
pub struct Element<'a, 'text> {
    node: Node<'a, 'text>,
    path: &'a Path,
}

impl<'a, 'text> Element<'a, 'text> {
    /// The outermost element, which must have the name `name`.
    ///
    /// # Errors
    ///
    /// [`Error::Map`] if it has another.
    pub fn root(document: &'a Document<'text>, path: &'a Path, name: &str) -> Result<Self> {
        let root = Element { node: document.root_element(), path };
        if root.name() == name {
            return Ok(root);
        }
        Err(root.fault(format!("the outermost element should be <{name}>")))
    }

    pub fn name(&self) -> &'a str {
        self.node.tag_name().name()
    }

    /// Children of that name, in the order of the file.
    pub fn children(self, name: &'static str) -> impl Iterator<Item = Element<'a, 'text>> {
        self.elements().filter(move |child| child.name() == name)
    }

    /// All child elements, in the order of the file.
    pub fn elements(self) -> impl Iterator<Item = Element<'a, 'text>> {
        let path = self.path;
        self.node.children().filter(Node::is_element).map(move |node| Element { node, path })
    }

    pub fn child(self, name: &'static str) -> Option<Element<'a, 'text>> {
        self.children(name).next()
    }

    /// The child of that name.
    ///
    /// # Errors
    ///
    /// [`Error::Map`] if there is none.
    pub fn needed_child(self, name: &'static str) -> Result<Element<'a, 'text>> {
        self.child(name).ok_or_else(|| self.fault(format!("<{name}> is missing")))
    }

    pub fn attribute(self, name: &str) -> Option<&'a str> {
        self.node.attribute(name)
    }

    /// The attribute of that name.
    ///
    /// # Errors
    ///
    /// [`Error::Map`] if there is none.
    pub fn text(self, name: &str) -> Result<&'a str> {
        self.attribute(name).ok_or_else(|| self.fault(format!("attribute `{name}` is missing")))
    }

    /// An attribute that is a finite number.
    ///
    /// # Errors
    ///
    /// [`Error::Map`] if it is missing or no finite number.
    pub fn number(self, name: &str) -> Result<f64> {
        let value: f64 = self.parsed(name, self.text(name)?, "a number")?;
        if value.is_finite() {
            return Ok(value);
        }
        Err(self.fault(format!("attribute `{name}` is {value}, a finite number is needed")))
    }

    /// The same with a value for when the attribute is missing.
    ///
    /// # Errors
    ///
    /// [`Error::Map`] if it is there and no finite number.
    pub fn number_or(self, name: &str, missing: f64) -> Result<f64> {
        if self.attribute(name).is_some() { self.number(name) } else { Ok(missing) }
    }

    /// An attribute that is a whole number.
    ///
    /// # Errors
    ///
    /// [`Error::Map`] if it is missing or no whole number.
    pub fn integer(self, name: &str) -> Result<i32> {
        self.parsed(name, self.text(name)?, "a whole number")
    }

    fn parsed<T: FromStr>(self, name: &str, text: &str, kind: &str) -> Result<T> {
        let Ok(value) = text.trim().parse() else {
            return Err(self.fault(format!("attribute `{name}` is `{text}`, not {kind}")));
        };
        Ok(value)
    }

    /// Line of the element, from 1.
    pub fn line(self) -> u32 {
        self.node.document().text_pos_at(self.node.range().start).row
    }

    /// An error about this element.
    pub fn fault(self, what: String) -> Error {
        self.fault_with(what, "correct that line, or export the map again")
    }

    /// The same with other advice.
    pub fn fault_with(self, what: String, hint: &str) -> Error {
        fault(self.path, self.line(), self.name(), what, Some(hint.to_string()))
    }
}
