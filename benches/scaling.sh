#!/usr/bin/env bash
# How time and memory of `semvs densify` grow with resolution, views, images and threads.
#
#   benches/scaling.sh [SCENE_FOLDER]
#
# The folder is as for compare.sh, with sparse/ (a COLMAP text model) for the curve over images; without one the bundled
# scene is taken. In the environment: SEMVS_BIN, SETTINGS, BENCH_PAGE as there; LEVELS (3 2 1 0), VIEWS (2 to 10), IMAGES
# (16 64 256, rounded up to whole scenes), SHIFT (100), the distance of the copies of a scene in its units.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

build
choose_scene "${1:-}"
smallest="--min-resolution 32 --estimate-roi 0"

# densify OPTIONS...: one measured run on a fresh copy; leaves r.json and, in `last`, "cpu wall peak".
densify() {
    fresh
    rm -f "$work/last"
    measure "$work/last" "$bin/semvs" densify scene.mvs --report r.json "$@"
}

# What a row says of the last run: maps, pixels, CPU, nanoseconds per pixel and view, wall, peak, bytes per pixel of all maps.
row() {
    local evaluations
    evaluations=$(awk '/"width":/ { w = $2 + 0 } /"height":/ { h = $2 + 0 } /"sources": \[$/ { on = 1; next }
        on && /\]/ { on = 0 } on { e += w * h } END { printf "%.0f", e }' r.json)
    awk -v p="$(pixels r.json)" -v e="$evaluations" -v views="$(grep -c '"index":' r.json)" \
        '{ printf "%d | %.2f | %.2f | %.0f | %.2f | %.0f | %.0f", views, p / 1e6, $1, e ? $1 * 1e9 / e : 0, $2, $3, $3 * 1e6 / p }' "$work/last"
}

head_of() {
    printf '| %s | images | Mpx of maps | CPU s | ns per pixel and view | wall s | peak MB | peak bytes per pixel of all maps |\n' "$1"
    printf '| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n'
}

# curve TITLE X Y: an SVG of "x y" lines on standard input, both axes logarithmic, with a dashed line of proportion.
curve() {
    awk -v title="$1" -v xname="$2" -v yname="$3" '
        function px(v) { return 60 + 300 * (log(v) - lx) / (hx - lx) }
        function py(v) { return 230 - 180 * (log(v) - ly) / (hy - ly) }
        $1 > 0 && $2 > 0 { x[++n] = $1; y[n] = $2 }
        END {
            lx = hx = log(x[1]); ly = hy = log(y[1])
            for (i = 1; i <= n; i++) {
                if (log(x[i]) < lx) { lx = log(x[i]); y0 = y[i] } if (log(x[i]) > hx) hx = log(x[i])
                if (log(y[i]) < ly) ly = log(y[i]); if (log(y[i]) > hy) hy = log(y[i])
            }
            if (hy - ly < hx - lx) hy = ly + hx - lx
            print "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"390\" height=\"280\" font-family=\"sans-serif\" font-size=\"11\">"
            print "<rect width=\"390\" height=\"280\" fill=\"white\"/>"
            printf "<text x=\"60\" y=\"24\" font-size=\"13\">%s</text>\n<text x=\"210\" y=\"270\" text-anchor=\"middle\">%s</text>\n", title, xname
            printf "<text x=\"14\" y=\"140\" transform=\"rotate(-90 14 140)\" text-anchor=\"middle\">%s</text>\n", yname
            print "<path d=\"M60 40V230H370\" fill=\"none\" stroke=\"#444\"/>"
            first = exp(ly); for (i = 1; i <= n; i++) if (log(x[i]) == lx) first = y[i]
            reach = hx - lx; if (log(first) + reach > hy) reach = hy - log(first)
            printf "<path d=\"M%.1f %.1fL%.1f %.1f\" stroke=\"#999\" stroke-dasharray=\"4 4\"/>\n", px(exp(lx)), py(first), px(exp(lx + reach)), py(first * exp(reach))
            printf "<polyline fill=\"none\" stroke=\"#0060a0\" stroke-width=\"2\" points=\""
            for (i = 1; i <= n; i++) printf "%.1f,%.1f ", px(x[i]), py(y[i])
            print "\"/>"
            for (i = 1; i <= n; i++) {
                printf "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3\" fill=\"#0060a0\"/>", px(x[i]), py(y[i])
                printf "<text x=\"%.1f\" y=\"246\" text-anchor=\"middle\">%.3g</text><text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">%.3g</text>\n", px(x[i]), x[i], px(x[i]) - 6, py(y[i]) - 5, y[i]
            }
            print "</svg>"
        }'
}

# draw FILE TITLE X Y: the curve of standard input beside the page.
draw() {
    mkdir -p "$(dirname "$page")/images"
    curve "$2" "$3" "$4" >"$(dirname "$page")/images/$1.svg"
    printf '\n![%s](images/%s.svg)\n' "$2" "$1"
}

over_resolution() {
    head_of '`--resolution-level`'
    : >"$work/curve"
    for level in ${LEVELS:-3 2 1 0}; do
        # shellcheck disable=SC2086
        densify $smallest --resolution-level "$level"
        printf '| %s | %s |\n' "$level" "$(row)"
        printf '%s %s\n' "$(awk -v p="$(pixels r.json)" 'BEGIN { print p / 1e6 }')" "$(cut -d ' ' -f 1 "$work/last")" >>"$work/curve"
    done
    draw "scaling-$name-resolution" "CPU time over pixels" "megapixels of all depth maps" "CPU seconds" <"$work/curve"
}

over_views() {
    head_of '`--number-views`'
    : >"$work/curve"
    for views in ${VIEWS:-2 3 4 5 6 8 10}; do
        # shellcheck disable=SC2086
        densify $settings --number-views "$views"
        printf '| %s | %s |\n' "$views" "$(row)"
        printf '%s %s\n' "$views" "$(cut -d ' ' -f 1 "$work/last")" >>"$work/curve"
    done
    draw "scaling-$name-views" "CPU time over views" "views each is matched with" "CPU seconds" <"$work/curve"
}

over_threads() {
    local one=
    printf '| `--max-threads` | wall s | CPU s | speed | peak MB |\n| ---: | ---: | ---: | ---: | ---: |\n'
    for threads in $(seq "$(getconf _NPROCESSORS_ONLN)"); do
        # shellcheck disable=SC2086
        densify $settings --max-threads "$threads"
        one=${one:-$(cut -d ' ' -f 2 "$work/last")}
        awk -v t="$threads" -v one="$one" '{ printf "| %s | %.2f | %.2f | %.2f | %.0f |\n", t, $2, $1, one / $2, $3 }' "$work/last"
    done
}

over_images() {
    local own copies folder
    own=$(awk '!/^#/ { n += 1 } END { print n / 2 }' "$scene/sparse/images.txt")
    printf '| images | Mpx of maps | CPU s | CPU s per image | wall s | peak MB | points | `semvs fuse` alone: CPU s | peak MB | 27 bytes per pixel and view, MB |\n'
    printf '| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n'
    : >"$work/curve"
    for images in ${IMAGES:-16 64 256}; do
        copies=$(awk -v i="$images" -v own="$own" 'BEGIN { c = int(i / own); print c * own < i ? c + 1 : c }')
        folder=$work/line
        rm -rf "$folder" "$work/last" "$work/fused"
        "$root/benches/repeat.sh" "$scene" "$copies" "${SHIFT:-100}" "$folder"
        cd "$folder"
        # shellcheck disable=SC2086
        measure "$work/last" "$bin/semvs" densify . $settings --report r.json
        measure "$work/fused" "$bin/semvs" fuse . --depth-maps semvs -o fused.ply
        awk -v n="$((copies * own))" -v p="$(pixels r.json)" -v points="$(points semvs/dense.ply)" -v fused="$(cat "$work/fused")" '{
            split(fused, f, " ")
            printf "| %d | %.2f | %.2f | %.3f | %.2f | %.0f | %d | %.2f | %.0f | %.0f |\n", n, p / 1e6, $1, $1 / n, $2, $3, points, f[1], f[3], 27 * p / 1e6
        }' "$work/last"
        printf '%s %s\n' "$((copies * own))" "$(cut -d ' ' -f 1 "$work/last")" >>"$work/curve"
        cd "$work"
    done
    draw "scaling-$name-images" "CPU time over images" "images" "CPU seconds" <"$work/curve"
}

{
    printf '### Growth on %s\n\nOne run each of `semvs densify`. %s.\n' "$name" "$(machine)"
    printf '\nOver the resolution (`%s`):\n\n' "$smallest"
    over_resolution
    printf '\nOver the views that each is matched with (`%s`):\n\n' "$settings"
    over_views
    printf '\nOver threads:\n\n'
    over_threads
    if [ -f "$scene/sparse/images.txt" ]; then
        printf '\nOver images: the scene several times along a line (`benches/repeat.sh`), its copies too far apart to share points:\n\n'
        over_images
    fi
} >"$work/section.md"
section "scaling $name" <"$work/section.md"
cat "$work/section.md"
