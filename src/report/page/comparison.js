// Fills the page about a comparison from its data.

const LAYERS = [["a", "depth of A"], ["b", "depth of B"], ["depth", "difference of depth"], ["presence", "only in A, only in B"], ["normal", "angle of normals"], ["confidence", "difference of confidence"]];
/// What a difference is measured in, by the last word of its name.
const UNITS = { normal: "degrees", rotation: "degrees", color: "levels", position: "scene units", center: "scene units", a_to_b: "scene units", b_to_a: "scene units", label_confidence: "absolute" };
const unitOf = d => d.relative ? "relative" : UNITS[d.name.split(".").pop()] ?? "";
const value = v => v === null || v === undefined ? "∞" : Number.isInteger(v) && Math.abs(v) < 1e6 ? count(v) : Math.abs(v) >= 1e-3 && Math.abs(v) < 1e6 ? String(Number(v.toFixed(6))) : v.toExponential(2).replace(/\.?0+e/, "e");
const number = v => ({ number: value(v) });
let pictures, viewer;

function head() {
  at("title").textContent = data.title;
  at("summary").append(table([], [["A, the result in question", data.a], ["B, what it should be", data.b]]));
  at("footer").textContent = `semvs compare · ${data.version}`;
}

function contents() {
  const links = [["limits", "Limits"], ["figures", "Figures"], ["views", "Depth maps"], ["cloud", "Distances"], ["histograms", "Histograms"]].filter(([id]) => !at(id).hidden);
  at("contents").append(...links.map(([id, name]) => make("a", { href: `#${id}` }, name)));
}

// ---- limits ------------------------------------------------------------------------------------------------------------

function limits() {
  if (!data.checks) { at("limits").hidden = true; return; }
  const failed = data.checks.filter(c => !c.holds), passed = data.checks.filter(c => c.holds);
  const bound = c => [c.min !== null ? `at least ${value(c.min)}` : null, c.max !== null ? `at most ${value(c.max)}` : null].filter(Boolean).join(", ");
  const state = c => make("span", { class: c.holds ? "pass" : "fail" }, c.holds ? "✓ pass" : "✗ fail");
  const rows = checks => table(["", "figure", "depth map", { number: "value" }, "limit"], checks.map(c => [state(c), c.figure, c.part ?? "", c.missing ? { number: "not there" } : number(c.value), bound(c)]));
  at("limit-table").append(
    make("p", { class: failed.length ? "verdict fail" : "verdict pass" }, failed.length ? `✗ ${count(failed.length)} of ${count(data.checks.length)} figures are outside their limits` : `✓ all ${count(data.checks.length)} figures are within their limits`),
    ...failed.length ? [make("div", { class: "wide" }, rows(failed))] : [],
    ...passed.length ? [make("details", failed.length || passed.length > 12 ? {} : { open: "" }, make("summary", {}, `${count(passed.length)} within their limits`), make("div", { class: "wide" }, rows(passed)))] : []);
}

// ---- figures -----------------------------------------------------------------------------------------------------------

const firstLine = first => first ? `First difference: ${first.place}, ${first.attribute}: ${first.a} in A, ${first.b} in B` : "No element differs.";

const single = figures => table(["figure", { number: "value" }], figures.single.map(([name, v]) => [name, number(v)]));
const differences = figures => figures.differences.length ? table(["differences", "unit", ...["compared", "equal", "p50", "p90", "p99", "p999", "max"].map(n => ({ number: n }))],
  figures.differences.map(d => [d.name, unitOf(d), number(d.compared), number(d.equal / d.compared), ...[d.p50, d.p90, d.p99, d.p999, d.max].map(number)])) : null;

/// A row for every pair of depth maps: a click opens it.
function pairs() {
  const of = (part, name) => part.figures.differences.find(d => d.name === name);
  const one = (part, name) => part.figures.single.find(([n]) => n === name)?.[1];
  const cell = (d, key) => d ? number(d[key]) : { number: "–" };
  const body = table(["depth map", ...["valid.a", "valid.b", "valid.iou", "depth equal", "depth p50", "depth p99", "depth max", "confidence p99", "normal p99"].map(n => ({ number: n }))],
    data.parts.map((part, i) => {
      const depth = of(part, "depth");
      return [make("button", { class: "link", onclick: () => { pictures.open(i); at("views").scrollIntoView({ behavior: "smooth" }); } }, part.name), number(one(part, "valid.a")), number(one(part, "valid.b")), number(one(part, "valid.iou")),
        depth ? number(depth.equal / depth.compared) : { number: "–" }, cell(depth, "p50"), cell(depth, "p99"), cell(depth, "max"), cell(of(part, "confidence"), "p99"), cell(of(part, "normal"), "p99")];
    }));
  return make("div", { class: data.parts.length > 25 ? "tall" : null }, body);
}

function figures() {
  const parts = data.parts.filter(p => p.first), first = data.parts.length ? parts[0]?.first : data.first;
  at("first").textContent = firstLine(first) + (parts.length ? `, in ${parts[0].name}` : "");
  at("notes").append(...data.notes.map(n => make("li", {}, n)));
  at("figure-table").append(...[single(data.figures), differences(data.figures), data.parts.length ? pairs() : null].filter(Boolean));
}

// ---- pictures ----------------------------------------------------------------------------------------------------------

function legend(key) {
  const { ramps, scales } = data, nothing = make("span", {}, swatch([150, 154, 160]), " not in both");
  const signed = (name, most, ends) => make("div", {}, scaleBar(name, ramps.difference, most ? [`−${short(most)}`, `−${short(most / 2)}`, "0", short(most / 2), short(most)] : ["", "0: nothing differs", ""]), make("span", {}, swatch(ramps.difference[1]), ` ${ends[0]} `, swatch(ramps.difference[7]), ` ${ends[1]} `, nothing));
  if (key === "a" || key === "b") return scaleBar(`depth of ${key.toUpperCase()}, scene units`, ramps.depth, ticksOf(...scales.depth));
  if (key === "depth") return signed("(A − B) / max(A, B) of depth", scales.difference, ["A is nearer", "A is farther"]);
  if (key === "confidence") return signed("confidence of A − of B", scales.confidence, ["A is less sure", "A is surer"]);
  if (key === "normal") return make("div", {}, scaleBar("angle between normals, degrees", ramps.amount, scales.normal ? ticksOf(0, scales.normal) : ["0: nothing differs", ""]), nothing);
  return make("span", {}, swatch(ramps.only[0]), " depth only in A ", swatch(ramps.only[1]), " only in B ", swatch(ramps.amount[0]), " in both ", swatch([150, 154, 160]), " in neither");
}

function facts(part) {
  const rows = [["size", `${part.size[0]} × ${part.size[1]}`], ...part.figures.single.filter(([name]) => name.startsWith("valid.")).map(([name, v]) => [name, value(v)])];
  for (const d of part.figures.differences) rows.push([`${d.name}, ${unitOf(d)}`, `median ${value(d.p50)}, p99 ${value(d.p99)}, most ${value(d.max)}`]);
  for (const note of part.notes) rows.push(["note", note]);
  rows.push(["first difference", part.first ? `${part.first.place}, ${part.first.attribute}: ${part.first.a} in A, ${part.first.b} in B` : "none"]);
  return rows;
}

function views() {
  if (!data.parts.length) { at("views").hidden = true; return; }
  const most = p => { const d = p.figures.differences.find(d => d.name === "depth"); return [-(p.figures.single.find(([n]) => n === "valid.iou")?.[1] ?? 1), d ? d.p99 ?? Infinity : 0]; };
  pictures = new Pictures(at("views"), { items: data.parts, what: "depth map", layers: LAYERS, left: "a", right: "depth", thumbnail: "depth", legend, facts, opened: histograms });
  // The pair that differs most is the one to look at first.
  const worst = data.parts.map((p, i) => [most(p), i]).sort(([p], [q]) => q[1] - p[1] || q[0] - p[0])[0][1];
  pictures.open(worst);
  at("views").append(make("p", { class: "hint" }, "Colours mean the same in all depth maps. Where a picture is smaller than its depth map, a dot shows the largest difference of the pixels that it stands for, so that none is lost."));
}

// ---- histograms --------------------------------------------------------------------------------------------------------

/// A power of ten as it is written.
const power = half => half % 2 ? short(10 ** (half / 2)) : half >= -3 && half <= 8 ? short(10 ** (half / 2)) : `1e${half / 2}`;

function sizesOf(name, all) {
  const { top, bars } = all.sizes, from = Math.max(0, bars.findIndex(v => v > 0)), shown = bars.slice(from), edge = i => top - (bars.length - 1 - i);
  const zero = `${count(all.equal)} of ${count(all.compared)} equal`, open = all.sizes.unbounded ? `, ${count(all.sizes.unbounded)} without bound` : "";
  const figure = make("div", {}, make("h3", {}, name), make("p", { class: "hint" }, zero + open));
  if (all.equal + all.sizes.unbounded < all.compared) {
    const first = edge(from) - 1, ticks = [[0, power(first)], [1, power(top)]];
    for (let k = first + 1; k < top; k++) if (k % 2 === 0 && (top - first < 10 || k % 4 === 0) && (k - first) / (top - first) > 0.17 && (top - k) / (top - first) > 0.17) ticks.push([(k - first) / (top - first), power(k)]);
    figure.append(histogram(shown, ticks, shown.map((_, i) => `${power(edge(from + i) - 1)} to ${power(edge(from + i))}`)));
  }
  return figure;
}

/// Sizes of several parts as those of one.
function together(all) {
  const top = Math.max(...all.map(d => d.sizes.top)), bars = new Array(24).fill(0), sum = key => all.reduce((s, d) => s + d[key], 0);
  for (const { sizes } of all) sizes.bars.forEach((v, i) => { bars[Math.max(0, i + sizes.top - top)] += v; });
  return { compared: sum("compared"), equal: sum("equal"), sizes: { top, bars, unbounded: all.reduce((s, d) => s + d.sizes.unbounded, 0) } };
}

function histograms() {
  const title = d => `${d.name}, ${unitOf(d)}`.replace(/, $/, "");
  const nodes = [], equal = [];
  const add = (name, d) => d.equal === d.compared ? equal.push(name) : nodes.push(sizesOf(name, d));
  for (const d of data.figures.differences) add(title(d), d);
  const names = [...new Set(data.parts.flatMap(p => p.figures.differences.map(d => d.name)))], now = pictures && data.parts[pictures.index];
  for (const name of names) {
    const every = data.parts.flatMap(p => p.figures.differences.filter(d => d.name === name));
    const differing = every.filter(d => d.sizes.bars.some(v => v));
    if (data.parts.length > 1) add(`${title(every[0])}: all depth maps`, { ...together(differing.length ? differing : every), compared: every.reduce((s, d) => s + d.compared, 0), equal: every.reduce((s, d) => s + d.equal, 0) });
    const own = (now ?? data.parts[0]).figures.differences.find(d => d.name === name);
    if (own) add(`${title(own)}: ${(now ?? data.parts[0]).name}`, own);
  }
  at("histogram-list").replaceChildren(...nodes);
  at("histograms-equal").textContent = equal.length ? `Without any difference: ${equal.join("; ")}.` : "";
  at("histograms").hidden = !nodes.length && !equal.length;
}

// ---- cloud -------------------------------------------------------------------------------------------------------------

function cloud() {
  const { cloud } = data, { distance } = data.scales, ramp = data.ramps.amount;
  if (!cloud || !cloud.count) { at("cloud").hidden = true; return; }
  const scale = distance[1] ? scaleBar("distance to the nearest point of the other cloud, scene units", ramp, [`≤ ${short(distance[0])}`, short(distance[0] * 10), short(distance[0] * 100), `≥ ${short(distance[1])}`]) : make("span", {}, "No point is away from the other cloud.");
  const modes = [["photograph", cloud.has_colors], ["A or B", true], ["distance to the other cloud", true, scale], ["views", false], ["normal", cloud.has_normals], ["", false]];
  const [a, b] = cloud.classes.map(c => count(c.points));
  viewer = showCloud(at("cloud"), { cloud, ramp, modes, mode: 2, cameras: [], opened: () => {}, note: `${a} points of A, ${b} of B` });
}

inTurn(head, limits, figures, views, cloud, histograms, contents);
