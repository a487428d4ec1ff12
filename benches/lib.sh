# Shared by compare.sh and scaling.sh: measuring, tables, sections of docs/benchmarks.md. Sourced, not run.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
page=${BENCH_PAGE:-$root/docs/benchmarks.md}
bin=${SEMVS_BIN:-$root/target/release}

fail() { printf 'error: %s\n' "$*" >&2; exit 1; }

# Builds the programs unless SEMVS_BIN says where they are.
build() {
    [ -n "${SEMVS_BIN:-}" ] || (cd "$root" && cargo build --release --bins) || fail "the programs do not build"
    [ -x "$bin/semvs" ] || fail "$bin/semvs is not there"
}

# measure OUT COMMAND...: runs the command in the current folder; appends "user+system-seconds wall-seconds peak-MB" to OUT.
# Without GNU time the peak is 0.
measure() {
    local out=$1 times
    shift
    if [ -x /usr/bin/time ]; then
        /usr/bin/time -o time.txt -f '%U %S %e %M' "$@" >run.log 2>&1 || fail "$* failed: $(tail -n 1 run.log)"
        awk 'END { printf "%.2f %.2f %.0f\n", $1 + $2, $3, $4 / 1000 }' time.txt >>"$out"
    else
        local TIMEFORMAT='%U %S %R'
        times=$({ time "$@" >run.log 2>&1; } 2>&1) || fail "$* failed: $(tail -n 1 run.log)"
        echo "$times" | awk 'END { printf "%.2f %.2f 0\n", $1 + $2, $3 }' >>"$out"
    fi
}

# column FILE N: the N-th column, sorted by number.
column() { awk -v n="$2" '{ print $n }' "$1" | sort -n; }

median() { column "$1" "$2" | awk '{ v[NR] = $1 } END { print NR % 2 ? v[(NR + 1) / 2] : (v[NR / 2] + v[NR / 2 + 1]) / 2 }'; }

# spread FILE N: least and most.
spread() { column "$1" "$2" | awk 'NR == 1 { low = $1 } END { print low "–" $1 }'; }

most() { column "$1" "$2" | tail -n 1; }

# field REPORT NAME: a number of a report of semvs.
field() { sed -n "s/^ *\"$2\": \([0-9.]*\),\{0,1\}\$/\1/p" "$1" | tail -n 1; }

# sum REPORT NAME: of a number of all its views.
sum() { sed -n "s/^ *\"$2\": \([0-9.]*\),\{0,1\}\$/\1/p" "$1" | awk '{ s += $1 } END { print s }'; }

# pixels REPORT: of all its depth maps.
pixels() {
    awk '/"width":/ { w = $2 + 0 } /"height":/ { p += w * ($2 + 0) } END { print p }' "$1"
}

# Processes that wanted a processor when it began.
load=$(cut -d ' ' -f 1 /proc/loadavg 2>/dev/null || echo '?')

# What the figures were measured on, in a line.
machine() {
    local model memory
    model=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo 2>/dev/null | head -n 1)
    memory=$(awk '/MemTotal/ { printf "%.0f GB", $2 / 1e6 }' /proc/meminfo 2>/dev/null)
    printf '%s, %s threads, %s, %s, %s; load %s from other work when it began, which wall times suffer from' \
        "${model:-unknown processor}" "$(getconf _NPROCESSORS_ONLN)" "${memory:-?}" \
        "$("$bin/semvs" --version | paste -sd ' ' | sed 's/kernels:/with the kernels/')" "$(LC_ALL=C date '+%B %Y')" "$load"
}

# section NAME: puts standard input in the place of that section of the page, or at its end.
section() {
    local name=$1 text
    text=$(cat)
    [ -f "$page" ] || printf '# Benchmarks\n' >"$page"
    local begin="<!-- generated: $name -->" end="<!-- end: $name -->"
    grep -qxF -- "$begin" "$page" || printf '\n%s\n%s\n' "$begin" "$end" >>"$page"
    BEGIN_MARK=$begin END_MARK=$end TEXT=$text awk '
        $0 == ENVIRON["BEGIN_MARK"] { print; print ""; print ENVIRON["TEXT"]; print ""; inside = 1; next }
        $0 == ENVIRON["END_MARK"] { inside = 0 }
        !inside' "$page" >"$page.new"
    mv "$page.new" "$page"
}

# Sets scene (a folder with scene.mvs and images), name, settings, thresholds and truth ("" = none) from the first argument:
# a folder, or nothing for the bundled scene. SETTINGS and THRESHOLDS in the environment say what a folder does not.
choose_scene() {
    scene=${1:-$root/compat-fixtures/facade6}
    scene=$(cd "$scene" && pwd) || fail "no folder $1"
    [ -f "$scene/scene.mvs" ] || fail "$scene: there is no scene.mvs"
    name=$(basename "$scene")
    settings="--resolution-level 1 --min-resolution 320 --estimate-roi 0"
    case $name in
    facade6) settings="--resolution-level 1 --min-resolution 160 --estimate-roi 0" thresholds="0.05 0.1 0.2" ;;
    facade16) thresholds="0.02 0.05 0.1" ;;
    *) thresholds="0.01 0.02 0.05" ;;
    esac
    settings=${SETTINGS:-$settings}
    thresholds=${THRESHOLDS:-$thresholds}
    truth=
    local found
    for found in "$scene/truth.ply" "$scene/truth/truth.ply"; do
        [ ! -f "$found" ] || truth=$found
    done
    work=$(mktemp -d)
    trap 'rm -rf "$work"' EXIT
    if [ -z "$truth" ] && [ -f "$scene/truth.ply.zst" ]; then
        command -v zstd >/dev/null || fail "zstd is needed to unpack $scene/truth.ply.zst"
        truth=$work/truth.ply
        zstd -qd "$scene/truth.ply.zst" -o "$truth"
    fi
}

# fresh: a new copy of the scene in $work/run, which becomes the current folder.
fresh() {
    rm -rf "$work/run"
    mkdir "$work/run"
    cd "$work/run" || exit 1
    cp "$scene/scene.mvs" .
    ln -s "$scene/images" images
}

# score CLOUD: "F1 / F1 / F1" and the gross share against the truth, with " | " between; dashes without truth.
score() {
    if [ -z "$truth" ]; then
        printf -- '– | –'
        return
    fi
    # shellcheck disable=SC2086
    "$bin/semvs" evaluate "$1" --truth "$truth" --thresholds $thresholds >score.txt || fail "$1 cannot be scored"
    awk 'table { f = f (f ? " / " : "") sprintf("%.3f", $4); if (!g) g = sprintf("%.4f", $5) } $1 == "distance" { table = 1 }
        END { printf "%s | %s", f, g }' score.txt
}

# points CLOUD: the number of its points.
points() { sed -n '1,/end_header/s/^element vertex //p' "$1" | tr -d '\r' | head -n 1; }
