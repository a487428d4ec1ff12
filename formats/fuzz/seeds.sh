#!/usr/bin/env bash
# Fills corpus/ with small sound files of every kind from the bundled fixtures.
set -euo pipefail
cd "$(dirname "$0")"
fixtures=../../compat-fixtures
small=$fixtures/format-corpus
sparse=$fixtures/facade6
for target in interface project dmap ply colmap_sparse colmap_dense rasters text_files las; do mkdir -p "corpus/$target"; done
cp "$small"/mvsi/i*.mvs corpus/interface/
cp "$small"/native/n*.mvs corpus/project/
cp "$small"/other/d7.dmap corpus/dmap/
{ printf 'D2'; tail -c +3 "$small/other/d7.dmap"; } >corpus/dmap/d2.dmap
cp "$small"/ply/*.ply corpus/ply/
cp "$small"/other/*.txt corpus/text_files/
cp "$sparse"/sparse/cameras.txt "$sparse"/colmap-4.2/binary/{cameras,rigs,frames}.bin corpus/colmap_sparse/
for name in images points3D; do
    head -n 8 "$sparse/sparse/$name.txt" | cut -c 1-1000 >"corpus/colmap_sparse/$name.txt"
    head -c 3000 "$sparse/colmap-4.2/binary/$name.bin" >"corpus/colmap_sparse/$name.bin"
done
{ printf '3&2&1&'; head -c 24 /dev/zero; } >corpus/colmap_dense/depth.bin
{ printf '1&2&3&'; head -c 24 /dev/zero; } >corpus/colmap_dense/normal.bin
{ printf '9&9&1&'; printf '\1\0\0\0\2\0\0\0\2\0\0\0\0\0\0\0\5\0\0\0'; } >corpus/colmap_dense/graph.bin
printf '\2\0\0\0\0\0\0\0\1\0\0\0\3\0\0\0\0\0\0\0' >corpus/colmap_dense/fused.ply.vis
printf 'a.jpg\n__auto__, 20\nb.jpg\na.jpg, c.jpg\n' >corpus/colmap_dense/patch-match.cfg
{ printf 'Pf\n3 2\n-1.0\n'; head -c 24 /dev/zero; } >corpus/rasters/depth.pfm
{ printf 'PF\n1 2\n1.0\n'; head -c 24 /dev/zero; } >corpus/rasters/normal.pfm
for order in False True; do
    header="{'descr': '<f4', 'fortran_order': $order, 'shape': (3, 2), }"
    { printf '\223NUMPY\1\0\100\0%-63s\n' "$header"; head -c 24 /dev/zero; } >"corpus/rasters/$order.npy"
done
