//! A PLY cloud on disk as a cloud that can be walked through.

use crate::error::{Error, Result};
use crate::scene::{CloudLayout, CloudPoint, PointSource, ViewIndex};
use crate::semantics::{Class, ClassId, ClassPolicy, ClassTable};
use semvs_formats::Limits;
use semvs_formats::ply::{Cloud, PointReader};
use std::fs::File;
use std::path::{Path, PathBuf};

/// Points in memory at a time.
const CHUNK: usize = 8192;

/// The points of a PLY file, those of unwanted classes left out.
#[derive(Clone, Debug)]
pub(crate) struct PlySource {
    path: PathBuf,
    limits: Limits,
    layout: CloudLayout,
    comments: Vec<String>,
    /// What the positions that are handed out are relative to: coordinates with more digits than they can hold.
    origin: [f64; 3],
    kept: Option<ClassPolicy>,
    len: u64,
}

impl PlySource {
    /// The cloud at `path`.
    ///
    /// # Errors
    /// It cannot be read.
    pub(crate) fn open(path: &Path, limits: Limits) -> Result<Self> {
        let mut reader = open(path, &limits)?;
        let failed = |e| Error::format(path, e);
        let mut first = Cloud::default();
        let len = reader.remaining();
        reader.read(&mut first, 1).map_err(failed)?;
        let layout = CloudLayout {
            normals: !first.normals.is_empty(),
            colors: !first.colors.is_empty(),
            views: first.has_views(),
            weights: !first.views.weights.is_empty(),
            confidence: !first.confidence.is_empty(),
            labels: !first.labels.is_empty(),
        };
        // Whole numbers: nothing is lost where the shift is undone.
        let origin = first.positions_f64.first().map_or([0.0; 3], |p| p.map(f64::floor));
        let comments = reader.header().comments.clone();
        Ok(PlySource { path: path.to_owned(), limits, layout, comments, origin, kept: None, len })
    }

    /// Where the origin of the positions is in the file's coordinates.
    pub(crate) fn origin(&self) -> [f64; 3] {
        self.origin
    }

    /// The classes that the header lists, as `comment class ID NAME R G B`.
    ///
    /// # Errors
    /// Two of one id, name or colour.
    pub(crate) fn listed_classes(&self) -> Result<Option<ClassTable>> {
        let classes: Vec<Class> = self.comments.iter().filter_map(|comment| listed_class(comment)).collect();
        match classes.is_empty() {
            true => Ok(None),
            false => ClassTable::listed(self.path.display().to_string(), classes)
                .map(Some)
                .map_err(|what| Error::content(&self.path, format!("the classes in its header: {what}"))),
        }
    }

    /// The ids of the labels.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(crate) fn labels(&self) -> Result<Vec<ClassId>> {
        let mut met = vec![false; 1 << 16];
        self.for_each(&mut |point| {
            met[usize::from(point.label)] = true;
            Ok(())
        })?;
        Ok((0..=u16::MAX).filter(|&id| met[usize::from(id)]).map(ClassId).collect())
    }

    /// Only the points of the classes that `policy` keeps.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(crate) fn keeping(mut self, policy: ClassPolicy) -> Result<Self> {
        if self.layout.labels && !policy.keeps_everything() {
            self.kept = Some(policy);
            let mut len = 0;
            self.for_each(&mut |_| {
                len += 1;
                Ok(())
            })?;
            self.len = len;
        }
        Ok(self)
    }
}

fn open(path: &Path, limits: &Limits) -> Result<PointReader<File>> {
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    PointReader::new(file, limits).map_err(|e| Error::format(path, e))
}

fn listed_class(comment: &str) -> Option<Class> {
    let ["class", id, name, r, g, b] = comment.split_whitespace().collect::<Vec<_>>()[..] else {
        return None;
    };
    let id: u16 = id.parse().ok().filter(|&id| id > 0)?;
    let color = Some([r.parse().ok()?, g.parse().ok()?, b.parse().ok()?]);
    Some(Class {
        id: ClassId(id),
        name: name.to_owned(),
        color,
        keep: true,
        estimate: None,
        surface: true,
        las: None,
        plane: None,
    })
}

impl PointSource for PlySource {
    fn layout(&self) -> CloudLayout {
        self.layout
    }

    fn len(&self) -> u64 {
        self.len
    }

    fn for_each(&self, visit: &mut dyn FnMut(&CloudPoint<'_>) -> Result<()>) -> Result<()> {
        let mut reader = open(&self.path, &self.limits)?;
        let mut cloud = Cloud::default();
        let mut views = Vec::new();
        while reader.read(&mut cloud, CHUNK).map_err(|e| Error::format(&self.path, e))? > 0 {
            for i in 0..cloud.len() {
                let label = cloud.labels.get(i).copied().unwrap_or_default();
                if self.kept.as_ref().is_some_and(|policy| !policy.is_kept(label)) {
                    continue;
                }
                views.clear();
                views.extend(cloud.images_of(i).iter().map(|&view| ViewIndex(view)));
                let relative =
                    |p: &[f64; 3]| std::array::from_fn(|axis| (p[axis] - self.origin[axis]) as f32);
                visit(&CloudPoint {
                    position: cloud.positions_f64.get(i).map_or(cloud.positions[i], relative),
                    normal: cloud.normals.get(i).copied().unwrap_or_default(),
                    color: cloud.colors.get(i).copied().unwrap_or_default(),
                    views: &views,
                    weights: cloud.weights_of(i),
                    confidence: cloud.confidence.get(i).copied().unwrap_or_default(),
                    label,
                    label_confidence: cloud.label_confidence.get(i).copied().unwrap_or_default(),
                })?;
            }
            cloud.clear();
        }
        Ok(())
    }
}
