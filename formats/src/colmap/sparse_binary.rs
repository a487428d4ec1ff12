//! The sparse model in binary files.

use super::model::{
    Camera, CameraModel, Frame, FrameData, Image, Model, Observation, Points, Pose, Rig, RigSensor, Sensor,
    SensorKind, TrackElement,
};
use super::workspace::ModelFile;
use crate::wire::{Place, Reader, Writer};
use crate::{Error, Result};
use std::io::{Read, Write};

/// Bytes that small files may take beyond four times their size.
const SPARE: u64 = 16 << 20;

/// Reads one file into its part of `model`.
pub(super) fn read_file<R: Read>(model: &mut Model, file: ModelFile, r: &mut Reader<R>) -> Result<()> {
    if let Some(length) = r.remaining() {
        // What is small in the file, such as rigs without sensors, may be larger in memory.
        r.cap_budget(length.saturating_mul(4).saturating_add(SPARE));
    }
    match file {
        ModelFile::Cameras => model.cameras = read_cameras(r)?,
        ModelFile::Images => model.images = read_images(r)?,
        ModelFile::Points => model.points = read_points(r)?,
        ModelFile::Rigs => model.rigs = read_rigs(r)?,
        ModelFile::Frames => model.frames = read_frames(r)?,
    }
    if !r.at_end()? {
        return Err(r.error(&Place::Root(file.stem()), "bytes follow the last entry"));
    }
    Ok(())
}

/// Writes the part of `model` that belongs into one file.
pub(super) fn write_file(model: &Model, file: ModelFile, out: impl Write) -> Result<()> {
    let mut w = Writer::new(out);
    match file {
        ModelFile::Cameras => write_cameras(&mut w, &model.cameras)?,
        ModelFile::Images => write_images(&mut w, &model.images)?,
        ModelFile::Points => write_points(&mut w, &model.points)?,
        ModelFile::Rigs => write_rigs(&mut w, &model.rigs)?,
        ModelFile::Frames => write_frames(&mut w, &model.frames)?,
    }
    w.finish()
}

fn read_cameras<R: Read>(r: &mut Reader<R>) -> Result<Vec<Camera>> {
    let root = Place::Root("cameras");
    list(r, &root, 24, |r, at| {
        let id = r.u32(&at.field("id"))?;
        let model_id = i32_of(r, &at.field("model"))?;
        let Some(model) = CameraModel::from_id(model_id) else {
            let what = format!("{at}: COLMAP camera model {model_id}; the rest of the file cannot be read");
            return Err(Error::Unsupported(what));
        };
        let (width, height) = (r.u64(&at.field("width"))?, r.u64(&at.field("height"))?);
        let params = r.vec(model.param_count() as u64, &at.field("params"), |b| f64::from_le_bytes(*b))?;
        Ok(Camera { id, model, width, height, params })
    })
}

fn write_cameras<W: Write>(w: &mut Writer<W>, cameras: &[Camera]) -> Result<()> {
    w.u64(cameras.len() as u64)?;
    for camera in cameras {
        w.u32(camera.id)?;
        w.bytes(&camera.model.id().to_le_bytes())?;
        w.u64(camera.width)?;
        w.u64(camera.height)?;
        w.f64s(&camera.params)?;
    }
    Ok(())
}

fn read_images<R: Read>(r: &mut Reader<R>) -> Result<Vec<Image>> {
    let root = Place::Root("images");
    list(r, &root, 73, |r, at| {
        let id = r.u32(&at.field("id"))?;
        let pose = read_pose(r, &at.field("pose"))?;
        let camera_id = r.u32(&at.field("camera"))?;
        let name = name(r, &at.field("name"))?;
        let count = r.u64(&at.field("points2D"))?;
        let observations = r.vec(count, &at.field("points2D"), |b: &[u8; 24]| {
            let [x, y, id] = std::array::from_fn(|k| std::array::from_fn(|i| b[8 * k + i]));
            Observation {
                position: [f64::from_le_bytes(x), f64::from_le_bytes(y)],
                point_id: u64::from_le_bytes(id),
            }
        })?;
        Ok(Image { id, pose, camera_id, name, observations })
    })
}

fn write_images<W: Write>(w: &mut Writer<W>, images: &[Image]) -> Result<()> {
    w.u64(images.len() as u64)?;
    for image in images {
        w.u32(image.id)?;
        write_pose(w, &image.pose)?;
        w.u32(image.camera_id)?;
        if image.name.contains(&0) {
            return Err(Error::Unsupported(format!("image {}: a name with a zero byte", image.id)));
        }
        w.bytes(&image.name)?;
        w.bytes(&[0])?;
        w.u64(image.observations.len() as u64)?;
        for observation in &image.observations {
            w.f64s(&observation.position)?;
            w.u64(observation.point_id)?;
        }
    }
    Ok(())
}

fn read_points<R: Read>(r: &mut Reader<R>) -> Result<Points> {
    let root = Place::Root("points3D");
    let count = r.u64(&root)?;
    let count = r.check_count(count, 51, &root)?;
    let mut points = Points::default();
    r.room(&mut points.ids, count, &root)?;
    r.room(&mut points.positions, count, &root)?;
    r.room(&mut points.colors, count, &root)?;
    r.room(&mut points.errors, count, &root)?;
    r.room(&mut points.track_ends, count, &root)?;
    for index in 0..count {
        let at = root.item(index);
        points.ids.push(r.u64(&at.field("id"))?);
        points.positions.push(r.f64s(&at.field("position"))?);
        points.colors.push(r.array(&at.field("color"))?);
        points.errors.push(f64::from_le_bytes(r.array(&at.field("error"))?));
        let length = r.u64(&at.field("track"))?;
        r.extend(&mut points.tracks, length, &at.field("track"), |b: &[u8; 8]| {
            let [image, observation] = std::array::from_fn(|k| std::array::from_fn(|i| b[4 * k + i]));
            TrackElement { image_id: u32::from_le_bytes(image), observation: u32::from_le_bytes(observation) }
        })?;
        points.track_ends.push(points.tracks.len() as u64);
    }
    Ok(points)
}

fn write_points<W: Write>(w: &mut Writer<W>, points: &Points) -> Result<()> {
    w.u64(points.len() as u64)?;
    for index in 0..points.len() {
        w.u64(points.ids[index])?;
        w.f64s(&points.positions[index])?;
        w.bytes(&points.colors[index])?;
        w.f64s(&[points.errors[index]])?;
        let track = points.track(index);
        w.u64(track.len() as u64)?;
        for element in track {
            w.u32(element.image_id)?;
            w.u32(element.observation)?;
        }
    }
    Ok(())
}

fn read_rigs<R: Read>(r: &mut Reader<R>) -> Result<Vec<Rig>> {
    let root = Place::Root("rigs");
    list(r, &root, 8, |r, at| {
        let mut rig = Rig { id: r.u32(&at.field("id"))?, reference: None, others: Vec::new() };
        let sensors = r.u32(&at.field("sensors"))?;
        if sensors > 0 {
            rig.reference = Some(read_sensor(r, &at.field("sensors"))?);
            let others = r.check_count(u64::from(sensors - 1), 9, &at.field("sensors"))?;
            r.room(&mut rig.others, others, &at.field("sensors"))?;
            for index in 0..others {
                let (field, sensor) = (at.field("sensors"), read_sensor(r, &at.field("sensors"))?);
                let field = field.item(index + 1);
                let pose = if r.u8(&field)? != 0 { Some(read_pose(r, &field)?) } else { None };
                rig.others.push(RigSensor { sensor, pose });
            }
        }
        Ok(rig)
    })
}

fn write_rigs<W: Write>(w: &mut Writer<W>, rigs: &[Rig]) -> Result<()> {
    w.u64(rigs.len() as u64)?;
    for rig in rigs {
        w.u32(rig.id)?;
        let Some(reference) = rig.reference else {
            w.u32(0)?;
            continue;
        };
        w.u32(rig.others.len() as u32 + 1)?;
        write_sensor(w, reference)?;
        for other in &rig.others {
            write_sensor(w, other.sensor)?;
            w.bytes(&[u8::from(other.pose.is_some())])?;
            if let Some(pose) = &other.pose {
                write_pose(w, pose)?;
            }
        }
    }
    Ok(())
}

fn read_frames<R: Read>(r: &mut Reader<R>) -> Result<Vec<Frame>> {
    let root = Place::Root("frames");
    list(r, &root, 68, |r, at| {
        let (id, rig_id) = (r.u32(&at.field("id"))?, r.u32(&at.field("rig"))?);
        let pose = read_pose(r, &at.field("pose"))?;
        let place = at.field("data");
        let count = u64::from(r.u32(&place)?);
        let count = r.check_count(count, 16, &place)?;
        let mut data = Vec::new();
        r.room(&mut data, count, &place)?;
        for index in 0..count {
            let sensor = read_sensor(r, &place.item(index))?;
            data.push(FrameData { sensor, data_id: r.u64(&place.item(index))? });
        }
        Ok(Frame { id, rig_id, pose, data })
    })
}

fn write_frames<W: Write>(w: &mut Writer<W>, frames: &[Frame]) -> Result<()> {
    w.u64(frames.len() as u64)?;
    for frame in frames {
        w.u32(frame.id)?;
        w.u32(frame.rig_id)?;
        write_pose(w, &frame.pose)?;
        w.u32(frame.data.len() as u32)?;
        for data in &frame.data {
            write_sensor(w, data.sensor)?;
            w.u64(data.data_id)?;
        }
    }
    Ok(())
}

/// A counted list of items of at least `min_size` bytes, and nothing after it.
fn list<R: Read, T>(
    r: &mut Reader<R>,
    root: &Place<'_>,
    min_size: u64,
    mut read: impl FnMut(&mut Reader<R>, &Place<'_>) -> Result<T>,
) -> Result<Vec<T>> {
    let count = r.u64(root)?;
    let count = r.check_count(count, min_size, root)?;
    let mut out = Vec::new();
    r.room(&mut out, count, root)?;
    for index in 0..count {
        out.push(read(r, &root.item(index))?);
    }
    Ok(out)
}

/// Bytes up to the next zero byte.
fn name<R: Read>(r: &mut Reader<R>, at: &Place<'_>) -> Result<Vec<u8>> {
    let mut name = Vec::new();
    loop {
        match r.u8(at)? {
            0 => return Ok(name),
            byte => name.push(byte),
        }
        if name.len() as u64 > r.max_string() {
            return Err(r.error(at, format!("no end within {} bytes", name.len())));
        }
    }
}

fn i32_of<R: Read>(r: &mut Reader<R>, at: &Place<'_>) -> Result<i32> {
    Ok(i32::from_le_bytes(r.array(at)?))
}

fn read_sensor<R: Read>(r: &mut Reader<R>, at: &Place<'_>) -> Result<Sensor> {
    let kind = i32_of(r, at)?;
    match SensorKind::from_id(kind) {
        Some(kind) => Ok(Sensor { kind, id: r.u32(at)? }),
        None => Err(Error::Unsupported(format!("{at}: COLMAP sensor type {kind}"))),
    }
}

fn write_sensor<W: Write>(w: &mut Writer<W>, sensor: Sensor) -> Result<()> {
    w.bytes(&sensor.kind.id().to_le_bytes())?;
    w.u32(sensor.id)
}

fn read_pose<R: Read>(r: &mut Reader<R>, at: &Place<'_>) -> Result<Pose> {
    Ok(Pose { rotation: r.f64s(at)?, translation: r.f64s(at)? })
}

fn write_pose<W: Write>(w: &mut Writer<W>, pose: &Pose) -> Result<()> {
    w.f64s(&pose.rotation)?;
    w.f64s(&pose.translation)
}
