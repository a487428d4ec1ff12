// What pages are made of: numbers, tables, bars, scales, pictures with a slider, the 3D view.

const data = JSON.parse(document.getElementById("data").textContent);
const at = id => document.getElementById(id);

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
const percent = v => `${(100 * v).toFixed(v > 0 && v < 0.1 ? 1 : 0)} %`;
const seconds = v => v < 1 ? `${v.toFixed(2)} s` : v < 10 ? `${v.toFixed(1)} s` : v < 120 ? `${v.toFixed(0)} s` : `${(v / 60).toFixed(1)} min`;
const short = v => v === 0 ? "0" : Math.abs(v) >= 1e6 || Math.abs(v) < 1e-3 ? v.toExponential(1) : Math.abs(v) >= 1000 ? count(v) : String(Number(v.toPrecision(3)));
const css = c => `rgb(${c.join(",")})`;
const swatch = color => make("span", { class: "swatch", style: `background:${css(color)}` });
const lastPart = path => path.split(/[\\/]/).pop();

function table(head, rows) {
  const cell = (tag, value) => make(tag, { class: typeof value === "object" && value?.number !== undefined ? "number" : null }, value?.number ?? value ?? "");
  return make("table", {}, head.length ? make("thead", {}, make("tr", {}, ...head.map(h => cell("th", h)))) : null, make("tbody", {}, ...rows.map(r => make("tr", {}, ...r.map(v => cell("td", v))))));
}

/// Horizontal bars: [label, value, text].
function bars(rows) {
  const most = Math.max(...rows.map(r => r[1]), 1e-9), h = 18;
  return make("svg", { viewBox: `0 0 380 ${rows.length * h}`, width: 380, role: "img" }, ...rows.flatMap(([label, value, text], i) => [
    make("text", { x: 118, y: i * h + 13, "text-anchor": "end" }, label),
    make("rect", { class: "bar", x: 124, y: i * h + 3, width: 140 * value / most, height: h - 6 }),
    make("text", { x: 130 + 140 * value / most, y: i * h + 13 }, text)]));
}

/// Upright bars; `ticks`: texts under them, [share of the width, text]; `titles`: what each bar stands for.
function histogram(values, ticks, titles = []) {
  const most = Math.max(...values, 1), w = 300 / values.length;
  return make("svg", { viewBox: "0 0 300 132", width: 300, role: "img" },
    make("text", { x: 0, y: 10 }, `most: ${count(most)}`),
    make("line", { class: "axis", x1: 0, y1: 112, x2: 300, y2: 112 }),
    ...values.map((v, i) => make("rect", { class: "bar", x: i * w + 0.5, y: 112 - 96 * v / most, width: Math.max(w - 1, 0.5), height: 96 * v / most }, make("title", {}, titles[i] ? `${titles[i]}: ${count(v)}` : count(v)))),
    ...ticks.map(([share, text]) => make("text", { x: 300 * share, y: 126, "text-anchor": share < 0.02 ? "start" : share > 0.98 ? "end" : "middle" }, text)));
}

/// A ramp of colours over the values at its ends and between.
function scaleBar(name, stops, labels) {
  return make("div", { class: "scale" }, make("span", {}, name),
    make("div", {}, make("div", { class: "ramp", style: `background:linear-gradient(90deg,${stops.map(css).join(",")})` }),
      make("div", { class: "ticks" }, ...labels.map(l => make("span", {}, l)))));
}

/// Five values from `low` to `high`.
const ticksOf = (low, high) => [0, 1, 2, 3, 4].map(i => short(low + (high - low) * i / 4));

/// Two pictures of a thing, one over the other, with a border to move; controls to choose thing and pictures; thumbnails.
class Pictures {
  /// `items`: [{ name, layers: { key: address } }]; `layers`: [[key, name]] of all; `left`, `right`: keys at first; `thumbnail`: a key;
  /// `what`: a word for an item; `legend(key, item)`: nodes; `facts(item)`: rows of a table; `opened(index)`: called after a change.
  constructor(place, options) {
    Object.assign(this, { what: "view", facts: () => [], legend: () => null, opened: () => {} }, options, { index: 0, border: 50 });
    const picture = side => make("img", { id: `picture-${side}`, alt: "", draggable: "false" });
    const choice = side => make("label", {}, `${side} `, make("select", { id: `choose-${side}`, onchange: e => { this[side] = e.target.value; this.show(); } }));
    const go = step => this.open((this.index + step + this.items.length) % this.items.length);
    this.box = make("div", { class: "compare", id: "compare", tabindex: 0, role: "slider", "aria-label": "Border between the two pictures", "aria-valuemin": 0, "aria-valuemax": 100 }, picture("left"), picture("right"), make("div", { class: "handle" }));
    place.append(
      make("div", { class: "controls", id: "view-controls" },
        make("label", {}, `${this.what} `, make("select", { id: "view-number", onchange: e => this.open(Number(e.target.value)) }, ...this.items.map((v, i) => make("option", { value: i }, lastPart(v.name))))),
        make("span", {}, make("button", { onclick: () => go(-1) }, "‹ previous"), " ", make("button", { onclick: () => go(1) }, "next ›")),
        choice("left"), choice("right")),
      make("div", { class: "beside" }, make("div", {}, this.box, make("div", { class: "legend", id: "picture-legend" })), make("div", { id: "view-facts" })),
      make("div", { class: "strip", id: "strip" }, ...this.items.map((v, i) => make("button", { "data-view": i, title: v.name, onclick: () => this.open(i) },
        v.layers[this.thumbnail] ? make("img", { src: v.layers[this.thumbnail], alt: lastPart(v.name), loading: "lazy", decoding: "async" }) : lastPart(v.name)))));
    this.listen();
    this.cut(50);
    this.show();
  }

  listen() {
    const box = this.box, place = e => { const r = box.getBoundingClientRect(); this.cut(100 * (e.clientX - r.left) / r.width); };
    box.addEventListener("pointerdown", e => { box.setPointerCapture(e.pointerId); place(e); });
    box.addEventListener("pointermove", e => { if (e.buttons) place(e); });
    box.addEventListener("keydown", e => {
      const to = { ArrowLeft: this.border - 5, ArrowRight: this.border + 5, PageDown: this.border - 20, PageUp: this.border + 20, Home: 0, End: 100 }[e.key];
      if (to !== undefined) { e.preventDefault(); this.cut(to); }
    });
  }

  cut(percent) {
    this.border = Math.max(0, Math.min(100, percent));
    this.box.style.setProperty("--cut", `${this.border}%`);
    this.box.setAttribute("aria-valuenow", Math.round(this.border));
  }

  open(index) { this.index = index; this.show(); }

  show() {
    const item = this.items[this.index];
    if (!item) return;
    const there = this.layers.filter(([key]) => item.layers[key]);
    // What was chosen stays chosen for the items that have it.
    const shown = { left: item.layers[this.left] ? this.left : there[0]?.[0], right: item.layers[this.right] ? this.right : there[Math.min(1, there.length - 1)]?.[0] };
    for (const [side, key] of Object.entries(shown)) {
      const picture = at(`picture-${side}`);
      picture.hidden = !key;
      if (key) picture.src = item.layers[key];
      // Maps of classes and differences have sharp borders.
      picture.classList.toggle("sharp", Boolean(key) && item.layers[key].startsWith("data:image/png"));
      picture.alt = `${key ?? "nothing"} of ${lastPart(item.name)}`;
      at(`choose-${side}`).replaceChildren(...there.map(([k, name]) => make("option", { value: k, selected: k === key }, name)));
    }
    this.box.hidden = !there.length;
    at("view-number").value = this.index;
    at("picture-legend").replaceChildren(...[...new Set(Object.values(shown))].filter(Boolean).map(key => this.legend(key, item)).filter(Boolean));
    at("view-facts").replaceChildren(table([], this.facts(item)));
    for (const button of at("strip").children) {
      const isShown = Number(button.dataset.view) === this.index;
      button.setAttribute("aria-current", isShown);
      if (isShown) at("strip").scrollLeft = button.offsetLeft - at("strip").clientWidth / 2;
    }
    this.opened(this.index);
  }
}

/// Takes one step after the other; the browser may draw between them, so that the first is seen before the last is done.
function inTurn(...steps) {
  const next = () => {
    const step = steps.shift();
    if (!step) { document.documentElement.dataset.ready = "true"; return; }
    step();
    // A picture is drawn, or none is wanted: tabs in the background get no frames.
    let isOver = false;
    const go = () => { if (!isOver) { isOver = true; next(); } };
    requestAnimationFrame(() => setTimeout(go));
    setTimeout(go, 100);
  };
  next();
}

function bytesOf(text) {
  const raw = atob(text.trim()), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

/// The 3D view with its controls. `modes`: [name, whether there, legend or null] in the viewer's order, `mode` the one at first;
/// `ramp`: colours of values; `note`: what is shown; `opened`: called with the view of a camera that is clicked.
function showCloud(section, { cloud, cameras, ramp, modes, mode, note, opened }) {
  const canvas = make("canvas", { id: "viewer", tabindex: 0, role: "img", "aria-label": "Point cloud in 3D; arrow keys turn it" }), said = make("p", { id: "viewer-note" }, note);
  section.append(make("div", { class: "stage" }, canvas, said));
  let viewer;
  try { viewer = new CloudViewer(canvas, cloud, bytesOf(at("points").textContent), cameras, ramp, opened); }
  catch (e) { said.textContent = `No 3D view: ${e.message}`; return null; }
  canvas.addEventListener("webglcontextlost", () => { said.textContent = "The browser has given the 3D view up; load the page anew."; });
  const set = change => { change(); viewer.draw(); }, legend = make("div", { class: "legend", id: "viewer-legend" });
  const colour = i => set(() => { viewer.mode = i; legend.replaceChildren(...[modes[i][2]].filter(Boolean)); });
  const classes = cloud.classes.length > 1 ? cloud.classes.filter(c => c.points) : [];
  section.append(
    make("div", { class: "controls", id: "viewer-controls" },
      make("label", {}, "colours ", make("select", { id: "mode", onchange: e => colour(Number(e.target.value)) }, ...modes.flatMap(([name, there], i) => there ? [make("option", { value: i, selected: i === mode }, name)] : []))),
      make("label", {}, "point size ", make("input", { type: "range", min: 0.3, max: 5, step: 0.1, value: 1, oninput: e => set(() => viewer.size = Number(e.target.value)) })),
      cameras.length ? make("label", {}, make("input", { type: "checkbox", checked: true, onchange: e => set(() => viewer.frusta = e.target.checked) }), "cameras") : null,
      make("button", { onclick: () => viewer.home() }, "whole cloud")),
    make("div", { class: "controls", id: "viewer-classes" }, ...classes.map(c => make("label", {}, make("input", { type: "checkbox", checked: c.shown, onchange: e => set(() => { c.shown = e.target.checked; viewer.paintClasses(); }) }), swatch(c.color), c.name))),
    legend,
    make("p", { class: "hint" }, `Drag to turn, drag with shift, the right button or two fingers to move, turn the wheel or pinch to zoom${cameras.length ? ", click a camera to open its view" : ""}. Keys: arrows turn, with shift they move, + and − zoom, h shows the whole cloud.`));
  colour(mode);
  return viewer;
}
