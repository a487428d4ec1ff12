"use strict";
// A point cloud in WebGL 2: orbit, pan, zoom, colours, classes, camera frusta.

const VERTEX = `#version 300 es
layout(location=0) in vec3 place; layout(location=1) in vec2 label; layout(location=2) in vec4 rgb; layout(location=3) in vec4 normal;
uniform mat4 view; uniform vec3 extent; uniform float size, scale, views; uniform int mode; uniform sampler2D paints;
out vec3 color;
vec3 ramp(float t) { return texelFetch(paints, ivec2(int(clamp(t, 0., 1.) * 255. + .5), 1), 0).rgb; }
void main() {
  vec4 paint = texelFetch(paints, ivec2(int(label.x + .5), 0), 0);
  gl_Position = paint.a < .5 ? vec4(2., 2., 2., 1.) : view * vec4(place * extent, 1.);
  gl_PointSize = clamp(size * scale / max(gl_Position.w, 1e-6), 1., 24.);
  color = mode == 0 ? rgb.rgb : mode == 1 ? paint.rgb : mode == 2 ? ramp(rgb.a) : mode == 3 ? ramp(normal.w * 127. / views) : mode == 4 ? normal.xyz * .5 + .5 : ramp(label.y / 255.);
}`;
const FRAGMENT = `#version 300 es
precision mediump float; in vec3 color; out vec4 result;
void main() { vec2 p = gl_PointCoord - .5; if (dot(p, p) > .25) discard; result = vec4(color, 1.); }`;
const LINE_VERTEX = `#version 300 es
layout(location=0) in vec3 place; uniform mat4 view; void main() { gl_Position = view * vec4(place, 1.); }`;
const LINE_FRAGMENT = `#version 300 es
precision mediump float; uniform vec4 paint; out vec4 result; void main() { result = paint; }`;

class CloudViewer {
  /// `cloud`: { count, extent: [x, y, z], center, span, spacing, most_views, classes: [{ color, shown }] }; `ramp`: colours of 0..1;
  /// `bytes`, 16 of each point: x, y, z (u16, shares of the extent), class, label confidence, red, green, blue, confidence (u8),
  /// normal (i8 ×3), views (i8). `cameras`: { center, axis, down, corners, view }, all relative to the corner of the extent.
  constructor(canvas, cloud, bytes, cameras, ramp, opened) {
    Object.assign(this, { canvas, cloud, cameras, ramp, opened, mode: 0, size: 1, frusta: true, budget: Math.min(cloud.count, 60000) });
    const gl = this.gl = canvas.getContext("webgl2", { antialias: false });
    if (!gl) throw new Error("this browser has no WebGL 2");
    this.points = this.program(VERTEX, FRAGMENT);
    this.lines = this.program(LINE_VERTEX, LINE_FRAGMENT);
    this.pointArray = this.upload(bytes);
    this.lineArray = this.frustumLines();
    this.paints = gl.createTexture();
    this.paintClasses();
    this.home();
    this.listen();
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  program(vertex, fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    const place = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const name = gl.getActiveUniform(program, i).name;
      place[name] = gl.getUniformLocation(program, name);
    }
    return { program, place };
  }

  upload(bytes) {
    const gl = this.gl, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, bytes, gl.STATIC_DRAW);
    for (const [i, width, kind, isShare, at] of [[0, 3, gl.UNSIGNED_SHORT, true, 0], [1, 2, gl.UNSIGNED_BYTE, false, 6], [2, 4, gl.UNSIGNED_BYTE, true, 8], [3, 4, gl.BYTE, true, 12]]) {
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, width, kind, isShare, 16, at);
    }
    return array;
  }

  /// A part of the cloud's size, but not so much that neighbouring cameras hide each other.
  frustumLength() {
    const centers = this.cameras.map(c => c.center), step = Math.ceil(centers.length / 200) || 1;
    const nearest = centers.filter((_, i) => i % step === 0).map(p => Math.min(...centers.filter(q => q !== p).map(q => Math.hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]))));
    const usual = nearest.sort((a, b) => a - b)[nearest.length >> 1] ?? Infinity;
    return Math.max(Math.min(0.04 * this.cloud.span, 0.6 * usual), 0.001 * this.cloud.span);
  }

  frustumLines() {
    const gl = this.gl, out = [], span = this.frustumLength();
    for (const { center, corners } of this.cameras) {
      const tips = corners.map(c => c.map((v, i) => center[i] + v * span));
      tips.forEach((tip, i) => out.push(...center, ...tip, ...tip, ...tips[(i + 1) % 4]));
    }
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(out), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    this.lineCount = out.length / 3;
    return array;
  }

  paintClasses() {
    const gl = this.gl, data = new Uint8Array(2 * 256 * 4).fill(255), last = this.ramp.length - 1;
    this.cloud.classes.forEach(({ color, shown }, i) => data.set([...color, shown ? 255 : 0], 4 * i));
    for (let i = 0; i < 256; i++) {
      const place = i / 255 * last, below = Math.min(Math.floor(place), last - 1), share = place - below;
      data.set([0, 1, 2].map(k => this.ramp[below][k] * (1 - share) + this.ramp[below + 1][k] * share), 4 * (256 + i));
    }
    gl.bindTexture(gl.TEXTURE_2D, this.paints);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 256, 2, 0, gl.RGBA, gl.UNSIGNED_BYTE, data);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  }

  span() { return Math.hypot(...this.cloud.extent); }

  /// The whole cloud as the first camera sees it.
  home() {
    const first = this.cameras[0];
    this.target = [...this.cloud.center];
    this.distance = this.cloud.span * 0.95 / Math.min(1, this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight) / 1.2);
    this.up = first ? first.down.map(v => -v) : [0, 0, 1];
    const out = first ? first.axis.map(v => -v) : [0, -1, 0];
    this.orient(out);
    this.draw();
  }

  /// Yaw and pitch of a direction about the up axis.
  orient(out) {
    const up = unit(this.up), side = unit(Math.abs(up[0]) < 0.9 ? cross(up, [1, 0, 0]) : cross(up, [0, 1, 0]));
    this.basis = [side, cross(up, side), up];
    const [x, y, z] = this.basis.map(b => dot(b, out));
    this.yaw = Math.atan2(y, x);
    this.pitch = Math.asin(Math.max(-1, Math.min(1, z / Math.hypot(x, y, z))));
  }

  matrix() {
    const c = Math.cos(this.pitch), local = [c * Math.cos(this.yaw), c * Math.sin(this.yaw), Math.sin(this.pitch)];
    const back = [0, 1, 2].map(i => this.basis.reduce((sum, b, k) => sum + b[i] * local[k], 0));
    const right = unit(cross(this.basis[2], back)), up = cross(back, right);
    this.axes = { right, up };
    const eye = this.target.map((t, i) => t + back[i] * this.distance);
    const near = this.distance / 200, far = this.distance * 4 + this.span() * 4;
    const f = 1 / Math.tan(0.4), aspect = this.canvas.width / this.canvas.height, d = near - far;
    const rows = [[right, f / aspect], [up, f]].map(([axis, s]) => [...axis.map(v => v * s), -dot(axis, eye) * s]);
    const depth = -dot(back, eye);
    rows.push([...back.map(v => v * (far + near) / d), depth * (far + near) / d + 2 * far * near / d]);
    rows.push([...back.map(v => -v), -depth]);
    return new Float32Array([0, 1, 2, 3].flatMap(c => rows.map(r => r[c])));
  }

  /// Draws soon: all points or, while the view moves, as many of them as a fortieth of a second allows. They are stored in an
  /// order in which any first part is spread over the whole cloud.
  draw(moving = false) {
    this.moving = moving;
    clearTimeout(this.rest);
    if (moving) this.rest = setTimeout(() => this.draw(), 250);
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => { this.pending = false; if (this.moving) this.hurry(); else this.render(); });
  }

  hurry() {
    const start = performance.now();
    this.render(this.budget);
    this.wait();
    const change = 25 / Math.max(performance.now() - start, 1);
    this.budget = Math.max(2000, Math.min(this.cloud.count, this.budget * Math.max(0.4, Math.min(2, change))));
  }

  /// Until what was drawn is there.
  wait() { this.gl.readPixels(0, 0, 1, 1, this.gl.RGBA, this.gl.UNSIGNED_BYTE, new Uint8Array(4)); }

  render(count = this.cloud.count) {
    const gl = this.gl, canvas = this.canvas, ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [w, h] = [canvas.clientWidth * ratio | 0, canvas.clientHeight * ratio | 0];
    if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
    gl.viewport(0, 0, w, h);
    gl.clearColor(0.063, 0.07, 0.078, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    const view = this.view = this.matrix();
    const { place } = this.points;
    gl.useProgram(this.points.program);
    gl.uniformMatrix4fv(place.view, false, view);
    gl.uniform3fv(place.extent, this.cloud.extent);
    gl.uniform1f(place.size, this.size * Math.min(3, Math.sqrt(this.cloud.count / Math.max(count, 1))));
    gl.uniform1f(place.scale, this.cloud.spacing * h / 0.8);
    gl.uniform1f(place.views, Math.max(1, this.cloud.most_views));
    gl.uniform1i(place.mode, this.mode);
    gl.bindTexture(gl.TEXTURE_2D, this.paints);
    gl.bindVertexArray(this.pointArray);
    gl.drawArrays(gl.POINTS, 0, count | 0);
    if (this.frusta && this.lineCount) {
      gl.useProgram(this.lines.program);
      gl.uniformMatrix4fv(this.lines.place.view, false, view);
      gl.uniform4f(this.lines.place.paint, 1, 0.75, 0.2, 1);
      gl.bindVertexArray(this.lineArray);
      gl.drawArrays(gl.LINES, 0, this.lineCount);
    }
  }

  listen() {
    const canvas = this.canvas, held = new Map();
    let moved = 0;
    canvas.addEventListener("contextmenu", e => e.preventDefault());
    canvas.addEventListener("pointerdown", e => { canvas.setPointerCapture(e.pointerId); if (!held.size) moved = 0; held.set(e.pointerId, [e.offsetX, e.offsetY]); });
    canvas.addEventListener("pointerup", e => { held.delete(e.pointerId); if (moved < 4 && e.button === 0 && !held.size) this.pick(e.offsetX, e.offsetY); });
    canvas.addEventListener("pointercancel", e => held.delete(e.pointerId));
    canvas.addEventListener("pointermove", e => {
      const before = held.get(e.pointerId);
      if (!before) return;
      const [dx, dy] = [e.offsetX - before[0], e.offsetY - before[1]];
      if (held.size === 2) {
        const other = [...held].find(([id]) => id !== e.pointerId)[1];
        this.zoom(Math.hypot(before[0] - other[0], before[1] - other[1]) / Math.max(1, Math.hypot(e.offsetX - other[0], e.offsetY - other[1])));
        this.pan(dx / 2, dy / 2);
      } else if (e.buttons & 2 || e.shiftKey) this.pan(dx, dy);
      else this.turn(-dx * 0.006, dy * 0.006);
      moved += Math.abs(dx) + Math.abs(dy);
      held.set(e.pointerId, [e.offsetX, e.offsetY]);
    });
    canvas.addEventListener("wheel", e => { e.preventDefault(); this.zoom(Math.exp(e.deltaY * (e.deltaMode ? 0.05 : 0.0015))); }, { passive: false });
    canvas.addEventListener("keydown", e => {
      const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[e.key];
      const act = step ? () => e.shiftKey ? this.pan(-40 * step[0], 40 * step[1]) : this.turn(0.1 * step[0], 0.1 * step[1])
        : { "+": () => this.zoom(0.85), "=": () => this.zoom(0.85), "-": () => this.zoom(1.18), h: () => this.home() }[e.key];
      // Keys with Ctrl or Alt are the browser's.
      if (act && !e.ctrlKey && !e.altKey && !e.metaKey) { e.preventDefault(); act(); }
    });
  }

  turn(yaw, pitch) { this.yaw += yaw; this.pitch = Math.max(-1.55, Math.min(1.55, this.pitch + pitch)); this.draw(true); }
  zoom(factor) { this.distance = Math.max(this.span() * 1e-4, Math.min(this.span() * 20, this.distance * factor)); this.draw(true); }
  pan(dx, dy) {
    const step = this.distance * 0.845 / Math.max(1, this.canvas.clientHeight), { right, up } = this.axes;
    this.target = this.target.map((t, i) => t - right[i] * dx * step + up[i] * dy * step);
    this.draw(true);
  }

  /// Where a point of the scene is on the canvas, in CSS pixels; null behind the eye.
  project(p) {
    const m = this.view, q = [0, 1, 3].map(r => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r]);
    return q[2] <= 0 ? null : [(q[0] / q[2] + 1) / 2 * this.canvas.clientWidth, (1 - q[1] / q[2]) / 2 * this.canvas.clientHeight];
  }

  /// Opens the view whose camera is nearest to a click.
  pick(x, y) {
    let best = null;
    for (const camera of this.frusta ? this.cameras : []) {
      const at = this.project(camera.center);
      const away = at ? Math.hypot(at[0] - x, at[1] - y) : Infinity;
      if (away < 14 && (!best || away < best.away)) best = { away, camera };
    }
    if (best) this.opened(best.camera.view);
  }

  /// Frames per second over a full turn of `n` frames of `count` points.
  spin(n, count = this.cloud.count) {
    const start = performance.now();
    for (let i = 0; i < n; i++) {
      this.yaw += 2 * Math.PI / n;
      this.render(count);
      this.wait();
    }
    return n * 1000 / (performance.now() - start);
  }
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = v => { const n = Math.hypot(...v) || 1; return v.map(x => x / n); };
