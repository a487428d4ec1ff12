//! Little-endian reader and writer that know their offset; counted vectors under limits.
