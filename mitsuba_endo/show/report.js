"use strict";

function connectViewer(viewer) {
  const panels = [...viewer.querySelectorAll(".panels")];
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
    viewer.style.setProperty("--blend", blend.value / 100);
  }
  viewer.addEventListener("input", show);
  show();
}

function decoded(text) {
  return Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
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
  let points, quads, colour, lines, order, sx, sy, depth, behind;
  let yaw, pitch, zoom, pending = false;

  function choose() {
    const frame = slider ? slider.value - 1 : -1;  // -1: all
    if (told) told.textContent = frame < 0 ? "all" : names[frame];
    const quantity = Math.max(0, radios.findIndex((r) => r.checked));
    legends.forEach((l, i) => { l.hidden = i !== quantity; });
    const shown = surfaces.length > 1 && frame >= 0 ? frame : 0;
    [points, quads, colour] = [surfaces[shown], patches[shown], colours[quantity][shown]];
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
  }
  function redraw() {
    if (!pending) requestAnimationFrame(draw);
    pending = true;
  }
  function reset() {
    [yaw, pitch, zoom] = [0.95, -0.3, 1.5];
    redraw();
  }
  canvas.addEventListener("pointerdown", (e) => canvas.setPointerCapture(e.pointerId));
  canvas.addEventListener("pointermove", (e) => {
    if (!canvas.hasPointerCapture(e.pointerId)) return;
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
