//! The region of interest, and how each container spells it.

use super::scene::{IDENTITY3, Scene};

/// Largest entry of `R Rᵀ - I` of a matrix that counts as a rotation.
pub(crate) const ROTATION_TOLERANCE: f64 = 1e-3;

/// Oriented bounding box, in the state OpenMVS uses it: world point `X` is inside if
/// `|rotation · (X - center)| <= half_extent` in every component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Obb {
    /// Rows are the box axes in the world, row-major 3×3.
    pub rotation: [f64; 9],
    /// Box centre in the world.
    pub center: [f64; 3],
    /// Half sizes along the axes, all > 0.
    pub half_extent: [f64; 3],
}

impl Obb {
    /// Whether it is finite and has a volume, and the rows of its rotation are orthonormal within 1e-3.
    pub fn is_valid(&self) -> bool {
        let finite = self.center.iter().chain(&self.half_extent).all(|v| v.is_finite());
        finite && self.half_extent.iter().all(|&v| v > 0.0) && is_orthonormal(&self.rotation)
    }
}

/// A region of interest as a file spells it, kept so that rewriting a file reproduces its bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StoredBox {
    /// MVSI: `min = center - half_extent`, `max = center + half_extent`.
    Corners {
        /// Rows are the box axes in the world, row-major 3×3.
        rotation: [f64; 9],
        /// `center - half_extent`.
        min: [f64; 3],
        /// `center + half_extent`.
        max: [f64; 3],
    },
    /// Native archives.
    Center {
        /// Rows are the box axes in the world, row-major 3×3.
        rotation: [f32; 9],
        /// Box centre in the world.
        center: [f32; 3],
        /// Half sizes along the axes.
        half_extent: [f32; 3],
    },
}

impl StoredBox {
    /// The box that the bytes mean; `None` if it has no volume, is not finite or not rotated properly.
    pub fn decode(&self) -> Option<Obb> {
        Some(self.as_obb()).filter(Obb::is_valid)
    }

    /// Whether the bytes hold a number that is not finite, which no program means.
    pub fn is_damaged(&self) -> bool {
        let Obb { rotation, center, half_extent } = self.as_obb();
        rotation.iter().chain(&center).chain(&half_extent).any(|v| !v.is_finite())
    }

    /// The numbers of the box, good or bad.
    fn as_obb(&self) -> Obb {
        match *self {
            StoredBox::Corners { rotation, min, max } => Obb {
                rotation,
                center: [0, 1, 2].map(|i| 0.5 * (min[i] + max[i])),
                half_extent: [0, 1, 2].map(|i| 0.5 * (max[i] - min[i])),
            },
            StoredBox::Center { rotation, center, half_extent } => Obb {
                rotation: rotation.map(f64::from),
                center: center.map(f64::from),
                half_extent: half_extent.map(f64::from),
            },
        }
    }

    /// The box of a scene as MVSI files spell it: as it was stored, if that is still what `obb` says.
    pub(crate) fn corners_of(scene: &Scene) -> StoredBox {
        match scene.stored_box.filter(|s| s.decode() == scene.obb) {
            Some(stored @ StoredBox::Corners { .. }) => stored,
            Some(stored) => StoredBox::corners(Some(&stored.as_obb())),
            None => StoredBox::corners(scene.obb.as_ref()),
        }
    }

    /// The box of a scene as native archives spell it: as it was stored, if that is still what `obb` says.
    pub(crate) fn center_of(scene: &Scene) -> StoredBox {
        match scene.stored_box.filter(|s| s.decode() == scene.obb) {
            Some(stored @ StoredBox::Center { .. }) => stored,
            Some(stored) => StoredBox::center(Some(&stored.as_obb())),
            None => StoredBox::center(scene.obb.as_ref()),
        }
    }

    /// Sets the box of a scene from its file; keeps the spelling only if `obb` alone would be spelled differently.
    pub(crate) fn store(self, scene: &mut Scene) {
        scene.obb = self.decode();
        let spelled = match self {
            StoredBox::Corners { .. } => StoredBox::corners(scene.obb.as_ref()),
            StoredBox::Center { .. } => StoredBox::center(scene.obb.as_ref()),
        };
        scene.stored_box = (!self.same_bits(&spelled)).then_some(self);
    }

    /// The box as MVSI spells it; `None` is the identity with both corners at the origin.
    fn corners(obb: Option<&Obb>) -> StoredBox {
        match obb {
            None => StoredBox::Corners { rotation: IDENTITY3, min: [0.0; 3], max: [0.0; 3] },
            Some(o) => StoredBox::Corners {
                rotation: o.rotation,
                min: [0, 1, 2].map(|i| o.center[i] - o.half_extent[i]),
                max: [0, 1, 2].map(|i| o.center[i] + o.half_extent[i]),
            },
        }
    }

    /// The box as native archives spell it; `None` is the identity at the origin without extent.
    fn center(obb: Option<&Obb>) -> StoredBox {
        let (rotation, center, half_extent) = match obb {
            None => (IDENTITY3, [0.0; 3], [0.0; 3]),
            Some(o) => (o.rotation, o.center, o.half_extent),
        };
        StoredBox::Center {
            rotation: rotation.map(|v| v as f32),
            center: center.map(|v| v as f32),
            half_extent: half_extent.map(|v| v as f32),
        }
    }

    /// Whether both are of one kind with the same bits.
    fn same_bits(&self, other: &StoredBox) -> bool {
        match (self, other) {
            (
                StoredBox::Corners { rotation: r, min: a, max: b },
                StoredBox::Corners { rotation: s, min: c, max: d },
            ) => same64(r, s) && same64(a, c) && same64(b, d),
            (
                StoredBox::Center { rotation: r, center: a, half_extent: b },
                StoredBox::Center { rotation: s, center: c, half_extent: d },
            ) => same32(r, s) && same32(a, c) && same32(b, d),
            _ => false,
        }
    }
}

fn same64(a: &[f64], b: &[f64]) -> bool {
    a.iter().map(|v| v.to_bits()).eq(b.iter().map(|v| v.to_bits()))
}

fn same32(a: &[f32], b: &[f32]) -> bool {
    a.iter().map(|v| v.to_bits()).eq(b.iter().map(|v| v.to_bits()))
}

/// Whether `R Rᵀ` is the identity within [`ROTATION_TOLERANCE`]; false for anything not finite.
pub(crate) fn is_orthonormal(r: &[f64; 9]) -> bool {
    (0..3).all(|i| {
        (0..3).all(|j| {
            let dot: f64 = (0..3).map(|k| r[3 * i + k] * r[3 * j + k]).sum();
            (dot - if i == j { 1.0 } else { 0.0 }).abs() < ROTATION_TOLERANCE
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_box_is_the_identity_without_extent_in_both_spellings() {
        assert_eq!(StoredBox::corners(None).decode(), None);
        assert_eq!(StoredBox::center(None).decode(), None);
    }

    #[test]
    fn a_box_survives_both_spellings() {
        let obb = Obb {
            rotation: [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            center: [1.0, -2.0, 3.5],
            half_extent: [0.5, 1.0, 2.0],
        };
        assert_eq!(StoredBox::corners(Some(&obb)).decode(), Some(obb));
        assert_eq!(StoredBox::center(Some(&obb)).decode(), Some(obb));
    }

    #[test]
    fn boxes_that_cannot_contain_anything_are_absent() {
        let good = Obb { rotation: IDENTITY3, center: [0.0; 3], half_extent: [1.0; 3] };
        for bad in [
            Obb { half_extent: [1.0, 0.0, 1.0], ..good },
            Obb { half_extent: [1.0, -1.0, 1.0], ..good },
            Obb { center: [f64::NAN, 0.0, 0.0], ..good },
            Obb { rotation: [2.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], ..good },
            Obb { rotation: [f64::INFINITY; 9], ..good },
        ] {
            assert_eq!(StoredBox::corners(Some(&bad)).decode(), None, "{bad:?}");
        }
    }
}
