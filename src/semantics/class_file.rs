//! Class tables as files: TOML, and the `labels.json` of OpenMVS's segmentation script.

use super::classes::{Class, ClassId, ClassTable, plain_class};
use super::names::normalized;
use super::regions::PlanePrior;
use crate::{Error, Result};
use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Whether two classes may have one colour, as they do in a public benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SharedColors {
    Allowed,
    Refused,
}

const TABLE_KEYS: [&str; 4] = ["name", "void-name", "void-colors", "class"];
const CLASS_KEYS: [&str; 10] = [
    "id",
    "name",
    "color",
    "keep",
    "estimate",
    "surface",
    "las",
    "prior",
    "max-normal-deviation",
    "min-region",
];

/// Reads a class table from TOML; `path` is for messages and, without a `name` key, for the table's name.
pub(super) fn parse(text: &str, path: &Path, shared: SharedColors) -> Result<ClassTable> {
    let source = Source { text, path };
    let root = DeTable::parse(text).map_err(|e| source.error(e.span().unwrap_or_default(), e.message()))?;
    let root = Keys::of(source, "", root.get_ref(), &TABLE_KEYS)?;
    let name = match root.value("name") {
        Some(value) => source.string("name", value)?,
        None => path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
    };
    let void_name = root.value("void-name").map(|value| source.string("void-name", value)).transpose()?;
    let mut roster = Roster::new(shared);
    let mut void_colors = Vec::new();
    if let Some(value) = root.value("void-colors") {
        for color in source.array("void-colors", value)? {
            void_colors.push(source.color("void-colors", color)?);
        }
    }
    let classes =
        root.value("class").map(|value| source.array("class", value)).transpose()?.unwrap_or_default();
    for value in classes {
        let class = parse_class(source, value, &void_colors)?;
        roster.add(class, value.span()).map_err(|(span, what)| source.error(span, &what))?;
    }
    if roster.classes.is_empty() {
        return Err(Error::content(
            path,
            "no class in this table; it needs [[class]] entries with id and name",
        ));
    }
    Ok(ClassTable::of(name, roster.classes, void_name, void_colors))
}

fn parse_class(source: Source<'_>, value: &Spanned<DeValue<'_>>, void_colors: &[[u8; 3]]) -> Result<Class> {
    let DeValue::Table(table) = value.get_ref() else {
        return Err(source.error(value.span(), "key class: an entry must be a table with id and name"));
    };
    let keys = Keys::of(source, "class.", table, &CLASS_KEYS)?;
    let required = |key: &'static str| {
        keys.value(key).ok_or_else(|| source.error(value.span(), &format!("this class lacks the key {key}")))
    };
    let id = source.integer("class.id", required("id")?, 1..=u16::MAX.into())? as u16;
    let name_value = required("name")?;
    let name = source.string("class.name", name_value)?;
    check_name(&name).map_err(|what| source.error(name_value.span(), &format!("key class.name: {what}")))?;
    let mut class = plain_class(ClassId(id), name);
    if let Some(value) = keys.value("color") {
        let color = source.color("class.color", value)?;
        if void_colors.contains(&color) {
            return Err(
                source.error(value.span(), &format!("key class.color: {color:?} is one of void-colors"))
            );
        }
        class.color = Some(color);
    }
    if let Some(value) = keys.value("keep") {
        class.keep = source.boolean("class.keep", value)?;
    }
    if let Some(value) = keys.value("surface") {
        class.surface = source.boolean("class.surface", value)?;
    }
    class.estimate =
        keys.value("estimate").map(|value| source.boolean("class.estimate", value)).transpose()?;
    let las =
        keys.value("las").map(|value| source.integer("class.las", value, 0..=u8::MAX.into())).transpose()?;
    class.las = las.map(|code| code as u8);
    class.plane = parse_plane(source, &keys)?;
    Ok(class)
}

/// The keys about the class's planes.
fn parse_plane(source: Source<'_>, keys: &Keys<'_, '_>) -> Result<Option<PlanePrior>> {
    let mut plane = PlanePrior::default();
    let Some(prior) = keys.value("prior") else {
        let without =
            ["max-normal-deviation", "min-region"].into_iter().find_map(|key| Some((key, keys.value(key)?)));
        return without.map_or(Ok(None), |(key, value)| {
            Err(source.error(value.span(), &format!("key class.{key} needs prior = \"plane\" in this class")))
        });
    };
    let name = source.string("class.prior", prior)?;
    if name != "plane" {
        return Err(
            source.error(prior.span(), &format!("key class.prior: {name:?} is unknown, there is \"plane\""))
        );
    }
    if let Some(value) = keys.value("max-normal-deviation") {
        plane.max_normal_deviation = source.angle("class.max-normal-deviation", value)?;
    }
    if let Some(value) = keys.value("min-region") {
        plane.min_region = source.integer("class.min-region", value, 1..=u32::MAX.into())? as u32;
    }
    Ok(Some(plane))
}

/// A name must survive a `comment` line of a PLY header and a comma-separated list.
fn check_name(name: &str) -> std::result::Result<(), String> {
    if name.trim().is_empty() {
        Err("the name is empty".to_owned())
    } else if name.chars().any(|c| c.is_control() || c == ',') {
        Err(format!("{name:?} holds a comma or a control character"))
    } else if normalized(name) == "void" {
        Err("void is always id 0".to_owned())
    } else {
        Ok(())
    }
}

/// The classes so far, and where the table names each id, name and colour.
struct Roster {
    classes: Vec<Class>,
    ids: HashMap<ClassId, usize>,
    names: HashMap<String, usize>,
    colors: HashMap<[u8; 3], usize>,
    shared: SharedColors,
}

impl Roster {
    fn new(shared: SharedColors) -> Self {
        let (ids, names, colors) = Default::default();
        Roster { classes: Vec::new(), ids, names, colors, shared }
    }

    /// Adds a class, or says which earlier class it repeats and in what.
    fn add<Place>(&mut self, class: Class, place: Place) -> std::result::Result<(), (Place, String)> {
        let position = self.classes.len();
        let repeats = if let Some(other) = self.ids.insert(class.id, position) {
            Some((other, format!("id: {}", class.id)))
        } else if let Some(other) = self.names.insert(normalized(&class.name), position) {
            Some((other, format!("name: {:?}", class.name)))
        } else {
            let other = class.color.and_then(|color| self.colors.insert(color, position));
            let other = other.filter(|_| self.shared == SharedColors::Refused);
            other.map(|other| (other, format!("color: {:?}", class.color.unwrap_or_default())))
        };
        if let Some((other, what)) = repeats {
            let other = &self.classes[other];
            let what = format!("key class.{what} is taken by class {} {:?}", other.id, other.name);
            return Err((place, what));
        }
        self.classes.push(class);
        Ok(())
    }
}

/// The same classes, unless two have one id or one name.
///
/// # Errors
/// What they share.
pub(super) fn distinct(classes: Vec<Class>) -> std::result::Result<Vec<Class>, String> {
    let mut roster = Roster::new(SharedColors::Allowed);
    classes.into_iter().try_for_each(|class| roster.add(class, ()).map_err(|((), what)| what))?;
    Ok(roster.classes)
}

/// A TOML text and the file it came from.
#[derive(Clone, Copy)]
struct Source<'a> {
    text: &'a str,
    path: &'a Path,
}

impl Source<'_> {
    /// An error at the line in which `span` starts.
    fn error(self, span: Range<usize>, what: &str) -> Error {
        let start = span.start.min(self.text.len());
        let line = 1 + self.text.as_bytes()[..start].iter().filter(|&&b| b == b'\n').count();
        Error::content(self.path, format!("line {line}: {}", what.replace('\n', ", ")))
    }

    fn mismatch(self, key: &str, value: &Spanned<DeValue<'_>>, wanted: &str) -> Error {
        self.error(value.span(), &format!("key {key}: {} where {wanted} belongs", value.get_ref().type_str()))
    }

    fn string(self, key: &str, value: &Spanned<DeValue<'_>>) -> Result<String> {
        match value.get_ref() {
            DeValue::String(s) => Ok(s.trim().to_owned()),
            _ => Err(self.mismatch(key, value, "a string")),
        }
    }

    fn boolean(self, key: &str, value: &Spanned<DeValue<'_>>) -> Result<bool> {
        match value.get_ref() {
            DeValue::Boolean(b) => Ok(*b),
            _ => Err(self.mismatch(key, value, "true or false")),
        }
    }

    fn integer(
        self,
        key: &str,
        value: &Spanned<DeValue<'_>>,
        range: std::ops::RangeInclusive<i64>,
    ) -> Result<i64> {
        let DeValue::Integer(integer) = value.get_ref() else {
            return Err(self.mismatch(key, value, "an integer"));
        };
        match i64::from_str_radix(integer.as_str(), integer.radix()) {
            Ok(i) if range.contains(&i) => Ok(i),
            _ => {
                let what = format!("key {key}: {integer} is not in {}..={}", range.start(), range.end());
                Err(self.error(value.span(), &what))
            }
        }
    }

    /// An angle above 0, at most 90 degrees.
    fn angle(self, key: &str, value: &Spanned<DeValue<'_>>) -> Result<f32> {
        let degrees: Option<f32> = match value.get_ref() {
            DeValue::Float(float) => float.as_str().parse().ok(),
            DeValue::Integer(integer) => integer.as_str().parse().ok(),
            _ => return Err(self.mismatch(key, value, "a number of degrees")),
        };
        degrees
            .filter(|degrees| *degrees > 0.0 && *degrees <= 90.0)
            .ok_or_else(|| self.error(value.span(), &format!("key {key}: give degrees above 0, at most 90")))
    }

    fn array<'v, 'i>(
        self,
        key: &str,
        value: &'v Spanned<DeValue<'i>>,
    ) -> Result<Vec<&'v Spanned<DeValue<'i>>>> {
        match value.get_ref() {
            DeValue::Array(array) => Ok(array.iter().collect()),
            _ => Err(self.mismatch(key, value, "an array")),
        }
    }

    fn color(self, key: &str, value: &Spanned<DeValue<'_>>) -> Result<[u8; 3]> {
        let channels = self.array(key, value)?;
        let &[r, g, b] = channels.as_slice() else {
            return Err(self
                .error(value.span(), &format!("key {key}: a colour is [red, green, blue], 0 to 255 each")));
        };
        let channel = |value| self.integer(key, value, 0..=255).map(|c| c as u8);
        Ok([channel(r)?, channel(g)?, channel(b)?])
    }
}

/// A TOML table all of whose keys are known.
struct Keys<'t, 'i>(&'t DeTable<'i>);

impl<'t, 'i> Keys<'t, 'i> {
    fn of(source: Source<'_>, prefix: &str, table: &'t DeTable<'i>, known: &[&str]) -> Result<Self> {
        let mut unknown: Vec<_> =
            table.keys().filter(|key| !known.contains(&key.get_ref().as_ref())).collect();
        unknown.sort_by_key(|key| key.span().start);
        match unknown.first() {
            None => Ok(Keys(table)),
            Some(key) => {
                let what =
                    format!("unknown key {prefix}{}, the keys are {}", key.get_ref(), known.join(", "));
                Err(source.error(key.span(), &what))
            }
        }
    }

    fn value(&self, key: &str) -> Option<&'t Spanned<DeValue<'i>>> {
        self.0.iter().find(|(k, _)| k.get_ref().as_ref() == key).map(|(_, value)| value)
    }
}

/// Reads a `labels.json`: one object from decimal id to name.
pub(super) fn parse_labels_json(text: &str, path: &Path) -> Result<ClassTable> {
    let refused = |what: String| Error::content(path, what);
    let Entries(entries) = serde_json::from_str(text).map_err(|e| {
        refused(format!("{e}; a labels.json is one object from id to name, {{\"1\": \"building\"}}"))
    })?;
    let mut roster = Roster::new(SharedColors::Refused);
    let mut void_name = None;
    for (key, name) in entries {
        let id: u16 = key.parse().map_err(|_| refused(format!("key {key:?} is not an id in 0..=65535")))?;
        let name = name.trim().to_owned();
        if id == 0 {
            if void_name.replace(name).is_some() {
                return Err(refused(format!("key {key:?}: id 0 is given twice")));
            }
            continue;
        }
        check_name(&name).map_err(|what| refused(format!("key {key:?}: {what}")))?;
        let class = plain_class(ClassId(id), name);
        roster.add(class, ()).map_err(|((), what)| refused(format!("key {key:?}: {what}")))?;
    }
    if roster.classes.is_empty() {
        return Err(refused("no class in this table".to_owned()));
    }
    Ok(ClassTable::of("labels.json".to_owned(), roster.classes, void_name, Vec::new()))
}

/// A JSON object with its keys in file order, repeated ones included.
struct Entries(Vec<(String, String)>);

impl<'de> serde::Deserialize<'de> for Entries {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Visitor;
        impl<'de> serde::de::Visitor<'de> for Visitor {
            type Value = Entries;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("an object from id to name")
            }
            fn visit_map<A: serde::de::MapAccess<'de>>(
                self,
                mut map: A,
            ) -> std::result::Result<Entries, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                Ok(Entries(entries))
            }
        }
        deserializer.deserialize_map(Visitor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn toml_error(text: &str) -> String {
        ClassTable::from_toml(text, Path::new("t.toml")).unwrap_err().to_string()
    }

    const WALL: &str = "[[class]]\nid = 1\nname = \"wall\"\ncolor = [1, 2, 3]\n";

    #[test]
    fn a_full_table_is_read() {
        let text = "name = \"facade\"\nvoid-name = \"other\"\nvoid-colors = [[9, 9, 9]]\n[[class]]\nid = 65535\nname = \"sky\"\n\
                    color = [255, 255, 0]\nkeep = false\nestimate = true\nsurface = false\nlas = 6\n\
                    prior = \"plane\"\nmax-normal-deviation = 12.5\nmin-region = 40\n[[class]]\nid = 0x1\nname = \"wall\"\n";
        let table = ClassTable::from_toml(text, Path::new("t.toml")).unwrap();
        assert_eq!(table.name(), "facade");
        let [wall, sky] = table.classes() else { panic!("{table:?}") };
        assert_eq!(*wall, plain_class(ClassId(1), "wall".into()));
        let color = Some([255, 255, 0]);
        let expected = Class {
            id: ClassId(65535),
            name: "sky".into(),
            color,
            keep: false,
            estimate: Some(true),
            surface: false,
            las: Some(6),
            plane: Some(PlanePrior { max_normal_deviation: 12.5, min_region: 40 }),
        };
        assert_eq!(*sky, expected);
        assert_eq!(table.resolve("Other").unwrap(), ClassId::VOID);
        assert_eq!(table.colors(), [([9, 9, 9], ClassId::VOID), ([255, 255, 0], ClassId(65535))].into());
        let unnamed = ClassTable::from_toml(WALL, Path::new("dir/my classes.toml")).unwrap();
        assert_eq!(unnamed.name(), "my classes");
    }

    #[test]
    fn planes_have_defaults_and_are_off_unless_asked_for() {
        let plane = |text: &str| {
            let table = ClassTable::from_toml(&format!("{WALL}{text}"), Path::new("t.toml")).unwrap();
            table.classes()[0].plane
        };
        assert_eq!(plane(""), None);
        assert_eq!(plane("prior = \"plane\"\n"), Some(PlanePrior::default()));
        let angle = plane("prior = \"plane\"\nmax-normal-deviation = 45\n").unwrap().max_normal_deviation;
        assert_eq!(angle, 45.0);
        assert!(ClassTable::builtin_names().all(|name| {
            ClassTable::builtin(name).unwrap().classes().iter().all(|class| class.plane.is_none())
        }));
    }

    #[test]
    fn errors_about_planes_name_line_and_key() {
        let cases = [
            (format!("{WALL}prior = 1\n"), "line 5: key class.prior: integer where a string belongs"),
            (
                format!("{WALL}prior = \"sphere\"\n"),
                "line 5: key class.prior: \"sphere\" is unknown, there is",
            ),
            (format!("{WALL}min-region = 9\n"), "line 5: key class.min-region needs prior = \"plane\""),
            (
                format!("{WALL}max-normal-deviation = 9\n"),
                "line 5: key class.max-normal-deviation needs prior = \"plane\"",
            ),
            (
                format!("{WALL}prior = \"plane\"\nmin-region = 0\n"),
                "line 6: key class.min-region: 0 is not in 1..=4294967295",
            ),
            (
                format!("{WALL}prior = \"plane\"\nmax-normal-deviation = 90.5\n"),
                "line 6: key class.max-normal-deviation: give degrees above 0, at most 90",
            ),
            (
                format!("{WALL}prior = \"plane\"\nmax-normal-deviation = nan\n"),
                "line 6: key class.max-normal-deviation: give degrees",
            ),
            (
                format!("{WALL}prior = \"plane\"\nmax-normal-deviation = \"20\"\n"),
                "line 6: key class.max-normal-deviation: string where a number of degrees belongs",
            ),
        ];
        for (text, expected) in cases {
            let error = toml_error(&text);
            assert!(error.contains(expected), "{text}\n  gave {error}\n  not {expected}");
        }
    }

    #[test]
    fn every_error_names_file_line_and_key() {
        let cases = [
            (format!("{WALL}colour = 3\n"), "t.toml: line 5: unknown key class.colour"),
            (format!("title = \"x\"\n{WALL}"), "t.toml: line 1: unknown key title"),
            (
                format!("{WALL}[[class]]\nid = 1\nname = \"sky\"\n"),
                "t.toml: line 5: key class.id: 1 is taken by class 1",
            ),
            (
                format!("{WALL}[[class]]\nid = 2\nname = \"Wall\"\n"),
                "line 5: key class.name: \"Wall\" is taken",
            ),
            (
                format!("{WALL}[[class]]\nid = 2\nname = \"sky\"\ncolor = [1, 2, 3]\n"),
                "line 5: key class.color: [1, 2, 3]",
            ),
            ("[[class]]\nid = 0\nname = \"a\"\n".into(), "line 2: key class.id: 0 is not in 1..=65535"),
            ("[[class]]\nid = 65536\nname = \"a\"\n".into(), "line 2: key class.id: 65536 is not in"),
            ("[[class]]\nid = -1\nname = \"a\"\n".into(), "line 2: key class.id: -1 is not in"),
            ("[[class]]\nid = \"1\"\nname = \"a\"\n".into(), "line 2: key class.id: string where an integer"),
            ("[[class]]\nname = \"a\"\n".into(), "line 1: this class lacks the key id"),
            ("[[class]]\nid = 1\n".into(), "line 1: this class lacks the key name"),
            ("[[class]]\nid = 1\nname = \"a,b\"\n".into(), "line 3: key class.name"),
            ("[[class]]\nid = 1\nname = \"a\\nb\"\n".into(), "line 3: key class.name"),
            ("[[class]]\nid = 1\nname = \" \"\n".into(), "line 3: key class.name: the name is empty"),
            ("[[class]]\nid = 1\nname = \"Void\"\n".into(), "line 3: key class.name: void is always id 0"),
            (
                "[[class]]\nid = 1\nname = \"a\"\ncolor = [1, 2]\n".into(),
                "line 4: key class.color: a colour is",
            ),
            (
                "[[class]]\nid = 1\nname = \"a\"\ncolor = [1, 2, 256]\n".into(),
                "line 4: key class.color: 256 is not in",
            ),
            (
                "[[class]]\nid = 1\nname = \"a\"\nkeep = 1\n".into(),
                "line 4: key class.keep: integer where true",
            ),
            (
                "[[class]]\nid = 1\nname = \"a\"\nlas = 256\n".into(),
                "line 4: key class.las: 256 is not in 0..=255",
            ),
            (
                format!("void-colors = [[1, 2, 3]]\n{WALL}"),
                "line 5: key class.color: [1, 2, 3] is one of void-colors",
            ),
            ("class = 3\n".into(), "line 1: key class: integer where an array"),
            ("class = [3]\n".into(), "line 1: key class: an entry must be a table"),
            ("name = \"empty\"\n".into(), "t.toml: no class in this table"),
            ("[[class]]\nid = \n".into(), "t.toml: line 2: "),
            ("[[class]]\nid = 1\nid = 2\n".into(), "t.toml: line 3: "),
        ];
        for (text, expected) in cases {
            let error = toml_error(&text);
            assert!(error.contains(expected), "{text}\n  gave {error}\n  not {expected}");
            assert!(!error.contains('\n'), "{error}");
        }
    }

    #[test]
    fn labels_json_is_a_table_without_colours() {
        let text = r#"{"0": "unclassified", "2": "building", "300": "road"}"#;
        let table = ClassTable::from_labels_json(text, Path::new("labels.json")).unwrap();
        let names: Vec<_> = table.classes().iter().map(|c| (c.id.0, c.name.as_str())).collect();
        assert_eq!(names, [(2, "building"), (300, "road")]);
        assert_eq!(table.resolve("unclassified").unwrap(), ClassId::VOID);
        assert!(!table.has_colors() && table.colors().is_empty());
        assert!(!table.contains(ClassId(1)) && table.contains(ClassId(0)));
        let error =
            |text| ClassTable::from_labels_json(text, Path::new("labels.json")).unwrap_err().to_string();
        for (text, expected) in [
            (r#"{"1": "a", "1": "b"}"#, "key \"1\": key class.id: 1 is taken by class 1 \"a\""),
            (r#"{"1": "a", "2": "A"}"#, "key \"2\": key class.name: \"A\" is taken"),
            (r#"{"65536": "a"}"#, "key \"65536\" is not an id"),
            (r#"{"-1": "a"}"#, "key \"-1\" is not an id"),
            (r#"{"1": 2}"#, "labels.json: invalid type: integer `2`, expected a string at line 1"),
            ("[1]", "expected an object from id to name"),
            ("{}", "no class"),
            ("{\"1\": \"a\"", "line 1 column"),
        ] {
            assert!(error(text).contains(expected), "{text}: {}", error(text));
        }
    }
}
