//! Classes, and the class of every pixel.

use crate::error::{Error, Result};
use crate::geometry::Size;
use crate::scene::{self, Grid};
use crate::semantics::{self, ClassId};
use crate::store::labels::{LabelSources, read_label_map};
use semvs_formats::Limits;
use std::path::Path;
use std::sync::Arc;

/// The classes that label maps speak of: numbers, names, colours.
///
/// ```
/// let classes = semvs::ClassTable::named("3dom-facade")?;
/// let window = classes.id("window")?;
/// assert_eq!((window, classes.name(window).as_str()), (4, "window"));
/// assert_eq!(classes.ids().count(), 5);
/// let error = classes.id("widnow").unwrap_err();
/// assert!(error.to_string().contains("did you mean \"window\"?"));
/// # Ok::<(), semvs::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ClassTable(pub(super) semantics::ClassTable);

/// The class of every pixel of a photograph; 0 is void, which agrees with every class.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelMap(pub(super) Arc<scene::LabelMap>);

impl ClassTable {
    /// A built-in table (`3dom-facade`, `cityscapes`, `ade20k`, `openmvs-aerial`, or `ids`, whose classes are what is met),
    /// or the TOML file at that path.
    ///
    /// # Errors
    /// [`Error`]: neither, or a file that is no class table, with line and key.
    pub fn named(name: &str) -> Result<Self> {
        let sources = LabelSources { class_table: Some(name.to_owned()), ..LabelSources::default() };
        sources.table(Limits::default()).map(ClassTable)
    }

    /// The numbers of all classes, ascending, without 0.
    pub fn ids(&self) -> impl Iterator<Item = u16> {
        self.0.classes().iter().map(|class| class.id.0)
    }

    /// The number of a class by its name, whatever its case.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the nearest name.
    pub fn id(&self, name: &str) -> Result<u16> {
        self.0.resolve(name).map(|id| id.0)
    }

    /// The name of a class; one that the table lacks is called by its number.
    pub fn name(&self, id: u16) -> String {
        self.0.class_name(ClassId(id)).into_owned()
    }

    /// The colour of a class: red, green, blue.
    pub fn color(&self, id: u16) -> [u8; 3] {
        self.0.color(ClassId(id))
    }
}

impl LabelMap {
    /// Reads a PNG file: numbers of classes in one channel, or the colours of `classes`.
    ///
    /// # Errors
    /// [`Error`]: unreadable, not a PNG, a number or colour that `classes` lacks.
    pub fn read(path: impl AsRef<Path>, classes: &ClassTable) -> Result<Self> {
        let map = read_label_map(path.as_ref(), &classes.0, Limits::default())?;
        Ok(LabelMap(Arc::new(map)))
    }

    /// A map from numbers of classes, by rows from the top.
    ///
    /// # Errors
    /// [`Error::Invalid`]: `ids` are not `width` × `height`.
    pub fn new(width: u32, height: u32, ids: Vec<u16>) -> Result<Self> {
        let (size, count) = (Size::new(width, height), ids.len());
        let map = Grid::from_vec(size, ids)
            .ok_or_else(|| Error::invalid(format!("label map: {count} numbers for {size} pixels")))?;
        Ok(LabelMap(Arc::new(map)))
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.0.size().width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.0.size().height
    }

    /// The number of every pixel's class, by rows from the top.
    pub fn ids(&self) -> &[u16] {
        self.0.data()
    }
}
