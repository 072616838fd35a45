"use strict";

function connectViewer(viewer) {
  const panels = [...viewer.querySelectorAll(".panels")];
  const photographs = [...viewer.querySelectorAll(".photograph")];
  const frame = viewer.querySelector("[name=frame]");
  const blend = viewer.querySelector("[name=blend]");
  const named = viewer.querySelector("output");
  const coordinates = [...viewer.querySelectorAll("[type=radio]")];

  function show() {
    const index = frame ? frame.value : "0";
    const coordinate = coordinates.find((c) => c.checked).value;
    for (const panel of panels) {
      panel.hidden = panel.dataset.frame !== index || panel.dataset.coordinate !== coordinate;
      if (!panel.hidden && named) named.textContent = panel.dataset.name;
    }
    for (const picture of photographs) picture.hidden = picture.dataset.frame !== index;
    viewer.style.setProperty("--blend", blend.value / 100);
  }
  viewer.addEventListener("input", show);
  show();
}

// A long verdict stands above the picture: what is left of the window is the picture's, unless that
// is too little to see anything.
function fitBelow(canvas) {
  const top = canvas.getBoundingClientRect().top + window.scrollY;
  const room = window.innerHeight - top - 8;
  if (room > 300 && room < canvas.clientHeight) canvas.style.height = `${Math.floor(room)}px`;
}

function decoded(text) {
  return Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
}

function round(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  const digit = [5, 2, 1].find((d) => d * power <= length) || 1;
  return Number((digit * power).toPrecision(1));
}

// What is known of the errors of a surface's points: their own, and what they share.
function deviations(surface) {
  const read = (q) => q && Float32Array.from(new Int16Array(decoded(q.data)), (v) => v * q.unit);
  return { own: read(surface.own), modes: read(surface.modes) };
}

// The distance of two points with its 95 % interval; the formula is that of show/measure.py.
function measured(points, origin, error, data, a, b) {
  const at = (i) => [0, 1, 2].map((k) => points[3 * i + k]);
  const dot = (u, v) => u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
  const unit = (u) => u.map((v) => v / Math.hypot(...u));
  const between = at(a).map((v, k) => v - at(b)[k]), long = Math.hypot(...between);
  if (!error.own || !long) return `${long.toPrecision(4)} ${data.unit}`;
  const along = unit(between);
  const ray = (i) => unit(at(i).map((v, k) => v - origin[k]));
  const ca = dot(along, ray(a)), cb = -dot(along, ray(b));
  const own = [Math.abs(ca) * error.own[a], Math.abs(cb) * error.own[b]];
  let variance = error.modes ? own[0] ** 2 + own[1] ** 2 : (own[0] + own[1]) ** 2;
  const count = error.modes ? error.modes.length / error.own.length : 0;
  for (let k = 0; k < count; k++) {
    variance += (ca * error.modes[a * count + k] + cb * error.modes[b * count + k]) ** 2;
  }
  variance += (long * data.scaleStd) ** 2;
  const half = 1.96 * Math.sqrt(variance);
  const places = Math.min(6, Math.max(0, 1 - Math.floor(Math.log10(half))));
  return `${long.toFixed(places)} ± ${half.toFixed(places)} ${data.unit}`;
}

// Patches sorted by depth and painted back to front: needs no WebGL, so it works everywhere.
function connectScene(space) {
  const data = JSON.parse(space.dataset.scene);
  const names = JSON.parse(space.dataset.frames);
  const canvas = space.querySelector("canvas");
  const slider = space.querySelector("[name=shown]");
  const told = space.querySelector("output");
  const radios = [...space.querySelectorAll("[type=radio]")];
  const boxes = [...space.querySelectorAll("[type=checkbox]")];
  const legends = [...space.querySelectorAll(".legend")];
  const surfaces = data.surfaces.map((s) => new Float32Array(decoded(s.points)));
  const patches = data.surfaces.map((s) => new Uint16Array(decoded(s.quads)));
  const colours = data.colours.map((q) => q.map((c) => new Uint8Array(decoded(c))));
  fitBelow(canvas);
  const context = canvas.getContext("2d");
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  const include = (p) => p.forEach((v, i) => {
    low[i] = Math.min(low[i], v);
    high[i] = Math.max(high[i], v);
  });
  for (const s of surfaces) {
    for (let i = 0; i < s.length; i += 3) include([s[i], s[i + 1], s[i + 2]]);
  }
  for (const line of data.lines) {
    if (line.kind === "frusta") line.segments.forEach((s) => s.forEach(include));
  }
  const centre = low.map((v, i) => (v + high[i]) / 2);
  const radius = Math.hypot(...low.map((v, i) => (high[i] - v) / 2));
  const errors = data.surfaces.map(deviations);
  const on = (name) => boxes.some((b) => b.name === name && b.checked);
  let points, quads, colour, lines, order, sx, sy, depth, behind, error, origin;
  let yaw, pitch, zoom, moved, chosen = 0, pending = false, marks = [];

  function choose() {
    const frame = slider ? slider.value - 1 : -1;  // -1: all
    if (told) told.textContent = frame < 0 ? "all" : names[frame];
    const quantity = Math.max(0, radios.findIndex((r) => r.checked));
    legends.forEach((l, i) => { l.hidden = i !== quantity; });
    const shown = surfaces.length > 1 && frame >= 0 ? frame : 0;
    [points, quads, colour] = [surfaces[shown], patches[shown], colours[quantity][shown]];
    [error, origin, marks] = [errors[shown], data.surfaces[shown].origin, on("ruler") && shown === chosen ? marks : []];
    chosen = shown;
    const kinds = boxes.filter((b) => b.checked).map((b) => b.name);
    lines = data.lines.filter((l) => kinds.includes(l.kind) && (frame < 0 || l.frame === frame));
    const count = points.length / 3;
    order = Uint32Array.from({ length: quads.length / 4 }, (_, i) => 4 * i);
    behind = new Float32Array(quads.length);
    [sx, sy, depth] = [0, 1, 2].map(() => new Float32Array(count));
    redraw();
  }
  function project(x, y, z, scale, width, height) {
    const [cy, sy_, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
    const [dx, dy, dz] = [x - centre[0], y - centre[1], z - centre[2]];
    const u = cy * dx + sy_ * dz, w = -sy_ * dx + cy * dz;
    const v = cp * dy - sp * w, d = sp * dy + cp * w;
    const near = 4 * radius / (4 * radius + d);
    return [width / 2 + scale * near * u, height / 2 + scale * near * v, d, near];
  }
  function draw() {
    pending = false;
    const ratio = window.devicePixelRatio || 1;
    const width = canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const height = canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    const scale = zoom * 0.5 * Math.min(width, height) / radius;
    for (let i = 0; i < depth.length; i++) {
      const at = project(points[3 * i], points[3 * i + 1], points[3 * i + 2], scale, width, height);
      sx[i] = at[0]; sy[i] = at[1]; depth[i] = at[2];
    }
    for (const q of order) behind[q] = depth[quads[q]] + depth[quads[q + 2]];
    order.sort((a, b) => behind[b] - behind[a]);
    context.lineWidth = ratio;  // closes the seams that smoothing leaves between patches
    context.lineJoin = "bevel";
    for (const q of order) {
      const i = 3 * quads[q];
      context.fillStyle = context.strokeStyle = `rgb(${colour[i]},${colour[i + 1]},${colour[i + 2]})`;
      context.beginPath();
      for (let k = q; k < q + 4; k++) context.lineTo(sx[quads[k]], sy[quads[k]]);
      context.closePath();
      context.fill();
      context.stroke();
    }
    for (const line of lines) {
      context.strokeStyle = line.colour;
      context.lineWidth = (line.kind === "rays" ? 0.6 : 1.5) * ratio;
      context.beginPath();
      for (const [a, b] of line.segments) {
        const [p, q] = [a, b].map((c) => project(...c, scale, width, height));
        context.moveTo(p[0], p[1]);
        context.lineTo(q[0], q[1]);
      }
      context.stroke();
    }
    annotate(scale, width, height, ratio);
  }
  // Names of cameras, axes of the first one, a bar of a round length, the ruler.
  function annotate(scale, width, height, ratio) {
    const at = (p) => project(...p, scale, width, height);
    context.font = `${12 * ratio}px system-ui, sans-serif`;
    const write = (text, x, y, ink) => {
      context.lineWidth = 3 * ratio;
      context.strokeStyle = "#ffffffd0";
      context.strokeText(text, x, y);
      context.fillStyle = ink;
      context.fillText(text, x, y);
    };
    const stroke = (from, to, ink, wide) => {
      context.strokeStyle = ink;
      context.lineWidth = wide * ratio;
      context.beginPath();
      context.moveTo(from[0], from[1]);
      context.lineTo(to[0], to[1]);
      context.stroke();
    };
    const drawn = lines.filter((l) => l.kind === "frusta" && l.colour === data.lines[0].colour);
    if (names.length > 1 && drawn.length <= 3) {
      for (const line of drawn) {
        const p = at(line.segments[0][0]);
        write(names[line.frame], p[0] + 6 * ratio, p[1] - 6 * ratio, "#1d2733");
      }
    }
    if (on("axes")) {
      const long = round(radius / 5);
      [["x", "#b2182b"], ["y", "#1b7837"], ["z", "#0072b2"]].forEach(([name, ink], i) => {
        const tip = [0, 0, 0];
        tip[i] = long;
        const [p, q] = [at([0, 0, 0]), at(tip)];
        stroke(p, q, ink, 2.5);
        write(name, q[0] + 3 * ratio, q[1] + 4 * ratio, ink);
      });
      const bar = round(0.2 * width / scale), [x, y] = [16 * ratio, height - 16 * ratio];
      stroke([x, y], [x + bar * scale, y], "#1d2733", 2.5);
      for (const end of [x, x + bar * scale]) stroke([end, y - 4 * ratio], [end, y + 4 * ratio], "#1d2733", 2.5);
      write(`${bar} ${data.unit}, at the middle`, x, y - 8 * ratio, "#1d2733");
    }
    const placed = marks.map((i) => at([points[3 * i], points[3 * i + 1], points[3 * i + 2]]));
    if (placed.length === 2) stroke(...placed, "#d6004c", 2);
    for (const p of placed) {
      context.fillStyle = "#d6004c";
      context.beginPath();
      context.arc(p[0], p[1], 4 * ratio, 0, 7);
      context.fill();
    }
    if (placed.length === 2) {
      const [p, q] = placed;
      canvas.dataset.ruler = measured(points, origin, error, data, ...marks);
      write(canvas.dataset.ruler, (p[0] + q[0]) / 2 + 8 * ratio, (p[1] + q[1]) / 2, "#a00038");
    }
  }
  // The corner, nearest to a click, of the foremost patch under it; -1: none.
  function picked(x, y) {
    for (let n = order.length - 1; n >= 0; n--) {
      const corners = [0, 1, 2, 3].map((k) => quads[order[n] + k]);
      let inside = false;
      corners.forEach((i, k) => {
        const j = corners[(k + 3) % 4];
        if ((sy[i] > y) !== (sy[j] > y) && x < sx[i] + (sx[j] - sx[i]) * (y - sy[i]) / (sy[j] - sy[i])) inside = !inside;
      });
      if (!inside) continue;
      const far = (i) => Math.hypot(sx[i] - x, sy[i] - y);
      return corners.reduce((a, b) => (far(b) < far(a) ? b : a));
    }
    return -1;
  }
  function redraw() {
    if (!pending) requestAnimationFrame(draw);
    pending = true;
  }
  function reset() {
    [yaw, pitch, zoom] = [0.7, -0.25, 1.75];
    redraw();
  }
  canvas.addEventListener("pointerdown", (e) => {
    moved = 0;
    canvas.setPointerCapture(e.pointerId);
  });
  canvas.addEventListener("pointerup", (e) => {
    if (!on("ruler") || moved > 4) return;
    const box = canvas.getBoundingClientRect(), ratio = canvas.width / box.width;
    const mark = picked((e.clientX - box.left) * ratio, (e.clientY - box.top) * ratio);
    if (mark >= 0) marks = marks.length < 2 ? [...marks, mark] : [mark];
    redraw();
  });
  canvas.addEventListener("pointermove", (e) => {
    if (!canvas.hasPointerCapture(e.pointerId)) return;
    moved += Math.abs(e.movementX) + Math.abs(e.movementY);
    yaw -= e.movementX * 0.008;
    pitch = Math.max(-1.57, Math.min(1.57, pitch + e.movementY * 0.008));
    redraw();
  });
  canvas.addEventListener("wheel", (e) => {
    e.preventDefault();
    zoom = Math.max(0.2, Math.min(20, zoom * Math.exp(-e.deltaY * 0.001)));
    redraw();
  }, { passive: false });
  canvas.addEventListener("dblclick", reset);
  space.addEventListener("input", choose);
  window.addEventListener("resize", redraw);
  reset();
  choose();
}

document.querySelectorAll(".viewer").forEach(connectViewer);
document.querySelectorAll(".space").forEach(connectScene);
window.addEventListener("beforeprint", () => {
  document.querySelectorAll("details").forEach((d) => { d.open = true; });
});
