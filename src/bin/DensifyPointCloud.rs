//! The program `DensifyPointCloud`: drop-in for OpenMVS's.

fn main() {}
