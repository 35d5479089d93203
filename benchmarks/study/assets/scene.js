"use strict";
// A small renderer for an arm: tubes, balls and lines in perspective, painted from far to near on a canvas.

class Camera {
  constructor(target, distance) {
    this.home = { target, distance, azimuth: 0.62, elevation: 0.3 };
    this.reset();
  }
  reset() { Object.assign(this, { ...this.home }); }
  turn(dx, dy) {
    this.azimuth -= dx * 0.008;
    this.elevation = Math.min(1.45, Math.max(0.02, this.elevation + dy * 0.008));
  }
  zoom(factor) { this.distance = Math.min(4 * this.home.distance, Math.max(0.3 * this.home.distance, this.distance * factor)); }
  // Screen position, depth, and pixels per millimetre there.
  project(p, width, height) {
    const [x, y, z] = [p[0] - this.target[0], p[1] - this.target[1], p[2] - this.target[2]];
    const [ca, sa, ce, se] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.elevation), Math.sin(this.elevation)];
    const right = -sa * x + ca * y;
    const towards = ca * x + sa * y;
    const up = ce * z - se * towards;
    const depth = this.distance - (ce * towards + se * z);
    const scale = 1.35 * Math.min(width, height * 1.15) / Math.max(depth, 1);
    return { x: width / 2 + scale * right, y: height / 2 - scale * up, depth, scale };
  }
}

function shade(colour, amount) {
  const part = i => parseInt(colour.slice(i, i + 2), 16);
  const mix = value => Math.round(amount < 0 ? value * (1 + amount) : value + (255 - value) * amount);
  return `rgb(${mix(part(1))},${mix(part(3))},${mix(part(5))})`;
}

class Scene {
  constructor(canvas, camera) {
    this.canvas = canvas;
    this.camera = camera;
    this.context = canvas.getContext("2d");
  }
  begin() {
    const ratio = window.devicePixelRatio || 1, box = this.canvas.getBoundingClientRect();
    const [width, height] = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
    if (this.canvas.width !== width || this.canvas.height !== height) [this.canvas.width, this.canvas.height] = [width, height];
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    [this.width, this.height] = [box.width, box.height];
    this.context.clearRect(0, 0, box.width, box.height);
    this.parts = [];
  }
  at(p) { return this.camera.project(p, this.width, this.height); }
  add(depth, paint) { this.parts.push({ depth, paint }); }
  end() {
    this.parts.sort((a, b) => b.depth - a.depth);
    for (const part of this.parts) part.paint(this.context);
  }
  // Drawn at once: what lies under everything.
  floor(centre, reach, step) {
    const c = this.context;
    c.strokeStyle = "rgba(120,130,140,.28)";
    c.lineWidth = 1;
    c.beginPath();
    for (let d = -reach; d <= reach + 1e-6; d += step) {
      for (const ends of [[[d, -reach], [d, reach]], [[-reach, d], [reach, d]]]) {
        const [a, b] = ends.map(e => this.at([centre[0] + e[0], centre[1] + e[1], 0]));
        c.moveTo(a.x, a.y);
        c.lineTo(b.x, b.y);
      }
    }
    c.stroke();
  }
  shadow(points, radius) {
    const c = this.context, on = points.map(p => this.at([p[0], p[1], 0]));
    c.save();
    c.strokeStyle = "rgba(40,50,60,.13)";
    c.lineWidth = 2 * radius * on[on.length - 1].scale;
    c.lineJoin = c.lineCap = "round";
    c.beginPath();
    on.forEach((p, i) => (i ? c.lineTo(p.x, p.y) : c.moveTo(p.x, p.y)));
    c.stroke();
    c.restore();
  }
  line(points, colour, width, { dash = [], chunk = 4, nearer = 0 } = {}) {
    for (let i = 0; i + 1 < points.length; i += chunk) {
      const some = points.slice(i, i + chunk + 1).map(p => this.at(p));
      const depth = some.reduce((sum, p) => sum + p.depth, 0) / some.length - nearer;
      this.add(depth, c => {
        c.strokeStyle = colour;
        c.lineWidth = width;
        c.setLineDash(dash);
        c.lineCap = dash.length ? "butt" : "round";
        c.beginPath();
        some.forEach((p, j) => (j ? c.lineTo(p.x, p.y) : c.moveTo(p.x, p.y)));
        c.stroke();
        c.setLineDash([]);
      });
    }
  }
  ball(p, radius, colour) {
    const at = this.at(p), r = radius * at.scale;
    this.add(at.depth - 0.6 * radius, c => {
      const fill = c.createRadialGradient(at.x - 0.35 * r, at.y - 0.4 * r, 0.1 * r, at.x, at.y, r);
      fill.addColorStop(0, shade(colour, 0.55));
      fill.addColorStop(0.55, colour);
      fill.addColorStop(1, shade(colour, -0.4));
      c.fillStyle = fill;
      c.beginPath();
      c.arc(at.x, at.y, r, 0, 2 * Math.PI);
      c.fill();
    });
  }
  tube(from, to, radius, colour) {
    const pieces = 4;
    for (let i = 0; i < pieces; i++) {
      const between = s => from.map((value, k) => value + (to[k] - value) * s);
      // A little overlap, or seams would show.
      this.piece(between(Math.max(0, i / pieces - 0.01)), between((i + 1) / pieces), radius, colour);
    }
  }
  piece(from, to, radius, colour) {
    const [a, b] = [this.at(from), this.at(to)];
    const length = Math.hypot(b.x - a.x, b.y - a.y) || 1;
    const [nx, ny] = [-(b.y - a.y) / length, (b.x - a.x) / length];
    const [ra, rb] = [radius * a.scale, radius * b.scale];
    this.add(0.5 * (a.depth + b.depth), c => {
      const [x, y, r] = [0.5 * (a.x + b.x), 0.5 * (a.y + b.y), Math.max(ra, rb)];
      // Light comes from the upper left.
      const side = nx * -0.6 + ny * -0.8 > 0 ? 1 : -1;
      const fill = c.createLinearGradient(x + side * r * nx, y + side * r * ny, x - side * r * nx, y - side * r * ny);
      fill.addColorStop(0, shade(colour, -0.05));
      fill.addColorStop(0.28, shade(colour, 0.5));
      fill.addColorStop(0.6, colour);
      fill.addColorStop(1, shade(colour, -0.42));
      c.fillStyle = fill;
      c.beginPath();
      c.moveTo(a.x + nx * ra, a.y + ny * ra);
      c.lineTo(b.x + nx * rb, b.y + ny * rb);
      c.lineTo(b.x - nx * rb, b.y - ny * rb);
      c.lineTo(a.x - nx * ra, a.y - ny * ra);
      c.closePath();
      c.fill();
    });
  }
  arrow(from, vector, colour) {
    const [a, b] = [this.at(from), this.at(from.map((value, k) => value + vector[k]))];
    const length = Math.hypot(b.x - a.x, b.y - a.y);
    if (length < 3) return;
    this.add(Math.min(a.depth, b.depth) - 80, c => {
      const [ux, uy] = [(b.x - a.x) / length, (b.y - a.y) / length], head = Math.min(11, 0.6 * length);
      c.strokeStyle = c.fillStyle = colour;
      c.lineWidth = 2.6;
      c.beginPath();
      c.moveTo(a.x, a.y);
      c.lineTo(b.x - ux * head * 0.8, b.y - uy * head * 0.8);
      c.stroke();
      c.beginPath();
      c.moveTo(b.x, b.y);
      c.lineTo(b.x - ux * head - uy * head * 0.45, b.y - uy * head + ux * head * 0.45);
      c.lineTo(b.x - ux * head + uy * head * 0.45, b.y - uy * head - ux * head * 0.45);
      c.closePath();
      c.fill();
    });
  }
}
