// Fills the page about a run from its data.

const LAYERS = [["image", "photograph"], ["depth", "depth"], ["normal", "normals"], ["confidence", "confidence"], ["labels", "label map"], ["removed", "class check"]];
const names = new Map(data.views.map(v => [v.id, lastPart(v.image)]));
const nameOf = id => names.get(id) ?? String(id);
const scores = new Map(data.edges.map(([a, b, score]) => [`${a} ${b}`, score]));
const scoreOf = (a, b) => scores.get(a < b ? `${a} ${b}` : `${b} ${a}`);
let pictures, viewer;

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

function legend(key, view) {
  const { ramps } = data;
  if (key === "depth") return scaleBar("depth, scene units", ramps.depth, ticksOf(...view.depth_scale));
  if (key === "confidence") return scaleBar("confidence", ramps.confidence, ticksOf(0, 1));
  if (key === "normal") return make("span", {}, "normals: ", swatch([255, 128, 128]), " to the right ", swatch([128, 255, 128]), " up ", swatch([128, 128, 255]), " towards the camera");
  if (key === "removed") return make("span", {}, swatch([230, 40, 30]), " depths of classes that are not wanted, or whose class most other views contradict");
  if (key === "labels") return make("span", {}, "label map: ", ...data.classes.flatMap(c => [swatch(c.color), ` ${c.name} `]));
  return null;
}

function facts(view) {
  const matched = view.sources.map(id => { const score = scoreOf(view.id, id); return score === undefined ? nameOf(id) : `${nameOf(id)} (${short(score)})`; });
  const rows = [["image", nameOf(view.id)], ["depth map", view.width ? `${view.width} × ${view.height}` : "none"]];
  if (view.width) rows.push(["depths", percent(view.coverage)], ["confidence, mean", view.mean_confidence == null ? "–" : view.mean_confidence.toFixed(2)]);
  rows.push(["matched with (score)", matched.join(", ") || "–"]);
  if (view.removed != null) rows.push(["class check", `${percent(view.removed)} of the depths have their class against them`]);
  if (view.dropped) rows.push(["left out", view.dropped]);
  return rows;
}

function openView(index) {
  openAt(index);
  at("views").scrollIntoView({ behavior: "smooth" });
}

function openAt(index) { pictures.open(index); }

function views() {
  pictures = new Pictures(at("views"), { items: data.views.map(v => Object.assign(v, { name: v.image })), layers: LAYERS, left: "image", right: "depth", thumbnail: "image", legend, facts, opened: mark });
}

// ---- graph, tables -----------------------------------------------------------------------------------------------------

/// Marks a view and its pairs in the graph.
function mark(index) {
  const id = data.views[index]?.id;
  for (const node of at("graph-picture").querySelectorAll(".node")) node.classList.toggle("now", Number(node.dataset.id) === id);
  for (const line of at("graph-picture").querySelectorAll(".edge")) line.classList.toggle("now", line.dataset.ids.split(" ").includes(String(id)));
}

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
  const values = data.edges.map(e => e[2]), top = Math.max(...values, 1e-9);
  const open = v => openView(data.views.indexOf(v));
  const named = views.length <= 40;
  at("graph-picture").append(make("svg", { viewBox: `0 0 900 ${height}`, width: 900 },
    ...data.edges.filter(e => places.has(e[0]) && places.has(e[1])).map(([a, b, score]) => {
      const [p, q] = [places.get(a), places.get(b)];
      return make("line", { class: "edge", "data-ids": `${a} ${b}`, x1: p[0], y1: p[1], x2: q[0], y2: q[1], "stroke-width": (0.5 + 3 * score / top).toFixed(2), "stroke-opacity": (0.15 + 0.5 * score / top).toFixed(3) }, make("title", {}, `${nameOf(a)} – ${nameOf(b)}: ${short(score)}`));
    }),
    ...views.flatMap(v => {
      const p = places.get(v.id);
      return [make("circle", { class: "node", "data-id": v.id, tabindex: 0, role: "button", "aria-label": `open ${nameOf(v.id)}`, cx: p[0], cy: p[1], r: named ? 6 : 4, onclick: () => open(v), onkeydown: e => { if (e.key === "Enter" || e.key === " ") { e.preventDefault(); open(v); } } }, make("title", {}, v.image)),
        named ? make("text", { class: "name", x: p[0], y: p[1] - 10, "text-anchor": p[0] < 60 ? "start" : p[0] > 840 ? "end" : "middle" }, nameOf(v.id)) : null].filter(Boolean);
    })));
  at("graph-note").textContent = values.length ? `Cameras from where they spread most. The thicker a line, the better two views match: scores from ${short(Math.min(...values))} to ${short(top)}, each shown when the pointer rests on its line. Orange: the view that is open above, and its pairs.` : "The scene names no neighbours, and its points give none.";
}

function tables() {
  if (data.classes.length) {
    const isCounted = data.classes.some(c => c.pixels), n = v => ({ number: count(v) });
    const more = c => isCounted ? [n(c.pixels), n(c.depths), { number: c.mean_confidence == null ? "–" : c.mean_confidence.toFixed(3) }, n(c.rejected), n(c.excluded)] : [];
    at("class-table").append(table(["", "class", { number: "points" }, { number: "share" }, ...isCounted ? ["pixels", "depths", "confidence", "rejected", "excluded"].map(h => ({ number: h })) : [], ""],
      data.classes.map(c => [swatch(c.color), c.name, n(c.points), { number: percent(c.share) }, ...more(c), c.kept ? "" : "not kept"])));
    if (isCounted) at("class-table").append(make("p", { class: "hint" }, "Pixels are those of the views that started points. Rejected: pixels whose point failed the check of labels across views. Excluded: pixels that started no point because their class, or the class voted for, is not kept."));
  } else at("classes").hidden = true;
  const memory = s => s.peak_memory_bytes ? ` · ${count(s.peak_memory_bytes / 1e6)} MB` : "";
  const fill = (id, rows, picture) => rows.length ? at(id).append(picture()) : at(id).parentElement.hidden = true;
  const filled = bars => bars.filter(v => v > 0);
  const titles = unit => data.coverage_histogram.map((_, i) => `${unit(i / 20)} to ${unit((i + 1) / 20)}`);
  fill("stage-bars", data.stages, () => bars(data.stages.map(s => [s.stage, s.seconds, seconds(s.seconds) + memory(s)])));
  fill("coverage-bars", filled(data.coverage_histogram), () => histogram(data.coverage_histogram, [[0, "0"], [0.5, "50 %"], [1, "100 % of the pixels"]], titles(percent)));
  fill("confidence-bars", filled(data.confidence_histogram), () => histogram(data.confidence_histogram, [[0, "0"], [0.5, "0.5"], [1, "1"]], titles(short)));
  fill("program", [data.version], () => table([], [["program", data.program || "semvs report"], ["version", data.version], ["kernels", data.cpu_level ?? "–"], ["scene", data.scene]].filter(r => r[1])));
  fill("outputs", data.outputs, () => table(["file", "content", { number: "points" }], data.outputs.map(o => [o.path, o.content, { number: o.points == null ? "" : count(o.points) }])));
  fill("options", Object.keys(data.options), () => table(["option", "value"], Object.entries(data.options).filter(([, v]) => v !== null && v !== "").map(([k, v]) => [k, typeof v === "string" ? v : JSON.stringify(v)])));
}

// ---- cloud -------------------------------------------------------------------------------------------------------------

function cloud() {
  const { cloud } = data, ramp = data.ramps.confidence;
  if (!cloud || !cloud.count) { at("cloud").hidden = true; return; }
  const share = name => scaleBar(name, ramp, ticksOf(0, 1));
  const modes = [["photograph", cloud.has_colors], ["class", true], ["confidence of depth", cloud.has_confidence, share("confidence")],
    ["views", cloud.has_views, scaleBar("views that see the point", ramp, ["0", short(cloud.most_views / 2), `${cloud.most_views} and more`])],
    ["normal", cloud.has_normals, make("span", {}, "normals along the axes of the scene: ", swatch([255, 128, 128]), " x ", swatch([128, 255, 128]), " y ", swatch([128, 128, 255]), " z")],
    ["confidence of label", cloud.has_label_confidence, share("confidence")]];
  viewer = showCloud(at("cloud"), { cloud, ramp, modes, mode: modes.findIndex(([, there]) => there), opened: openView,
    cameras: data.views.flatMap((v, i) => v.camera ? [{ ...v.camera, view: i }] : []),
    note: `${count(cloud.count)}${cloud.count < data.points ? ` of ${count(data.points)}` : ""} points` });
}

inTurn(head, views, graph, tables, cloud, () => mark(pictures.index));
