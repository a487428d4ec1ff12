//! The program `semvs`.

fn main() {}
