//! Reading one label map from a PNG file.

use crate::error::{Error, Result};
use crate::geometry::Size;
use crate::scene::{Grid, LabelMap};
use crate::semantics::{ClassId, ClassTable};
use semvs_formats::Limits;
use std::collections::HashMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// What to do with an id or a colour that the class table lacks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UnknownLabel {
    /// Stop: the table or the map is the wrong one.
    #[default]
    Refuse,
    /// Take it for void.
    Void,
}

/// Compressed data cannot grow by more than this (the bound of the deflate format, rounded up).
const MAX_INFLATION: u64 = 1040;

/// The values of a grey PNG as they stand; `None` for one in colours.
///
/// # Errors
/// [`Error`] about `path`: unreadable, not a PNG, larger than the limits.
pub fn grey_ids(path: &Path, limits: Limits) -> Result<Option<LabelMap>> {
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    let info = png::Decoder::new(BufReader::new(file)).read_info();
    let info = info.map_err(|e| Error::content(path, format!("not a readable PNG: {e}")))?;
    if !matches!(info.info().color_type, png::ColorType::Grayscale | png::ColorType::GrayscaleAlpha) {
        return Ok(None);
    }
    let (table, unknown) = (ClassTable::ids(), UnknownLabel::Refuse);
    let reader = LabelReader { table, colors: HashMap::new(), table_is_assumed: true, unknown, limits };
    reader.read(path, |_| Ok(())).map(Some)
}

/// How the pixels of a PNG file become class ids.
#[derive(Clone, Debug)]
pub(super) struct LabelReader {
    /// Classes that may occur.
    pub(super) table: ClassTable,
    /// [`ClassTable::colors`] of `table`.
    pub(super) colors: HashMap<[u8; 3], ClassId>,
    /// Whether the table is only a stand-in because none was named.
    pub(super) table_is_assumed: bool,
    pub(super) unknown: UnknownLabel,
    pub(super) limits: Limits,
}

impl LabelReader {
    /// Reads a label map at its own size: grey values are ids as they stand, whatever their bit depth; palette and
    /// true colours are looked up, transparency is ignored. `check_size` sees the size before any pixel is read.
    ///
    /// # Errors
    /// [`Error`] about `path`: unreadable, not a PNG, what `check_size` says, larger than the limits, an id or colour
    /// that the table lacks with the first pixel that has it.
    pub(super) fn read(&self, path: &Path, check_size: impl FnOnce(Size) -> Result<()>) -> Result<LabelMap> {
        let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
        let file_bytes = file.metadata().map_err(|e| Error::io(path, "open", e))?.len();
        let refused = |e: png::DecodingError| match e {
            png::DecodingError::IoError(e) if e.kind() != std::io::ErrorKind::UnexpectedEof => {
                Error::io(path, "read", e)
            }
            e => Error::content(path, format!("not a readable PNG label map: {e}")),
        };
        let budget = usize::try_from(self.limits.max_bytes).unwrap_or(usize::MAX);
        let mut decoder = png::Decoder::new_with_limits(BufReader::new(file), png::Limits { bytes: budget });
        decoder.set_transformations(png::Transformations::IDENTITY);
        let mut reader = decoder.read_info().map_err(refused)?;
        let size = Size::new(reader.info().width, reader.info().height);
        check_size(size)?;
        let raw = reader.output_buffer_size().filter(|&raw| self.fits(size, raw, file_bytes));
        let raw = raw.ok_or_else(|| {
            Error::content(
                path,
                format!("claims {size} pixels, more than the file can hold or the limits allow"),
            )
        })?;
        let mut bytes = vec![0; raw];
        let frame = reader.next_frame(&mut bytes).map_err(refused)?;
        let palette = reader.info().palette.as_deref().unwrap_or_default();
        let image =
            RawImage { size, color: frame.color_type, depth: frame.bit_depth, row_bytes: frame.line_size };
        self.translate(path, image, &bytes, palette)
    }

    /// Whether pixels that need `raw` bytes can come out of a file of `file_bytes` and fit the limits as ids.
    fn fits(&self, size: Size, raw: usize, file_bytes: u64) -> bool {
        let ids = u64::from(size.width) * u64::from(size.height) * 2;
        raw as u64 <= file_bytes.saturating_mul(MAX_INFLATION) && ids <= self.limits.max_bytes
    }

    fn translate(&self, path: &Path, image: RawImage, bytes: &[u8], palette: &[u8]) -> Result<LabelMap> {
        use png::{BitDepth, ColorType};
        let refused = |what: &str| Err(Error::content(path, what.to_owned()));
        let is_grey = matches!(image.color, ColorType::Grayscale | ColorType::GrayscaleAlpha);
        if !is_grey && self.colors.is_empty() {
            return refused(&self.needs_colors());
        }
        match (image.color, image.depth) {
            (ColorType::Grayscale, BitDepth::Sixteen) => {
                self.ids(path, image, bytes, |p| be16(p[0], p[1]), 2)
            }
            (ColorType::GrayscaleAlpha, BitDepth::Sixteen) => {
                self.ids(path, image, bytes, |p| be16(p[0], p[1]), 4)
            }
            (ColorType::GrayscaleAlpha, _) => self.ids(path, image, bytes, |p| p[0].into(), 2),
            (ColorType::Grayscale, _) => {
                let bytes = unpack(image, bytes);
                self.ids(path, image.unpacked(), &bytes, |p| p[0].into(), 1)
            }
            (ColorType::Indexed, _) => {
                let bytes = unpack(image, bytes);
                let color = |i: u8| palette.chunks_exact(3).nth(i.into()).map(|c| [c[0], c[1], c[2]]);
                let entries: Vec<Option<[u8; 3]>> = (0..=u8::MAX).map(color).collect();
                if bytes.iter().any(|&i| entries[usize::from(i)].is_none()) {
                    return refused("a pixel's palette index is beyond the palette");
                }
                let look_up = |p: &[u8]| entries[usize::from(p[0])].unwrap_or_default();
                self.classes(path, image.unpacked(), &bytes, look_up, 1)
            }
            (ColorType::Rgb, BitDepth::Eight) => self.classes(path, image, bytes, |p| [p[0], p[1], p[2]], 3),
            (ColorType::Rgba, BitDepth::Eight) => self.classes(path, image, bytes, |p| [p[0], p[1], p[2]], 4),
            _ => refused("16-bit colours; a label map has 8-bit colours, or 8 or 16-bit grey ids"),
        }
    }

    /// Grey pixels of `step` bytes each, whose value `id` is the class.
    fn ids(
        &self,
        path: &Path,
        image: RawImage,
        bytes: &[u8],
        id: impl Fn(&[u8]) -> u16,
        step: usize,
    ) -> Result<LabelMap> {
        let known: Vec<bool> = (0..=u16::MAX).map(|id| self.table.contains(ClassId(id))).collect();
        let translate = |value: u16| known[usize::from(value)].then_some(value);
        self.map(path, image, bytes.chunks_exact(step).map(id), translate, |id| format!("id {id}"))
    }

    /// Pixels of `step` bytes each, whose colour is looked up.
    fn classes(
        &self,
        path: &Path,
        image: RawImage,
        bytes: &[u8],
        color: impl Fn(&[u8]) -> [u8; 3],
        step: usize,
    ) -> Result<LabelMap> {
        let mut last = ([0; 3], self.colors.get(&[0; 3]).copied());
        let translate = |color: [u8; 3]| {
            if color != last.0 {
                last = (color, self.colors.get(&color).copied());
            }
            last.1.map(|id| id.0)
        };
        let show = |[r, g, b]: [u8; 3]| format!("colour ({r}, {g}, {b})");
        self.map(path, image, bytes.chunks_exact(step).map(color), translate, show)
    }

    fn map<V: Copy>(
        &self,
        path: &Path,
        image: RawImage,
        values: impl Iterator<Item = V>,
        mut translate: impl FnMut(V) -> Option<u16>,
        show: impl Fn(V) -> String,
    ) -> Result<LabelMap> {
        let mut labels = Vec::with_capacity(image.size.area());
        for value in values {
            match translate(value) {
                Some(id) => labels.push(id),
                None if self.unknown == UnknownLabel::Void => labels.push(0),
                None => {
                    let (x, y) =
                        (labels.len() % image.size.width as usize, labels.len() / image.size.width as usize);
                    let what = format!(
                        "{} at pixel ({x}, {y}) is not in class table {}; correct either, or take what is unknown for void \
                         with --unknown-label void",
                        show(value),
                        self.table.name()
                    );
                    return Err(Error::content(path, what));
                }
            }
        }
        Grid::from_vec(image.size, labels).ok_or_else(|| Error::content(path, "the PNG ends early"))
    }

    /// What to say of a colour map without colours to look up.
    fn needs_colors(&self) -> String {
        let builtin: Vec<&str> = ClassTable::builtin_names().collect();
        let why = match self.table_is_assumed {
            true => "this label map holds colours and no class table says what they mean".to_owned(),
            false => format!("this label map holds colours but class table {} has none", self.table.name()),
        };
        format!(
            "{why}; give --class-table a TOML file or one of {}, or save the map as grey ids",
            builtin.join(", ")
        )
    }
}

/// How the bytes of a decoded PNG are laid out.
#[derive(Clone, Copy)]
struct RawImage {
    size: Size,
    color: png::ColorType,
    depth: png::BitDepth,
    row_bytes: usize,
}

impl RawImage {
    /// The same after [`unpack`].
    fn unpacked(self) -> Self {
        RawImage { depth: png::BitDepth::Eight, row_bytes: self.size.width as usize, ..self }
    }
}

fn be16(high: u8, low: u8) -> u16 {
    u16::from_be_bytes([high, low])
}

/// One byte per sample from samples of 1, 2, 4 or 8 bits, unscaled; a row starts on a byte, high bits first.
fn unpack(image: RawImage, bytes: &[u8]) -> Vec<u8> {
    let bits = image.depth as usize;
    if bits >= 8 {
        return bytes.to_vec();
    }
    let mask = (1u16 << bits) as u8 - 1;
    let mut out = Vec::with_capacity(image.size.area());
    for row in bytes.chunks_exact(image.row_bytes) {
        out.extend((0..image.size.width as usize).map(|x| {
            let shift = 8 - bits - x * bits % 8;
            row[x * bits / 8] >> shift & mask
        }));
    }
    out
}
