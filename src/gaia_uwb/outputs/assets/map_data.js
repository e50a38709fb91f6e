"use strict";
// The scripts of this folder are one script in the page, in the order of interactive_map.py.
// Text from the data enters the page through textContent and setAttribute only.
const { features, report, road, timeline, messages, sources } = JSON.parse(byId("data").textContent);
const map = byId("map");
const known = (value) => value !== null && value !== undefined;
const RINGS = {  // of a geometry: lists of points; an area may have holes and several pieces
  Point: (c) => [[c]], LineString: (c) => [c], MultiLineString: (c) => c,
  Polygon: (c) => c, MultiPolygon: (c) => c.flat(),
};
const all = features.features.filter(({ geometry }) => geometry)
  .map(({ properties, geometry: { type, coordinates } }) => {
    const rings = RINGS[type](coordinates);
    return { ...properties, rings, points: rings.flat(), isLine: type.endsWith("LineString") };
  });
const cones = new Map(all.filter((f) => f.role === "cone").map((cone) => [cone.id, cone]));
const mirrors = new Map(all.filter((f) => f.role === "mirror").map((cone) => [cone.id, cone]));
const order = report.anchors.map((anchor) => anchor.id);
const anchors = new Map(report.anchors.map((anchor) => [anchor.id, anchor]));
const origin = all[0].points[0];  // browsers draw in single precision: keep numbers small
let spacing = Infinity;  // metres between neighbouring cones
const steps = timeline.t_s.length;
const bearings = timeline.bearings.map((pairs) => new Map(pairs));  // of each cone, by the step
// The hull is another shape than what a driver sees, unless the cones stand around an area.
const hullLeads = road === null;
const chosen = { id: null, step: 0, ranges: false };  // what the reader looks at

const STATUS = {
  ok: "located", ambiguous: "side uncertain", "ill-conditioned": "poorly determined",
  "not-converged": "no stable position", "does-not-fit": "ranges do not fit",
  moved: "probably moved", "too-few-ranges": "not located",
};

function byId(id) { return document.getElementById(id); }

function html(name, text, parent, className = "") {
  const element = document.createElement(name);
  element.textContent = text;
  if (className) element.className = className;
  parent.append(element);
  return element;
}

function svg(name, attributes, parent) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  parent.append(element);
  return element;
}

const minus = (text) => text.replace("-", "−");
const metres = (value) => (known(value) ? `${minus(value.toFixed(2))}\u00a0m` : "unknown");
const percent = (share) => `${Math.round(100 * share)}\u00a0%`;
const NINETY = "(90\u00a0%)";  // the level of every ± on the page
const seconds = (step) => `${timeline.t_s[step].toFixed(1)} s`;

// Areas to three figures or to a tenth of a square metre, whichever is less.
function squareMetres(area) {
  return `${area < 100 ? area.toFixed(1) : Math.round(area).toLocaleString("en-US")}\u00a0m²`;
}

function signed(cm) {
  return `${cm < 0 ? "−" : "+"}${(Math.abs(cm) / 100).toFixed(2)}\u00a0m`;
}

// The longer semi-axis of a cone's 90 % ellipse: its uncertainty in the worst direction.
function sureness(id) {
  const cone = cones.get(id);
  return cone && known(cone.ellipse_semi_major_m)
    ? `±\u00a0${metres(cone.ellipse_semi_major_m)} ${NINETY}` : "uncertainty unknown";
}

// ---- how well the ranges fit, along the path ------------------------------------------------

// Root mean square of the misfits about each step: of one cone, or of all; null without any.
function misfits(id) {
  const columns = timeline.residual_cm.filter((_, n) => id === null || order[n] === id);
  const sums = new Float64Array(steps + 1), counts = new Float64Array(steps + 1);
  for (let k = 0; k < steps; k += 1) {
    sums[k + 1] = sums[k];
    counts[k + 1] = counts[k];
    for (const column of columns) {
      if (column[k] === null) continue;
      sums[k + 1] += column[k] ** 2;
      counts[k + 1] += 1;
    }
  }
  return timeline.t_s.map((_, k) => {
    const first = Math.max(k - 2, 0), last = Math.min(k + 3, steps);  // less flicker
    if (counts[k + 1] === counts[k]) return null;
    return Math.sqrt((sums[last] - sums[first]) / (counts[last] - counts[first]));
  });
}

// One scale for the whole page, so that a colour keeps its meaning: four round steps that reach
// the misfit that all but a twentieth of the path stays below.
function classWidth() {
  const sorted = misfits(null).filter(known).sort((a, b) => a - b);
  const high = sorted.length ? sorted[Math.floor(0.95 * (sorted.length - 1))] : 1;
  const least = Math.max(high / 4, 0.5), power = 10 ** Math.floor(Math.log10(least));
  return power * [1, 2, 2.5, 5, 10].find((factor) => factor * power >= least * 0.999);
}

const fit = { all: misfits(null), width: classWidth(), shown: [] };
fit.shown = fit.all;
const CLASSES = ["none", "fit0", "fit1", "fit2", "fit3", "fit4"];

function fitClass(cm) {
  return known(cm) ? CLASSES[1 + Math.min(Math.floor(Math.abs(cm) / fit.width), 4)] : "none";
}
