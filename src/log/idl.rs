//! Message definitions in OMG IDL (`ros2idl`) to the type tree of [`schema`](crate::log::schema).
//!
//! Grammar: OMG IDL 4.2 section 7, <https://www.omg.org/spec/IDL/4.2>, as far as message types use
//! it: modules, structs, typedefs, enums, constants, annotations. A log concatenates the
//! definitions of a message and of all that it uses, each behind a line of `=` and `IDL: ` with
//! its name, <https://mcap.dev/spec/registry#ros2idl>.

use std::collections::BTreeMap;

use crate::{
    error::{Error, Result},
    log::{
        idl_tokens::{Lexer, Token},
        schema::{Arity, Element, Field, Schema, StructType, short_name},
        value::Scalar,
    },
};

/// Longest name of a module with those around it: it is repeated for every type inside.
const MAX_SCOPE_BYTES: usize = 255;

/// Most typedefs of typedefs that are followed; one that names itself has no end.
const MAX_ALIASES: usize = 16;

/// Parse the concatenated definitions of the message `name` (`pkg/msg/Type`).
///
/// # Errors
///
/// [`Error::Definition`] with the line: what is no IDL or has no place in a plain CDR message
/// (unions, optional members, lists of lists), a type that is neither built in nor defined, a
/// type that contains itself.
pub fn parse(name: &str, text: &str) -> Result<Schema> {
    let mut parser =
        Parser { lexer: Lexer::new(text), scope: String::new(), found: Found::default() };
    let fail = |(line, what)| Error::Definition { schema: name.into(), line, what };
    parser.definitions().map_err(|what| fail((parser.lexer.line(), what)))?;
    Schema::of(name, parser.found.types(name).map_err(fail)?)
}

/// A type as its place in the text names it.
#[derive(Clone, Copy)]
enum Named<'t> {
    BuiltIn(Element),
    Other(&'t str),
}

struct Member<'t> {
    line: usize,
    name: &'t str,
    named: Named<'t>,
    arity: Arity,
}

struct Struct<'t> {
    /// `a::b::C`.
    name: String,
    scope: String,
    members: Vec<Member<'t>>,
}

struct Alias<'t> {
    scope: String,
    named: Named<'t>,
    arity: Arity,
}

/// What a text declares, by full names `a::b::C`.
#[derive(Default)]
struct Found<'t> {
    structs: Vec<Struct<'t>>,
    aliases: BTreeMap<String, Alias<'t>>,
    constants: BTreeMap<String, usize>,
}

struct Parser<'t> {
    lexer: Lexer<'t>,
    /// The modules around, `a::b`; empty outside of all.
    scope: String,
    found: Found<'t>,
}

impl<'t> Parser<'t> {
    fn definitions(&mut self) -> Result<(), String> {
        loop {
            match self.lexer.next_token() {
                Token::End | Token::Section if !self.scope.is_empty() => {
                    return Err(format!("module `{}` is not closed", self.scope));
                }
                Token::End => return Ok(()),
                Token::Section | Token::Sign(';') => {}
                Token::Sign('@') => {
                    if self.annotation()? == "bit_bound" {
                        return Err("enums of other sizes than 4 bytes are not read".to_string());
                    }
                }
                Token::Sign('}') if !self.scope.is_empty() => {
                    let outer = self.scope.rfind("::").unwrap_or(0);
                    self.scope.truncate(outer);
                }
                Token::Word("module") => {
                    self.scope = self.declared()?;
                    if self.scope.len() > MAX_SCOPE_BYTES {
                        return Err("the names of these modules are too long".to_string());
                    }
                    self.expect('{')?;
                }
                Token::Word("struct") => self.structure()?,
                Token::Word("typedef") => {
                    let (named, arity) = self.type_of()?;
                    self.declarators(arity, &mut |parser, name, arity| {
                        let alias = Alias { scope: parser.scope.clone(), named, arity };
                        parser.found.aliases.insert(within(&parser.scope, name), alias);
                    })?;
                }
                Token::Word("const") => {
                    self.type_of()?;
                    let name = self.declared()?;
                    self.expect('=')?;
                    let value = self.lexer.peek();
                    self.skip_to(';')?;
                    if let Token::Number(value) = value
                        && let Ok(value) = value.parse()
                    {
                        self.found.constants.insert(name, value);
                    }
                }
                Token::Word("enum") => {
                    let name = self.declared()?;
                    self.expect('{')?;
                    self.skip_to('}')?;
                    // DDS-XTypes 1.3 section 7.2.2.4.1.2: 32 bits unless annotated.
                    let named = Named::BuiltIn(Element::Scalar(Scalar::I32));
                    let alias = Alias { scope: String::new(), named, arity: Arity::One };
                    self.found.aliases.insert(name, alias);
                }
                token => return Err(format!("{} where a definition should begin", token.said())),
            }
        }
    }

    fn structure(&mut self) -> Result<(), String> {
        let name = self.declared()?;
        match self.lexer.next_token() {
            Token::Sign(';') => return Ok(()),
            Token::Sign('{') => {}
            Token::Sign(':') => return Err(format!("`{name}` inherits, which is not read")),
            token => return Err(format!("{} where `{{` should be", token.said())),
        }
        let mut members = Vec::new();
        loop {
            match self.lexer.peek() {
                Token::Sign('}') => break,
                Token::Sign('@') => {
                    self.lexer.next_token();
                    if self.annotation()? == "optional" {
                        return Err("optional members are not read".to_string());
                    }
                }
                _ => {
                    let (named, arity) = self.type_of()?;
                    self.declarators(arity, &mut |parser, name, arity| {
                        let line = parser.lexer.line();
                        members.push(Member { line, name, named, arity });
                    })?;
                }
            }
        }
        self.expect('}')?;
        self.found.structs.push(Struct { name, scope: self.scope.clone(), members });
        Ok(())
    }

    /// The name of an annotation; what stands in its parentheses says nothing of the bytes.
    fn annotation(&mut self) -> Result<&'t str, String> {
        let name = self.word()?;
        if self.lexer.peek() == Token::Sign('(') {
            let mut open = 0_usize;
            loop {
                match self.lexer.next_token() {
                    Token::Sign('(') => open += 1,
                    Token::Sign(')') if open == 1 => break,
                    Token::Sign(')') => open -= 1,
                    Token::End | Token::Section => return Err(format!("`@{name}(` has no end")),
                    _ => {}
                }
            }
        }
        Ok(name)
    }

    /// A type as it stands before the names of members and typedefs.
    fn type_of(&mut self) -> Result<(Named<'t>, Arity), String> {
        if self.lexer.peek() != Token::Word("sequence") {
            return Ok((self.item()?, Arity::One));
        }
        self.lexer.next_token();
        self.expect('<')?;
        if self.lexer.peek() == Token::Word("sequence") {
            return Err(LIST_OF_LISTS.to_string());
        }
        let named = self.item()?;
        self.skip_to('>')?;
        Ok((named, Arity::Sequence))
    }

    fn item(&mut self) -> Result<Named<'t>, String> {
        let scalar = match self.word()? {
            "boolean" => Scalar::Bool,
            "int8" => Scalar::I8,
            "uint8" | "octet" | "char" => Scalar::U8,
            "int16" | "short" => Scalar::I16,
            "uint16" => Scalar::U16,
            "int32" => Scalar::I32,
            "uint32" => Scalar::U32,
            "int64" => Scalar::I64,
            "uint64" => Scalar::U64,
            "float" => Scalar::F32,
            "double" => Scalar::F64,
            "long" => match self.lexer.peek() {
                Token::Word("double") => return Err("`long double` is not read".to_string()),
                _ if self.is_next_long() => Scalar::I64,
                _ => Scalar::I32,
            },
            "unsigned" => match self.word()? {
                "short" => Scalar::U16,
                "long" if self.is_next_long() => Scalar::U64,
                "long" => Scalar::U32,
                other => return Err(format!("`unsigned {other}` is no type")),
            },
            kind @ ("string" | "wstring") => {
                // A bound does not change the bytes.
                if self.lexer.peek() == Token::Sign('<') {
                    self.skip_to('>')?;
                }
                let is_wide = kind == "wstring";
                let element = if is_wide { Element::WideString } else { Element::String };
                return Ok(Named::BuiltIn(element));
            }
            other => return Ok(Named::Other(other)),
        };
        Ok(Named::BuiltIn(Element::Scalar(scalar)))
    }

    fn is_next_long(&mut self) -> bool {
        let is_long = self.lexer.peek() == Token::Word("long");
        if is_long {
            self.lexer.next_token();
        }
        is_long
    }

    /// Names behind a type, up to the `;`, each with its own array sizes.
    fn declarators(
        &mut self,
        of: Arity,
        declare: &mut dyn FnMut(&mut Self, &'t str, Arity),
    ) -> Result<(), String> {
        loop {
            let name = self.word()?;
            let mut arity = of;
            while self.lexer.peek() == Token::Sign('[') {
                self.lexer.next_token();
                let size = match self.lexer.next_token() {
                    Token::Number(size) => size.parse().ok(),
                    Token::Word(name) => lookup(&self.scope, name, &self.found.constants).copied(),
                    _ => None,
                };
                let size = size.ok_or_else(|| format!("`{name}` has no array size"))?;
                self.expect(']')?;
                arity = nested(arity, Arity::Array(size))?;
            }
            declare(self, name, arity);
            match self.lexer.next_token() {
                Token::Sign(',') => {}
                Token::Sign(';') => return Ok(()),
                token => return Err(format!("{} behind `{name}`", token.said())),
            }
        }
    }

    fn word(&mut self) -> Result<&'t str, String> {
        match self.lexer.next_token() {
            Token::Word(word) => Ok(word),
            token => Err(format!("{} where a name should be", token.said())),
        }
    }

    /// The full name of what is declared here.
    fn declared(&mut self) -> Result<String, String> {
        let name = self.word()?;
        Ok(within(&self.scope, name))
    }

    fn expect(&mut self, sign: char) -> Result<(), String> {
        match self.lexer.next_token() {
            Token::Sign(found) if found == sign => Ok(()),
            token => Err(format!("{} where `{sign}` should be", token.said())),
        }
    }

    fn skip_to(&mut self, sign: char) -> Result<(), String> {
        loop {
            match self.lexer.next_token() {
                Token::Sign(found) if found == sign => return Ok(()),
                token @ (Token::End | Token::Section) => {
                    return Err(format!("{} where `{sign}` should be", token.said()));
                }
                _ => {}
            }
        }
    }
}

impl Found<'_> {
    /// The types with their names looked up, the message `name` first.
    fn types(self, name: &str) -> Result<Vec<StructType>, (usize, String)> {
        let root = short_name(name);
        let mut structs: Vec<&Struct> = self.structs.iter().collect();
        let at = structs.iter().position(|found| short_name(&found.name) == root);
        let at = at.ok_or_else(|| (1, format!("no struct `{root}` is defined in the log")))?;
        let message = structs.remove(at);
        structs.insert(0, message);
        let index: BTreeMap<String, usize> =
            structs.iter().enumerate().rev().map(|(at, found)| (found.name.clone(), at)).collect();
        let field = |scope: &str, member: &Member| -> Result<Field, (usize, String)> {
            let found = self.element(scope, member, &index);
            let (element, arity) = found.map_err(|what| (member.line, what))?;
            Ok(Field { name: member.name.to_string(), element, arity })
        };
        let fields = |found: &Struct| -> Result<Vec<Field>, (usize, String)> {
            found.members.iter().map(|member| field(&found.scope, member)).collect()
        };
        let types = structs
            .into_iter()
            .map(|found| Ok(StructType { name: short_name(&found.name), fields: fields(found)? }));
        types.collect()
    }

    /// What a member holds, behind all typedefs.
    fn element(
        &self,
        scope: &str,
        member: &Member,
        structs: &BTreeMap<String, usize>,
    ) -> Result<(Element, Arity), String> {
        let (mut scope, mut named, mut arity) = (scope, member.named, member.arity);
        for _ in 0..MAX_ALIASES {
            let name = match named {
                Named::BuiltIn(element) => return Ok((element, arity)),
                Named::Other(name) => name,
            };
            if let Some(at) = lookup(scope, name, structs) {
                return Ok((Element::Struct(*at), arity));
            }
            let alias = lookup(scope, name, &self.aliases)
                .ok_or_else(|| format!("type `{name}` is not defined in the log"))?;
            (scope, named, arity) = (&alias.scope, alias.named, nested(arity, alias.arity)?);
        }
        Err(format!("the typedefs behind `{}` do not end", member.name))
    }
}

const LIST_OF_LISTS: &str = "lists of lists are not read";

/// Lists of what is a list itself: arrays of arrays lie in the message as one long array does.
fn nested(outer: Arity, inner: Arity) -> Result<Arity, String> {
    match (outer, inner) {
        (Arity::One, arity) | (arity, Arity::One) => Ok(arity),
        (Arity::Array(a), Arity::Array(b)) => {
            a.checked_mul(b).map(Arity::Array).ok_or("an array longer than the memory".to_string())
        }
        _ => Err(LIST_OF_LISTS.to_string()),
    }
}

fn within(scope: &str, name: &str) -> String {
    if scope.is_empty() { name.to_string() } else { format!("{scope}::{name}") }
}

/// What a name means in a scope: the innermost that knows it decides.
fn lookup<'m, T>(scope: &str, name: &str, known: &'m BTreeMap<String, T>) -> Option<&'m T> {
    if let Some(name) = name.strip_prefix("::") {
        return known.get(name);
    }
    let mut scope = scope;
    loop {
        match known.get(&within(scope, name)) {
            None if !scope.is_empty() => scope = &scope[..scope.rfind("::").unwrap_or(0)],
            found => return found,
        }
    }
}
