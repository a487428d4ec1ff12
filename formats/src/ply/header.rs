//! The header of a PLY file: encoding, comments, elements and their properties.

use crate::source::Source;
use crate::{Error, Limits, Result};
use std::io::Read;

/// Longest header accepted, in bytes; real ones take a few kilobytes at most.
const MAX_HEADER: u64 = 4 << 20;
/// Most elements of a file, and most properties of an element; real files have a dozen or two.
const MAX_COLUMNS: usize = 1024;

/// How the values after the header are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// Decimal text, one record per line.
    Ascii,
    /// Packed values, least significant byte first.
    LittleEndian,
    /// Packed values, most significant byte first.
    BigEndian,
}

/// Type of a number. PLY knows each under two names (`float` and `float32`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScalarType {
    /// `char`, `int8`
    I8,
    /// `uchar`, `uint8`
    U8,
    /// `short`, `int16`
    I16,
    /// `ushort`, `uint16`
    U16,
    /// `int`, `int32`
    I32,
    /// `uint`, `uint32`
    U32,
    /// `float`, `float32`
    F32,
    /// `double`, `float64`
    F64,
}

/// Which of the two names of a type a writer uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TypeNames {
    /// `float32`, `uint8`: what OpenMVS writes.
    Sized,
    /// `float`, `uchar`: the names of the original specification, understood by every reader.
    Legacy,
}

impl ScalarType {
    const ALL: [(ScalarType, &'static str, &'static str); 8] = [
        (ScalarType::I8, "int8", "char"),
        (ScalarType::U8, "uint8", "uchar"),
        (ScalarType::I16, "int16", "short"),
        (ScalarType::U16, "uint16", "ushort"),
        (ScalarType::I32, "int32", "int"),
        (ScalarType::U32, "uint32", "uint"),
        (ScalarType::F32, "float32", "float"),
        (ScalarType::F64, "float64", "double"),
    ];

    /// The type called `name` in either family.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(_, sized, legacy)| *sized == name || *legacy == name).map(|t| t.0)
    }

    /// The name in the given family.
    pub fn name(self, names: TypeNames) -> &'static str {
        let (_, sized, legacy) = Self::ALL[self as usize];
        match names {
            TypeNames::Sized => sized,
            TypeNames::Legacy => legacy,
        }
    }

    /// Bytes of one value in the binary encodings.
    pub fn bytes(self) -> usize {
        match self {
            ScalarType::I8 | ScalarType::U8 => 1,
            ScalarType::I16 | ScalarType::U16 => 2,
            ScalarType::I32 | ScalarType::U32 | ScalarType::F32 => 4,
            ScalarType::F64 => 8,
        }
    }

    /// Whether values are whole numbers.
    pub fn is_integer(self) -> bool {
        !matches!(self, ScalarType::F32 | ScalarType::F64)
    }
}

/// What a property holds per record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PropertyType {
    /// One number.
    Scalar(ScalarType),
    /// A count, then that many numbers.
    List {
        /// Type of the count.
        count: ScalarType,
        /// Type of each entry.
        item: ScalarType,
    },
}

/// A named column of an element.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Property {
    /// Name, as in the file.
    pub name: String,
    /// What it holds.
    pub kind: PropertyType,
}

/// A table of records, such as the vertices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Element {
    /// Name, as in the file.
    pub name: String,
    /// Number of records declared.
    pub count: u64,
    /// Columns in file order.
    pub properties: Vec<Property>,
}

/// Everything up to and including the line `end_header`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// How the values are stored.
    pub encoding: Encoding,
    /// Text of the `comment` lines, without the keyword.
    pub comments: Vec<String>,
    /// Tables in file order.
    pub elements: Vec<Element>,
}

impl Header {
    /// The first element called `name`.
    pub fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|e| e.name == name)
    }

    /// The header as it stands in a file, lines ending in `\n`.
    pub fn to_text(&self, names: TypeNames) -> String {
        let encoding = match self.encoding {
            Encoding::Ascii => "ascii",
            Encoding::LittleEndian => "binary_little_endian",
            Encoding::BigEndian => "binary_big_endian",
        };
        let mut text = format!("ply\nformat {encoding} 1.0\n");
        for comment in &self.comments {
            // a line break would end the comment and start a header line
            text += &format!("comment {}\n", comment.replace(['\n', '\r'], " "));
        }
        for element in &self.elements {
            text += &format!("element {} {}\n", element.name, element.count);
            for Property { name, kind } in &element.properties {
                text += &match kind {
                    PropertyType::Scalar(t) => format!("property {} {name}\n", t.name(names)),
                    PropertyType::List { count, item } => {
                        format!("property list {} {} {name}\n", count.name(names), item.name(names))
                    }
                };
            }
        }
        text + "end_header\n"
    }

    /// Reads a header and leaves `source` at the first byte after it.
    pub(super) fn read<R: Read>(source: &mut Source<R>, limits: &Limits) -> Result<Self> {
        let mut line = Vec::new();
        // A file of another kind may have no line end for long.
        match source.line(&mut line, 16, "magic") {
            Ok(_) | Err(Error::Limits { .. }) => {}
            Err(error) => return Err(error),
        }
        if line != b"ply" {
            return Err(broken(0, "magic", "this is no PLY file, which would start with \"ply\""));
        }
        let mut parser = Parser::default();
        loop {
            let offset = source.offset();
            if offset > MAX_HEADER {
                let limit = MAX_HEADER;
                return Err(Error::Limits { field: "header".into(), needed: offset, limit });
            }
            if !source.line(&mut line, limits.max_string.min(MAX_HEADER), "header")? {
                return Err(broken(offset, "header", "the file ends before the line \"end_header\""));
            }
            if parser.line(&readable(&line), offset)? {
                return parser.finish(source.offset());
            }
        }
    }
}

#[derive(Default)]
struct Parser {
    encoding: Option<Encoding>,
    comments: Vec<String>,
    elements: Vec<Element>,
}

impl Parser {
    /// Takes one line; true if it is the last of the header.
    fn line(&mut self, line: &str, offset: u64) -> Result<bool> {
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let words: Vec<&str> = rest.split_whitespace().collect();
        match (keyword, words.as_slice()) {
            ("comment", _) => self.comments.push(rest.to_owned()),
            ("obj_info" | "", _) => {}
            ("end_header", _) => return Ok(true),
            ("format", [encoding, "1.0"]) => {
                self.encoding = Some(match *encoding {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::LittleEndian,
                    "binary_big_endian" => Encoding::BigEndian,
                    other => {
                        return Err(broken(
                            offset,
                            "format",
                            format!("unknown encoding \"{}\"", excerpt(other)),
                        ));
                    }
                });
            }
            ("format", _) => {
                let what = format!("expected an encoding and 1.0, found \"{}\"", excerpt(rest));
                return Err(broken(offset, "format", what));
            }
            ("element", [name, count]) => {
                let field = format!("element {name}");
                let Ok(count) = count.parse() else {
                    return Err(broken(offset, field, format!("\"{}\" is not a count", excerpt(count))));
                };
                if self.elements.len() == MAX_COLUMNS {
                    return Err(broken(offset, field, format!("more than {MAX_COLUMNS} elements")));
                }
                self.elements.push(Element { name: (*name).to_owned(), count, properties: Vec::new() });
            }
            ("property", ["list", count, item, name]) => {
                let kind = PropertyType::List { count: scalar(count, offset)?, item: scalar(item, offset)? };
                self.property(name, kind, offset)?;
            }
            ("property", [kind, name]) => {
                self.property(name, PropertyType::Scalar(scalar(kind, offset)?), offset)?;
            }
            _ => return Err(broken(offset, "header", format!("line not understood: \"{}\"", excerpt(line)))),
        }
        Ok(false)
    }

    fn property(&mut self, name: &str, kind: PropertyType, offset: u64) -> Result<()> {
        let broken = |what: &str| broken(offset, format!("property {name}"), what);
        let Some(element) = self.elements.last_mut() else {
            return Err(broken("it stands before the first element"));
        };
        if element.properties.iter().any(|p| p.name == name) {
            return Err(broken(&format!("declared twice in element {}", excerpt(&element.name))));
        }
        if element.properties.len() == MAX_COLUMNS {
            return Err(broken(&format!("more than {MAX_COLUMNS} properties of an element")));
        }
        if let PropertyType::List { count, .. } = kind
            && !count.is_integer()
        {
            return Err(broken("the count of a list must be an integer"));
        }
        element.properties.push(Property { name: name.to_owned(), kind });
        Ok(())
    }

    fn finish(self, offset: u64) -> Result<Header> {
        let Some(encoding) = self.encoding else {
            return Err(broken(offset, "header", "there is no \"format\" line"));
        };
        Ok(Header { encoding, comments: self.comments, elements: self.elements })
    }
}

fn scalar(name: &str, offset: u64) -> Result<ScalarType> {
    ScalarType::parse(name)
        .ok_or_else(|| broken(offset, "property", format!("unknown type \"{}\"", excerpt(name))))
}

/// A header line as text; bytes that are no UTF-8 are spelled out, as `\xff`.
fn readable(line: &[u8]) -> String {
    let mut text = String::with_capacity(line.len());
    for chunk in line.utf8_chunks() {
        text += chunk.valid();
        text += &chunk.invalid().escape_ascii().to_string();
    }
    text
}

/// The start of `text`, short enough for a message, without characters that a terminal would act on.
fn excerpt(text: &str) -> String {
    let shown = |c: char| if c == '\\' { vec![c] } else { c.escape_debug().collect() };
    text.chars().take(60).flat_map(shown).collect()
}

pub(super) fn broken(offset: u64, field: impl Into<String>, what: impl Into<String>) -> Error {
    Error::Format { offset, field: excerpt(&field.into()), what: what.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Header> {
        Header::read(&mut Source::new(text.as_bytes()), &Limits::default())
    }

    #[test]
    fn both_type_families_lists_comments_and_line_ends_are_understood() {
        let text = "ply\r\nformat ascii 1.0\r\ncomment  two  spaces\r\nobj_info x\r\nelement vertex 3\r\n\
                    property float x\r\nproperty float64 y\r\nproperty list uchar int32 v\r\nend_header\r\n";
        let header = parse(text).unwrap();
        assert_eq!(header.encoding, Encoding::Ascii);
        assert_eq!(header.comments, [" two  spaces"]);
        let kinds: Vec<_> = header.element("vertex").unwrap().properties.iter().map(|p| p.kind).collect();
        let list = PropertyType::List { count: ScalarType::U8, item: ScalarType::I32 };
        let expected = [PropertyType::Scalar(ScalarType::F32), PropertyType::Scalar(ScalarType::F64), list];
        assert_eq!(kinds, expected);
    }

    #[test]
    fn bytes_that_cannot_be_shown_are_spelled_out() {
        let error =
            |bytes: &[u8]| Header::read(&mut Source::new(bytes), &Limits::default()).unwrap_err().to_string();
        let message = error(b"ply\nformat ascii 1.0\n\xff\xfe\x1b[2J what\n");
        assert!(message.starts_with(r#"line not understood: "\xff\xfe\u{1b}[2J what""#), "{message}");
        let message = error(b"ply\nformat ascii 1.0\nelement vertex\x80 many\n");
        assert!(message.contains(r"element vertex\x80"), "{message}");
        assert!(message.chars().all(|c| !c.is_control() && c != char::REPLACEMENT_CHARACTER));
    }

    #[test]
    fn text_is_read_back_in_both_families() {
        let text = "ply\nformat binary_big_endian 1.0\ncomment c\nelement vertex 1\nproperty float x\n\
                    property list uchar uint v\nelement face 0\nend_header\n";
        let header = parse(text).unwrap();
        assert_eq!(header.to_text(TypeNames::Legacy), text);
        assert_eq!(parse(&header.to_text(TypeNames::Sized)).unwrap(), header);
    }

    #[test]
    fn broken_headers_are_refused_with_the_place() {
        let cases = [
            ("plx\n", "no PLY file"),
            ("ply\n", "ends before"),
            ("ply\nend_header\n", "no \"format\""),
            ("ply\nformat ascii 2.0\n", "expected an encoding"),
            ("ply\nformat morse 1.0\n", "unknown encoding"),
            ("ply\nformat ascii 1.0\nelement vertex -1\n", "not a count"),
            ("ply\nformat ascii 1.0\nproperty float x\n", "before the first element"),
            ("ply\nformat ascii 1.0\nelement v 1\nproperty half x\n", "unknown type"),
            ("ply\nformat ascii 1.0\nelement v 1\nproperty int x\nproperty int x\n", "declared twice"),
            ("ply\nformat ascii 1.0\nelement v 1\nproperty list float int x\n", "must be an integer"),
            ("ply\nwhat is this\n", "not understood"),
        ];
        for (text, expected) in cases {
            let error = parse(text).unwrap_err().to_string();
            assert!(error.contains(expected), "{text:?}: {error}");
        }
    }

    #[test]
    fn endless_header_lines_are_refused() {
        let text = format!("ply\nformat ascii 1.0\ncomment {}", "x".repeat(1 << 20));
        assert!(matches!(parse(&text), Err(Error::Limits { .. })));
    }
}
