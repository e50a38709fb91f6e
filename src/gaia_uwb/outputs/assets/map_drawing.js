// ---- what is drawn: made once; a new view only moves it -------------------------------------
const grid = svg("g", {}, map);
const world = svg("g", {}, map);  // lines and areas, in metres about the origin
const hull = svg("g", { id: "hull" }, world);  // the paper's boundary, which can be hidden
const areas = svg("g", {}, world), path = svg("g", {}, world), lines = svg("g", {}, world);
const now = svg("g", {}, world);
const ellipses = svg("g", {}, world);
const screen = svg("g", {}, map);  // rays, links and the ruler, in pixels
const marks = svg("g", {}, map);  // cones and names, which keep their size on the screen
const furniture = svg("g", { "aria-hidden": "true" }, map);
const places = [];
const pathLines = Object.fromEntries(
  ["halo", ...CLASSES].map((name) => [name, svg("path", { class: name }, path)]));
const pen = document.createElement("canvas").getContext("2d");
pen.font = "600 13px system-ui, sans-serif";

const warned = (status) => (status && status !== "ok" ? " warn" : "");

// An area's role ends in what it is: the outlines that hold with 90 % are an inner and an outer.
function areaClass(role) {
  return ["inner", "outer"].find((word) => role.includes(word)) ?? role;
}

const isHull = (role) => role.startsWith("hull") || role === "outline";

function layerOf({ role, isLine }) {
  if (role === "ellipse") return ellipses;
  if (isHull(role)) return hull;
  return isLine ? lines : areas;
}

function drawAreas() {
  for (const feature of all) {
    if (feature.points.length < 2 || feature.role === "path") continue;
    const corner = ([e, n]) => `${(e - origin[0]).toFixed(4)} ${(n - origin[1]).toFixed(4)}`;
    const end = feature.isLine ? "" : "z";
    const d = feature.rings.map((ring) => `M${ring.map(corner).join("L")}${end}`).join("");
    const layer = layerOf(feature);
    const other = feature.mirror ? " other" : "";  // the ellipse about the other possible place
    svg("path", { class: areaClass(feature.role) + warned(feature.status) + other, d,
                  "fill-rule": "evenodd" }, layer);
  }
}

function showHull(shown) {
  hull.style.display = shown ? "" : "none";
  byId("hull-shown").checked = shown;
}

// Shapes tell the states apart where colours cannot.
function markPath(role, status) {
  if (role === "mirror" || status === "ambiguous") return "M0-8.5L8.5 0 0 8.5-8.5 0z";
  if (warned(status)) return "M0-8.5L8.5 6.5H-8.5z";
  return "M-7 0a7 7 0 1 0 14 0a7 7 0 1 0-14 0z";
}

function labelOf(feature) {
  const anchor = anchors.get(feature.id);
  const longest = map.clientWidth < 620 ? 12 : 24;
  const name = feature.id.length > longest ? `${feature.id.slice(0, longest - 1)}…` : feature.id;
  if (feature.role === "mirror") return `${name} ${percent(feature.mirror_probability)}`;
  return mirrors.has(feature.id) ? `${name} ${percent(1 - anchor.mirror_probability)}` : name;
}

function spoken(feature) {
  if (feature.role === "mirror")
    return `${feature.id}, other position, ${percent(feature.mirror_probability)} probability`;
  return `${feature.id}, ${STATUS[feature.status] ?? feature.status}, ${sureness(feature.id)}`;
}

function drawPlaces() {
  for (const feature of all) {
    if (feature.points.length !== 1) continue;
    const [east, north] = feature.points[0];
    const group = svg("g", {
      class: `place ${feature.role}${warned(feature.status)}`, role: "button",
      tabindex: all.length < 200 ? 0 : -1, "aria-label": spoken(feature),
    }, marks);
    svg("circle", { class: "hit", r: 20 }, group);
    svg("circle", { class: "ring", r: 13 }, group);
    svg("path", { class: "mark", d: markPath(feature.role, feature.status) }, group);
    const label = svg("text", { class: "label" }, marks);
    label.textContent = labelOf(feature);
    const width = pen.measureText(label.textContent).width + 4;
    const place = { id: feature.id, role: feature.role, east, north, group, label, width };
    group.addEventListener("pointerenter", () => showTip(place));
    group.addEventListener("pointerleave", hideTip);
    group.addEventListener("focus", () => showTip(place));
    group.addEventListener("blur", hideTip);
    group.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      event.stopPropagation();
      take(place);
    });
    places.push(place);
  }
}

// Metres from a cone to the nearest other one: half of the cones stand closer to another, half not.
function usualSpacing() {
  const nearest = places.map((one) => Math.min(...places.filter((other) => other !== one)
    .map((other) => Math.hypot(other.east - one.east, other.north - one.north))));
  return nearest.sort((a, b) => a - b)[nearest.length >> 1] ?? Infinity;
}

function take(place) {
  if (ruler.active) addToRuler(place); else select(place.id);
}

// The path, one line per class of misfit: its corners are those of the timeline.
function paintPath() {
  const lines = Object.fromEntries(CLASSES.map((name) => [name, []]));
  let before = null;
  const starts = new Set([0, ...timeline.starts]);
  const corner = (k) => `${timeline.east_m[k].toFixed(2)} ${timeline.north_m[k].toFixed(2)}`;
  for (let k = 0; k + 1 < steps; k += 1) {
    const name = fitClass(fit.shown[k]);
    if (starts.has(k + 1)) { before = null; continue; }  // the way from one pass to the next
    if (name !== before) lines[name].push(`M${corner(k)}`);
    lines[name].push(`L${corner(k + 1)}`);
    before = name;
  }
  for (const name of CLASSES) pathLines[name].setAttribute("d", lines[name].join(""));
  const whole = timeline.t_s.map((_, k) => `${starts.has(k) ? "M" : "L"}${corner(k)}`).join("");
  pathLines.halo.setAttribute("d", whole);
}

// ---- details beside the pointer -------------------------------------------------------------
const tip = byId("tip");

function showTipAt(x, y, title, lines) {
  tip.replaceChildren();
  html("b", title, tip, "name");
  for (const line of lines) html("div", line, tip);
  tip.hidden = false;
  const right = map.clientWidth - tip.offsetWidth - 8;
  tip.style.left = `${Math.max(8, Math.min(x + 16, right))}px`;
  const below = y + 16 + tip.offsetHeight > map.clientHeight - 70;
  tip.style.top = `${Math.max(8, below ? y - tip.offsetHeight - 16 : y + 16)}px`;
}

function showTip(place) {
  if (ruler.active) return;  // it would cover what is measured
  const anchor = anchors.get(place.id), mirror = place.role === "mirror";
  const lines = mirror
    ? [`other position, ${percent(anchor.mirror_probability)} probability`]
    : [STATUS[anchor.status] ?? anchor.status, sureness(place.id), `${anchor.n_ranges} ranges`];
  if (!mirror && mirrors.has(place.id))
    lines.push(`this position: ${percent(1 - anchor.mirror_probability)} probability`);
  showTipAt(toX(place.east), toY(place.north), place.id, lines);
}

function hideTip() { tip.hidden = true; }

function showPathTip(x, y) {
  const step = nearestStep(x, y, 14);
  if (step === null) {
    hideTip();
    return;
  }
  const misfit = fit.shown[step];
  showTipAt(x, y, `${seconds(step)} after the start`,
    [known(misfit) ? `residual of the ranges: ${metres(misfit / 100)}` : "no range here",
     "click to show this moment"]);
}

function nearestStep(x, y, within) {
  let best = null, least = within ** 2;
  for (let k = 0; k < steps; k += 1) {
    const away = (toX(timeline.east_m[k] + origin[0]) - x) ** 2
                 + (toY(timeline.north_m[k] + origin[1]) - y) ** 2;
    if (away < least) [best, least] = [k, away];
  }
  return best;
}
