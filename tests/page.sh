#!/usr/bin/env bash
# Opens the page about a run over the bundled scene in a headless Chromium: no errors on its console, pictures there, the
# slider moves, the viewer draws; says how fast. Tells so and succeeds where there is no Chromium.
#
# Usage: tests/page.sh [SCREENSHOT.png]     SEMVS=path/to/semvs CHROMIUM=path/to/chromium
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

cat >"$work/check.html" <<'SCRIPT'
<pre id="found"></pre>
<script>
(async () => {
  const said = [], say = (name, value) => { said.push(`${name}=${value}`); at("found").textContent = `\n${said.join("\n")}\n`; };
  // Frames are not drawn unless a picture is taken, so nothing waits for them.
  const width = address => new Promise(done => {
    const image = new Image();
    image.onload = () => done(image.naturalWidth);
    image.onerror = () => done(0);
    image.src = address;
  });
  say("ready", document.documentElement.dataset.ready);
  try {
    const broken = [];
    for (const view of data.views) for (const [name, address] of Object.entries(view.layers)) {
      if (!await width(address)) broken.push(`${view.image} ${name}`);
    }
    say("layers", data.views.map(v => Object.keys(v.layers).length).join());
    say("broken", broken.join());
    say("left", await width(at("picture-left").src));
    say("right", await width(at("picture-right").src));
    const box = at("compare"), place = box.getBoundingClientRect();
    const pointer = (type, share) => box.dispatchEvent(new PointerEvent(type, { clientX: place.left + place.width * share, clientY: place.top + 9, buttons: 1, bubbles: true }));
    const capture = box.setPointerCapture;
    box.setPointerCapture = () => {};
    pointer("pointerdown", 0.5); pointer("pointermove", 0.25);
    box.setPointerCapture = capture;
    say("slider", box.getAttribute("aria-valuenow"));
    box.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }));
    say("slider_key", box.getAttribute("aria-valuenow"));
    openAt(2);
    say("opened", at("view-number").value);
    say("thumbnails", at("strip").children.length);
    say("nodes", document.querySelectorAll("#graph-picture circle").length);
    say("edges", document.querySelectorAll("#graph-picture line").length);
    say("classes", document.querySelectorAll("#class-table tbody tr").length);
    const gl = viewer.gl, lit = () => {
      viewer.render();
      const pixels = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
      gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
      let n = 0, sum = 0;
      for (let i = 0; i < pixels.length; i += 4) if (pixels[i] !== 16 || pixels[i + 1] !== 18) { n++; sum += pixels[i] + 2 * pixels[i + 1] + 3 * pixels[i + 2]; }
      return [n / (pixels.length / 4), sum];
    };
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
    viewer.frusta = true; viewer.render();
    const spot = viewer.project(viewer.cameras[1].center);
    openAt(4); viewer.pick(spot[0], spot[1]);
    say("picked", data.views[at("view-number").value].id === data.views[viewer.cameras[1].view].id);
    say("errors", gl.getError());
    say("points", viewer.cloud.count);
    // Time is not real in here, but it is in the log.
    viewer.render();
    viewer.wait();
    for (const count of [viewer.cloud.count, 20000]) {
      console.log(`spin of ${count} points`);
      viewer.spin(30, count);
    }
    console.log("spin ends");
  } catch (error) { say("failed", error.stack); }
  say("done", true);
})();
</script>
SCRIPT

flags=(--headless=new --no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader
    --user-data-dir="$work/profile" --hide-scrollbars --window-size=1300,2500 --enable-logging=stderr --v=0)
look() { # PAGE: what the injected script found, one NAME=VALUE per line
    # Without the copy's own policy the script may be added; what it checks stays as it is.
    cat "$1" "$work/check.html" >"$work/checked.html"
    timeout 180 "$chromium" "${flags[@]}" --virtual-time-budget=60000 --dump-dom \
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

for page in "$work/out/page.html" "$work/again.html" "$work/large.html"; do
    look "$page"
    expect ready true
    expect layers '[5-6],[5-6],[5-6],[5-6],[5-6],[5-6]'
    expect broken ''
    expect left '[1-9][0-9]+'
    expect right '[1-9][0-9]+'
    expect slider 25
    expect slider_key 30
    expect opened 2
    expect thumbnails 6
    expect nodes 6
    expect edges '[1-9][0-9]*'
    expect classes '[2-9]'
    expect lit '0\.[0-9]*[1-9][0-9]*'
    expect modes '6 of 6'
    expect hidden 0
    expect picked true
    expect errors 0
    echo "$(basename "$page"): fine; $(($(stat -c %s "$page") / 1024)) KiB; $(frames_per_second)"
done

if [ -n "${1:-}" ]; then
    "$chromium" "${flags[@]}" --virtual-time-budget=5000 --screenshot="$1" "file://$work/out/page.html" 2>/dev/null
    echo "$1"
fi
