// Fills the page from its data.

const data = JSON.parse(document.getElementById("data").textContent);
const at = id => document.getElementById(id);
const LAYERS = [["image", "photograph"], ["depth", "depth"], ["normal", "normals"], ["confidence", "confidence"], ["labels", "label map"], ["removed", "class check"]];

function make(tag, attributes = {}, ...children) {
  const space = ["svg", "rect", "text", "line", "circle", "title", "g"].includes(tag) && "http://www.w3.org/2000/svg";
  const node = space ? document.createElementNS(space, tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) node.setAttribute(name, value);
  }
  node.append(...children.filter(c => c !== null && c !== undefined));
  return node;
}
const count = v => Math.round(v).toLocaleString("en").replaceAll(",", "\u202f");
const percent = v => `${(100 * v).toFixed(v < 0.1 ? 1 : 0)} %`;
const seconds = v => v < 1 ? `${v.toFixed(2)} s` : v < 10 ? `${v.toFixed(1)} s` : v < 120 ? `${v.toFixed(0)} s` : `${(v / 60).toFixed(1)} min`;
const short = v => Math.abs(v) >= 1000 || Math.abs(v) < 0.01 ? v.toPrecision(3) : v.toFixed(Math.abs(v) < 10 ? 2 : 1);
const css = c => `rgb(${c.join(",")})`;

function table(head, rows) {
  const cell = (tag, value) => make(tag, { class: typeof value === "object" && value?.number !== undefined ? "number" : null }, value?.number ?? value ?? "");
  return make("table", {}, make("thead", {}, make("tr", {}, ...head.map(h => cell("th", h)))), make("tbody", {}, ...rows.map(r => make("tr", {}, ...r.map(v => cell("td", v))))));
}

/// Horizontal bars: [label, value, text].
function bars(rows) {
  const most = Math.max(...rows.map(r => r[1]), 1e-9), h = 18;
  return make("svg", { viewBox: `0 0 380 ${rows.length * h}`, width: 380, role: "img" }, ...rows.flatMap(([label, value, text], i) => [
    make("text", { x: 118, y: i * h + 13, "text-anchor": "end" }, label),
    make("rect", { class: "bar", x: 124, y: i * h + 3, width: 140 * value / most, height: h - 6 }),
    make("text", { x: 130 + 140 * value / most, y: i * h + 13 }, text)]));
}

function histogram(values, low, high) {
  const most = Math.max(...values, 1), w = 300 / values.length;
  return make("svg", { viewBox: "0 0 300 120", width: 300, role: "img" }, ...values.map((v, i) => make("rect", { class: "bar", x: i * w, y: 100 - 96 * v / most, width: Math.max(w - 1, 0.5), height: 96 * v / most }, make("title", {}, count(v)))),
    make("text", { x: 0, y: 114 }, low), make("text", { x: 300, y: 114, "text-anchor": "end" }, high));
}

function head() {
  at("title").textContent = data.title;
  const parts = [`${count(data.points)} points`, `${data.views.length} views`];
  if (data.seconds) parts.push(`${seconds(data.seconds)}`);
  if (data.cpu_seconds) parts.push(`${seconds(data.cpu_seconds)} of processor time`);
  if (data.peak_memory) parts.push(`${count(data.peak_memory / 1e6)} MB of memory at most`);
  at("summary").textContent = parts.join(" · ");
  at("warnings").append(...data.warnings.map(w => make("li", {}, w)));
  at("footer").textContent = [data.program, data.version, data.cpu_level && `kernels: ${data.cpu_level}`].filter(Boolean).join(" · ");
}

// ---- views -------------------------------------------------------------------------------------------------------------

const shown = { view: 0, left: "image", right: "depth", cut: 50 };

function openView(index) {
  shown.view = index;
  showView();
  at("views").scrollIntoView({ behavior: "smooth" });
}

function showView() {
  const view = data.views[shown.view];
  if (!view) return;
  const layers = LAYERS.filter(([key]) => view.layers[key]);
  const choose = (side, fallback) => { if (!view.layers[shown[side]]) shown[side] = layers[Math.min(fallback, layers.length - 1)]?.[0]; };
  choose("left", 0);
  choose("right", 1);
  for (const side of ["left", "right"]) {
    const key = shown[side];
    const picture = at(`picture-${side}`);
    picture.hidden = !key;
    if (key) picture.src = view.layers[key];
    picture.alt = `${key ?? "nothing"} of ${view.image}`;
    at(`choose-${side}`).replaceChildren(...layers.map(([k, name]) => make("option", { value: k, selected: k === key }, name)));
  }
  at("view-number").value = shown.view;
  at("picture-legend").replaceChildren(...["left", "right"].map(side => legend(side, shown[side], view)).filter(Boolean));
  const facts = [["image", nameOf(view.id)], ["depth map", view.width ? `${view.width} × ${view.height}` : "none"], ["depths", percent(view.coverage)], ["confidence, mean", view.mean_confidence == null ? "–" : view.mean_confidence.toFixed(2)], ["matched with", view.sources.map(nameOf).join(", ") || "–"]];
  if (view.removed != null) facts.push(["class check", `${percent(view.removed)} of the depths have their class against them`]);
  if (view.dropped) facts.push(["left out", view.dropped]);
  at("view-facts").replaceChildren(table([], facts));
  for (const button of at("strip").children) button.setAttribute("aria-current", Number(button.dataset.view) === shown.view);
}

const nameOf = id => data.views.find(v => v.id === id)?.image.split(/[\\/]/).pop() ?? String(id);

function legend(side, key, view) {
  const ramp = stops => make("span", { class: "ramp", style: `background:linear-gradient(90deg,${stops.map(css).join(",")})` });
  if (key === "depth") return make("span", {}, `${side}: ${short(view.depth_scale[0])} `, ramp(data.ramps.depth), ` ${short(view.depth_scale[1])} scene units`);
  if (key === "confidence") return make("span", {}, `${side}: 0 `, ramp(data.ramps.confidence), " 1");
  if (key === "removed") return make("span", {}, `${side}: `, make("span", { class: "swatch", style: "background:rgb(230,40,30)" }), " depths of classes that are not wanted, or whose class most other views contradict");
  if (key === "labels") return make("span", {}, `${side}: `, ...data.classes.flatMap(c => [make("span", { class: "swatch", style: `background:${css(c.color)}` }), ` ${c.name} `]));
  return null;
}

function cut(fraction) {
  shown.cut = Math.max(0, Math.min(100, fraction * 100));
  at("compare").style.setProperty("--cut", `${shown.cut}%`);
  at("compare").setAttribute("aria-valuenow", Math.round(shown.cut));
}

function views() {
  const box = at("compare"), place = e => { const r = box.getBoundingClientRect(); cut((e.clientX - r.left) / r.width); };
  box.addEventListener("pointerdown", e => { box.setPointerCapture(e.pointerId); place(e); });
  box.addEventListener("pointermove", e => { if (e.buttons) place(e); });
  box.addEventListener("keydown", e => { const step = { ArrowLeft: -5, ArrowRight: 5 }[e.key]; if (step) { e.preventDefault(); cut((shown.cut + step) / 100); } });
  const pick = side => make("label", {}, `${side} `, make("select", { id: `choose-${side}`, onchange: e => { shown[side] = e.target.value; showView(); } }));
  const go = step => openAt((shown.view + step + data.views.length) % data.views.length);
  at("view-controls").append(
    make("label", {}, "view ", make("select", { id: "view-number", onchange: e => openAt(Number(e.target.value)) }, ...data.views.map((v, i) => make("option", { value: i }, v.image.split(/[\\/]/).pop())))),
    make("button", { onclick: () => go(-1) }, "‹ previous"), make("button", { onclick: () => go(1) }, "next ›"), pick("left"), pick("right"));
  at("strip").append(...data.views.map((v, i) => make("button", { "data-view": i, title: v.image, onclick: () => openAt(i) }, v.layers.image ? make("img", { src: v.layers.image, alt: v.image, loading: "lazy" }) : v.image)));
  cut(0.5);
  showView();
}

function openAt(index) { shown.view = index; showView(); }

// ---- graph, tables -----------------------------------------------------------------------------------------------------

/// Cameras seen along the direction in which they spread least.
function graph() {
  const views = data.views.filter(v => v.camera);
  if (views.length < 2) { at("graph").hidden = true; return; }
  const first = views[0].camera, right = unit(cross(first.down, first.axis)), ahead = unit(cross(right, first.down));
  const spread = axis => { const p = views.map(v => dot(v.camera.center, axis)); return Math.max(...p) - Math.min(...p); };
  const second = spread(ahead) >= spread(first.down) ? ahead : unit(first.down).map(v => -v);
  const flat = views.map(v => [dot(v.camera.center, right), -dot(v.camera.center, second)]);
  const low = [0, 1].map(i => Math.min(...flat.map(p => p[i]))), most = Math.max(...[0, 1].map(i => (Math.max(...flat.map(p => p[i])) - low[i]) / [840, 320][i]), 1e-9);
  const places = new Map(views.map((v, i) => [v.id, flat[i].map((p, k) => 30 + (p - low[k]) / most)]));
  const height = 60 + Math.max(...[...places.values()].map(p => p[1] - 30));
  const top = Math.max(...data.edges.map(e => e[2]), 1e-9);
  at("graph-picture").append(make("svg", { viewBox: `0 0 900 ${height}`, width: 900, role: "img" },
    ...data.edges.filter(e => places.has(e[0]) && places.has(e[1])).map(([a, b, score]) => {
      const [p, q] = [places.get(a), places.get(b)];
      return make("line", { class: "edge", x1: p[0], y1: p[1], x2: q[0], y2: q[1], "stroke-opacity": (0.08 + 0.5 * score / top).toFixed(3) }, make("title", {}, `${nameOf(a)} – ${nameOf(b)}: ${short(score)}`));
    }),
    ...views.map(v => { const p = places.get(v.id); return make("circle", { class: "node", cx: p[0], cy: p[1], r: 5, onclick: () => openView(data.views.indexOf(v)) }, make("title", {}, v.image)); })));
}

function tables() {
  if (data.classes.length) {
    const total = data.classes.reduce((s, c) => s + c.points, 0) || 1;
    at("class-table").append(table(["", "class", { number: "points" }, { number: "share" }, ""], data.classes.map(c => [make("span", { class: "swatch", style: `background:${css(c.color)}` }), c.name, { number: count(c.points) }, { number: percent(c.points / total) }, c.kept ? "" : "not kept"])));
  } else at("classes").hidden = true;
  const memory = s => s.peak_memory_bytes ? ` · ${count(s.peak_memory_bytes / 1e6)} MB` : "";
  const fill = (id, rows, picture) => rows.length ? at(id).append(picture()) : at(id).parentElement.hidden = true;
  fill("stage-bars", data.stages, () => bars(data.stages.map(s => [s.stage, s.seconds, seconds(s.seconds) + memory(s)])));
  const filled = bars => bars.filter(v => v > 0);
  fill("coverage-bars", filled(data.coverage_histogram), () => histogram(data.coverage_histogram, "0 %", "100 % of pixels"));
  fill("confidence-bars", filled(data.confidence_histogram), () => histogram(data.confidence_histogram, "0", "1"));
  fill("outputs", data.outputs, () => table(["file", "content", { number: "points" }], data.outputs.map(o => [o.path, o.content, { number: o.points == null ? "" : count(o.points) }])));
  fill("options", Object.keys(data.options), () => table(["option", "value"], Object.entries(data.options).filter(([, v]) => v !== null && v !== "").map(([k, v]) => [k, typeof v === "string" ? v : JSON.stringify(v)])));
}

// ---- cloud -------------------------------------------------------------------------------------------------------------

function bytesOf(text) {
  const raw = atob(text.trim()), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

function cloud() {
  const { cloud } = data;
  if (!cloud || !cloud.count) { at("cloud").hidden = true; return; }
  const cameras = data.views.flatMap((v, i) => v.camera ? [{ ...v.camera, view: i }] : []);
  const viewer = new CloudViewer(at("viewer"), cloud, bytesOf(at("points").textContent), cameras, data.ramps.confidence, openView);
  window.viewer = viewer;
  at("viewer-note").textContent = `${count(cloud.count)}${cloud.count < data.points ? ` of ${count(data.points)}` : ""} points · drag to turn, shift or right button to move, wheel to zoom, click a camera to open its view`;
  const modes = [["photograph", cloud.has_colors], ["class", true], ["confidence of depth", cloud.has_confidence], [`views, up to ${cloud.most_views}`, cloud.has_views], ["normal", cloud.has_normals], ["confidence of label", cloud.has_label_confidence]];
  viewer.mode = modes.findIndex(([, there]) => there);
  const set = change => { change(); viewer.draw(); };
  at("viewer-controls").append(
    make("label", {}, "colours ", make("select", { id: "mode", onchange: e => set(() => viewer.mode = Number(e.target.value)) }, ...modes.flatMap(([name, there], i) => there ? [make("option", { value: i }, name)] : []))),
    make("label", {}, "point size ", make("input", { type: "range", min: 0.3, max: 5, step: 0.1, value: 1, oninput: e => set(() => viewer.size = Number(e.target.value)) })),
    make("label", {}, make("input", { type: "checkbox", checked: true, onchange: e => set(() => viewer.frusta = e.target.checked) }), "cameras"),
    make("button", { onclick: () => viewer.home() }, "whole cloud"),
    ...cloud.classes.length > 1 ? cloud.classes.filter(c => c.points).map(c => make("label", {}, make("input", { type: "checkbox", checked: true, onchange: e => set(() => { c.shown = e.target.checked; viewer.paintClasses(); }) }), make("span", { class: "swatch", style: `background:${css(c.color)}` }), c.name)) : []);
}

head();
views();
graph();
tables();
try { cloud(); } catch (e) { at("viewer-note").textContent = `No 3D view: ${e.message}`; }
document.documentElement.dataset.ready = "true";
