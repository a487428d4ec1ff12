//! A surface with textures, as native archives hold it.

/// Triangle mesh. Nothing in it is computed: what a file holds is kept, absent parts are empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// World positions.
    pub vertices: Vec<[f32; 3]>,
    /// Vertex indices of each triangle.
    pub faces: Vec<[u32; 3]>,
    /// Empty or one per vertex.
    pub vertex_normals: Vec<[f32; 3]>,
    /// Neighbouring vertices of each vertex.
    pub vertex_vertices: IndexLists,
    /// Faces at each vertex.
    pub vertex_faces: IndexLists,
    /// Whether each vertex is on the boundary (0 or 1).
    pub vertex_boundary: Vec<u8>,
    /// Empty or one per face.
    pub face_normals: Vec<[f32; 3]>,
    /// Texture coordinates: empty or three per face.
    pub face_texcoords: Vec<[f32; 2]>,
    /// Texture of each face: empty or one per face.
    pub face_textures: Vec<u8>,
    /// Texture pictures, at most 255.
    pub textures: Vec<Texture>,
}

impl Mesh {
    /// Whether it has neither vertices nor textures.
    pub fn is_empty(&self) -> bool {
        *self == Mesh::default()
    }
}

/// Lists of indices, stored back to back.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct IndexLists {
    /// Where each list ends in `indices`; it starts where the one before ends, the first at 0.
    pub ends: Vec<u64>,
    /// Entries of all lists.
    pub indices: Vec<u32>,
}

impl IndexLists {
    /// The lists in order; where `ends` is out of order or range, an empty one.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        let starts = std::iter::once(&0).chain(&self.ends);
        starts
            .zip(&self.ends)
            .map(|(&start, &end)| self.indices.get(start as usize..end as usize).unwrap_or_default())
    }
}

/// A texture picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Texture {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Red, green, blue; row-major, top row first.
    pub pixels: Vec<[u8; 3]>,
}
