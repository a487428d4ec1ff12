//! PLY point clouds: header, streaming read, streaming write.
