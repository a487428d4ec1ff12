//! Records in blocks, the first ones in memory, the others in a file without a name.

use super::record::RecordFormat;
use crate::error::{Error, Result};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Size of a block unless a single record is longer.
const BLOCK_BYTES: usize = 1 << 20;

/// A run of whole records.
#[derive(Debug)]
struct Block {
    /// Number of its first record.
    first: u64,
    place: Place,
}

#[derive(Debug)]
enum Place {
    Memory(Vec<u8>),
    File { offset: u64, bytes: usize },
}

/// All records of a spool in order.
#[derive(Debug)]
pub(super) struct Blocks {
    folder: PathBuf,
    /// Bytes that may still be kept in memory.
    memory: u64,
    blocks: Vec<Block>,
    /// The block that is being filled.
    open: Vec<u8>,
    open_first: u64,
    records: u64,
    file: Option<Mutex<File>>,
    file_bytes: u64,
}

impl Blocks {
    pub(super) fn new(folder: &Path, memory: u64) -> Self {
        Blocks {
            folder: folder.to_owned(),
            memory,
            blocks: Vec::new(),
            open: Vec::new(),
            open_first: 0,
            records: 0,
            file: None,
            file_bytes: 0,
        }
    }

    pub(super) fn records(&self) -> u64 {
        self.records
    }

    /// Appends a record of `bytes` bytes that `encode` writes.
    pub(super) fn append(&mut self, bytes: usize, encode: impl FnOnce(&mut Vec<u8>)) -> Result<()> {
        if !self.open.is_empty() && self.open.len() + bytes > BLOCK_BYTES {
            self.close_block()?;
        }
        encode(&mut self.open);
        self.records += 1;
        Ok(())
    }

    /// Closes the last block.
    pub(super) fn finish(mut self) -> Result<Self> {
        if !self.open.is_empty() {
            self.close_block()?;
            self.open = Vec::new();
        }
        Ok(self)
    }

    fn close_block(&mut self) -> Result<()> {
        let bytes = self.open.len();
        let place = if self.file.is_none() && bytes as u64 <= self.memory {
            self.memory -= bytes as u64;
            Place::Memory(std::mem::replace(&mut self.open, Vec::with_capacity(BLOCK_BYTES)))
        } else {
            self.write_open_block()?
        };
        self.blocks.push(Block { first: self.open_first, place });
        self.open.clear();
        self.open_first = self.records;
        Ok(())
    }

    fn write_open_block(&mut self) -> Result<Place> {
        let failed = |source| Error::io(&self.folder, "write a temporary file in", source);
        let file = match self.file.take() {
            Some(file) => file,
            None => Mutex::new(tempfile::tempfile_in(&self.folder).map_err(failed)?),
        };
        let mut file = file.into_inner().unwrap_or_else(PoisonError::into_inner);
        file.write_all(&self.open).map_err(failed)?;
        self.file = Some(Mutex::new(file));
        let place = Place::File { offset: self.file_bytes, bytes: self.open.len() };
        self.file_bytes += self.open.len() as u64;
        Ok(place)
    }

    /// Reads a block that is in the file into `out`.
    fn read(&self, offset: u64, bytes: usize, out: &mut Vec<u8>) -> Result<()> {
        let failed = |source| Error::io(&self.folder, "read back a temporary file in", source);
        let Some(file) = &self.file else { return Err(failed(std::io::ErrorKind::NotFound.into())) };
        let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
        out.resize(bytes, 0);
        file.seek(SeekFrom::Start(offset)).map_err(failed)?;
        file.read_exact(out).map_err(failed)
    }
}

/// Finds records by number; cheap when the numbers ascend.
#[derive(Debug)]
pub(super) struct BlockReader<'a> {
    blocks: &'a Blocks,
    format: RecordFormat,
    block: usize,
    /// The block's bytes if it is in the file.
    loaded: Vec<u8>,
    /// Number of the record that starts at byte `at` of the block.
    record: u64,
    at: usize,
}

impl<'a> BlockReader<'a> {
    pub(super) fn new(blocks: &'a Blocks, format: RecordFormat) -> Self {
        BlockReader { blocks, format, block: usize::MAX, loaded: Vec::new(), record: 0, at: 0 }
    }

    /// The bytes of record `number`, which must exist.
    pub(super) fn seek(&mut self, number: u64) -> Result<&[u8]> {
        let all = &self.blocks.blocks;
        let is_here = |block: usize| {
            all.get(block).is_some_and(|b| b.first <= number)
                && all.get(block + 1).is_none_or(|next| number < next.first)
        };
        if !is_here(self.block) {
            self.block = all.partition_point(|b| b.first <= number).saturating_sub(1);
            if let Place::File { offset, bytes } = all[self.block].place {
                self.blocks.read(offset, bytes, &mut self.loaded)?;
            }
            (self.record, self.at) = (all[self.block].first, 0);
        } else if number < self.record {
            (self.record, self.at) = (all[self.block].first, 0);
        }
        let bytes = match &all[self.block].place {
            Place::Memory(bytes) => bytes,
            Place::File { .. } => &self.loaded,
        };
        while self.record < number {
            self.at += self.format.len_of(&bytes[self.at..]);
            self.record += 1;
        }
        Ok(&bytes[self.at..][..self.format.len_of(&bytes[self.at..])])
    }
}
