//! Which images each point of a fused cloud was seen in (`fused.ply.vis`).

use crate::mvs::Visibility;
use crate::wire::{Place, Reader, Writer};
use crate::{Error, Limits, Result};
use std::io::{Read, Write};

/// Reads the lists, one per point of the cloud beside it: positions in the order of the model's images, unsorted.
/// `length` is the number of bytes in `source`, if known.
///
/// # Errors
/// [`Error::Format`] for a file that is shorter or longer than its counts say; [`Error::Limits`]; [`Error::Io`].
pub fn read_visibility(source: impl Read, length: Option<u64>, limits: &Limits) -> Result<Visibility> {
    let mut r = Reader::new(source, length, limits);
    let root = Place::Root("visibility");
    let count = r.u64(&root)?;
    let count = r.check_count(count, 4, &root)?;
    let mut views = Visibility { offsets: vec![0], ..Default::default() };
    r.room(&mut views.offsets, count, &root)?;
    for index in 0..count {
        let at = root.item(index);
        let n = r.u32(&at)?;
        r.extend(&mut views.images, n.into(), &at, |b| u32::from_le_bytes(*b))?;
        views.offsets.push(views.images.len() as u64);
    }
    if !r.at_end()? {
        return Err(r.error(&root, format!("bytes follow the lists of {count} points")));
    }
    Ok(views)
}

/// Writes the lists.
///
/// # Errors
/// [`Error::Unsupported`] if the offsets do not fit the images; [`Error::Io`].
pub fn write_visibility(views: &Visibility, out: impl Write) -> Result<()> {
    let mut w = Writer::new(out);
    w.u64(views.offsets.len().saturating_sub(1) as u64)?;
    for range in views.offsets.windows(2) {
        let Some(images) = views.images.get(range[0] as usize..range[1] as usize) else {
            return Err(Error::Unsupported("view lists that overlap their end".into()));
        };
        w.u32(images.len() as u32)?;
        w.records(images, |image| image.to_le_bytes())?;
    }
    w.finish()
}
