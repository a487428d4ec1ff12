//! Reading of the sparse model's text files.

use super::model::{
    Camera, CameraModel, Frame, FrameData, Image, Model, NO_POINT, Observation, Pose, Rig, RigSensor, Sensor,
    SensorKind, TrackElement,
};
use super::workspace::ModelFile;
use crate::source::{Source, grow};
use crate::{Error, Limits, Result};
use std::io::Read;
use std::str::FromStr;

/// Longest line, in bytes: that of an image with about a million observations.
const MAX_LINE: u64 = 16 << 20;
/// Bytes of values that a file may have however small it is.
const FREE_VALUES: u64 = 8 << 20;
/// Bytes of values for each two bytes of the file beyond that. Real files have less than one for one.
const MOST_VALUES: u64 = 5;

/// Bytes of the values of a point without its track.
const BYTES_PER_POINT: usize = 8 + 24 + 3 + 8 + 8;

/// Reads one file into its part of `model`.
pub(super) fn read_file(
    model: &mut Model,
    file: ModelFile,
    source: impl Read,
    limits: &Limits,
) -> Result<()> {
    let mut lines = Lines::new(source, file.stem(), limits);
    match file {
        ModelFile::Cameras => {
            model.cameras.clear();
            while let Some(mut line) = lines.next_entry()? {
                let camera = camera(&mut line)?;
                lines.charge(size_of::<Camera>() + 8 * camera.params.len())?;
                append(&mut model.cameras, camera);
            }
        }
        ModelFile::Images => {
            model.images.clear();
            while let Some(mut line) = lines.next_entry()? {
                let mut image = image(&mut line)?;
                let name = image.name.len();
                // the line after an image is its observations, be it empty
                if let Some(mut line) = lines.next_line()? {
                    observations(&mut line, &mut image.observations)?;
                }
                lines.charge(size_of::<Image>() + name + size_of_val(image.observations.as_slice()))?;
                append(&mut model.images, image);
            }
        }
        ModelFile::Points => {
            model.points = Default::default();
            while let Some(mut line) = lines.next_entry()? {
                let before = model.points.tracks.len();
                point(&mut line, model)?;
                let elements = model.points.tracks.len() - before;
                lines.charge(BYTES_PER_POINT + elements * size_of::<TrackElement>())?;
            }
        }
        ModelFile::Rigs => {
            model.rigs.clear();
            while let Some(mut line) = lines.next_entry()? {
                let rig = rig(&mut line)?;
                lines.charge(size_of::<Rig>() + size_of_val(rig.others.as_slice()))?;
                append(&mut model.rigs, rig);
            }
        }
        ModelFile::Frames => {
            model.frames.clear();
            while let Some(mut line) = lines.next_entry()? {
                let frame = frame(&mut line)?;
                lines.charge(size_of::<Frame>() + size_of_val(frame.data.as_slice()))?;
                append(&mut model.frames, frame);
            }
        }
    }
    Ok(())
}

fn append<T>(out: &mut Vec<T>, element: T) {
    grow(out, 1);
    out.push(element);
}

fn camera(line: &mut Line<'_>) -> Result<Camera> {
    let id = line.number("CAMERA_ID")?;
    let name = line.word("MODEL")?;
    let Some(model) = CameraModel::from_name(name) else {
        return Err(Error::Unsupported(format!("camera {id}: COLMAP camera model {}", excerpt(name))));
    };
    let (width, height) = (line.number("WIDTH")?, line.number("HEIGHT")?);
    let params = (0..model.param_count()).map(|_| line.number("PARAMS")).collect::<Result<_>>()?;
    line.end()?;
    Ok(Camera { id, model, width, height, params })
}

fn image(line: &mut Line<'_>) -> Result<Image> {
    let id = line.number("IMAGE_ID")?;
    let pose = line.pose()?;
    let camera_id = line.number("CAMERA_ID")?;
    // COLMAP takes one word; names with spaces are understood as long as they stand last
    let name = line.rest.trim_ascii();
    if name.is_empty() {
        return Err(line.error("NAME", "it is missing"));
    }
    Ok(Image { id, pose, camera_id, name: name.to_vec(), observations: Vec::new() })
}

fn observations(line: &mut Line<'_>, out: &mut Vec<Observation>) -> Result<()> {
    while !line.is_empty() {
        let position = [line.number("X")?, line.number("Y")?];
        let point_id = match line.word("POINT3D_ID")? {
            "-1" => NO_POINT,
            id => id.parse().map_err(|_| line.bad("POINT3D_ID", id))?,
        };
        append(out, Observation { position, point_id });
    }
    Ok(())
}

fn point(line: &mut Line<'_>, model: &mut Model) -> Result<()> {
    let points = &mut model.points;
    let id = line.number("POINT3D_ID")?;
    let position = [line.number("X")?, line.number("Y")?, line.number("Z")?];
    let color = [line.number("R")?, line.number("G")?, line.number("B")?];
    let error = line.number("ERROR")?;
    while !line.is_empty() {
        let element =
            TrackElement { image_id: line.number("IMAGE_ID")?, observation: line.number("POINT2D_IDX")? };
        append(&mut points.tracks, element);
    }
    append(&mut points.ids, id);
    append(&mut points.positions, position);
    append(&mut points.colors, color);
    append(&mut points.errors, error);
    append(&mut points.track_ends, points.tracks.len() as u64);
    Ok(())
}

fn rig(line: &mut Line<'_>) -> Result<Rig> {
    let mut rig = Rig { id: line.number("RIG_ID")?, reference: None, others: Vec::new() };
    let sensors: u32 = line.number("NUM_SENSORS")?;
    if sensors > 0 {
        rig.reference = Some(line.sensor()?);
    }
    for _ in 1..sensors {
        let sensor = line.sensor()?;
        let pose = if line.number::<u8>("HAS_POSE")? != 0 { Some(line.pose()?) } else { None };
        append(&mut rig.others, RigSensor { sensor, pose });
    }
    line.end()?;
    Ok(rig)
}

fn frame(line: &mut Line<'_>) -> Result<Frame> {
    let (id, rig_id) = (line.number("FRAME_ID")?, line.number("RIG_ID")?);
    let pose = line.pose()?;
    let count: u32 = line.number("NUM_DATA_IDS")?;
    let mut data = Vec::new();
    for _ in 0..count {
        append(&mut data, FrameData { sensor: line.sensor()?, data_id: line.number("DATA_ID")? });
    }
    line.end()?;
    Ok(Frame { id, rig_id, pose, data })
}

/// The lines of a file.
struct Lines<R> {
    source: Source<R>,
    buffer: Vec<u8>,
    stem: &'static str,
    number: u64,
    limit: u64,
    values: u64,
}

impl<R: Read> Lines<R> {
    fn new(source: R, stem: &'static str, limits: &Limits) -> Self {
        let (source, buffer) = (Source::new(source), Vec::new());
        Lines { source, buffer, stem, number: 0, limit: limits.max_bytes, values: 0 }
    }

    /// Accounts for values that were read.
    fn charge(&mut self, bytes: usize) -> Result<()> {
        self.values += bytes as u64;
        let limit = (self.source.offset() / 2).saturating_mul(MOST_VALUES).saturating_add(FREE_VALUES);
        if self.values > limit.min(self.limit) {
            let (needed, limit) = (self.values, limit.min(self.limit));
            return Err(Error::Limits { field: self.stem.to_owned(), needed, limit });
        }
        Ok(())
    }

    /// The next line, `None` at the end.
    fn next_line(&mut self) -> Result<Option<Line<'_>>> {
        let offset = self.source.offset();
        // values take at most a few times the bytes of their text
        if offset > self.limit {
            let (field, limit) = (self.stem.to_owned(), self.limit);
            return Err(Error::Limits { field, needed: offset, limit });
        }
        let ended = !self.source.line(&mut self.buffer, self.limit.min(MAX_LINE), self.stem)?
            && self.buffer.is_empty();
        self.number += 1;
        let line = Line { rest: &self.buffer, stem: self.stem, number: self.number, offset };
        Ok((!ended).then_some(line))
    }

    /// The next line that is neither empty nor a comment.
    fn next_entry(&mut self) -> Result<Option<Line<'_>>> {
        loop {
            if self.next_line()?.is_none() {
                return Ok(None);
            }
            let text = self.buffer.trim_ascii();
            if !text.is_empty() && !text.starts_with(b"#") {
                let offset = self.source.offset() - self.buffer.len() as u64;
                return Ok(Some(Line { rest: &self.buffer, stem: self.stem, number: self.number, offset }));
            }
        }
    }
}

/// What is left of a line.
struct Line<'a> {
    rest: &'a [u8],
    stem: &'static str,
    number: u64,
    offset: u64,
}

impl<'a> Line<'a> {
    fn error(&self, field: &str, what: impl Into<String>) -> Error {
        let field = format!("{} line {}, {field}", self.stem, self.number);
        Error::Format { offset: self.offset, field, what: what.into() }
    }

    fn bad(&self, field: &str, word: &str) -> Error {
        self.error(field, format!("\"{}\" is not such a value", excerpt(word)))
    }

    fn is_empty(&mut self) -> bool {
        self.rest = self.rest.trim_ascii_start();
        self.rest.is_empty()
    }

    fn word(&mut self, field: &str) -> Result<&'a str> {
        if self.is_empty() {
            return Err(self.error(field, "the line ends before this value"));
        }
        let end = self.rest.iter().position(u8::is_ascii_whitespace).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        std::str::from_utf8(word).map_err(|_| self.error(field, "not text"))
    }

    fn number<T: FromStr>(&mut self, field: &str) -> Result<T> {
        let word = self.word(field)?;
        word.parse().map_err(|_| self.bad(field, word))
    }

    fn pose(&mut self) -> Result<Pose> {
        let rotation = [self.number("QW")?, self.number("QX")?, self.number("QY")?, self.number("QZ")?];
        Ok(Pose { rotation, translation: [self.number("TX")?, self.number("TY")?, self.number("TZ")?] })
    }

    fn sensor(&mut self) -> Result<Sensor> {
        let name = self.word("SENSOR_TYPE")?;
        let Some(kind) = SensorKind::from_name(name) else { return Err(self.bad("SENSOR_TYPE", name)) };
        Ok(Sensor { kind, id: self.number("SENSOR_ID")? })
    }

    fn end(&mut self) -> Result<()> {
        if self.is_empty() { Ok(()) } else { Err(self.error("end", "more values than expected")) }
    }
}

/// The start of `text`, short enough for a message.
fn excerpt(text: &str) -> String {
    text.chars().take(40).flat_map(char::escape_debug).collect()
}
