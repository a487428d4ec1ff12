//! Writing of the sparse model's text files, as COLMAP writes them.

use super::model::{Camera, Frame, Image, Model, NO_POINT, Points, Pose, Rig, Sensor};
use super::workspace::ModelFile;
use crate::number::general;
use crate::{Error, Result};
use std::io::{BufWriter, Write};

/// Digits that bring every double back.
const DIGITS: u8 = 17;

/// Writes the part of `model` that belongs into one file.
pub(super) fn write_file(model: &Model, file: ModelFile, out: impl Write) -> Result<()> {
    let mut out = BufWriter::with_capacity(256 << 10, out);
    match file {
        ModelFile::Cameras => cameras(&mut out, &model.cameras)?,
        ModelFile::Images => images(&mut out, &model.images)?,
        ModelFile::Points => points(&mut out, &model.points)?,
        ModelFile::Rigs => rigs(&mut out, &model.rigs)?,
        ModelFile::Frames => frames(&mut out, &model.frames)?,
    }
    Ok(out.flush()?)
}

fn cameras(out: &mut impl Write, cameras: &[Camera]) -> Result<()> {
    writeln!(out, "# Camera list with one line of data per camera:")?;
    writeln!(out, "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]")?;
    writeln!(out, "# Number of cameras: {}", cameras.len())?;
    for c in cameras {
        write!(out, "{} {} {} {}", c.id, c.model.name(), c.width, c.height)?;
        numbers(out, &c.params)?;
        writeln!(out)?;
    }
    Ok(())
}

fn images(out: &mut impl Write, images: &[Image]) -> Result<()> {
    let seen = |i: &Image| i.observations.iter().filter(|o| o.point_id != NO_POINT).count();
    let mean = mean(images.iter().map(seen).sum(), images.len());
    writeln!(out, "# Image list with two lines of data per image:")?;
    writeln!(out, "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME")?;
    writeln!(out, "#   POINTS2D[] as (X, Y, POINT3D_ID)")?;
    writeln!(out, "# Number of images: {}, mean observations per image: {mean}", images.len())?;
    for image in images {
        if image.name.is_empty() || image.name.iter().any(|b| b.is_ascii_whitespace() || *b == 0) {
            let what =
                format!("image {}: a name with white space in a text model; write it binary", image.id);
            return Err(Error::Unsupported(what));
        }
        write!(out, "{}", image.id)?;
        pose(out, &image.pose)?;
        write!(out, " {} ", image.camera_id)?;
        out.write_all(&image.name)?;
        writeln!(out)?;
        for o in &image.observations {
            write!(out, "{} {} ", general(o.position[0], DIGITS), general(o.position[1], DIGITS))?;
            match o.point_id {
                NO_POINT => write!(out, "-1 ")?,
                id => write!(out, "{id} ")?,
            }
        }
        writeln!(out)?;
    }
    Ok(())
}

fn points(out: &mut impl Write, points: &Points) -> Result<()> {
    let mean = mean(points.tracks.len(), points.len());
    writeln!(out, "# 3D point list with one line of data per point:")?;
    writeln!(out, "#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)")?;
    writeln!(out, "# Number of points: {}, mean track length: {mean}", points.len())?;
    for index in 0..points.len() {
        write!(out, "{}", points.ids[index])?;
        numbers(out, &points.positions[index])?;
        let [r, g, b] = points.colors[index];
        write!(out, " {r} {g} {b}")?;
        numbers(out, &[points.errors[index]])?;
        for element in points.track(index) {
            write!(out, " {} {}", element.image_id, element.observation)?;
        }
        writeln!(out)?;
    }
    Ok(())
}

fn rigs(out: &mut impl Write, rigs: &[Rig]) -> Result<()> {
    writeln!(out, "# Rig calib list with one line of data per calib:")?;
    writeln!(
        out,
        "#   RIG_ID, NUM_SENSORS, REF_SENSOR_TYPE, REF_SENSOR_ID, SENSORS[] as (SENSOR_TYPE, SENSOR_ID, HAS_POSE, \
         [QW, QX, QY, QZ, TX, TY, TZ])"
    )?;
    writeln!(out, "# Number of rigs: {}", rigs.len())?;
    for rig in rigs {
        let Some(reference) = rig.reference else {
            writeln!(out, "{} 0", rig.id)?;
            continue;
        };
        write!(out, "{} {}", rig.id, rig.others.len() + 1)?;
        sensor(out, reference)?;
        for other in &rig.others {
            sensor(out, other.sensor)?;
            write!(out, " {}", u8::from(other.pose.is_some()))?;
            if let Some(p) = &other.pose {
                pose(out, p)?;
            }
        }
        writeln!(out)?;
    }
    Ok(())
}

fn frames(out: &mut impl Write, frames: &[Frame]) -> Result<()> {
    writeln!(out, "# Frame list with one line of data per frame:")?;
    writeln!(
        out,
        "#   FRAME_ID, RIG_ID, RIG_FROM_WORLD[QW, QX, QY, QZ, TX, TY, TZ], NUM_DATA_IDS, DATA_IDS[] as (SENSOR_TYPE, \
         SENSOR_ID, DATA_ID)"
    )?;
    writeln!(out, "# Number of frames: {}", frames.len())?;
    for frame in frames {
        write!(out, "{} {}", frame.id, frame.rig_id)?;
        pose(out, &frame.pose)?;
        write!(out, " {}", frame.data.len())?;
        for data in &frame.data {
            sensor(out, data.sensor)?;
            write!(out, " {}", data.data_id)?;
        }
        writeln!(out)?;
    }
    Ok(())
}

fn sensor(out: &mut impl Write, sensor: Sensor) -> Result<()> {
    Ok(write!(out, " {} {}", sensor.kind.name(), sensor.id)?)
}

fn pose(out: &mut impl Write, pose: &Pose) -> Result<()> {
    numbers(out, &pose.rotation)?;
    numbers(out, &pose.translation)
}

/// Each number after a space.
fn numbers(out: &mut impl Write, values: &[f64]) -> Result<()> {
    for value in values {
        write!(out, " {}", general(*value, DIGITS))?;
    }
    Ok(())
}

/// The mean that header comments give.
fn mean(total: usize, of: usize) -> String {
    general(if of > 0 { total as f64 / of as f64 } else { 0.0 }, DIGITS)
}
