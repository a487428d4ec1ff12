#!/usr/bin/env bash
# Whole programs on a scene: OpenMVS's DensifyPointCloud where one is installed, ours beside it.
#
#   benches/compare.sh [SCENE_FOLDER]
#
# The folder holds scene.mvs, images/ and, for scores, truth.ply or truth.ply.zst; without one the bundled scene is taken.
# In the environment: OPENMVS_BIN, OpenMVS's program or the folder of its programs; SEMVS_BIN, the folder of ours (else they
# are built); ROUNDS (5); SETTINGS and THRESHOLDS of a scene; LEVELS, instruction sets besides the best (avx2 scalar);
# BENCH_PAGE, the page that is written (docs/benchmarks.md).
#
# The programs take turns, ROUNDS times each, from a fresh copy of the scene. CPU is user and system time. The section of the
# page about this scene is replaced. Without OpenMVS the stored figures of benches/openmvs.tsv stand in.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

rounds=${ROUNDS:-5}
levels=${LEVELS-avx2 scalar}
build
choose_scene "${1:-}"

# Whether a program is OpenMVS's; ours has the same name.
is_openmvs() {
    local said
    [ -f "$1" ] && [ -x "$1" ] || return 1
    said=$(cd "$work" && "$1" --help 2>&1 | head -n 5; rm -f "$work"/DensifyPointCloud-*.log)
    case $said in
    *semvs*) return 1 ;;
    *OpenMVS*) return 0 ;;
    esac
    return 1
}

# The program of an installed OpenMVS, if there is one.
find_openmvs() {
    local place
    for place in "${OPENMVS_BIN:-}" "${OPENMVS_BIN:-}/DensifyPointCloud" /usr/local/bin/OpenMVS/DensifyPointCloud \
        /usr/bin/OpenMVS/DensifyPointCloud /usr/lib/openmvs/DensifyPointCloud /opt/OpenMVS/bin/DensifyPointCloud \
        /opt/openmvs/bin/DensifyPointCloud "$(command -v DensifyPointCloud || true)"; do
        if is_openmvs "$place"; then
            printf '%s' "$place"
            return
        fi
    done
    [ -z "${OPENMVS_BIN:-}" ] || fail "OPENMVS_BIN=$OPENMVS_BIN: that is not OpenMVS's DensifyPointCloud"
}

openmvs=$(find_openmvs)

# run KEY: one run of a program on a fresh copy of the scene; its cloud becomes KEY.ply.
run() {
    local key=$1 cloud=scene_dense.ply
    fresh
    case $key in
    # shellcheck disable=SC2086
    openmvs) measure "$work/$key" "$openmvs" scene.mvs $settings --tower-mode 0 ;;
    # shellcheck disable=SC2086
    openmvs-best) measure "$work/$key" "$openmvs" scene.mvs $settings --tower-mode 0 --postprocess-dmaps 0 ;;
    # shellcheck disable=SC2086
    drop-in) measure "$work/$key" "$bin/DensifyPointCloud" scene.mvs $settings --tower-mode 0 ;;
    # shellcheck disable=SC2086
    semvs) measure "$work/$key" "$bin/semvs" densify scene.mvs $settings ;;
    # shellcheck disable=SC2086
    semvs-*) SEMVS_CPU=${key#semvs-} measure "$work/$key" "$bin/semvs" densify scene.mvs $settings ;;
    esac
    mv "$cloud" "$work/$key.ply"
}

keys="semvs"
for level in $levels; do
    if SEMVS_CPU=$level "$bin/semvs" --version >/dev/null 2>&1; then keys="$keys semvs-$level"; fi
done
keys="$keys drop-in"
[ -z "$openmvs" ] || keys="openmvs $keys openmvs-best"

for round in $(seq "$rounds"); do
    for key in $keys; do
        printf 'round %s of %s: %s\n' "$round" "$rounds" "$key" >&2
        run "$key"
    done
done

label() {
    case $1 in
    openmvs) printf 'OpenMVS' ;;
    openmvs-best) printf 'OpenMVS `--postprocess-dmaps 0`' ;;
    drop-in) printf '`DensifyPointCloud` of semvs' ;;
    semvs) printf '`semvs densify`' ;;
    semvs-*) printf '`SEMVS_CPU=%s semvs densify`' "${1#semvs-}" ;;
    esac
}

# CPU seconds of OpenMVS's default run that the others are held against: measured, else stored, else nothing.
baseline=
if [ -n "$openmvs" ]; then
    baseline=$(median "$work/openmvs" 1)
else
    baseline=$(awk -F '\t' -v s="$name" -v o="$settings" '$1 == s && $2 == o && $3 == "(default)" && $4 != "-" { print $4 }' \
        "$root/benches/openmvs.tsv")
fi

measured_rows() {
    local key cpu ratio
    for key in $keys; do
        cpu=$(median "$work/$key" 1)
        ratio=$([ -n "$baseline" ] && awk -v a="$baseline" -v b="$cpu" 'BEGIN { printf "%.1f", a / b }' || printf '–')
        printf '| %s | %.1f (%s) | %s | %.1f | %s | %s | %s |\n' "$(label "$key")" "$cpu" "$(spread "$work/$key" 1)" \
            "$ratio" "$(median "$work/$key" 2)" "$(most "$work/$key" 3)" "$(points "$work/$key.ply")" \
            "$(score "$work/$key.ply")"
    done
}

stored_rows() {
    [ -z "$openmvs" ] || return 0
    awk -F '\t' -v s="$name" -v o="$settings" -v t="$thresholds" '
        function dash(v) { return v == "-" ? "–" : v }
        $1 == s && $2 == o {
            score = $8 == t ? $9 " | " $10 : "– | –"
            printf "| OpenMVS %s, stored | %s | %s | %s | %s | %s | %s |\n", $3 == "(default)" ? "" : "`" $3 "`", dash($4),
                $4 == "-" ? "–" : "1", dash($5), dash($6), dash($7), score
        }' "$root/benches/openmvs.tsv" | sed 's/OpenMVS ,/OpenMVS,/'
}

cd "$work"
{
    printf '### %s\n\n`%s`, everything else default. ' "$name" "$settings"
    printf 'CPU: user and system seconds of the whole process, median of %s in turn (least–most); ' \
        "$([ "$rounds" = 1 ] && echo 'one run' || echo "$rounds runs")"
    printf 'F1 within %s scene units of the truth; gross: share of points farther off than ten times the first of them.\n\n' \
        "$(printf '%s' "$thresholds" | sed 's/ /, /g')"
    printf '| program | CPU s | OpenMVS ÷ this | wall s | peak MB | points | F1 | gross |\n'
    printf '| --- | --- | ---: | ---: | ---: | ---: | --- | ---: |\n'
    stored_rows
    measured_rows
    printf '\n%s.' "$(machine)"
    if [ -n "$openmvs" ]; then
        printf ' OpenMVS: %s.\n' "$(cd "$work" && "$openmvs" --help 2>&1 | grep -m 1 -o 'OpenMVS [^[:cntrl:]]*' || printf 'version unknown')"
    else
        printf ' No OpenMVS is installed there: its rows are the stored figures of version 2.3.0 on two threads of an AMD EPYC (Zen 5), user time alone, in `benches/openmvs.tsv`.\n'
    fi
} >section.md
section "compare $name" <section.md
cat section.md
