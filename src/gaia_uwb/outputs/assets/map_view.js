// ---- the view: which place is in the middle, and pixels per metre ---------------------------
const view = { east: 0, north: 0, scale: 1, waiting: false };
const toX = (east) => (east - view.east) * view.scale + map.clientWidth / 2;
const toY = (north) => (view.north - north) * view.scale + map.clientHeight / 2;
const toEast = (x) => view.east + (x - map.clientWidth / 2) / view.scale;
const toNorth = (y) => view.north - (y - map.clientHeight / 2) / view.scale;

// Pixels at the edges that the tools and the time bar cover, with room for names and the scale.
function edges() {
  const { offsetTop, offsetHeight } = byId("tools");
  return { top: offsetTop + offsetHeight + 20, side: Math.min(36 + map.clientWidth / 40, 60),
           bottom: map.clientHeight - byId("time").offsetTop + 50 };
}

function redraw() {
  if (view.waiting) return;
  view.waiting = true;
  requestAnimationFrame(() => {
    view.waiting = false;
    draw();
  });
}

function draw() {
  const x = toX(origin[0]), y = toY(origin[1]);
  world.setAttribute("transform", `translate(${x} ${y}) scale(${view.scale} ${-view.scale})`);
  for (const place of places) {
    place.x = toX(place.east);
    place.y = toY(place.north);
    place.group.setAttribute("transform", `translate(${place.x} ${place.y})`);
  }
  // Marks that touch each other would hide the edge that they stand on.
  marks.classList.toggle("crowded", spacing * view.scale < 22);
  screen.replaceChildren();
  drawStart();
  drawLinks();
  drawRays();
  drawRuler();
  drawLabels();
  drawGrid();
}

function drawStart() {
  const [x, y] = [toX(origin[0]), toY(origin[1])];
  svg("rect", { class: "start", x: x - 5, y: y - 5, width: 10, height: 10 }, screen);
  svg("text", { class: "label", x: x + 10, y: y + 5 }, screen).textContent = "start";
}

// A dotted line joins the two places between which a cone is undecided, a thin one two cones that
// ranged each other.
function drawLinks() {
  for (const [a, b] of timeline.ties) {
    const [one, other] = [a, b].map((n) => places.find((place) =>
      place.role === "cone" && place.id === order[n]));
    const own = [order[a], order[b]].includes(chosen.id) ? " chosen" : "";
    if (one && other)
      svg("path", { class: `tie${own}`, d: `M${one.x} ${one.y}L${other.x} ${other.y}` }, screen);
  }
  for (const other of places) {
    if (other.role !== "mirror") continue;
    const cone = places.find((place) => place.role === "cone" && place.id === other.id);
    svg("path", { class: "link", d: `M${cone.x} ${cone.y}L${other.x} ${other.y}` }, screen);
  }
}

// A name stands beside its mark where it covers no other mark and no other name, or not at all.
function drawLabels() {
  const taken = places.map(({ x, y }) => ({ x: x - 8, y: y - 8, width: 16, height: 16 }));
  taken.push({ x: map.clientWidth - 40, y: northTop(), width: 40, height: 46 });
  const free = (box) => !taken.some((other) => other.x < box.x + box.width
    && box.x < other.x + other.width && other.y < box.y + box.height
    && box.y < other.y + other.height);
  let tried = 0;  // of a thousand cones side by side, the eye reads no more either
  const first = places.filter(({ id }) => id === chosen.id);
  for (const place of [...first, ...places.filter(({ id }) => id !== chosen.id)]) {
    const { x, y, width, label } = place, height = 17;
    const inside = x > -20 && y > -20 && x < map.clientWidth + 20 && y < map.clientHeight + 20;
    const corners = [[x + 12, y - 9], [x - 12 - width, y - 9], [x - width / 2, y - 28],
                     [x - width / 2, y + 11], [x + 8, y - 26], [x - 8 - width, y - 26],
                     [x + 8, y + 9], [x - 8 - width, y + 9]];
    tried += inside;
    const open = inside && tried < 300
      ? corners.filter(([left, top]) => free({ x: left, y: top, width, height })) : [];
    const within = ([left]) => left > 4 && left + width < map.clientWidth - 4;
    const found = open.find(within) ?? (place.id === chosen.id ? open[0] : undefined);
    label.style.display = found ? "" : "none";
    if (!found) continue;
    taken.push({ x: found[0], y: found[1], width, height });
    label.setAttribute("x", found[0] + 2);
    label.setAttribute("y", found[1] + 13);
  }
}

function northTop() {
  const tools = byId("tools");
  return map.clientWidth < 620 ? tools.offsetTop + tools.offsetHeight + 10 : 14;
}

function drawGrid() {
  const width = map.clientWidth, height = map.clientHeight;
  const least = 80 / view.scale, power = 10 ** Math.floor(Math.log10(least));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= least);
  grid.replaceChildren();
  for (let k = Math.ceil(toEast(0) / step); toX(k * step) < width; k += 1)
    svg("line", { class: "grid", x1: toX(k * step), x2: toX(k * step), y1: 0, y2: height }, grid);
  for (let k = Math.ceil(toNorth(height) / step); toY(k * step) > 0; k += 1)
    svg("line", { class: "grid", x1: 0, x2: width, y1: toY(k * step), y2: toY(k * step) }, grid);
  furniture.replaceChildren();
  const right = width - 18, left = right - step * view.scale, y = byId("time").offsetTop - 14;
  svg("path", { class: "scale", d: `M${left} ${y - 6}V${y}H${right}V${y - 6}` }, furniture);
  const text = step < 1 ? `${Math.round(step * 1000) / 10} cm`
    : step < 1000 ? `${step} m` : `${step / 1000} km`;
  svg("text", { class: "label", x: right - 6, y: y - 8, "text-anchor": "end" }, furniture)
    .textContent = text;
  const top = northTop();
  svg("path", { d: `M${width - 28} ${top}l8 25-8-6-8 6z`, class: "north" }, furniture);
  svg("text", { class: "label", x: width - 33, y: top + 41 }, furniture).textContent = "N";
}

function show(points) {
  const [west, east, south, north] = [0, 1].flatMap((axis) => points.reduce(
    ([low, high], point) => [Math.min(low, point[axis]), Math.max(high, point[axis])],
    [Infinity, -Infinity]));
  const { top, bottom, side } = edges();
  const width = Math.max(map.clientWidth - 2 * side, 40);
  const height = Math.max(map.clientHeight - top - bottom, 40);
  view.scale = 0.94 * Math.min(width / Math.max(east - west, 2), height / Math.max(north - south, 2));
  view.east = (west + east) / 2;
  view.north = (south + north) / 2 + (top - bottom) / 2 / view.scale;
  hideTip();
  draw();
}

const pointsOf = (...roles) => all.filter(({ role }) => roles.includes(role))
  .flatMap(({ points }) => points);
const showDrive = () => show(pointsOf("path", "cone", "mirror"));

function showZone() {
  const zone = pointsOf("cone", "mirror");
  if (!zone.length) {
    showDrive();
    return;
  }
  // Ellipses belong to the picture unless they are hopeless.
  const size = Math.max(2, ...[0, 1].map((axis) => Math.max(...zone.map((p) => p[axis]))
                                                   - Math.min(...zone.map((p) => p[axis]))));
  const usable = all.filter((f) => f.role === "ellipse" && f.ellipse_semi_major_m < size);
  show([...zone, ...usable.flatMap(({ points }) => points)]);
}

function zoom(factor, x = map.clientWidth / 2, y = map.clientHeight / 2) {
  const scale = Math.min(Math.max(view.scale * factor, 0.005), 20000);
  const moved = 1 / view.scale - 1 / scale;  // keeps the place under the pointer where it is
  view.east += (x - map.clientWidth / 2) * moved;
  view.north -= (y - map.clientHeight / 2) * moved;
  view.scale = scale;
  redraw();
}

function pan(x, y) {
  view.east -= x / view.scale;
  view.north += y / view.scale;
  redraw();
}

// ---- pointers (a mouse, or one or two fingers) ----------------------------------------------
const pointers = new Map();
let moved = 0;  // pixels since the first pointer went down; a click moves less than a few

function spread() {
  const [a, b] = [...pointers.values()];
  return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, size: Math.hypot(a.x - b.x, a.y - b.y) };
}

function pixel(event) {
  const box = map.getBoundingClientRect();
  return { x: event.clientX - box.left, y: event.clientY - box.top };
}

map.addEventListener("pointerdown", (event) => {
  if (event.button) return;
  if (!pointers.size) moved = 0;
  pointers.set(event.pointerId, pixel(event));
});
map.addEventListener("pointermove", (event) => {
  const last = pointers.get(event.pointerId), at = pixel(event);
  if (!last) {
    if (ruler.active) aimRuler(at);
    else if (!event.target.closest(".place")) showPathTip(at.x, at.y);
    return;
  }
  moved += Math.hypot(at.x - last.x, at.y - last.y);
  if (moved > 5) map.setPointerCapture(event.pointerId);
  if (pointers.size === 1) pan(at.x - last.x, at.y - last.y);
  const before = pointers.size === 2 ? spread() : null;
  pointers.set(event.pointerId, at);
  hideTip();
  if (!before) return;
  const after = spread();
  pan(after.x - before.x, after.y - before.y);
  zoom(after.size / Math.max(before.size, 1), after.x, after.y);
});
map.addEventListener("pointerup", (event) => {
  const click = pointers.delete(event.pointerId) && !pointers.size && moved <= 5;
  if (click) clicked(pixel(event));
});
map.addEventListener("pointercancel", (event) => pointers.delete(event.pointerId));
map.addEventListener("pointerleave", hideTip);
map.addEventListener("wheel", (event) => {
  event.preventDefault();
  const { x, y } = pixel(event);
  zoom(Math.exp(-event.deltaY / (event.deltaMode ? 12 : 400)), x, y);
}, { passive: false });

function nearestPlace({ x, y }, within = 20) {
  const away = (place) => Math.hypot(place.x - x, place.y - y);
  return places.filter((place) => away(place) < within)
    .sort((a, b) => away(a) - away(b))[0];
}

function clicked(at) {
  const place = nearestPlace(at);
  if (place) {
    take(place);
    showTip(place);
  } else if (ruler.active) {
    addToRuler({ east: toEast(at.x), north: toNorth(at.y) });
  } else {
    const step = nearestStep(at.x, at.y, 14);
    if (step === null) select(null); else showMoment(step);
  }
}

// ---- keys -----------------------------------------------------------------------------------
const KEYS = {
  "+": () => zoom(1.4), "=": () => zoom(1.4), "-": () => zoom(1 / 1.4),
  ArrowLeft: () => pan(60, 0), ArrowRight: () => pan(-60, 0),
  ArrowUp: () => pan(0, 60), ArrowDown: () => pan(0, -60),
  z: showZone, d: showDrive, n: () => next(1), b: () => next(-1), m: () => toggleRuler(),
  h: () => showHull(!byId("hull-shown").checked),
  ",": () => showMoment(chosen.step - 1), ".": () => showMoment(chosen.step + 1),
  " ": () => togglePlay(),
};

map.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (ruler.active && name === "Enter") addToRuler(centreOfMap());
  else if (ruler.active && name === "Backspace") undoRuler();
  else if (KEYS[name]) KEYS[name]();
  else return;
  event.preventDefault();
});
document.addEventListener("keydown", (event) => {
  if (event.key !== "Escape") return;
  if (!tip.hidden) hideTip();
  else if (ruler.active) toggleRuler(false);
  else select(null);
});

function next(direction) {
  const located = order.filter((id) => cones.has(id));
  if (!located.length) return;
  const at = located.indexOf(chosen.id);
  const index = at < 0 && direction < 0 ? located.length - 1 : at + direction;
  centre(located[(index + located.length) % located.length]);
}
