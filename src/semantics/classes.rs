//! The classes that label maps speak of.

use super::regions::PlanePrior;
use super::{class_file, names};
use crate::{Error, Result};
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

/// Number of a semantic class, as label maps store it; 0 is [`ClassId::VOID`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ClassId(pub u16);

impl ClassId {
    /// Unlabelled: agrees with every class.
    pub const VOID: ClassId = ClassId(0);

    /// Whether this is [`ClassId::VOID`].
    #[inline]
    pub const fn is_void(self) -> bool {
        self.0 == 0
    }
}

impl From<u16> for ClassId {
    #[inline]
    fn from(id: u16) -> Self {
        ClassId(id)
    }
}

impl std::fmt::Display for ClassId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

/// One semantic class.
#[derive(Clone, Debug, PartialEq)]
pub struct Class {
    /// Never [`ClassId::VOID`].
    pub id: ClassId,
    /// Unique in its table, also when case, spaces, `_` and `-` are ignored.
    pub name: String,
    /// Red, green, blue in label maps; `None` in a table of grey maps.
    pub color: Option<[u8; 3]>,
    /// Whether points of this class belong in the cloud unless the command line says otherwise.
    pub keep: bool,
    /// Whether depths of this class are estimated; `None`: where the class is kept.
    pub estimate: Option<bool>,
    /// Whether what it labels has a surface; sky has none.
    pub surface: bool,
    /// ASPRS LAS classification code.
    pub las: Option<u8>,
    /// The planes that pixels of this class are drawn towards; `None`: none.
    pub plane: Option<PlanePrior>,
}

/// The classes of a set of label maps, in order of their ids.
#[derive(Clone, Debug, PartialEq)]
pub struct ClassTable {
    name: String,
    classes: Vec<Class>,
    void_name: Option<String>,
    void_colors: Vec<[u8; 3]>,
    open: bool,
    display: HashMap<ClassId, [u8; 3]>,
}

/// The built-in tables that are written as TOML.
const BUILTIN: [(&str, &str); 4] = [
    ("3dom-facade", include_str!("tables/3dom-facade.toml")),
    ("cityscapes", include_str!("tables/cityscapes.toml")),
    ("ade20k", include_str!("tables/ade20k.toml")),
    ("openmvs-aerial", include_str!("tables/openmvs-aerial.toml")),
];

/// The built-in table that holds whatever ids it meets.
const IDS: &str = "ids";

impl ClassTable {
    /// Names of the built-in tables.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        BUILTIN.iter().map(|&(name, _)| name).chain([IDS])
    }

    /// The built-in table called `name`.
    ///
    /// In `ade20k` two classes share a colour, as in the benchmark (road and skyscraper): it reads as road.
    ///
    /// # Errors
    /// There is none of that name; the message lists them all and suggests the nearest.
    pub fn builtin(name: &str) -> Result<Self> {
        if name == IDS {
            return Ok(ClassTable::ids());
        }
        if let Some((name, text)) = BUILTIN.iter().find(|(builtin, _)| *builtin == name) {
            return class_file::parse(text, Path::new(name), class_file::SharedColors::Allowed);
        }
        let all: Vec<&str> = ClassTable::builtin_names().collect();
        let hint = names::nearest(name, all.iter().copied()).map(|n| format!(", did you mean {n}?"));
        Err(Error::invalid(format!(
            "class table {name:?} is neither a file nor built in ({}){}",
            all.join(", "),
            hint.unwrap_or_default()
        )))
    }

    /// The table for grey maps of unknown meaning: every id is a class, named `class-N`.
    pub fn ids() -> Self {
        ClassTable { open: true, ..ClassTable::of(IDS.to_owned(), Vec::new(), None, Vec::new()) }
    }

    /// The table that `text`, the content of a TOML file, describes.
    ///
    /// # Errors
    /// [`Error::Content`] about `path` with line and key: not TOML, an unknown key, a value of the wrong kind or out
    /// of range, a duplicate id, name or colour, no class at all.
    pub fn from_toml(text: &str, path: &Path) -> Result<Self> {
        class_file::parse(text, path, class_file::SharedColors::Refused)
    }

    /// The table that a `labels.json` describes: one object from decimal id to name, no colours.
    ///
    /// # Errors
    /// [`Error::Content`] about `path`: not such an object, an id out of 0..=65535, a duplicate id or name.
    pub fn from_labels_json(text: &str, path: &Path) -> Result<Self> {
        class_file::parse_labels_json(text, path)
    }

    /// The table `name` of `classes`, as a cloud lists them.
    ///
    /// # Errors
    /// What two of them share: an id, a name.
    pub fn listed(name: String, classes: Vec<Class>) -> std::result::Result<Self, String> {
        class_file::distinct(classes).map(|classes| ClassTable::of(name, classes, None, Vec::new()))
    }

    /// A table of checked parts.
    pub(super) fn of(
        name: String,
        mut classes: Vec<Class>,
        void_name: Option<String>,
        mut void_colors: Vec<[u8; 3]>,
    ) -> Self {
        classes.sort_by_key(|class| class.id);
        let has_colors = classes.iter().any(|class| class.color.is_some());
        let black = [0; 3];
        if has_colors && void_colors.is_empty() && classes.iter().all(|class| class.color != Some(black)) {
            void_colors.push(black);
        }
        let display = display_colors(&classes);
        ClassTable { name, classes, void_name, void_colors, open: false, display }
    }

    /// The table's own name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The classes, void excepted, by id. Empty for `ids` until [`ClassTable::with_ids`] has filled it in.
    pub fn classes(&self) -> &[Class] {
        &self.classes
    }

    /// Whether colour maps can be read with this table.
    pub fn has_colors(&self) -> bool {
        self.classes.iter().any(|class| class.color.is_some())
    }

    /// The class with this id, if the table lists it.
    pub fn get(&self, id: ClassId) -> Option<&Class> {
        self.classes.binary_search_by_key(&id, |class| class.id).ok().map(|i| &self.classes[i])
    }

    /// Whether a label map may hold this id; void always.
    pub fn contains(&self, id: ClassId) -> bool {
        id.is_void() || self.open || self.get(id).is_some()
    }

    /// The name of a class: `void` for void, `class-N` where the table has no name.
    pub fn class_name(&self, id: ClassId) -> Cow<'_, str> {
        match self.get(id) {
            _ if id.is_void() => Cow::Borrowed("void"),
            Some(class) => Cow::Borrowed(&class.name),
            None => Cow::Owned(format!("class-{id}")),
        }
    }

    /// The colour to show a class in: its own, or one of a fixed palette; void is black.
    pub fn color(&self, id: ClassId) -> [u8; 3] {
        match self.display.get(&id) {
            _ if id.is_void() => [0; 3],
            Some(&color) => color,
            None => palette_color(u32::from(id.0)),
        }
    }

    /// An id that no class has: the largest there is.
    pub fn free_id(&self) -> ClassId {
        (1..=u16::MAX).rev().map(ClassId).find(|&id| self.get(id).is_none()).unwrap_or_default()
    }

    /// The ASPRS LAS classification code of a class: the table's, else 64 + id, the first of the codes that users may
    /// define; void is 1, unclassified. `None`: 64 + id is beyond 255.
    pub fn las_code(&self, id: ClassId) -> Option<u8> {
        /// Code of what has been looked at without result.
        const UNCLASSIFIED: u8 = 1;
        /// First code that users may define.
        const FIRST_OF_USERS: u16 = 64;
        match self.get(id).and_then(|class| class.las) {
            _ if id.is_void() => Some(UNCLASSIFIED),
            Some(code) => Some(code),
            None => id.0.checked_add(FIRST_OF_USERS).and_then(|code| u8::try_from(code).ok()),
        }
    }

    /// Every colour that may occur in a label map, with its class.
    ///
    /// Black is void unless the table uses it otherwise.
    pub fn colors(&self) -> HashMap<[u8; 3], ClassId> {
        let mut colors: HashMap<[u8; 3], ClassId> = HashMap::new();
        for &color in &self.void_colors {
            colors.insert(color, ClassId::VOID);
        }
        for class in self.classes.iter().rev() {
            if let Some(color) = class.color {
                colors.insert(color, class.id);
            }
        }
        colors
    }

    /// The class that a user means by a name or an id; case, spaces, `_` and `-` do not matter.
    ///
    /// # Errors
    /// The table has no such class; the message suggests the nearest name.
    pub fn resolve(&self, name_or_id: &str) -> Result<ClassId> {
        let wanted = names::normalized(name_or_id);
        let is_void =
            wanted == "void" || self.void_name.as_deref().is_some_and(|n| names::normalized(n) == wanted);
        if is_void {
            return Ok(ClassId::VOID);
        }
        if let Some(class) = self.classes.iter().find(|class| names::normalized(&class.name) == wanted) {
            return Ok(class.id);
        }
        let digits = if self.open { wanted.strip_prefix("class_").unwrap_or(&wanted) } else { &wanted };
        match digits.parse().map(ClassId) {
            Ok(id) if self.contains(id) => Ok(id),
            _ => Err(self.unknown_class(name_or_id)),
        }
    }

    /// This table with a class for every id met: what `ids` becomes once the label maps are known.
    pub fn with_ids(&self, met: impl IntoIterator<Item = ClassId>) -> Self {
        let mut classes: BTreeMap<ClassId, Class> = self.classes.iter().map(|c| (c.id, c.clone())).collect();
        for id in met.into_iter().filter(|id| self.open && !id.is_void()) {
            classes.entry(id).or_insert_with(|| plain_class(id, format!("class-{id}")));
        }
        let classes = classes.into_values().collect();
        let table =
            ClassTable::of(self.name.clone(), classes, self.void_name.clone(), self.void_colors.clone());
        ClassTable { open: self.open, ..table }
    }

    fn unknown_class(&self, name: &str) -> Error {
        if self.open {
            return Error::invalid(format!(
                "class {name:?}: table ids knows classes by number, 1 or class-1"
            ));
        }
        let known = self.classes.iter().map(|class| class.name.as_str());
        let remedy = match names::nearest(name, known.clone()) {
            Some(nearest) => format!("did you mean {nearest:?}?"),
            None if self.classes.len() <= 20 => format!("it has {}", known.collect::<Vec<_>>().join(", ")),
            None => format!("it has {} classes, ids 1 to {}", self.classes.len(), self.last_id()),
        };
        Error::invalid(format!("class table {} has no class {name:?}; {remedy}", self.name))
    }

    fn last_id(&self) -> ClassId {
        self.classes.last().map_or(ClassId::VOID, |class| class.id)
    }
}

/// A class with everything but id and name at its default.
pub(super) fn plain_class(id: ClassId, name: String) -> Class {
    Class { id, name, color: None, keep: true, estimate: None, surface: true, las: None, plane: None }
}

/// One colour per class: its own where it has one, else the palette's, moved on where that one is taken.
fn display_colors(classes: &[Class]) -> HashMap<ClassId, [u8; 3]> {
    let mut taken: std::collections::HashSet<[u8; 3]> = classes.iter().filter_map(|c| c.color).collect();
    taken.insert([0; 3]);
    let mut display = HashMap::new();
    for class in classes {
        let color = class.color.or_else(|| {
            (0..=u32::from(u8::MAX))
                .map(|turn| palette_color(u32::from(class.id.0) | turn << 16))
                .find(|color| !taken.contains(color))
        });
        if let Some(color) = color {
            taken.insert(color);
            display.insert(class.id, color);
        }
    }
    display
}

/// Colour `n` of the Pascal VOC palette (Everingham et al. 2010): the bits of `n`, lowest first, become the high
/// bits of red, green and blue in turn. Different for every `n` below 2²⁴.
fn palette_color(n: u32) -> [u8; 3] {
    let mut color = [0u8; 3];
    for bit in 0..24 {
        color[bit % 3] |= ((n >> bit & 1) as u8) << (7 - bit / 3);
    }
    color
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    fn builtin(name: &str) -> ClassTable {
        ClassTable::builtin(name).unwrap()
    }

    #[test]
    fn every_builtin_table_is_read_under_its_own_name() {
        for name in ClassTable::builtin_names() {
            assert_eq!(builtin(name).name(), name);
        }
        let error = ClassTable::builtin("cityscape").unwrap_err().to_string();
        assert!(error.contains("did you mean cityscapes?") && error.contains("3dom-facade, "), "{error}");
    }

    #[test]
    fn the_facade_table_is_the_benchmarks() {
        let table = builtin("3dom-facade");
        let expected = [
            ([0, 0, 0], ClassId::VOID),
            ([0, 0, 255], ClassId(1)),
            ([255, 255, 0], ClassId(2)),
            ([255, 0, 0], ClassId(3)),
            ([0, 255, 0], ClassId(4)),
            ([255, 0, 255], ClassId(5)),
        ];
        assert_eq!(table.colors(), expected.into());
        let names: Vec<_> = table.classes().iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["building", "sky", "obstacle", "window", "door"]);
        assert_eq!(table.get(ClassId(1)).unwrap().las, Some(6));
        assert!(table.classes().iter().all(|c| c.keep));
    }

    #[test]
    fn cityscapes_has_its_19_classes_and_ignores_the_rest() {
        let table = builtin("cityscapes");
        assert_eq!(table.classes().len(), 19);
        assert!(table.classes().iter().enumerate().all(|(i, c)| usize::from(c.id.0) == i + 1));
        for (name, id, color) in
            [("road", 1, [128, 64, 128]), ("Sky", 11, [70, 130, 180]), ("bicycle", 19, [119, 11, 32])]
        {
            assert_eq!(table.resolve(name).unwrap(), ClassId(id));
            assert_eq!(table.colors()[&color], ClassId(id));
        }
        assert_eq!(table.colors()[&[111, 74, 0]], ClassId::VOID);
        assert_eq!(table.resolve("traffic_light").unwrap(), table.resolve("Traffic Light").unwrap());
    }

    #[test]
    fn ade20k_has_150_classes_and_one_shared_colour() {
        let table = builtin("ade20k");
        assert_eq!(table.classes().len(), 150);
        for (name, id, color) in [
            ("wall", 1, [120, 120, 120]),
            ("building", 2, [180, 120, 120]),
            ("sky", 3, [6, 230, 230]),
            ("windowpane", 9, [230, 230, 230]),
            ("door", 15, [8, 255, 51]),
            ("clock", 149, [102, 255, 0]),
            ("flag", 150, [92, 0, 255]),
        ] {
            assert_eq!(table.resolve(name).unwrap(), ClassId(id), "{name}");
            assert_eq!(table.colors()[&color], ClassId(id), "{name}");
        }
        assert_eq!(table.colors()[&[140, 140, 140]], table.resolve("road").unwrap());
        let void_and_distinct = 1 + 149;
        assert_eq!(table.colors().len(), void_and_distinct);
    }

    #[test]
    fn the_aerial_table_has_no_colours_of_its_own_but_shows_distinct_ones() {
        let table = builtin("openmvs-aerial");
        assert!(!table.has_colors());
        assert_eq!(table.class_name(ClassId(4)), "static_car");
        let shown: HashSet<_> = (0..=8).map(|id| table.color(ClassId(id))).collect();
        assert_eq!(shown.len(), 9);
    }

    #[test]
    fn the_palette_repeats_no_colour_in_16_bits_and_avoids_the_tables_own() {
        let shown: HashSet<_> = (0..=u32::from(u16::MAX)).map(palette_color).collect();
        assert_eq!(shown.len(), 1 << 16);
        let text = "[[class]]\nid = 7\nname = \"a\"\ncolor = [128, 0, 0]\n[[class]]\nid = 1\nname = \"b\"\n";
        let table = ClassTable::from_toml(text, Path::new("t.toml")).unwrap();
        assert_eq!(table.color(ClassId(7)), [128, 0, 0]);
        assert_eq!(palette_color(1), [128, 0, 0]);
        assert_ne!(table.color(ClassId(1)), [128, 0, 0]);
    }

    #[test]
    fn the_ids_table_learns_the_ids_it_meets() {
        let table = builtin("ids");
        assert!(table.contains(ClassId(65_535)) && table.classes().is_empty());
        let met = table.with_ids([ClassId(300), ClassId(0), ClassId(2), ClassId(300)]);
        let names: Vec<_> = met.classes().iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["class-2", "class-300"]);
        assert_eq!(met.color(ClassId(300)), table.color(ClassId(300)));
        let facade = builtin("3dom-facade");
        assert_eq!(facade.with_ids([ClassId(9)]), facade);
    }

    #[test]
    fn the_largest_unused_id_is_free() {
        assert_eq!(builtin("3dom-facade").free_id(), ClassId(u16::MAX));
        let met = builtin("ids").with_ids([ClassId(65_535), ClassId(65_533)]);
        assert_eq!(met.free_id(), ClassId(65_534));
    }

    #[test]
    fn las_codes_are_the_tables_else_those_for_users() {
        let facade = builtin("3dom-facade");
        let codes: Vec<_> = (0..=5).map(|id| facade.las_code(ClassId(id))).collect();
        assert_eq!(codes, [1, 6, 66, 67, 68, 69].map(Some));
        let ids = builtin("ids");
        assert_eq!((ids.las_code(ClassId(191)), ids.las_code(ClassId(192))), (Some(255), None));
        assert_eq!(ids.las_code(ClassId(u16::MAX)), None);
        assert_eq!(builtin("ade20k").las_code(ClassId(150)), Some(214));
    }

    #[test]
    fn black_is_void_unless_it_is_a_class() {
        let table = |color: &str| {
            let text = format!("[[class]]\nid = 1\nname = \"a\"\ncolor = {color}\n");
            ClassTable::from_toml(&text, Path::new("t.toml")).unwrap().colors()
        };
        assert_eq!(table("[1, 1, 1]")[&[0, 0, 0]], ClassId::VOID);
        assert_eq!(table("[0, 0, 0]"), [([0, 0, 0], ClassId(1))].into());
    }
}
