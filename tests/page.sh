#!/usr/bin/env bash
# Opens pages about a run over the bundled scene and about comparisons in a headless Chromium: no errors on the console, pictures
# there, the slider moves, the viewer draws and obeys mouse, fingers and keys, narrow windows hold everything; says how fast.
# Tells so and succeeds where there is no Chromium.
#
# Usage: tests/page.sh [RUN.png [COMPARISON.png]]     SEMVS=path/to/semvs CHROMIUM=path/to/chromium
set -euo pipefail
cd "$(dirname "$0")/.."
semvs=${SEMVS:-$PWD/target/release/semvs}
chromium=${CHROMIUM:-$(command -v chromium || command -v chromium-browser || command -v google-chrome || true)}
if [ -z "$chromium" ]; then
    echo "skipped: no chromium is there"
    exit 0
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
scene=compat-fixtures/facade6
"$semvs" densify $scene/scene.mvs -o "$work/out/facade6.ply" -w "$work/out" --label-path $scene/labels \
    --class-table 3dom-facade --report "$work/out/run.json" --report-html "$work/out/page.html" -q >/dev/null

# One point more often than there are pixels: a cloud of 500,000 points to measure with.
python3 - "$work/out/facade6.ply" "$work/out/large.ply" <<'PYTHON' || echo "no python3: speed is measured with the bundled cloud"
import sys
data = open(sys.argv[1], "rb").read()
end = data.index(b"end_header\n") + 11
head = data[:end].decode("latin-1")
count = int(head.split("element vertex ")[1].split()[0])
body = data[end:]
size = len(body) // count
times = 500_000 // count + 1
points = (body * times)[: 500_000 * size]
open(sys.argv[2], "wb").write(head.replace(f"element vertex {count}", "element vertex 500000").encode("latin-1") + points)
PYTHON
large="$work/out/facade6.ply"
if [ -s "$work/out/large.ply" ]; then large="$work/out/large.ply"; fi
"$semvs" report "$work/out" --cloud "$large" -o "$work/large.html" --label-path $scene/labels --class-table 3dom-facade -q >/dev/null
"$semvs" report "$work/out" -o "$work/again.html" -q >/dev/null
# Results of OpenMVS before and after its filters, and clouds and scenes of both programs.
theirs=$scene/openmvs-2.3.0
printf '[limits]\nmaps.both = { min = 6 }\nmaps.only_a = { max = 0 }\ndepth.p50 = { max = 1e-4 }\n' >"$work/expect.toml"
"$semvs" compare $theirs/post7 $theirs/raw --expect "$work/expect.toml" --html "$work/maps.html" >/dev/null || [ $? = 1 ]
"$semvs" compare "$work/out/facade6.ply" $theirs/post7/scene_dense.ply.zst --html "$work/clouds.html" >/dev/null
"$semvs" compare $theirs/post7/scene_dense.mvs $theirs/archive2/scene_dense.mvs --html "$work/scenes.html" >/dev/null

cat >"$work/check-shared.html" <<'SCRIPT'
<pre id="found"></pre>
<script>
const said = [], say = (name, value) => { said.push(`${name}=${value}`); at("found").textContent = `\n${said.join("\n")}\n`; };
// Frames are not drawn unless a picture is taken, so nothing waits for them.
const width = address => new Promise(done => {
  const image = new Image();
  image.onload = () => done(image.naturalWidth);
  image.onerror = () => done(0);
  image.src = address;
});
// Events made by scripts have no pointer that could be captured.
Element.prototype.setPointerCapture = () => {};
const pointer = (node, type, x, y, more = {}) => {
  const place = node.getBoundingClientRect();
  node.dispatchEvent(new PointerEvent(type, { clientX: place.left + x, clientY: place.top + y, buttons: 1, bubbles: true, ...more }));
};
const key = (node, key, more = {}) => node.dispatchEvent(new KeyboardEvent("keydown", { key, ...more }));
async function checkPictures(items) {
  const broken = [];
  for (const item of items) for (const [name, address] of Object.entries(item.layers)) {
    if (!await width(address)) broken.push(`${item.name} ${name}`);
  }
  say("layers", items.map(v => Object.keys(v.layers).length).join());
  say("broken", broken.join());
  say("left", await width(at("picture-left").src));
  say("right", await width(at("picture-right").src));
  const box = at("compare"), w = box.getBoundingClientRect().width;
  pointer(box, "pointerdown", w / 2, 9); pointer(box, "pointermove", w / 4, 9);
  say("slider", box.getAttribute("aria-valuenow"));
  key(box, "ArrowRight");
  say("slider_key", box.getAttribute("aria-valuenow"));
  key(box, "End");
  say("slider_end", box.getAttribute("aria-valuenow"));
  pictures.open(2);
  say("opened", at("view-number").value);
  say("thumbnails", at("strip").children.length);
}
const lit = () => {
  const gl = viewer.gl;
  viewer.render();
  const pixels = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
  gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  let n = 0, sum = 0;
  for (let i = 0; i < pixels.length; i += 4) if (pixels[i] !== 16 || pixels[i + 1] !== 18) { n++; sum += pixels[i] + 2 * pixels[i + 1] + 3 * pixels[i + 2]; }
  return [n / (pixels.length / 4), sum];
};
function checkViewer() {
  viewer.frusta = false;
  say("lit", lit()[0].toFixed(3));
  const sums = [];
  for (const option of at("mode").options) { viewer.mode = Number(option.value); sums.push(lit()[1]); }
  say("modes", new Set(sums).size + " of " + sums.length);
  viewer.cloud.classes.forEach(c => { c.shown = false; });
  viewer.paintClasses();
  say("hidden", lit()[0]);
  viewer.cloud.classes.forEach(c => { c.shown = true; });
  viewer.paintClasses();
  // Mouse, fingers, wheel and keys, each by what it changes.
  const canvas = at("viewer"), state = () => ({ turn: viewer.yaw, move: viewer.target.join(), zoom: viewer.distance });
  const changes = act => { viewer.home(); viewer.matrix(); const before = state(); act(); const after = state(); return Object.keys(before).filter(k => before[k] !== after[k]).join("+"); };
  const drag = more => { pointer(canvas, "pointerdown", 100, 100, more); pointer(canvas, "pointermove", 140, 120, more); pointer(canvas, "pointerup", 140, 120, more); };
  const finger = (id, type, x) => pointer(canvas, type, x, 100, { pointerId: id, pointerType: "touch" });
  say("drag", changes(() => drag({})));
  say("drag_shift", changes(() => drag({ shiftKey: true })));
  say("drag_right", changes(() => drag({ buttons: 2, button: 2 })));
  say("one_finger", changes(() => { finger(7, "pointerdown", 100); finger(7, "pointermove", 150); finger(7, "pointerup", 150); }));
  say("two_fingers", changes(() => { finger(7, "pointerdown", 100); finger(8, "pointerdown", 200); finger(8, "pointermove", 260); finger(8, "pointerup", 260); finger(7, "pointerup", 100); }));
  say("wheel", changes(() => canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: 100, cancelable: true }))));
  say("key", changes(() => key(canvas, "ArrowLeft")));
  say("key_shift", changes(() => key(canvas, "ArrowLeft", { shiftKey: true })));
  say("key_zoom", changes(() => key(canvas, "+")));
  viewer.home();
  viewer.render();
  say("errors", viewer.gl.getError());
  say("points", viewer.cloud.count);
}
async function check(body) {
  for (let i = 0; i < 500 && !document.documentElement.dataset.ready; i++) await new Promise(done => setTimeout(done, 10));
  say("ready", document.documentElement.dataset.ready);
  say("wider", document.documentElement.scrollWidth > document.documentElement.clientWidth);
  try { await body(); } catch (error) { say("failed", error.stack); }
  say("done", true);
}
</script>
SCRIPT
cat >"$work/check-run.html" <<'SCRIPT'
<script>
check(async () => {
  await checkPictures(data.views);
  say("nodes", document.querySelectorAll("#graph-picture circle").length);
  say("edges", document.querySelectorAll("#graph-picture line").length);
  say("classes", document.querySelectorAll("#class-table tbody tr").length);
  checkViewer();
  viewer.frusta = true; viewer.render();
  const spot = viewer.project(viewer.cameras[1].center);
  openAt(4);
  pointer(at("viewer"), "pointerdown", ...spot); pointer(at("viewer"), "pointerup", ...spot);
  say("picked", data.views[at("view-number").value].id === data.views[viewer.cameras[1].view].id);
  // Time is not real in here, but it is in the log.
  viewer.render();
  viewer.wait();
  for (const count of [viewer.cloud.count, 20000]) {
    console.log(`spin of ${count} points`);
    viewer.spin(30, count);
  }
  console.log("spin ends");
});
</script>
SCRIPT
cat >"$work/check-comparison.html" <<'SCRIPT'
<script>
check(async () => {
  say("histograms", document.querySelectorAll("#histogram-list svg").length);
  say("equal", at("histograms-equal").textContent.split(";").length);
  say("verdict", document.querySelector(".verdict")?.textContent ?? "none");
  say("failed_rows", document.querySelectorAll("#limit-table td .fail").length);
  say("passed_rows", document.querySelectorAll("#limit-table td .pass").length);
  say("first", at("first").textContent.split(",")[0]);
  say("sections", [...document.querySelectorAll("main > section")].filter(s => !s.hidden).map(s => s.id).join());
  if (data.parts.length) await checkPictures(data.parts);
  if (data.cloud) checkViewer();
});
</script>
SCRIPT

flags=(--headless=new --no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader
    --user-data-dir="$work/profile" --hide-scrollbars --window-size=1300,2500 --enable-logging=stderr --v=0)
look() { # KIND PAGE [FLAG...]: what the injected script found, one NAME=VALUE per line
    cat "$2" "$work/check-shared.html" "$work/check-$1.html" >"$work/checked.html"
    shift 2
    timeout 180 "$chromium" "${flags[@]}" "$@" --virtual-time-budget=60000 --dump-dom \
        "file://$work/checked.html" 2>"$work/console" | sed -n '/<pre id="found">/,/<\/pre>/p' | sed 's/<[^>]*>//g' >"$work/found"
    grep -q '^done=true' "$work/found" || { cat "$work/found"; grep CONSOLE "$work/console" || tail "$work/console"; echo "the check did not end" >&2; exit 1; }
    ! grep 'CONSOLE' "$work/console" | grep -v '"spin ' || { echo "the console has messages" >&2; exit 1; }
}
frames_per_second() { # from the log's times, [MMDD/HHMMSS.ffffff:INFO:CONSOLE...] or [PID:TID:MMDD/...]
    sed -nE 's/^\[.*[0-9]{4}\/([0-9]{2})([0-9]{2})([0-9.]+):.*"spin (of ([0-9]+))?.*/\1 \2 \3 \5/p' "$work/console" |
        awk '{ t = $1 * 3600 + $2 * 60 + $3; if (NR > 1) printf "%s%s points at %.1f frames per second", (NR > 2 ? ", " : ""), points, 30 / (t - from); from = t; points = $4 }'
}
expect() { # NAME PATTERN
    grep -qE "^$1=$2\$" "$work/found" || { cat "$work/found"; echo "$1 is not $2" >&2; exit 1; }
}

expect_pictures() {
    expect broken ''
    expect left '[1-9][0-9]+'
    expect right '[1-9][0-9]+'
    expect slider 25
    expect slider_key 30
    expect slider_end 100
    expect opened 2
    expect thumbnails 6
}
expect_viewer() {
    expect lit '0\.[0-9]*[1-9][0-9]*'
    expect hidden 0
    for way in drag one_finger key; do expect $way turn; done
    for way in drag_shift drag_right key_shift; do expect $way move; done
    for way in wheel key_zoom; do expect $way zoom; done
    expect two_fingers 'move\+zoom'
    expect errors 0
}

for page in "$work/out/page.html" "$work/again.html" "$work/large.html"; do
    look run "$page"
    expect ready true
    expect wider false
    expect layers '[5-6],[5-6],[5-6],[5-6],[5-6],[5-6]'
    expect_pictures
    expect nodes 6
    expect edges '[1-9][0-9]*'
    expect classes '[2-9]'
    expect_viewer
    expect modes '6 of 6'
    expect picked true
    echo "$(basename "$page"): fine; $(($(stat -c %s "$page") / 1024)) KiB; $(frames_per_second)"
done
look run "$work/out/page.html" --window-size=500,900
expect wider false

look comparison "$work/maps.html"
expect ready true
expect wider false
expect sections limits,figures,views,histograms
expect layers '6,6,6,6,6,6'
expect_pictures
expect histograms 6
expect verdict '✗ 6 of 8 .*'
expect failed_rows 6
expect passed_rows 2
expect first 'First difference: pixel .*'
echo "maps.html: fine; $(($(stat -c %s "$work/maps.html") / 1024)) KiB"
look comparison "$work/maps.html" --window-size=500,900
expect wider false
look comparison "$work/clouds.html"
expect sections figures,cloud,histograms
expect_viewer
expect modes '[34] of [34]'
expect histograms 2
echo "clouds.html: fine; $(($(stat -c %s "$work/clouds.html") / 1024)) KiB"
look comparison "$work/scenes.html"
expect sections figures,histograms
expect histograms 0
expect equal '[1-9][0-9]*'
echo "scenes.html: fine; $(($(stat -c %s "$work/scenes.html") / 1024)) KiB"

if [ -n "${1:-}" ]; then
    shot() { "$chromium" "${flags[@]}" --virtual-time-budget=5000 "--screenshot=$2" "file://$1" 2>/dev/null && echo "$2"; }
    shot "$work/out/page.html" "$1"
    [ -z "${2:-}" ] || shot "$work/maps.html" "$2"
fi
