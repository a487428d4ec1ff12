#!/usr/bin/env bash
# Kills runs over the bundled scene at random moments, resumes each, and compares every result with that of a run that
# nobody disturbed: not a byte may differ.
#
# Usage: tests/kill.sh [KILLS] [SEED]     (default 10, seed from the clock); SEMVS=path/to/semvs
set -euo pipefail
cd "$(dirname "$0")/.."
kills=${1:-10}
seed=${2:-$(date +%s)}
semvs=${SEMVS:-$PWD/target/release/semvs}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
RANDOM=$seed
echo "seed $seed"

fresh() {
    rm -rf "$work/$1"
    mkdir -p "$work/$1"
    ln -s "$PWD/compat-fixtures/facade6/images" "$work/$1/images"
    cp compat-fixtures/facade6/scene.mvs "$work/$1/"
}
start() {
    cd "$work/$1"
    exec "$semvs" densify scene.mvs -o out/cloud.ply -w maps --resolution-level 2 --min-resolution 80 \
        --number-views-fuse 2 -q
}
# What must be equal; the journal names digests only and must be equal too.
digests() { (cd "$work/$1" && find . -type f ! -name '*.log' -exec sha256sum {} + | sort -k 2); }

fresh whole
began=$(date +%s%N)
(start whole) >/dev/null
span=$((($(date +%s%N) - began) / 1000))
digests whole >"$work/expected"
echo "an undisturbed run takes $((span / 1000)) ms and leaves $(wc -l <"$work/expected") files"

i=0
while ((i < kills)); do
    fresh killed
    (start killed) >/dev/null 2>&1 &
    pid=$!
    delay=$(((RANDOM * 32768 + RANDOM) % span))
    sleep "$(printf '%d.%06d' $((delay / 1000000)) $((delay % 1000000)))"
    # A run that has ended already does not count.
    if ! kill -KILL "$pid" 2>/dev/null; then
        wait "$pid"
        continue
    fi
    wait "$pid" 2>/dev/null || true
    i=$((i + 1))
    left=$(cd "$work/killed" && find . -type f -name '*.dmap' | wc -l)
    (start killed) >"$work/log" 2>&1 || { cat "$work/log"; echo "kill $i after $delay us: cannot be resumed" >&2; exit 1; }
    digests killed >"$work/found"
    if ! diff "$work/expected" "$work/found" >&2; then
        echo "kill $i after $delay us, with $left maps: the results differ" >&2
        exit 1
    fi
done
echo "$kills runs killed and resumed: identical results"
