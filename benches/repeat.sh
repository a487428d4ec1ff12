#!/usr/bin/env bash
# A scene several times along a line, as a COLMAP workspace: benches/repeat.sh SCENE_FOLDER COPIES SHIFT OUT
#
# SCENE_FOLDER has sparse/ (a COLMAP text model) and images/; every copy is SHIFT scene units farther along x than the one
# before, far enough that no two share points. Used by scaling.sh for curves over the number of images.
set -euo pipefail
from=$(cd "$1" && pwd) copies=$2 shift=$3 out=$4

mkdir -p "$out/sparse" "$out/images"
out=$(cd "$out" && pwd)
cp "$from/sparse/cameras.txt" "$out/sparse/"

# Centre C and translation t = -R C: a shift s of all centres changes t by -R s.
awk -v copies="$copies" -v shift="$shift" -v out="$out" -v from="$from" '
    /^#/ { next }
    !pose { split($0, image, " "); for (i in image) first[images + 1, i] = image[i]; images += 1; pose = 1; next }
    { points[images] = $0; pose = 0; if ($3 + 0 > most) most = $3 + 0; for (i = 3; i <= NF; i += 3) if ($i + 0 > most) most = $i + 0 }
    END {
        ids = out "/ids"; model = out "/sparse/images.txt"; links = out "/links"
        for (i = 1; i <= images; i++) if (first[i, 1] + 0 > last) last = first[i, 1] + 0
        printf "%d %d\n", last, most > ids
        for (k = 0; k < copies; k++) for (i = 1; i <= images; i++) {
            w = first[i, 2]; x = first[i, 3]; y = first[i, 4]; z = first[i, 5]; s = k * shift
            name = sprintf("%03d_%s", k, first[i, 10])
            printf "%d %s %s %s %s %.12g %.12g %.12g %s %s\n", first[i, 1] + k * last, w, x, y, z,
                first[i, 6] - s * (1 - 2 * (y * y + z * z)), first[i, 7] - s * 2 * (x * y + w * z),
                first[i, 8] - s * 2 * (x * z - w * y), first[i, 9], name > model
            n = split(points[i], p, " ")
            for (j = 1; j <= n; j += 3)
                printf "%s %s %d%s", p[j], p[j + 1], p[j + 2] < 0 ? -1 : p[j + 2] + k * most, (j + 3 > n ? "" : " ") > model
            printf "\n" > model
            printf "%s\t%s\n", from "/images/" first[i, 10], out "/images/" name > links
        }
    }' "$from/sparse/images.txt"
read -r last most <"$out/ids"
awk -v copies="$copies" -v shift="$shift" -v last="$last" -v most="$most" '
    /^#/ { next }
    { line[++n] = $0 }
    END {
        for (k = 0; k < copies; k++) for (i = 1; i <= n; i++) {
            m = split(line[i], f, " ")
            printf "%d %.9g %s %s %s %s %s %s", f[1] + k * most, f[2] + k * shift, f[3], f[4], f[5], f[6], f[7], f[8]
            for (j = 9; j <= m; j += 2) printf " %d %s", f[j] + k * last, f[j + 1]
            printf "\n"
        }
    }' "$from/sparse/points3D.txt" >"$out/sparse/points3D.txt"
while IFS=$(printf '\t') read -r target link; do ln -sfn "$target" "$link"; done <"$out/links"
rm "$out/ids" "$out/links"
